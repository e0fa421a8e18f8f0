// What curved borders ring like, against the closed form of a disc.
#include "segmentation/fit/curved_edges.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/base/frames.hpp"
#include "segmentation/fit/edge_response.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double inside_globe = 0.2, outside_globe = 1;
constexpr double slice_mm = 1;

/// The edge response, with its ringing beyond the table's end: Si(x) = pi/2 - cos(x) / x (1 - 2 / x^2) -
/// sin(x) / x^2.
double edge(double t) {
  if (std::abs(t) < 20) return edge_response(t);
  const double x = pi * std::abs(t);
  const double e = 1 - (std::cos(x) / x * (1 - 2 / (x * x)) + std::sin(x) / (x * x)) / pi;
  return t > 0 ? e : 1 - e;
}

/// What a Hann window makes of a response in units of 1 / (2 k_c): it moves by a unit either way.
template <typename Response>
double filtered(const Response& response, double t, bool hann) {
  return hann ? response(t) / 2 + (response(t - 1) + response(t + 1)) / 4 : response(t);
}

/// Image of a disc of this radius cut off in k-space at `cutoff_per_mm` in either direction: over its chords,
/// each an edge response's difference.
double disc_image(double radius_mm, double x_mm, double y_mm, const Eigen::Vector2d& cutoff_per_mm,
                  bool hann) {
  const auto line = [](double t) { return std::abs(t) < 1e-9 ? 1 : std::sin(pi * t) / (pi * t); };
  constexpr int steps = 1500;
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double angle = ((i + 0.5) / steps - 0.5) * pi;
    const double at = radius_mm * std::sin(angle), half_chord = radius_mm * std::cos(angle);
    const double across = filtered(line, 2 * cutoff_per_mm.x() * (x_mm - at), hann);
    sum += 2 * cutoff_per_mm.x() * across * half_chord * pi / steps *
           (filtered(edge, 2 * cutoff_per_mm.y() * (y_mm + half_chord), hann) -
            filtered(edge, 2 * cutoff_per_mm.y() * (y_mm - half_chord), hann));
  }
  return sum;
}

/// A round globe, dark in bright surroundings, at the origin of LPS and its slices across the axis.
struct Globe {
  Stack stack;
  std::vector<ObservedStack> observed;
  ForwardModel model;
  VectorXd parameters;
  double radius_mm;      ///< of the wall's outside, across the axis
  double half_depth_mm;  ///< along it
  // What the scanner makes of it.
  bool hann = false;
  Eigen::Vector2d cutoff_per_mm;  ///< along rows, along columns

  explicit Globe(double pixel_mm)
      : stack(stack_of(pixel_mm)), observed{{&stack, 1, sampling_of(stack), {}}}, model(make_model()) {
    parameters = population_mean(model.layout());
    const double centre_depth = parameters[axial_length] - parameters[globe_z];
    parameters[apex_y] = -centre_depth;  // the eye looks to -y
    parameters[globe_y] = parameters[globe_x];
    for (int i = vitreous; i <= iris; ++i) parameters[i] = inside_globe;
    parameters[wall_layering] = parameters[lens_nucleus] = 0;
    for (const int i : {int(lid), int(air), int(surround)}) parameters[i] = outside_globe;
    radius_mm = parameters[globe_x] + parameters[wall_lateral];
    half_depth_mm = parameters[globe_z] + parameters[wall_axial];
    cutoff_per_mm.setConstant(0.5 / pixel_mm);
  }

  static Stack stack_of(double pixel_mm) {
    Stack stack;
    stack.along_row = Vector3d::UnitX();
    stack.along_column = -Vector3d::UnitZ();
    stack.normal = Vector3d::UnitY();
    stack.column_spacing_mm = stack.row_spacing_mm = pixel_mm;
    stack.slice_thickness_mm = slice_mm;
    for (int s = 0; s < 30; ++s) stack.slice_position.push_back({-25, s - 15.0, 25});
    return stack;
  }
  static StackSampling sampling_of(const Stack& stack) {
    StackSampling sampling{stack.along_row, stack.along_column, stack.normal};
    sampling.row_cutoff_per_mm = 0.5 / stack.column_spacing_mm;
    sampling.column_cutoff_per_mm = 0.5 / stack.row_spacing_mm;
    sampling.thickness_mm = slice_mm;
    sampling.subslices = 2;
    return sampling;
  }
  ForwardModel make_model() const {
    ParameterLayout layout;
    layout.bumps = static_cast<int>(bump_directions().size());
    return {layout, {observed.front().sampling}, Vector3d::Zero()};
  }

