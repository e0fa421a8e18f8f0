#include <fmt/format.h>

#include <array>
#include <cctype>
#include <cmath>
#include <map>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/exchange/glass_catalogue.hpp"
#include "pipeline/eye/exchange/lens_system.hpp"
#include "pipeline/eye/exchange/words.hpp"
#include "pipeline/eye/exchange/zernike_form.hpp"
#include "pipeline/eye/exchange/zmx.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope {
namespace {

/// One SURF of the file.
struct ZmxSurface {
  std::string place;  ///< "file: line 12: surface 3"
  std::string type = "STANDARD", comment;
  double curvature_per_mm = 0, conic = 0, thickness_mm = 0, semi_diameter_mm = 0, aperture_mm = 0;
  std::map<int, double> parameters, extra;
  std::vector<std::string> glass;  ///< the words after GLAS
  bool is_stop = false;

  double parameter(int k) const { return parameters.count(k) != 0 ? parameters.at(k) : 0; }
};

struct ZmxFile {
  std::string name;
  std::map<int, double> wavelengths_um;
  int primary = 1;
  std::optional<double> entrance_pupil_mm;
  bool stop_sets_aperture = false;
  std::vector<std::string> catalogues;
  std::vector<ZmxSurface> surfaces;
};

Error unsupported_here(const std::string& place, const std::string& what) {
  return unsupported_error(place + ": " + what + " has no counterpart in an eye");
}

/// What stands before the first surface.
void read_system_line(const WordLine& line, ZmxFile& zmx) {
  const std::string& key = line.words[0];
  if (key == "NAME") zmx.name = line.rest();
  if (key == "MODE" && line.word(1) != "SEQ") throw unsupported_here(line.place, "mode " + line.word(1));
  if (key == "UNIT" && line.word(1) != "MM")
    throw unsupported_error(line.place + ": lengths in " + line.word(1), "scale the lens to millimetres");
  if (key == "WAVM") zmx.wavelengths_um[line.whole(1)] = line.number(2);
  if (key == "WAVL")
    for (std::size_t k = 1; k < line.words.size(); ++k)
      zmx.wavelengths_um[static_cast<int>(k)] = line.number(k);
  if (key == "PWAV") zmx.primary = line.whole(1);
  if (key == "ENPD") zmx.entrance_pupil_mm = line.number(1);
  if (key == "FLOA") zmx.stop_sets_aperture = true;
  if (key == "GCAT") zmx.catalogues.assign(line.words.begin() + 1, line.words.end());
}

void read_surface_line(const WordLine& line, ZmxSurface& surface) {
  const std::string& key = line.words[0];
  if (key == "TYPE") surface.type = line.word(1);
  if (key == "COMM") surface.comment = line.rest();
  if (key == "CURV") surface.curvature_per_mm = line.number(1);
  if (key == "CONI") surface.conic = line.number(1);
  if (key == "DISZ") surface.thickness_mm = line.word(1) == "INFINITY" ? INFINITY : line.number(1);
  if (key == "DIAM") surface.semi_diameter_mm = line.number(1);
  if (key == "PARM") surface.parameters[line.whole(1)] = line.number(2);
  if (key == "XDAT") surface.extra[line.whole(1)] = line.number(2);
  if (key == "GLAS") surface.glass.assign(line.words.begin() + 1, line.words.end());
  if (key == "STOP") surface.is_stop = true;
  if (key == "CLAP") {
    if (line.number(1) != 0) throw unsupported_here(line.place, "a ring as aperture");
    surface.aperture_mm = line.number(2);
  }
  for (const char* other : {"SQAP", "ELAP", "OBSC", "SQOB", "ELOB", "SPID", "UDAD", "UDOB"})
    if (key == other) throw unsupported_here(line.place, "an aperture of type " + key);
}

ZmxFile read_file_of(const std::filesystem::path& file) {
  ZmxFile zmx;
  zmx.name = file.stem().string();
  for (const WordLine& line : word_lines(file)) {
    if (line.words[0] == "SURF") {
      zmx.surfaces.emplace_back();
      zmx.surfaces.back().place = fmt::format("{}: surface {}", line.place, line.whole(1));
    } else if (zmx.surfaces.empty()) {
      read_system_line(line, zmx);
    } else {
      read_surface_line(line, zmx.surfaces.back());
    }
  }
  if (zmx.surfaces.size() < 3)
    throw input_error(file.string() + ": no lens of Zemax: " + std::to_string(zmx.surfaces.size()) +
                      " lines SURF, at least an object, a surface and an image are expected");
  return zmx;
}

double radius_of(double curvature) { return 1 / curvature; }

/// The surface of a biconic, told as the ellipsoid that it is where both meridians agree.
ShapePtr biconic_or_ellipsoid(double r_x, double r_y, double q_x, double q_y) {
  const double depth_x = r_x / (1 + q_x), depth_y = r_y / (1 + q_y);
  if (1 + q_x > 0 && 1 + q_y > 0 && std::abs(depth_x - depth_y) < 1e-12 * std::abs(depth_x))
    return make_ellipsoid({std::abs(r_x) / std::sqrt(1 + q_x), std::abs(r_y) / std::sqrt(1 + q_y), depth_x},
                          0);
  return make_biconic(r_x, r_y, q_x, q_y, 0);
}

/// "Zernike Standard Sag": a conic with Noll's terms; its even powers must be 0.
ShapePtr zernike_of(const ZmxSurface& surface) {
  for (int k = 1; k <= 8; ++k)
    if (surface.parameter(k) != 0)
      throw unsupported_here(surface.place, "an even power beside Zernike terms");
  if (surface.extra.count(1) == 0 || surface.extra.count(2) == 0)
    throw input_error(surface.place + ": XDAT 1 (number of terms) or XDAT 2 (radius) is missing");
  if (surface.curvature_per_mm == 0) throw unsupported_here(surface.place, "Zernike terms upon a plane");
  constexpr double most_terms = 231;
  if (!(surface.extra.at(1) >= 1 && surface.extra.at(1) <= most_terms))
    throw input_error(surface.place + ": XDAT 1: 1 to 231 terms are expected");
  const int terms = static_cast<int>(surface.extra.at(1));
  std::vector<double> coefficients_um;
  for (int j = 0, found = 0; found < terms; ++j) {
    const int noll = noll_number(j);
    const auto entry = surface.extra.find(2 + noll);
    const bool named = noll <= terms;
    found += named ? 1 : 0;
    const double value = named && entry != surface.extra.end() ? entry->second : 0;
    coefficients_um.push_back(1000 * sign_mirrored_in_x(j) * value);
  }
  const double radius = radius_of(surface.curvature_per_mm);
  return make_zernike(radius, radius, surface.conic, surface.conic, 0, surface.extra.at(2), coefficients_um);
}

ShapePtr shape_of(const ZmxSurface& surface) {
  const bool flat = surface.curvature_per_mm == 0;
  const auto standard = [&]() -> ShapePtr {
    if (flat) return make_plane();
    const double radius = radius_of(surface.curvature_per_mm);
    return surface.conic == 0 ? make_sphere(radius) : make_conic(radius, surface.conic);
  };
  if (surface.type == "STANDARD" || surface.type == "GRINSUR3") return standard();
  if (surface.type == "SZERNSAG") return zernike_of(surface);
  if (surface.type == "EVENASPH") {
    for (int k = 1; k <= 8; ++k)
      if (surface.parameter(k) != 0) throw unsupported_here(surface.place, "an even asphere's power");
    return standard();
  }
  if (surface.type == "BICONICX") {
    // A radius of 0 stands for a flat meridian.
    if (flat || surface.parameter(1) == 0) throw unsupported_here(surface.place, "a cylinder");
    return biconic_or_ellipsoid(surface.parameter(1), radius_of(surface.curvature_per_mm),
                                surface.parameter(2), surface.conic);
  }
  throw unsupported_here(surface.place, "a surface of type " + surface.type);
}

GradientIndex gradient_of(const ZmxSurface& surface) {
  // Gradient 3: step, n0, r^2, r^4, r^6, z, z^2, z^3
  constexpr std::array<GradientIndex::Term, 7> terms{
      {{0, 0, 0}, {0, 2, 0}, {0, 4, 0}, {0, 6, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}};
  GradientIndex gradient;
  for (std::size_t k = 0; k < terms.size(); ++k)
    if (const double value = surface.parameter(static_cast<int>(k) + 2); value != 0)
      gradient.terms.push_back({terms[k].depth_power, terms[k].radius_power, value});
  return gradient;
}

/// Names the medium behind each surface and puts it among the system's media.
class GlassReader {
 public:
  GlassReader(const std::filesystem::path& file, const ZmxFile& zmx, double wavelength_nm) {
    for (const std::string& name : zmx.catalogues)
      for (const char* ending : {".agf", ".AGF"}) {
        const std::filesystem::path beside = file.parent_path() / (name + ending);
        if (!std::filesystem::exists(beside)) continue;
        glasses_.merge(read_glass_catalogue(beside, wavelength_nm));
        break;
      }
  }

  std::string medium_after(const ZmxSurface& surface, LensSystem& system) const {
    if (surface.type == "GRINSUR3") {
      Medium medium;
      medium.gradient = gradient_of(surface);
      medium.index = medium.gradient->index(0, 0);
      return add("gradient_" + std::to_string(system.media.size() + 1), medium, system);
    }
    if (surface.glass.empty()) return "air";
    const std::string name = capitals(surface.glass[0]);
    if (name == "MIRROR") throw unsupported_here(surface.place, "a mirror");
    if (name == "___BLANK") return add("", model_glass(surface), system);
    const auto found = glasses_.find(name);
    if (found == glasses_.end())
      throw input_error(
          surface.place + ": the glass " + name + " is in no catalogue beside the file, or there by a " +
              "formula other than Schott's, Sellmeier's of three terms and Conrady's",
          "put its catalogue (.agf), named under GCAT, beside the file, or make it a model glass");
    std::string lower = name;
    for (char& c : lower) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    return add(lower, found->second, system);
  }

 private:
  /// Index at d and Abbe number.
  static Medium model_glass(const ZmxSurface& surface) {
    const WordLine line{surface.glass, {}, surface.place};
    const double index = line.number(3), abbe = line.number(4, 0);
    if (!(index >= 1 && index <= 4))
      throw input_error(surface.place + fmt::format(": GLAS: an index of {} is found", index));
    Medium medium;
    medium.index = index;
    if (abbe > 0) medium.dispersion = {Dispersion::Formula::abbe, {index, abbe}};
    return medium;
  }

  static std::string add(std::string name, Medium medium, LensSystem& system) {
    if (medium.dispersion.formula == Dispersion::Formula::abbe)
      medium.index = medium.dispersion.formula_index(system.wavelength_nm);
    if (name.empty()) name = "medium_" + std::to_string(system.media.size() + 1);
    system.media[name] = std::move(medium);
    return name;
  }

  std::map<std::string, Medium> glasses_;
};

Eigen::Matrix3d turn(const ZmxSurface& surface) {
  const auto about = [&](int k, const Eigen::Vector3d& axis) {
    return Eigen::AngleAxisd(surface.parameter(k) * degree, axis);
  };
  const auto x = about(3, Eigen::Vector3d::UnitX()), y = about(4, Eigen::Vector3d::UnitY()),
             z = about(5, Eigen::Vector3d::UnitZ());
  // Order 0: decentre, then tilts about x, the new y, the new z. Order 1: the other way round.
  return surface.parameter(6) == 0 ? (x * y * z).toRotationMatrix() : (z * y * x).toRotationMatrix();
}

void pass_coordinate_break(const ZmxSurface& surface, Eigen::Isometry3d& pose) {
  const Eigen::Vector3d decentre(surface.parameter(1), surface.parameter(2), 0);
  if (surface.parameter(6) == 0) pose.translate(decentre);
  pose.rotate(turn(surface));
  if (surface.parameter(6) != 0) pose.translate(decentre);
}

}  // namespace

EyeModel read_zmx(const std::filesystem::path& file) {
  const ZmxFile zmx = read_file_of(file);
  LensSystem system;
  system.name = zmx.name;
  const auto wavelength = zmx.wavelengths_um.find(zmx.primary);
  if (wavelength == zmx.wavelengths_um.end())
    throw input_error(file.string() + ": no primary wavelength (WAVM, PWAV)");
  system.wavelength_nm = 1000 * wavelength->second;
  const GlassReader glasses(file, zmx, system.wavelength_nm);
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  std::string medium = "air";
  for (std::size_t k = 1; k < zmx.surfaces.size(); ++k) {
    const ZmxSurface& from = zmx.surfaces[k];
    const bool last = k + 1 == zmx.surfaces.size();
    if (from.type == "COORDBRK") {
      pass_coordinate_break(from, pose);
    } else {
      if (!last) medium = glasses.medium_after(from, system);
      system.surfaces.push_back(
          {from.comment, shape_of(from), pose, medium, from.aperture_mm, from.is_stop && !last});
      if (from.is_stop && zmx.stop_sets_aperture) system.stop_diameter_mm = 2 * from.semi_diameter_mm;
    }
    if (!last && !std::isfinite(from.thickness_mm))
      throw unsupported_here(from.place, "an infinite distance to the next surface");
    pose.translate(Eigen::Vector3d(0, 0, from.thickness_mm));
  }
  system.entrance_pupil_mm = zmx.entrance_pupil_mm;
  try {
    return eye_of(system);
  } catch (const Error& error) {
    throw Error(error.status(), file.string() + ": " + error.what(), error.remedy());
  }
}

}  // namespace emmetrope
