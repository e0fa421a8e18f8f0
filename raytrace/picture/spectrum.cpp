#include "raytrace/picture/spectrum.hpp"

#include <Eigen/LU>
#include <cmath>

namespace emmetrope::raytrace {
namespace {

constexpr double first_nm = 390, last_nm = 700;
constexpr int wavelength_steps = 63;  ///< of 5 nm

double nm_at(int i) { return first_nm + (last_nm - first_nm) * i / (wavelength_steps - 1); }

double lobe(double wavelength, double centre, double below, double above) {
  const double t = (wavelength - centre) / (wavelength < centre ? below : above);
  return std::exp(-0.5 * t * t);
}

using Curve = Eigen::Matrix<double, wavelength_steps, 1>;

/// The smoothest non-negative spectrum (least sum of squared slopes, power 0 at both ends) with given XYZ:
/// quadratic programme by pinning what would be negative to 0 and solving again.
Curve primary(const Eigen::Vector3d& xyz) {
  Eigen::Matrix<double, wavelength_steps, wavelength_steps> roughness =
      Eigen::Matrix<double, wavelength_steps, wavelength_steps>::Identity() * 1e-3;
  for (int i = 0; i <= wavelength_steps; ++i) {
    if (i < wavelength_steps) roughness(i, i) += 1;
    if (i > 0) roughness(i - 1, i - 1) += 1;
    if (i > 0 && i < wavelength_steps) roughness(i, i - 1) -= 1, roughness(i - 1, i) -= 1;
  }
  std::vector<bool> pinned(wavelength_steps, false);
  Curve curve = Curve::Zero();
  for (int round = 0; round < wavelength_steps; ++round) {
    Eigen::MatrixXd system = Eigen::MatrixXd::Zero(wavelength_steps + 3, wavelength_steps + 3);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(wavelength_steps + 3);
    system.topLeftCorner(wavelength_steps, wavelength_steps) = roughness;
    for (int i = 0; i < wavelength_steps; ++i) {
      const Eigen::Vector3d observer = cie_1931(nm_at(i));
      system.block<3, 1>(wavelength_steps, i) = observer;
      system.block<1, 3>(i, wavelength_steps) = observer.transpose();
      if (pinned[i]) {
        system.row(i).setZero();
        system(i, i) = 1;
      }
    }
    right.tail<3>() = xyz;
    curve = system.fullPivLu().solve(right).head<wavelength_steps>();
    bool changed = false;
    for (int i = 0; i < wavelength_steps; ++i)
      if (!pinned[i] && curve[i] < -1e-12) pinned[i] = changed = true;
    if (!changed) break;
  }
  return curve.cwiseMax(0);
}

Eigen::Matrix<double, wavelength_steps, 3> primaries_of_display() {
  const Eigen::Matrix3d xyz_from_rgb = srgb_from_xyz().inverse();
  Eigen::Matrix<double, wavelength_steps, 3> primaries;
  for (int c = 0; c < 3; ++c) primaries.col(c) = primary(xyz_from_rgb.col(c));
  return primaries;
}

}  // namespace

DisplayPrimaries::DisplayPrimaries() : power_(primaries_of_display()) {}

Eigen::Vector3d DisplayPrimaries::at(double wavelength_nm) const {
  const double place = (wavelength_nm - first_nm) / (last_nm - first_nm) * (wavelength_steps - 1);
  if (!(place >= 0 && place <= wavelength_steps - 1)) return {0, 0, 0};
  const int before = std::min(static_cast<int>(place), wavelength_steps - 2);
  return (1 - (place - before)) * power_.row(before) + (place - before) * power_.row(before + 1);
}

Eigen::Vector3d cie_1931(double w) {
  return {1.056 * lobe(w, 599.8, 37.9, 31.0) + 0.362 * lobe(w, 442.0, 16.0, 26.7) -
              0.065 * lobe(w, 501.1, 20.4, 26.2),
          0.821 * lobe(w, 568.8, 46.9, 40.5) + 0.286 * lobe(w, 530.9, 16.3, 31.1),
          1.217 * lobe(w, 437.0, 11.8, 36.0) + 0.681 * lobe(w, 459.0, 26.0, 13.8)};
}

Eigen::Matrix3d srgb_from_xyz() {
  Eigen::Matrix3d xyz_from_srgb;
  xyz_from_srgb << 0.4124, 0.3576, 0.1805, 0.2126, 0.7152, 0.0722, 0.0193, 0.1192, 0.9505;
  return xyz_from_srgb.inverse();
}

double srgb_encoded(double linear) {
  if (!(linear > 0)) return 0;
  if (linear >= 1) return 1;
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

double srgb_decoded(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

Spectrum display_spectrum() {
  const Eigen::Matrix3d rgb_from_xyz = srgb_from_xyz();
  const Eigen::Matrix<double, wavelength_steps, 3> primaries = primaries_of_display();

  // Share of the light: X + Y + Z of white, cumulated.
  Curve share;
  for (int i = 0; i < wavelength_steps; ++i) share[i] = cie_1931(nm_at(i)).sum() * primaries.row(i).sum();
  std::array<double, wavelength_steps + 1> below{};
  for (int i = 0; i < wavelength_steps; ++i) below[i + 1] = below[i] + share[i] / share.sum();

  Spectrum spectrum;
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (int k = 0; k < wavelength_count; ++k) {
    // The k-th sixteenth of the light: its mean wavelength and its colours.
    const double low = static_cast<double>(k) / wavelength_count,
                 high = static_cast<double>(k + 1) / wavelength_count;
    Eigen::Matrix3d xyz = Eigen::Matrix3d::Zero();
    double mean = 0;
    for (int i = 0; i < wavelength_steps; ++i) {
      const double part = std::max(0.0, std::min(high, below[i + 1]) - std::max(low, below[i]));
      if (part == 0) continue;
      mean += part * nm_at(i);
      xyz += part / (below[i + 1] - below[i]) * cie_1931(nm_at(i)) * primaries.row(i);
    }
    spectrum.wavelength_nm[k] = mean * wavelength_count;
    spectrum.rgb_from_rgb[k] = rgb_from_xyz * xyz;
    sum += spectrum.rgb_from_rgb[k];
  }
  const Eigen::Matrix3d exact = sum.inverse();  // what non-negativity and rounding have left: parts in 1e-6
  for (auto& matrix : spectrum.rgb_from_rgb) matrix = matrix * exact;
  return spectrum;
}

}  // namespace emmetrope::raytrace
