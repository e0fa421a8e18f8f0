#include "raytrace/tracer/optical_system.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/tracer/device_surface.hpp"

namespace emmetrope::raytrace {
namespace {

using Parameters = std::array<float, OpticalSystem::parameters>;

class Builder {
 public:
  Builder(const EyeModel& eye, const std::array<double, wavelength_count>& wavelength_nm)
      : eye_(eye), wavelength_nm_(wavelength_nm) {}

  /// Turns the frame to that of the next surface.
  void turn_to(const Eigen::Matrix3d& eye_from_frame) {
    const Eigen::Matrix3d turn = eye_from_frame.transpose() * frame_;
    if ((turn - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-12) return;
    Parameters p{};
    for (int i = 0; i < 9; ++i) p[i] = static_cast<float>(turn(i / 3, i % 3));
    add(Operation::rotate, p, nullptr, nullptr);
    frame_ = eye_from_frame;
  }

  /// The surface's origin in the present frame and its clear radius.
  Parameters placed(const Surface& surface, double clear_radius_mm) const {
    const Eigen::Vector3d origin = frame_.transpose() * surface.eye_from_surface().translation();
    Parameters p{};
    for (int i = 0; i < 3; ++i) p[i] = static_cast<float>(origin[i]);
    p[3] = static_cast<float>(clear_radius_mm * clear_radius_mm);
    return p;
  }

  /// \param behind, front  media on the retina's side and on the other; null for air
  void add(Operation kind, const Parameters& p, const Medium* behind, const Medium* front) {
    system_.kinds.push_back(kind);
    system_.operations.insert(system_.operations.end(), p.begin(), p.end());
    for (const double wavelength : wavelength_nm_) {
      const double ratio = index(behind, wavelength) / index(front, wavelength);
      system_.ratios.push_back(static_cast<float>(ratio));
    }
  }

  OpticalSystem& system() { return system_; }

 private:
  double index(const Medium* medium, double wavelength_nm) const {
    return medium == nullptr ? 1.0 : medium->index_at(wavelength_nm, eye_.reference_wavelength_nm);
  }

  const EyeModel& eye_;
  const std::array<double, wavelength_count>& wavelength_nm_;
  Eigen::Matrix3d frame_ = Eigen::Matrix3d::Identity();
  OpticalSystem system_;
};

float bits(int value) {
  float result = 0;
  std::memcpy(&result, &value, sizeof result);
  return result;
}

}  // namespace

bool OpticalSystem::has(Operation kind) const {
  return std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
}

std::string OpticalSystem::definitions() const {
  const std::array<std::pair<Operation, const char*>, 7> names{{{Operation::sphere, "SPHERE"},
                                                                {Operation::quadric, "QUADRIC"},
                                                                {Operation::biconic, "BICONIC"},
                                                                {Operation::patch, "PATCH"},
                                                                {Operation::stop, "STOP"},
                                                                {Operation::rotate, "ROTATE"},
                                                                {Operation::triangles, "TRIANGLES"}}};
  std::string text;
  for (const auto& [kind, name] : names)
    text += std::string(" -DHAS_") + name + "=" + (has(kind) ? "1" : "0");
  return text;
}

OpticalSystem make_optical_system(const EyeModel& eye,
                                  const std::array<double, wavelength_count>& wavelength_nm,
                                  Representation representation, int vertices) {
  Builder builder(eye, wavelength_nm);
  auto& system = builder.system();
  const auto medium = [&](const std::string& name) -> const Medium* {
    if (name.empty()) return nullptr;
    const Medium& found = eye.medium(name);
    if (found.gradient)
      throw unsupported_error("eye \"" + eye.name +
                              "\": the device does not trace the gradient of medium \"" + name + "\" yet");
    return &found;
  };

  for (int i = static_cast<int>(eye.surfaces.size()) - 2; i >= 0; --i) {
    const Surface& surface = eye.surfaces[i];
    const Eigen::Matrix3d eye_from_surface = surface.eye_from_surface().linear();
    system.operation_of[surface.name] = static_cast<int>(system.kinds.size());
    if (surface.is_stop()) {
      builder.turn_to(eye_from_surface);
      system.operation_of[surface.name] = static_cast<int>(system.kinds.size());
      builder.add(Operation::stop, builder.placed(surface, surface.stop_diameter_mm / 2), nullptr, nullptr);
      continue;
    }
    int before = i - 1;  // the medium in front is what follows the next refracting surface towards the light
    while (before >= 0 && eye.surfaces[before].is_stop()) --before;
    const Medium* front = before < 0 ? nullptr : medium(eye.surfaces[before].medium_after);
    const Medium* behind = medium(surface.medium_after);

    const DeviceSurface form = device_surface(surface, representation, vertices);
    builder.turn_to(eye_from_surface * Eigen::AngleAxisd(form.axis_deg * degree, Eigen::Vector3d::UnitZ()));
    system.operation_of[surface.name] = static_cast<int>(system.kinds.size());
    Parameters p = builder.placed(surface, form.clear_radius_mm);
    std::transform(form.parameters.begin(), form.parameters.end(), p.begin() + 4,
                   [](double value) { return static_cast<float>(value); });
    if (form.kind == Operation::patch) {
      p[11] = bits(form.columns);
      p[12] = bits(static_cast<int>(system.records.size()));
      system.records.insert(system.records.end(), form.records.begin(), form.records.end());
    }
    if (!form.note.empty()) system.notes.push_back(surface.name + ": " + form.note);
    builder.add(form.kind, p, behind, front);
  }
  builder.turn_to(Eigen::Matrix3d::Identity());
  return system;
}

}  // namespace emmetrope::raytrace