  /// Voxels of the slice 4 mm behind the globe's middle, from the border to 4 mm within it.
  std::vector<Sample> samples() const {
    std::vector<Sample> list;
    const double pixel = stack.column_spacing_mm;
    for (int r = 0; r < 50 / pixel; ++r)
      for (int c = 0; c < 50 / pixel; ++c) {
        Sample sample;
        sample.position = stack.slice_position[19] + Vector3d(c * pixel, 0, -r * pixel);
        const double off_axis = std::hypot(sample.position.x(), sample.position.z());
        if (off_axis < slice_radius(4) - 4 || off_axis > slice_radius(4) + 0.6) continue;
        sample.near_wall = true;
        list.push_back(sample);
      }
    return list;
  }
  double slice_radius(double behind_mm) const {
    return radius_mm * std::sqrt(1 - std::pow(behind_mm / half_depth_mm, 2));
  }
  double expected(const Sample& sample) const {
    constexpr int layers = 8;
    double disc = 0;
    for (int i = 0; i < layers; ++i)
      disc += disc_image(slice_radius(sample.position.y() + ((i + 0.5) / layers - 0.5) * slice_mm),
                         sample.position.x(), sample.position.z(), cutoff_per_mm, hann) /
              layers;
    return outside_globe + (inside_globe - outside_globe) * disc;
  }
};

/// Largest error of planar edges, and of these with what curved ones have beyond them.
struct Errors {
  double planar = 0, curved = 0;
};
Errors errors_of(const Globe& globe) {
  std::vector<Sample> samples = globe.samples();
  const ForwardModel::AtParameters at(globe.model, globe.parameters);
  Errors worst;
  for (const Sample& sample : samples)
    worst.planar = std::max(worst.planar, std::abs(at.intensity(sample, nullptr) - globe.expected(sample)));
  add_curved_edges(samples, globe.model, globe.parameters, globe.observed);
  for (const Sample& sample : samples)
    worst.curved = std::max(worst.curved, std::abs(at.intensity(sample, nullptr) - globe.expected(sample)));
  return worst;
}

TEST(CurvedEdges, RingAsADiscDoes) {
  const Errors coarse = errors_of(Globe(1));
  EXPECT_GT(coarse.planar, 0.01);
  EXPECT_LT(coarse.curved, 0.004);
}

TEST(CurvedEdges, AreThoseOfTheScannersResolution) {
  Globe globe(1);
  globe.parameters[globe.model.layout().stack(0) + log_sharpness] = std::log(0.8);
  std::vector<Sample> samples = globe.samples();
  add_curved_edges(samples, globe.model, globe.parameters, globe.observed);
  const ForwardModel::AtParameters at(globe.model, globe.parameters);
  Globe blurred(1 / 0.8);  // its closed form has that cut-off
  for (const Sample& sample : samples)
    EXPECT_NEAR(at.intensity(sample, nullptr), blurred.expected(sample), 0.004);
}

TEST(CurvedEdges, AreSharperAlongRowsWhereTheScannerIs) {
  Globe globe(0.7);
  globe.cutoff_per_mm = {0.5 / 0.7 * 1.1, 0.5 / 0.7 / 1.1};
  globe.parameters[globe.model.layout().stack(0) + log_sharpness_ratio] = 2 * std::log(1.1);
  EXPECT_LT(errors_of(globe).curved, 0.004);
  globe.cutoff_per_mm.reverseInPlace();
  EXPECT_GT(errors_of(globe).curved, 0.008);
}

TEST(CurvedEdges, AreThoseOfTheScannersFilter) {
  Globe globe(0.7);
  globe.hann = true;
  const int at_stack = globe.model.layout().stack(0);
  globe.parameters[at_stack + k_space_filter] = 1;
  globe.parameters[at_stack + log_sharpness] = -log_cutoff_per_filter;  // the cut-off is the nominal one
  EXPECT_LT(errors_of(globe).curved, 0.004);
}

