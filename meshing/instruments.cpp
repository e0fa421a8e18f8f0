#include "meshing/instruments.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "meshing/analytic_eye.hpp"
#include "meshing/biometry.hpp"
#include "meshing/corneal_metrics.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

std::optional<double> number(const std::string& text) {
  std::size_t used = 0;
  try {
    const double value = std::stod(text, &used);
    if (used == text.size() && std::isfinite(value)) return value;
  } catch (const std::exception&) {
  }
  return std::nullopt;
}

Error misread(const std::string& flag, const std::string& text, const std::string& expected) {
  return usage_error(fmt::format("{} {}: cannot be read", flag, text), "expected " + expected);
}

double checked(const std::string& flag, const std::string& text, double low, double high, const char* unit) {
  const auto value = number(text);
  if (!value) throw misread(flag, text, fmt::format("a number in {}", unit));
  if (*value < low || *value > high)
    throw usage_error(fmt::format("{} {}: no eye has that", flag, text),
                      fmt::format("expected {:g} to {:g} {}", low, high, unit));
  return *value;
}

struct Meridian {
  double power_D, axis_deg;
};

Meridian parse_meridian(const std::string& text) {
  const auto at = text.find('@');
  if (at == std::string::npos) throw misread("--keratometry", text, "POWER@AXIS, such as 43.25@175");
  return {checked("--keratometry", text.substr(0, at), 30, 60, "D"),
          checked("--keratometry", text.substr(at + 1), 0, 180, "degrees")};
}

ExternalMeasurement scalar(std::string source, Functional of_eye, double value, double sigma) {
  return {std::move(source), std::move(of_eye), VectorXd::Constant(1, value),
          MatrixXd::Constant(1, 1, sigma * sigma)};
}

VectorXd one(double value) { return VectorXd::Constant(1, value); }

}  // namespace

EyeFlag parse_eye_flag(const std::string& flag, const std::string& text, double default_sigma) {
  const std::string expected = "EYE:VALUE+-SIGMA, EYE being od or os";
  EyeFlag parsed;
  if (text.rfind("od:", 0) == 0)
    parsed.eye = Laterality::od;
  else if (text.rfind("os:", 0) == 0)
    parsed.eye = Laterality::os;
  else
    throw misread(flag, text, expected);
  const auto sign = text.rfind("+-");
  parsed.value = text.substr(3, sign == std::string::npos ? sign : sign - 3);
  parsed.sigma = default_sigma;
  if (sign != std::string::npos) {
    const auto sigma = number(text.substr(sign + 2));
    if (!sigma || !(*sigma > 0)) throw misread(flag, text, "a positive number after +-");
    parsed.sigma = *sigma;
  }
  if (parsed.value.empty()) throw misread(flag, text, expected);
  return parsed;
}

ExternalMeasurement keratometry_measurement(const EyeFlag& flag) {
  const auto slash = flag.value.find('/');
  if (slash == std::string::npos) throw misread("--keratometry", flag.value, "POWER@AXIS/POWER@AXIS");
  const Meridian a = parse_meridian(flag.value.substr(0, slash)),
                 b = parse_meridian(flag.value.substr(slash + 1));
  const double off_square_deg = std::abs(std::abs(normalise_axis_deg(a.axis_deg - b.axis_deg)) - 90);
  if (off_square_deg > 5)
    throw usage_error(fmt::format("--keratometry {}: the meridians are {:g} degrees from perpendicular",
                                  flag.value, off_square_deg),
                      "give the flat and the steep meridian, 90 degrees apart");
  const Meridian& flat = a.power_D <= b.power_D ? a : b;
  const Meridian& steep = a.power_D <= b.power_D ? b : a;
  const double half = (steep.power_D - flat.power_D) / 2;
  // Mean and half difference of two independent powers: sigma/sqrt 2 each; the second astigmatic component
  // alike.
  return {"keratometry",
          [](const ParametricEye& eye) -> VectorXd {
            const CornealPower power = corneal_power(anterior_cornea(eye));
            return Vector3d(power.M_D, power.J0_D, power.J45_D);
          },
          Vector3d((flat.power_D + steep.power_D) / 2, half * std::cos(2 * flat.axis_deg * degree),
                   half * std::sin(2 * flat.axis_deg * degree)),
          Matrix3d::Identity() * flag.sigma* flag.sigma / 2};
}

ExternalMeasurement axial_length_measurement(const EyeFlag& flag, double retinal_depth_mm) {
  return scalar(
      "biometry", [=](const ParametricEye& eye) { return one(eye.pole_depth_mm() + retinal_depth_mm); },
      checked("--axial-length", flag.value, 14, 40, "mm"), flag.sigma);
}

ExternalMeasurement anterior_chamber_measurement(const EyeFlag& flag) {
  return scalar(
      "biometry", [](const ParametricEye& eye) { return one(lens_on_axis(eye).front_mm); },
      checked("--acd", flag.value, 1, 7, "mm"), flag.sigma);
}

ExternalMeasurement lens_thickness_measurement(const EyeFlag& flag) {
  return scalar(
      "biometry",
      [](const ParametricEye& eye) {
        const LensOnAxis lens = lens_on_axis(eye);
        return one(lens.back_mm - lens.front_mm);
      },
      checked("--lens-thickness", flag.value, 2, 8, "mm"), flag.sigma);
}

}  // namespace emmetrope
