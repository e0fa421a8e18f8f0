#include <algorithm>
#include <cmath>
#include <cstring>
#include <random>

#include "data_samples/phantom/geometry.hpp"
#include "data_samples/phantom/population.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/population/population.hpp"

namespace emmetrope::phantom {
namespace {

/// Draws from the population's table. The standard's own normal distribution differs between libraries.
class Draw {
 public:
  explicit Draw(unsigned long long seed) : engine_(seed) {}
  double uniform() { return (static_cast<double>(engine_() >> 11) + 0.5) * 0x1.0p-53; }
  double normal() {
    const double radius = std::sqrt(-2 * std::log(uniform()));
    return radius * std::cos(2 * pi * uniform());
  }
  /// \param shared  what this eye has in common with others or other values, in standard deviations
  /// \param loading  its weight; the rest is the eye's own
  double of(const char* name, double age_years = 40, double shared = 0, double loading = 0) {
    const Distribution& row =
        *std::find_if(population().begin(), population().end(),
                      [&](const Distribution& d) { return std::strcmp(d.name, name) == 0; });
    const double own = std::sqrt(1 - loading * loading);
    const double mean = row.mean + row.per_year * (age_years - 40);
    for (int i = 0; i < 1000; ++i) {
      const double value = mean + row.sd * (loading * shared + own * normal());
      if (value >= row.low && value <= row.high) return value;
    }
    return std::clamp(mean + row.sd * loading * shared, row.low, row.high);
  }

