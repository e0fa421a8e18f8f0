#include "data_samples/phantom/world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

class Draw {
 public:
  /// \param salt  tells the worlds and their parts apart
  Draw(unsigned long long seed, unsigned long long salt)
      : engine_(seed * 0x9E3779B97F4A7C15ULL + salt * 0x7654321ULL) {}
  double between(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) + 0.5) * 0x1.0p-53;
  }
  bool chance(double share) { return between(0, 1) < share; }

 private:
  std::mt19937_64 engine_;
};

/// Layers and tendons as anatomy has them: the wall's inner layer is bright, its outer one dark.
void furnish_tissue(EyeGeometry& eye, Draw& draw) {
  eye.choroid_mm = draw.between(0.3, 0.55) * std::min(eye.wall_lateral_mm, eye.wall_axial_mm);
  eye.tendon_mm = draw.between(0.6, 1.4);
  eye.nucleus_share = draw.between(0.5, 0.75);
  eye.ciliary_thickness_mm = draw.between(1.2, 2.2);
}

/// What both eyes of a person of `orbit` share: the orbits, the lids, where the person looks, and the size of the
/// eyes, which are other people's than the fit's priors are of: flatter and steeper corneas, rounder and flatter globes.
struct OrbitPerson {
  double proptosis_mm, slope;
  bool open;
  double gaze_h_deg, gaze_v_deg;
  double flatter, rounder;
};

void furnish_orbit(EyeGeometry& eye, Draw& draw, const OrbitPerson& person) {
  eye.choroid_mm = draw.between(0.25, 0.65) * std::min(eye.wall_lateral_mm, eye.wall_axial_mm);
  eye.wall_variation = draw.between(0.1, 0.35);
  eye.tendon_mm = draw.between(0.3, 1.8);
  eye.nucleus_share = draw.chance(0.5) ? draw.between(0.4, 0.8) : 0;
  eye.liquefied_share = draw.chance(0.5) ? draw.between(0.1, 0.5) : 0;
  eye.lid_slope = person.slope;
  eye.proptosis_mm = person.proptosis_mm;
  if (person.open) eye.lid_thickness_mm = 0;
  eye.cornea_radius_x_mm *= person.flatter;
  eye.cornea_radius_y_mm *= person.flatter;
  eye.globe_semi_x_mm *= person.rounder;
  eye.globe_semi_y_mm *= person.rounder;
  eye.globe_semi_z_mm = matching_globe_semi_z_mm(eye);
}

void treat(EyeGeometry& eye, Draw& draw) {
  const double kind = draw.between(0, 4);
  if (kind < 1) {
    eye.oil = 1;
  } else if (kind < 2) {
    eye.buckle_mm = draw.between(1, 3);
  } else if (kind < 3) {
    eye.implant = 1;
    eye.anterior_chamber_depth_mm += 1;
    eye.lens_thickness_mm = draw.between(0.7, 1.1);
    eye.lens_equator_radius_mm = 3;
    eye.lens_anterior_radius_mm = 16;
    eye.lens_posterior_radius_mm = 16;
    eye.lens_anterior_q = eye.lens_posterior_q = 0;
  } else {
    // Not at the pole: there the length would be that to the tumour.
    const double away_deg = draw.between(45, 90), around = draw.between(0, 2 * pi);
    eye.tumour_mm = draw.between(2, 6);
    eye.tumour_x_deg = away_deg * std::cos(around);
    eye.tumour_y_deg = away_deg * std::sin(around);
  }
}

/// \throw Error (usage) for an unknown name
unsigned long long number_of(const std::string& name) {
  const std::vector<std::string>& names = world_names();
  const auto found = std::find(names.begin(), names.end(), name);
  if (found == names.end())
    throw usage_error(fmt::format("unknown world \"{}\"", name),
                      fmt::format("use one of: {}", fmt::join(names, ", ")));
  return static_cast<unsigned long long>(found - names.begin());
}

}  // namespace

const std::vector<std::string>& world_names() {
  static const std::vector<std::string> names{"tissue", "console", "orbit", "scanner", "treated"};
  return names;
}

void furnish(HeadGeometry& head, const std::string& world, unsigned long long seed) {
  Draw draw(seed, 2 * number_of(world));
  const bool orbit = world == "orbit";
  OrbitPerson person{};
  person.proptosis_mm = draw.between(-4, 3);
  person.slope = draw.between(-0.5, 0.5);
  person.open = draw.chance(0.2);
  person.gaze_h_deg = draw.between(-25, 25);
  person.gaze_v_deg = draw.between(-20, 20);
  if (orbit) {
    person.flatter = draw.between(0.95, 1.05);
    person.rounder = draw.between(0.96, 1.04);
  }
  for (const Laterality laterality : both_eyes) {
    EyeGeometry& eye = head.eye(laterality);
    if (world == "tissue" || world == "scanner") furnish_tissue(eye, draw);
    if (world == "treated") treat(eye, draw);
    if (!orbit) continue;
    furnish_orbit(eye, draw, person);
    eye.gaze_horizontal_deg += person.gaze_h_deg;
    eye.gaze_vertical_deg += person.gaze_v_deg;
    const double off_deg = std::hypot(eye.gaze_horizontal_deg, eye.gaze_vertical_deg);
    const double within = std::min(1.0, 40 / off_deg);
    eye.gaze_horizontal_deg *= within;
    eye.gaze_vertical_deg *= within;
  }
}

void disturb(Protocol& protocol, const std::string& world, unsigned long long seed) {
  Draw draw(seed, 2 * number_of(world) + 1);
  Disturbances& d = protocol.disturbances;
  if (world == "tissue") d.chemical_shift_px = draw.chance(0.5) ? 1 : 0;
  if (world == "orbit") d.chemical_shift_px = draw.between(-1.2, 1.2);
  if (world == "console") {
    d.window = draw.chance(0.5) ? Window::hann : Window::fermi;
    d.noise_variation = draw.between(0, 1);
    d.echo_train = draw.between(0, 1);
    const double acquired = draw.between(0.75, 1);
    for (StackPlan& plan : protocol.stacks) plan.acquired_phase = acquired;
  }
  if (world == "scanner") {
    d.window = draw.chance(0.3) ? Window::hann : Window::none;
    d.noise_variation = draw.between(0, 0.6);
    d.echo_train = draw.between(0, 1.5);
    d.ghost = draw.between(0, 0.04);
    d.slice_gain = draw.between(0, 0.04);
    d.slice_motion_mm = draw.between(0, 0.15);
    if (all_encoded(protocol)) d.slice_gain = d.slice_motion_mm = 0;
    d.scale_error = draw.between(-0.005, 0.005);
  }
}

}  // namespace emmetrope::phantom
