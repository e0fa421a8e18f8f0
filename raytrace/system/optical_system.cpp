#include "raytrace/system/optical_system.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"
#include "raytrace/system/device_surface.hpp"

namespace emmetrope::raytrace {
namespace {

using Parameters = std::array<float, OpticalSystem::parameters>;

float bits(int value) {
  float result = 0;
  std::memcpy(&result, &value, sizeof result);
  return result;
}

// O_FLAGS in kernels/surfaces.cl
constexpr int enters_body = 1, inside_body = 2, local_ratio = 4;

/// 0 where the shape has none, the mean of a biconic's two.
double conic_constant(const Shape& shape) {
  const Json json = shape.to_json();
  if (!json.contains("q")) return 0;
  return json["q"].is_array() ? (json["q"][0].get<double>() + json["q"][1].get<double>()) / 2
                              : json["q"].get<double>();
}

/// Bodies that a ray may pass by: a surface and the next one that leads back into the medium in front of it,
/// when the two meet in an edge (a nucleus smaller than the lens).
class Bodies {
 public:
  explicit Bodies(const EyeModel& eye) : flags_(eye.surfaces.size(), 0), edge_mm_(eye.surfaces.size(), 0) {
    std::string medium_before = "air";
    for (std::size_t i = 0; i + 1 < eye.surfaces.size(); ++i) {
      const Surface& front = eye.surfaces[i];
      if (front.is_stop()) continue;
      for (std::size_t j = i + 1; j + 1 < eye.surfaces.size(); ++j) {
        if (eye.surfaces[j].is_stop() || eye.surfaces[j].medium_after != medium_before) continue;
        const auto edge = edge_of(front, eye.surfaces[j]);
        if (edge && flags_[i] == 0 && flags_[j] == 0) {
          flags_[j] = enters_body;
          edge_mm_[i] = edge_mm_[j] = *edge;
          for (std::size_t k = i; k < j; ++k) flags_[k] = inside_body;
          any_ = true;
        }
        break;
      }
      medium_before = front.medium_after;
    }
  }
  bool any() const { return any_; }
  int flags(int surface) const { return flags_[surface]; }
  double edge_mm(int surface) const { return edge_mm_[surface]; }

 private:
  /// Where the two meet, if they do within 8 mm of the axis or before one of them ends.
  static std::optional<double> edge_of(const Surface& front, const Surface& back) {
    const auto apart = [&](double r) {
      const auto d = front.shape->depth_mm(r, 0), e = back.shape->depth_mm(r, 0);
      return d && e && back.position_mm + *e - front.position_mm - *d > 0;
    };
    constexpr double search_mm = 8, step_mm = 0.05;
    double low = 0;
    while (low < search_mm && apart(low + step_mm)) low += step_mm;
    if (low >= search_mm) return std::nullopt;
    double high = low + step_mm;
    for (int k = 0; k < 40; ++k) {
      const double middle = 0.5 * (low + high);
      (apart(middle) ? low : high) = middle;
    }
    return low;
  }

  std::vector<int> flags_;
  std::vector<double> edge_mm_;
  bool any_ = false;
};

/// What the device needs of every refracting surface, by its place in the eye; surfaces are independent of
/// each other.
std::vector<DeviceSurface> device_surfaces(const EyeModel& eye, const Bodies& bodies,
                                           const SystemForm& wanted) {
  std::vector<int> places, vertices;  // from the retina's side
  for (int i = static_cast<int>(eye.surfaces.size()) - 2; i >= 0; --i)
    if (!eye.surfaces[i].is_stop()) {
      vertices.push_back(wanted.vertices.size() == 1 ? wanted.vertices.front()
                                                     : wanted.vertices.at(places.size()));
      places.push_back(i);
    }
  std::vector<DeviceSurface> forms(eye.surfaces.size());
  on_threads(wanted.threads, places.size(), [&](std::size_t k) {
    Surface surface = eye.surfaces[places[k]];
    // A body's surface ends at its edge, and its sheet just beyond: further out it may be too steep for one.
    if (const double end_mm = 1.03 * bodies.edge_mm(places[k]); end_mm > 0 && surface.shape->type() != "mesh")
      surface.semi_diameter_mm =
          surface.semi_diameter_mm > 0 ? std::min(surface.semi_diameter_mm, end_mm) : end_mm;
    forms[places[k]] = device_surface(surface, wanted.representation, vertices[k]);
  });
  return forms;
}

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