/// A globe whose slices are phase-encoded: the closed form of its discs, cut off in k-space's third direction too.
struct EncodedGlobe : Globe {
  EncodedGlobe(double pixel_mm, double thickness_mm) : Globe(pixel_mm) {
    StackSampling& sampling = model.stacks().front();
    sampling.thickness_mm = thickness_mm;
    sampling.slice_cutoff_per_mm = 0.5 / thickness_mm;
    sampling.subslices = 1;
  }
  /// Few of the samples, as each is an integral over the whole globe.
  std::vector<Sample> some_samples() const {
    const std::vector<Sample> all = samples();
    std::vector<Sample> list;
    for (std::size_t i = 0; i < all.size(); i += 9) list.push_back(all[i]);
    return list;
  }
  double expected(const Sample& sample, double slice_cutoff_per_mm) const {
    constexpr double step_mm = 0.1;
    double sum = 0;
    for (double y = -half_depth_mm + step_mm / 2; y < half_depth_mm; y += step_mm) {
      const double t = 2 * slice_cutoff_per_mm * (sample.position.y() - y);
      const double weight = std::abs(t) < 1e-9 ? 1 : std::sin(pi * t) / (pi * t);
      sum += 2 * slice_cutoff_per_mm * weight * step_mm *
             disc_image(slice_radius(y), sample.position.x(), sample.position.z(), cutoff_per_mm, hann);
    }
    return outside_globe + (inside_globe - outside_globe) * sum;
  }
};

TEST(CurvedEdges, RingThroughEncodedSlicesToo) {
  // The last ones are interpolated to half their thickness.
  for (const auto& [through, thickness_mm] : {std::pair{1.0, 1.0}, {0.8, 1.0}, {1.0, 2.0}}) {
    EncodedGlobe globe(1, thickness_mm);
    globe.parameters[globe.model.layout().stack(0) + log_sharpness_through] = std::log(through);
    std::vector<Sample> samples = globe.some_samples();
    ASSERT_GT(samples.size(), 20);
    add_curved_edges(samples, globe.model, globe.parameters, globe.observed);
    const ForwardModel::AtParameters at(globe.model, globe.parameters);
    double worst = 0, of_box = 0;
    for (const Sample& sample : samples) {
      const double expected = globe.expected(sample, through * 0.5 / thickness_mm);
      worst = std::max(worst, std::abs(at.intensity(sample, nullptr) - expected));
      of_box = std::max(of_box, std::abs(globe.Globe::expected(sample) - expected));
    }
    EXPECT_LT(worst, 0.004) << through << " " << thickness_mm;
    EXPECT_GT(of_box, 0.01) << through << " " << thickness_mm;
  }
}

TEST(CurvedEdges, RingSoInSmallerVoxelsToo) { EXPECT_LT(errors_of(Globe(0.7)).curved, 0.004); }

TEST(CurvedEdges, AreLeftStraightInSmallPixels) {
  const Errors fine = errors_of(Globe(0.5));
  EXPECT_EQ(fine.curved, fine.planar);
}

TEST(CurvedEdges, AddNothingFarFromTheGlobe) {
  const Globe globe(1);
  std::vector<Sample> samples = globe.samples();
  Sample far = samples.front();
  far.position = globe.stack.slice_position[19] + Vector3d(150, 0, -300);
  samples.push_back(far);
  add_curved_edges(samples, globe.model, globe.parameters, globe.observed);
  EXPECT_NEAR(samples.back().curved, 0, 0.002);
}

TEST(CurvedEdges, OfTheFrontAreLeftAsTheyAre) {
  const Globe globe(1);
  std::vector<Sample> samples = globe.samples();
  for (Sample& sample : samples) sample.zone = Zone::front;
  add_curved_edges(samples, globe.model, globe.parameters, globe.observed);
  for (const Sample& sample : samples) EXPECT_EQ(sample.curved, 0);
}

}  // namespace
}  // namespace emmetrope::segmentation
