#include "raytrace/scene/sampled_spectrum.hpp"

#include <algorithm>

#include "raytrace/picture/spectrum.hpp"

namespace emmetrope::raytrace {
namespace {

constexpr double first_nm = 380, last_nm = 780, step_nm = 1;

/// Integral of a spectrum times the observer's matching functions.
template <typename At>
Eigen::Vector3d tristimulus(const At& at) {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();
  for (double nm = first_nm; nm <= last_nm; nm += step_nm) xyz += step_nm * at(nm) * cie_1931(nm);
  return xyz;
}

}  // namespace

double SampledSpectrum::at(double nm) const {
  return nm < wavelength_nm.front() || nm > wavelength_nm.back() ? 0 : held_at(nm);
}

double SampledSpectrum::held_at(double nm) const {
  const auto after = std::upper_bound(wavelength_nm.begin(), wavelength_nm.end(), nm);
  if (after == wavelength_nm.begin()) return values.front();
  if (after == wavelength_nm.end()) return values.back();
  const std::size_t next = after - wavelength_nm.begin();
  const double share = (nm - wavelength_nm[next - 1]) / (wavelength_nm[next] - wavelength_nm[next - 1]);
  return values[next - 1] + share * (values[next] - values[next - 1]);
}

Eigen::Vector3d colour_of_reflectance(const SampledSpectrum& reflectance) {
  const DisplayPrimaries display;
  const Eigen::Matrix3d rgb_from_xyz = srgb_from_xyz();
  const Eigen::Vector3d white = rgb_from_xyz * tristimulus([&](double nm) { return display.at(nm).sum(); });
  const Eigen::Vector3d seen =
      rgb_from_xyz * tristimulus([&](double nm) { return reflectance.held_at(nm) * display.at(nm).sum(); });
  return seen.cwiseQuotient(white).cwiseMax(0);
}

Eigen::Vector3d colour_of_light(const SampledSpectrum& radiance) {
  return (srgb_from_xyz() * tristimulus([&](double nm) { return radiance.at(nm); })).cwiseMax(0);
}

}  // namespace emmetrope::raytrace