  /// \param behind,  front media on the retina's side and on the other; null for air
  void add(Operation kind, const Parameters& p, const Medium* behind, const Medium* front) {
    system_.kinds.push_back(kind);
    system_.operations.insert(system_.operations.end(), p.begin(), p.end());
    for (const double wavelength : wavelength_nm_) {
      const double ratio = index(behind, wavelength) / index(front, wavelength);
      system_.ratios.push_back(static_cast<float>(ratio));
    }
  }

  /// The gradient as the kernel takes it, in the present frame; returns its number.
  /// \param owner  the surface whose vertex its depth is counted from
  int add_gradient(const Medium& medium, const Surface& owner) {
    if (!owner.eye_from_surface().linear().isApprox(frame_, 1e-9))
      throw unsupported_error(
          "a gradient medium behind \"" + owner.name + "\" ends at a surface of another tilt",
          "give both surfaces of a gradient the same tilt_deg");
    std::array<float, 32> g{};
    for (const auto& term : medium.gradient->terms) {
      if (term.depth_power > 3 || term.radius_power > 4)
        throw unsupported_error("the gradient behind \"" + owner.name + "\" has powers beyond t^3 and r^4");
      g[3 * term.depth_power + term.radius_power / 2] += static_cast<float>(term.coefficient);
    }
    const Eigen::Vector3d origin = frame_.transpose() * owner.eye_from_surface().translation();
    for (int c = 0; c < 3; ++c) g[12 + c] = static_cast<float>(origin[c]);
    for (int w = 0; w < wavelength_count; ++w)
      g[16 + w] =
          static_cast<float>(medium.index_at(wavelength_nm_[w], eye_.reference_wavelength_nm) - medium.index);
    system_.gradients.insert(system_.gradients.end(), g.begin(), g.end());
    return static_cast<int>(system_.gradients.size() / g.size()) - 1;
  }

  OpticalSystem& system() { return system_; }

 private:
  /// Of a gradient 1: the kernel multiplies by what it finds.
  double index(const Medium* medium, double wavelength_nm) const {
    return medium == nullptr || medium->gradient
               ? 1.0
               : medium->index_at(wavelength_nm, eye_.reference_wavelength_nm);
  }

  const EyeModel& eye_;
  const std::array<double, wavelength_count>& wavelength_nm_;
  Eigen::Matrix3d frame_ = Eigen::Matrix3d::Identity();
  OpticalSystem system_;
};

}  // namespace

bool OpticalSystem::has(Operation kind) const {
  return std::find(kinds.begin(), kinds.end(), kind) != kinds.end();
}

std::string OpticalSystem::definitions() const {
  const std::array<std::pair<Operation, const char*>, 9> names{
      {{Operation::sphere, "SPHERE"},
       {Operation::quadric, "QUADRIC"},
       {Operation::biconic, "BICONIC"},
       {Operation::patch, "PATCH"},
       {Operation::stop, "STOP"},
       {Operation::rotate, "ROTATE"},
       {Operation::triangles, "TRIANGLES"},
       {Operation::gradient, "GRADIENT"},
       {Operation::every_triangle, "EVERY_TRIANGLE"}}};
  std::string text;
  for (const auto& [kind, name] : names)
    text += std::string(" -DHAS_") + name + "=" + (has(kind) ? "1" : "0");
  return text + " -DHAS_BODY=" + (has_body ? "1" : "0");
}