 private:
  std::mt19937_64 engine_;
};

/// What both eyes of a person share, in standard deviations.
struct Person {
  double age_years, length, curvature, size, chamber, lens, thickness, limbus, lid;
};

EyeGeometry random_eye(Draw& draw, const Person& person, double nasal) {
  EyeGeometry eye;
  eye.axial_length_mm = draw.of("axial_length_mm", 40, person.length, 0.95);
  const double length = (eye.axial_length_mm - 23.6) / 1.05;

  const double mean_D = draw.of("corneal_power_D", 40, (0.9 * person.curvature - 0.3 * length) / 0.95, 0.95);
  const double j0_D = draw.of("corneal_j0_D");
  const double j45_D = draw.of("corneal_j45_D");
  const double half_D = std::hypot(j0_D, j45_D);
  eye.cornea_axis_deg = normalise_axis_deg(0.5 * std::atan2(j45_D, j0_D) / degree);  // the flat meridian
  eye.cornea_radius_x_mm = keratometric_D_mm / (mean_D - half_D);
  eye.cornea_radius_y_mm = keratometric_D_mm / (mean_D + half_D);
  const double q = draw.of("cornea_q");
  eye.cornea_q_x = q + draw.of("cornea_q_of_meridian");
  eye.cornea_q_y = q + draw.of("cornea_q_of_meridian");
  eye.cornea_thickness_mm = draw.of("cornea_thickness_mm", 40, person.thickness, 0.95);
  eye.cornea_back_ratio = draw.of("cornea_back_ratio");
  eye.limbus_radius_mm = draw.of("limbus_radius_mm", 40, person.limbus, 0.95);

  eye.lens_thickness_mm = draw.of("lens_thickness_mm", person.age_years, person.lens, 0.95);
  eye.anterior_chamber_depth_mm =
      draw.of("anterior_chamber_depth_mm", person.age_years,
              (std::sqrt(0.95 * 0.95 - 0.4 * 0.4) * person.chamber + 0.4 * length) / 0.95, 0.95);
  eye.lens_anterior_radius_mm = draw.of("lens_anterior_radius_mm", person.age_years);
  eye.lens_posterior_radius_mm = draw.of("lens_posterior_radius_mm", person.age_years);
  eye.lens_anterior_q = draw.of("lens_anterior_q");
  eye.lens_posterior_q = draw.of("lens_posterior_q");
  eye.lens_decentre_x_mm = draw.of("lens_decentre_x_mm");
  eye.lens_decentre_y_mm = draw.of("lens_decentre_y_mm");
  eye.lens_tilt_x_deg = draw.of("lens_tilt_x_deg");
  eye.lens_tilt_y_deg = nasal * draw.of("lens_tilt_y_deg");  // mirror images
  eye.lens_equator_radius_mm = draw.of("lens_equator_radius_mm");
  eye.iris_diameter_mm = draw.of("iris_diameter_mm");
  eye.iris_thickness_mm = draw.of("iris_thickness_mm");
  eye.ciliary_thickness_mm = draw.of("ciliary_thickness_mm");

  // Wider in larger heads and longer eyes; as high as wide but for a little; its front is where the limbus
  // is.
  eye.globe_semi_x_mm = draw.of("globe_semi_x_mm", 40, person.size, 0.9) + 0.12 * length;
  eye.globe_semi_y_mm = eye.globe_semi_x_mm + draw.of("globe_semi_y_mm") - 11.46;
  eye.wall_lateral_mm = draw.of("wall_lateral_mm");
  eye.wall_axial_mm = draw.of("wall_axial_mm");
  eye.bulge_height_mm = draw.of("bulge_height_mm");
  eye.bulge_width_deg = draw.of("bulge_width_deg");
  eye.bulge_x_deg = draw.of("bulge_x_deg");
  eye.bulge_y_deg = draw.of("bulge_y_deg");
  eye.lid_thickness_mm = draw.of("lid_thickness_mm", 40, person.lid, 0.95);
  eye.globe_semi_z_mm = matching_globe_semi_z_mm(eye);
  return eye;
}

}  // namespace

HeadGeometry random_head(unsigned long long seed) {
  Draw draw(seed * 0x9E3779B97F4A7C15ULL + 0x1234567ULL);
  HeadGeometry head;
  head.age_years = std::round(20 + 50 * draw.uniform());
  head.lens_index = draw.of("lens_index", head.age_years);
  Person person{};
  person.age_years = head.age_years;
  person.length = draw.normal();
  person.curvature = draw.normal();
  person.size = std::clamp(draw.normal(), -2.5, 2.5);
  person.chamber = draw.normal();
  person.lens = draw.normal();
  person.thickness = draw.normal();
  person.limbus = draw.normal();
  person.lid = draw.normal();
  head.interpupillary_distance_mm = draw.of("interpupillary_distance_mm");
  head.roll_deg = draw.of("roll_deg");
  head.position_x_mm = draw.of("position_x_mm");
  head.position_y_mm = draw.of("position_y_mm");
  head.position_z_mm = draw.of("position_z_mm");
  const double horizontal = draw.of("gaze_horizontal_deg");
  const double vertical = draw.of("gaze_vertical_deg");
  for (const Laterality laterality : both_eyes) {
    EyeGeometry& eye = head.eye(laterality);
    eye = random_eye(draw, person, laterality == Laterality::od ? 1 : -1);
    eye.gaze_horizontal_deg = horizontal + draw.of("gaze_of_an_eye_deg");
    eye.gaze_vertical_deg = vertical + draw.of("gaze_of_an_eye_deg");
  }
  return head;
}

HeadGeometry random_keratoconus(unsigned long long seed) {
  HeadGeometry head = random_head(seed);
  Draw draw(seed * 0x9E3779B97F4A7C15ULL + 0x7654321ULL);
  for (const Laterality laterality : both_eyes) {
    EyeGeometry& eye = head.eye(laterality);
    eye.cone_height_um = draw.of("cone_height_um");
    eye.cone_width_mm = draw.of("cone_width_mm");
    eye.cone_x_mm = (laterality == Laterality::od ? -1 : 1) * draw.of("cone_temporal_mm");
    eye.cone_y_mm = draw.of("cone_y_mm");
    eye.cone_back_ratio = draw.of("cone_back_ratio");
  }
  return head;
}

}  // namespace emmetrope::phantom
