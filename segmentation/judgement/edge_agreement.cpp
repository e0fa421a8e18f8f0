#include "segmentation/judgement/edge_agreement.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "pipeline/eye/population/limits.hpp"

namespace emmetrope::segmentation {
namespace {

/// How far outside the inner wall the fit itself sees the edge of fat.
struct FatEdge {
  double across_mm = 0, along_axis_mm = 0, centre_mm = 0;
};
FatEdge fat_edge(const EyeFit& fit) {
  // A wall brighter than that has an edge of its own.
  constexpr double dark_wall = 0.4;
  const double wall_share = (std::max(fit.value(wall), fit.inner_wall()) - fit.value(vitreous)) /
                            (fit.value(surround) - fit.value(vitreous));
  if (fit.weighting == Weighting::t2 || wall_share > dark_wall) return {};
  const double displaced_mm = fit.parameters.segment<2>(fit.layout.stack(0) + fat_shift_first).norm();
  return {2 * fit.value(wall_lateral) + displaced_mm, fit.value(wall_axial) + displaced_mm, displaced_mm};
}

/// A number in which the edges differ from a fit.
struct EdgeDifference {
  std::string what;
  double edges_outside_mm, fat_mm;
  double sigma_mm;       ///< of both; rms of a distance in space
  double within_sigmas;  ///< 95 % of such differences
};

std::vector<EdgeDifference> edge_differences(const EyeFit& fit, const ReadEye& read) {
  // Quantiles of the normal distribution, and of the chi distribution with three degrees of freedom over its rms.
  constexpr double of_length = 1.96, of_place = 1.614;
  const EdgeBiometry& edges = read.biometry;
  const FatEdge fat = fat_edge(fit);
  const double apart_mm = (fit.globe_centre_lps() - read.reading.globe.centre).norm();
  std::vector<EdgeDifference> list{{fmt::format("the globe's centres lie {:.1f} mm apart", apart_mm),
                                    apart_mm, fat.centre_mm, std::sqrt(3.0) * edges.centre.sigma, of_place}};
  const auto compare = [&](const char* what, double fitted_mm, double fitted_sigma_mm,
                           const Estimate& by_edges, double fat_mm) {
    list.push_back({fmt::format("{} {:.1f} mm, by the edges {:.1f} mm", what, fitted_mm, by_edges.value),
                    by_edges.value - fitted_mm, fat_mm, std::hypot(fitted_sigma_mm, by_edges.sigma),
                    of_length});
  };
  compare("width", 2 * fit.value(globe_x), 2 * fit.sigma(globe_x), edges.globe_width, fat.across_mm);
  compare("height", 2 * fit.value(globe_y), 2 * fit.sigma(globe_y), edges.globe_height, fat.across_mm);
  if (edges.axial_length)
    compare("length", fit.value(axial_length), fit.pole_depth_sigma_mm(), *edges.axial_length,
            fat.along_axis_mm);
  return list;
}

}  // namespace

bool EdgeAgreement::confirms() const {
  return with_length && limits_of("edge_disagreement").plausible.contains(sigmas);
}

EdgeBiometry with_doubt(const ReadEye& read, const EyeFit& fit) {
  EdgeBiometry biometry = read.biometry;
  constexpr double same_globe_mm = 5;  // chosen: well within a globe
  const Range plausible_mm = limits_of("globe_width_mm").plausible;
  const double width_mm = 2 * fit.value(globe_x), height_mm = 2 * fit.value(globe_y);
  if ((fit.globe_centre_lps() - read.reading.globe.centre).norm() > same_globe_mm ||
      !plausible_mm.contains(width_mm) || !plausible_mm.contains(height_mm))
    return biometry;
  const auto reach = [](Estimate& by_edges, double fitted_mm) {
    const double apart_mm = std::abs(by_edges.value - fitted_mm);
    if (apart_mm > 2 * by_edges.sigma) by_edges.sigma = std::hypot(by_edges.sigma, apart_mm / 2);
  };
  reach(biometry.globe_width, width_mm);
  reach(biometry.globe_height, height_mm);
  reach(biometry.globe_depth, 2 * fit.value(globe_z));
  if (biometry.axial_length) reach(*biometry.axial_length, fit.value(axial_length));
  return biometry;
}

EdgeAgreement compare_with_edges(const EyeFit& fit, const ReadEye& edges) {
  EdgeAgreement agreement;
  agreement.with_length = edges.biometry.axial_length.has_value();
  for (const EdgeDifference& difference : edge_differences(fit, edges)) {
    const double outside_mm = difference.edges_outside_mm,
                 beyond_mm = outside_mm < 0 ? -outside_mm : std::max(0.0, outside_mm - difference.fat_mm);
    agreement.sigmas = std::max(agreement.sigmas, std::abs(outside_mm) / difference.sigma_mm);
    if (beyond_mm / difference.sigma_mm < agreement.sigmas_beyond_wall) continue;
    agreement.sigmas_beyond_wall = beyond_mm / difference.sigma_mm;
    agreement.largest = difference.what;
  }
  return agreement;
}

LabelsBesideEdges compare_labels_with_edges(const EyeFit& drawn, const ReadEye& edges) {
  LabelsBesideEdges labels;
  for (const EdgeDifference& difference : edge_differences(drawn, edges)) {
    const double over_ci95 =
        std::abs(difference.edges_outside_mm) / (difference.within_sigmas * difference.sigma_mm);
    if (over_ci95 > labels.over_ci95) labels = {over_ci95, difference.what};
  }
  return labels;
}

}  // namespace emmetrope::segmentation
