#include "pipeline/eye/model/eye_model.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope {

Eigen::Isometry3d Surface::eye_from_surface() const {
  Eigen::Isometry3d result = Eigen::Isometry3d::Identity();
  result.translate(Eigen::Vector3d(decentre_mm.x(), decentre_mm.y(), -position_mm));
  result.rotate(Eigen::AngleAxisd(tilt_deg.y() * degree, Eigen::Vector3d::UnitY()) *
                Eigen::AngleAxisd(tilt_deg.x() * degree, Eigen::Vector3d::UnitX()));
  return result;
}

const Surface& EyeModel::surface(const std::string& surface_name) const {
  std::string known;
  for (const Surface& candidate : surfaces) {
    if (candidate.name == surface_name) return candidate;
    known += " " + candidate.name;
  }
  throw input_error("eye '" + name + "' has no surface '" + surface_name + "'; it has" + known);
}

Surface& EyeModel::surface(const std::string& surface_name) {
  return const_cast<Surface&>(static_cast<const EyeModel&>(*this).surface(surface_name));
}

const Surface* EyeModel::stop() const {
  for (const Surface& candidate : surfaces)
    if (candidate.is_stop()) return &candidate;
  return nullptr;
}

const Medium& EyeModel::medium(const std::string& medium_name) const {
  static const Medium air;
  const auto found = media.find(medium_name);
  if (found != media.end()) return found->second;
  if (medium_name == "air") return air;
  throw input_error("eye '" + name + "' has no medium '" + medium_name + "'");
}

void EyeModel::set_stop_diameter(double diameter_mm) {
  for (Surface& candidate : surfaces)
    if (candidate.is_stop()) candidate.stop_diameter_mm = diameter_mm;
}

namespace {

template <typename Predicate>
EyeModel without(EyeModel eye, const Predicate& goes) {
  eye.surfaces.erase(std::remove_if(eye.surfaces.begin(), eye.surfaces.end(), goes), eye.surfaces.end());
  return eye;
}

}  // namespace

std::string extrapolation_warning(const EyeModel& eye, double wavelength_nm) {
  constexpr double first_known_nm = 380, last_known_nm = 1000;  // of every eye's media, or near it
  bool has_dispersion = false;
  for (const auto& [name, medium] : eye.media) {
    has_dispersion = has_dispersion || medium.dispersion.formula != Dispersion::Formula::constant;
    const double index = medium.index_at(wavelength_nm, eye.reference_wavelength_nm);
    if (!(index >= 1 && index <= 4))
      throw input_error(fmt::format("at {:g} nm the dispersion of \"{}\" gives an index of {:g}",
                                    wavelength_nm, name, index),
                        fmt::format("give {:g} to {:g} nm", first_known_nm, last_known_nm));
  }
  if (!has_dispersion || (wavelength_nm >= first_known_nm && wavelength_nm <= last_known_nm)) return {};
  return fmt::format(
      "at {:g} nm the indices are extrapolated: the media's dispersion is known from {:g} to {:g} nm",
      wavelength_nm, first_known_nm, last_known_nm);
}

EyeModel without_stop(EyeModel eye) {
  return without(std::move(eye), [](const Surface& surface) { return surface.is_stop(); });
}

EyeModel without_spectacle(EyeModel eye) {
  return without(std::move(eye), [](const Surface& surface) { return surface.bearer == Bearer::head; });
}

}  // namespace emmetrope
