#include "pipeline/eye/exchange/eye_file.hpp"

#include <fmt/format.h>

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/eye/exchange/optiland.hpp"
#include "pipeline/eye/exchange/words.hpp"
#include "pipeline/eye/exchange/zmx.hpp"
#include "pipeline/eye/optics/paraxial.hpp"

namespace emmetrope {
namespace {

bool is_zmx(const std::filesystem::path& file) { return capitals(file.extension().string()) == ".ZMX"; }

/// What a fitted surface departs by in depth says little of its curvature, and so of the eye's power; and media may be
/// others in other light: the lines F and C, the ends of most of what is looked at.
std::string change_of_power(const EyeModel& eye, const std::filesystem::path& written) {
  constexpr double allowed_D = 0.02, blue_nm = 486.13, red_nm = 656.27;
  const EyeModel again = read_zmx(written);
  for (const double nm : {eye.reference_wavelength_nm, blue_nm, red_nm}) {
    const double power = cardinal_points(eye, nm).power_D, power_again = cardinal_points(again, nm).power_D;
    const double M = paraxial_refraction(eye, nm).M_D, M_again = paraxial_refraction(again, nm).M_D;
    if (std::abs(power_again - power) <= allowed_D && std::abs(M_again - M) <= allowed_D) continue;
    return fmt::format(
        "{} is not quite this eye: its power is {:.2f} D and not {:.2f} D, its refraction M {:+.2f} D and not {:+.2f} D "
        "(paraxial, at {:g} nm).",
        written.string(), power_again, power, M_again, M, nm);
  }
  return {};
}

}  // namespace

EyeModel read_eye_file(const std::filesystem::path& file) {
  if (is_zmx(file)) return read_zmx(file);
  const std::string text = read_file(file);
  const bool of_optiland = is_optiland(text);
  const Json json = parse_json(of_optiland ? without_infinities(text) : text, file.string());
  try {
    return of_optiland ? eye_from_optiland(json) : eye_from_json(json, file.parent_path());
  } catch (const Error& error) {
    throw Error(error.status(), file.string() + ": " + error.what(), error.remedy());
  }
}

WrittenEye write_eye_file(const std::filesystem::path& file, const EyeModel& eye) {
  if (is_zmx(file)) {
    WrittenEye written{{file, glass_catalogue_beside(file)}, write_zmx(file, eye), ""};
    if (!written.notes.empty()) written.warning = change_of_power(eye, file);
    return written;
  }
  write_eye(file, eye);
  return {{file}, {}, ""};
}

}  // namespace emmetrope
