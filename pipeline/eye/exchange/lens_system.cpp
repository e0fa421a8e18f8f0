#include "pipeline/eye/exchange/lens_system.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/paraxial.hpp"

namespace emmetrope {
namespace {

bool has_word(const std::string& text, std::initializer_list<const char*> words) {
  return std::any_of(words.begin(), words.end(),
                     [&](const char* word) { return text.find(word) != std::string::npos; });
}

/// Letters, digits and underscores of a comment, in lower case.
std::string plain_name(const std::string& comment) {
  std::string name;
  for (const unsigned char c : comment) {
    if (std::isalnum(c) != 0 && c < 128)
      name += static_cast<char>(std::tolower(c));
    else if (!name.empty() && name.back() != '_')
      name += '_';
  }
  while (!name.empty() && name.back() == '_') name.pop_back();
  return name;
}

/// One of the names that all commands know where the comment says as much.
std::string surface_name(const std::string& comment) {
  std::string text = plain_name(comment);
  const bool front = has_word(text, {"ant", "front"}), back = has_word(text, {"post", "back"});
  if (front != back) {
    const std::string side = front ? "_anterior" : "_posterior";
    if (has_word(text, {"cornea"})) return "cornea" + side;
    if (has_word(text, {"lens"}) && !has_word(text, {"contact", "spectacle"})) return "lens" + side;
  }
  return text;
}

bool is_worn(const std::string& name) { return has_word(name, {"spectacle", "contact"}); }

void take_pose(Surface& surface, const LensSurface& from) {
  const Eigen::Vector3d vertex = from.light_from_surface.translation();
  surface.position_mm = vertex.z();
  surface.decentre_mm = {-vertex.x(), vertex.y()};
  const Eigen::Matrix3d r = half_turn * from.light_from_surface.linear() * half_turn;
  // r = Ry(b) Rx(a) Rz(c); c is the axis of a toric surface.
  const double a = -std::asin(std::clamp(r(1, 2), -1.0, 1.0)), b = std::atan2(r(0, 2), r(2, 2));
  surface.tilt_deg = Eigen::Vector2d(a, b) / degree;
  if (surface.tilt_deg.cwiseAbs().maxCoeff() < 1e-13) surface.tilt_deg.setZero();
  const Eigen::Matrix3d tilt =
      (Eigen::AngleAxisd(b, Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(a, Eigen::Vector3d::UnitX()))
          .toRotationMatrix();
  const Eigen::Matrix3d about_axis = tilt.transpose() * r;
  const double turn_deg = std::atan2(about_axis(1, 0), about_axis(0, 0)) / degree;
  if (surface.shape && std::abs(turn_deg) > 1e-13) surface.shape = turned_about_axis(surface.shape, turn_deg);
}

Surface stop_of(const LensSurface& from) {
  Surface stop;
  stop.name = "iris";
  stop.stop_diameter_mm = 1;
  take_pose(stop, from);
  return stop;
}

/// Unique names; the first refracting surface that nobody wears is the cornea's where none says so.
void name_surfaces(EyeModel& eye) {
  eye.surfaces.back().name = "retina";
  const auto named = [&](const std::string& name) {
    return std::count_if(eye.surfaces.begin(), eye.surfaces.end(),
                         [&](const Surface& surface) { return surface.name == name; });
  };
  if (named("cornea_anterior") == 0) {
    const auto first = std::find_if(eye.surfaces.begin(), eye.surfaces.end() - 1, [](const Surface& surface) {
      return !surface.is_stop() && !is_worn(surface.name);
    });
    if (first != eye.surfaces.end() - 1) first->name = "cornea_anterior";
  }
  for (std::size_t k = 0; k < eye.surfaces.size(); ++k) {
    std::string& name = eye.surfaces[k].name;
    if (name.empty() || named(name) > 1) name = "surface_" + std::to_string(k + 1);
  }
}

void open_stop(EyeModel& eye, const LensSystem& system) {
  if (eye.stop() == nullptr) return;
  if (system.stop_diameter_mm) {
    eye.set_stop_diameter(*system.stop_diameter_mm);
  } else if (system.entrance_pupil_mm) {
    eye.set_stop_diameter(*system.entrance_pupil_mm / entrance_pupil(eye, system.wavelength_nm).diameter_mm);
  }
}

}  // namespace

EyeModel eye_of(const LensSystem& system) {
  EyeModel eye;
  eye.name = system.name;
  eye.reference_wavelength_nm = system.wavelength_nm;
  std::string medium = "air";
  for (const LensSurface& from : system.surfaces) {
    const bool last = &from == &system.surfaces.back();
    if (from.is_stop && !last) eye.surfaces.push_back(stop_of(from));
    if (!last && from.medium_after == medium) continue;
    Surface surface;
    surface.name = surface_name(from.comment);
    surface.bearer = has_word(surface.name, {"spectacle"}) ? Bearer::head : Bearer::eye;
    surface.shape = from.shape;
    surface.semi_diameter_mm = from.semi_diameter_mm;
    if (!last) surface.medium_after = medium = from.medium_after;
    take_pose(surface, from);
    eye.surfaces.push_back(surface);
    if (!last && medium != "air") eye.media[medium] = system.media.at(medium);
  }
  if (eye.media.empty()) throw input_error("no surface refracts: there is no eye in it");
  name_surfaces(eye);
  const double apex_mm = eye.surface("cornea_anterior").position_mm;
  for (Surface& surface : eye.surfaces) surface.position_mm -= apex_mm;
  open_stop(eye, system);
  // What eye.json demands is demanded of every eye.
  return eye_from_json(to_json(eye), {});
}

}  // namespace emmetrope
