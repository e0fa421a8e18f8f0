#include "pipeline/base/notation.hpp"

#include <fmt/core.h>

#include <boost/algorithm/string/predicate.hpp>
#include <charconv>
#include <cmath>
#include <string_view>
#include <vector>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope {
namespace {

constexpr double step_D = 0.25, step_deg = 5;

std::string signed_power(double power_D) {
  const double rounded_D = std::round(power_D * 100) / 100;
  return rounded_D == 0 ? "0.00" : fmt::format("{:+.2f}", rounded_D);
}

/// Where the cylinder is too small to be written the sphere is the spherical equivalent.
std::string written(const SpheroCylinder& refraction) {
  if (std::abs(refraction.cylinder_D) < least_cylinder_D)
    return signed_power(refraction.sphere_D + refraction.cylinder_D / 2) + " DS";
  return fmt::format("{} / {} x {}", signed_power(refraction.sphere_D), signed_power(refraction.cylinder_D),
                     format_axis(refraction.axis_deg));
}

/// Takes numbers and signs off the front of a text.
class Reader {
 public:
  explicit Reader(std::string_view text) : text_(text), rest_(text) {}

  double number(const char* of_what) {
    std::string_view digits = rest_;
    if (!digits.empty() && digits.front() == '+') {
      digits.remove_prefix(1);
      if (!digits.empty() && digits.front() == '-') fail(of_what);  // "+-" says how accurate, not how much
    }
    double value = 0;
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    if (error != std::errc() || !std::isfinite(value)) fail(of_what);
    rest_ = std::string_view(end, static_cast<std::size_t>(rest_.data() + rest_.size() - end));
    return value;
  }
  bool take(std::string_view sign) {
    if (!boost::algorithm::istarts_with(rest_, sign)) return false;
    rest_.remove_prefix(sign.size());
    return true;
  }
  bool at_end() const { return rest_.empty(); }
  [[noreturn]] void fail(std::string_view expected) const {
    throw usage_error(fmt::format("refraction \"{}\": {} expected at \"{}\"", text_, expected, rest_),
                      "write sphere/cylinder x axis @ vertex distance +- accuracy: -2.25/-1.00x180@12+-0.25");
  }
  /// Of a number that was read and that nobody has.
  [[noreturn]] void refuse(std::string_view what, const std::string& expected) const {
    throw usage_error(fmt::format("refraction \"{}\": nobody has {}", text_, what), "expected " + expected);
  }

 private:
  std::string_view text_, rest_;
};

}  // namespace

SpheroCylinder transpose(const SpheroCylinder& refraction) {
  return {refraction.sphere_D + refraction.cylinder_D, -refraction.cylinder_D,
          normalise_axis_deg(refraction.axis_deg + 90)};
}

std::string format_axis(double axis_deg) {
  const int rounded_deg = static_cast<int>(std::lround(normalise_axis_deg(axis_deg)));
  return fmt::format("{:03d}", rounded_deg == 0 ? 180 : rounded_deg);
}

std::string format_refraction(const SpheroCylinder& refraction) {
  return written(refraction.cylinder_D > 0 ? transpose(refraction) : refraction);
}

std::string format_plus_cylinder(const SpheroCylinder& refraction) {
  return written(refraction.cylinder_D < 0 ? transpose(refraction) : refraction);
}

double without_negative_zero(double value, int decimals) {
  return std::abs(value) < 0.5 * std::pow(10.0, -decimals) ? 0.0 : value;
}

RoundedRefraction round_refraction(const PowerVector& refraction) {
  const SpheroCylinder exact = to_sphero_cylinder(refraction);
  // For any cylinder and axis the best sphere is the step nearest to M - C/2, and the best (cylinder, axis)
  // lies within two steps of the exact cylinder (an axis 2.5 degrees off shortens it by 0.4 % only): the
  // search is small and complete.
  RoundedRefraction best{{}, INFINITY};
  const long nearest_steps = std::lround(exact.cylinder_D / step_D);
  for (long steps = std::min(0L, nearest_steps + 2); steps >= nearest_steps - 2; --steps) {
    const double cylinder_D = static_cast<double>(steps) * step_D;
    const double sphere_D = std::round((refraction.M_D - cylinder_D / 2) / step_D) * step_D;
    const int axes = static_cast<int>(180 / step_deg);
    for (int axis = steps == 0 ? axes : 1; axis <= axes; ++axis) {
      const SpheroCylinder candidate{sphere_D + 0.0, cylinder_D, axis * step_deg};
      const double residual_D = distance_D(to_power_vector(candidate), refraction);
      if (residual_D < best.residual_D - 1e-9) best = {candidate, residual_D};
    }
  }
  return best;
}

StatedRefraction parse_refraction(const std::string& text) {
  std::string compact;
  for (const char c : text)
    if (c != ' ') compact += c;
  Reader reader(compact);
  StatedRefraction stated;
  if (!reader.take("PLANO") && !reader.take("PL"))
    stated.refraction.sphere_D = reader.number("a sphere in dioptres");
  if (reader.take("/")) {
    stated.refraction.cylinder_D = reader.number("a cylinder in dioptres");
    if (!reader.take("x")) reader.fail("x and the axis in degrees");
    const double axis_deg = reader.number("an axis in degrees");
    if (axis_deg < 0 || axis_deg > 180) reader.refuse("that axis", "0 to 180 degrees");
    stated.refraction.axis_deg = normalise_axis_deg(axis_deg);
  } else {
    reader.take("DS");
  }
  if (reader.take("@")) stated.vertex_distance_mm = reader.number("a vertex distance in mm");
  if (reader.take("+-")) stated.sigma_D = reader.number("an accuracy in dioptres");
  if (!reader.at_end()) reader.fail("nothing more");
  // Hundredths of dioptres and metres are mistakes that people make.
  constexpr double most_D = 40, most_cylinder_D = 20, least_vertex_mm = 5, most_vertex_mm = 30;
  if (std::abs(stated.refraction.sphere_D) > most_D)
    reader.refuse("that sphere", fmt::format("at most {} D", most_D));
  if (std::abs(stated.refraction.cylinder_D) > most_cylinder_D)
    reader.refuse("that cylinder", fmt::format("at most {} D", most_cylinder_D));
  if (stated.vertex_distance_mm != 0 &&
      !(stated.vertex_distance_mm >= least_vertex_mm && stated.vertex_distance_mm <= most_vertex_mm))
    reader.refuse("that vertex distance",
                  fmt::format("0, on the cornea, or {} to {} mm", least_vertex_mm, most_vertex_mm));
  constexpr double least_sigma_D = 0.01, most_sigma_D = 5;
  if (stated.sigma_D && !(*stated.sigma_D >= least_sigma_D && *stated.sigma_D <= most_sigma_D))
    reader.refuse("that accuracy", fmt::format("{} to {} D", least_sigma_D, most_sigma_D));
  if (stated.refraction.cylinder_D > 0) stated.refraction = transpose(stated.refraction);
  return stated;
}

EyeRefraction parse_eye_refraction(const std::string& text) {
  const auto colon = text.find(':');
  const std::string side = text.substr(0, colon);
  if (colon == std::string::npos || (side != "od" && side != "os"))
    throw usage_error("--refraction \"" + text + "\" does not say which eye",
                      "write od: or os: first, as in od:-2.25/-1.00x180@12+-0.25");
  return {side == "od" ? Laterality::od : Laterality::os, parse_refraction(text.substr(colon + 1))};
}

}  // namespace emmetrope
