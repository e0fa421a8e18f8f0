#include "segmentation/judgement/edge_agreement.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/eye/population/limits.hpp"

namespace emmetrope::segmentation {
namespace {

void consider(EdgeAgreement& agreement, const char* what, double fitted_mm, double fitted_sigma_mm,
              const Estimate& read) {
  const double sigmas = std::abs(fitted_mm - read.value) / std::hypot(fitted_sigma_mm, read.sigma);
  if (sigmas <= agreement.sigmas) return;
  agreement.sigmas = sigmas;
  agreement.largest = fmt::format("{} {:.1f} mm, by the edges {:.1f} mm", what, fitted_mm, read.value);
}

}  // namespace

bool EdgeAgreement::confirms() const { return limits_of("edge_disagreement").plausible.contains(sigmas); }

EdgeAgreement compare_with_edges(const EyeFit& fit, const ReadEye& read) {
  const EdgeBiometry& edges = read.biometry;
  EdgeAgreement agreement;
  const double apart_mm = (fit.globe_centre_lps() - read.reading.globe.centre).norm();
  agreement.sigmas = apart_mm / (std::sqrt(3.0) * edges.centre.sigma);
  agreement.largest = fmt::format("the globe's centres lie {:.1f} mm apart", apart_mm);
  consider(agreement, "width", 2 * fit.value(globe_x), fit.sigma(globe_x), edges.globe_width);
  consider(agreement, "height", 2 * fit.value(globe_y), fit.sigma(globe_y), edges.globe_height);
  if (edges.axial_length)
    consider(agreement, "length", fit.value(axial_length), fit.pole_depth_sigma_mm(), *edges.axial_length);
  return agreement;
}

}  // namespace emmetrope::segmentation