std::string OpticalSystem::sequence_definitions() const {
  const bool long_code = has(Operation::patch) || has(Operation::triangles) ||
                         has(Operation::every_triangle) || has(Operation::gradient);
  if (long_code || kinds.size() > 16) return {};
  std::uint64_t kind_digits = 0, flag_digits = 0, form_digits = 0;
  for (std::size_t k = 0; k < kinds.size(); ++k) {
    const float* p = &operations[k * parameters];
    std::uint32_t flags = 0;
    if (kinds[k] != Operation::rotate) std::memcpy(&flags, p + 15, sizeof flags);
    const bool centred = p[0] == 0 && p[1] == 0, unlimited = p[3] >= unlimited_mm * unlimited_mm;
    kind_digits |= static_cast<std::uint64_t>(kinds[k]) << 4 * k;
    flag_digits |= static_cast<std::uint64_t>(flags) << 4 * k;
    form_digits |= static_cast<std::uint64_t>((centred ? 1 : 0) | (unlimited ? 2 : 0)) << 4 * k;
  }
  return fmt::format(" -DOPERATIONS={} -DKINDS={:#x}UL -DFLAGS={:#x}UL -DFORMS={:#x}UL", kinds.size(),
                     kind_digits, flag_digits, form_digits);
}

OpticalSystem make_optical_system(const EyeModel& eye,
                                  const std::array<double, wavelength_count>& wavelength_nm,
                                  const SystemForm& wanted) {
  Builder builder(eye, wavelength_nm);
  auto& system = builder.system();
  const auto medium = [&](const std::string& name) -> const Medium* {
    if (name.empty()) return nullptr;
    const Medium& found = eye.medium(name);
    return &found;
  };

  const Bodies bodies(eye);
  system.has_body = bodies.any() && !wanted.every_surface;
  const std::vector<DeviceSurface> forms = device_surfaces(eye, bodies, wanted);
  std::size_t floats = 0;
  for (const DeviceSurface& form : forms) floats += form.records.size() + form.seeds.size() + 16;
  system.records.reserve(floats);
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

    const DeviceSurface& form = forms[i];
    builder.turn_to(eye_from_surface * Eigen::AngleAxisd(form.axis_deg * degree, Eigen::Vector3d::UnitZ()));
    system.operation_of[surface.name] = static_cast<int>(system.kinds.size());
    int flags = system.has_body ? bodies.flags(i) : 0;
    const double clear_radius_mm =
        (flags & enters_body) != 0 ? std::min(form.clear_radius_mm, bodies.edge_mm(i)) : form.clear_radius_mm;
    Parameters p = builder.placed(surface, clear_radius_mm);
    const auto is_gradient = [](const Medium* m) { return m != nullptr && m->gradient; };
    if (is_gradient(behind) || is_gradient(front)) {
      Parameters crossing = p;
      const double c = surface.shape->vertex_curvature().trace() / 2;
      crossing[4] = static_cast<float>(c);
      crossing[5] = static_cast<float>(c * (1 + conic_constant(*surface.shape)));
      crossing[6] = bits(is_gradient(behind) ? builder.add_gradient(*behind, surface) : -1);
      crossing[7] = bits(is_gradient(front) ? builder.add_gradient(*front, eye.surfaces[before]) : -1);
      crossing[15] = bits(flags & inside_body);
      builder.add(Operation::gradient, crossing, behind, front);
      flags |= local_ratio;
    }
    std::transform(form.parameters.begin(), form.parameters.end(), p.begin() + 4,
                   [](double value) { return static_cast<float>(value); });
    if (!form.records.empty()) {
      p[11] = bits(form.columns);
      p[12] = bits(static_cast<int>(system.records.size()));
      system.records.insert(system.records.end(), form.records.begin(), form.records.end());
    }
    if (!form.seeds.empty()) {
      p[14] = bits(static_cast<int>(system.records.size()));
      system.records.insert(system.records.end(), form.seeds.begin(), form.seeds.end());
      system.records.resize((system.records.size() + 15) / 16 *
                            16);  // records are read at multiples of 64 bytes
    }
    p[15] = bits(flags);
    if (!form.note.empty()) system.notes.push_back(surface.name + ": " + form.note);
    builder.add(form.kind, p, behind, front);
  }
  builder.turn_to(Eigen::Matrix3d::Identity());
  return system;
}

}  // namespace emmetrope::raytrace
