#include "raytrace/system/optical_system.hpp"

#include <fmt/format.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/base/parallel.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "raytrace/system/device_surface.hpp"
#include "raytrace/system/int_bits.hpp"

namespace emmetrope::raytrace {
namespace {

using Parameters = std::array<float, OpticalSystem::parameters>;

// O_FLAGS in kernels/surfaces.cl
constexpr int enters_body = 1, inside_body = 2, local_ratio = 4;

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
    if (const double end_mm = 1.03 * bodies.edge_mm(places[k]); end_mm > 0 && mesh_of(surface) == nullptr)
      surface.semi_diameter_mm =
          surface.semi_diameter_mm > 0 ? std::min(surface.semi_diameter_mm, end_mm) : end_mm;
    forms[places[k]] = device_surface(surface, wanted.representation, vertices[k]);
  });
  return forms;
}

/// How a surface departs from a conic of curvature c and k = c (1 + q): coefficients of x^2, x y and y^2, then
/// of the same times r^2; nothing where it is that conic.
/// \param axis_deg  of the frame of x and y in the surface's own
std::optional<std::array<double, 6>> departure_from_conic(const Shape& shape, double axis_deg, double c,
                                                          double k) {
  constexpr double reach_mm = 4.5, same_mm = 1e-6;  // what a wide pupil lets through; a nanometre
  constexpr int rings = 8, spokes = 16;
  Eigen::Matrix<double, rings * spokes, 6> design;
  Eigen::Matrix<double, rings * spokes, 1> departure;
  design.setZero();
  departure.setZero();
  for (int i = 0; i < rings * spokes; ++i) {
    const int ring = 1 + i / spokes, spoke = i % spokes;
    const double r = reach_mm * ring / rings, angle = 2 * pi * spoke / spokes;
    const double x = r * std::cos(angle), y = r * std::sin(angle), turned = angle + axis_deg * degree;
    const auto depth = shape.depth_mm(r * std::cos(turned), r * std::sin(turned));
    const double inside = 1 - c * k * r * r;
    if (!depth || inside < 0) continue;
    departure[i] = *depth - c * r * r / (1 + std::sqrt(inside));
    design.row(i) << x * x, x * y, y * y, r * r * x * x, r * r * x * y, r * r * y * y;
  }
  if (departure.cwiseAbs().maxCoeff() < same_mm) return std::nullopt;
  std::array<double, 6> coefficients{};
  Eigen::Map<Eigen::Matrix<double, 6, 1>>(coefficients.data()) =
      design.colPivHouseholderQr().solve(departure);
  return coefficients;
}

class Builder {
 public:
  Builder(const EyeModel& eye, const std::array<double, wavelength_count>& wavelength_nm,
          const SystemForm& wanted)
      : eye_(eye),
        wavelength_nm_(wavelength_nm),
        bodies_(eye),
        forms_(device_surfaces(eye, bodies_, wanted)) {
    system_.has_body = bodies_.any() && !wanted.every_surface;
    std::size_t floats = 0;
    for (const DeviceSurface& form : forms_) floats += form.records.size() + form.seeds.size() + 16;
    system_.records.reserve(floats);
  }

  OpticalSystem operator()() {
    for (int i = static_cast<int>(eye_.surfaces.size()) - 2; i >= 0; --i)
      eye_.surfaces[i].is_stop() ? add_stop(eye_.surfaces[i]) : add_refraction(i);
    turn_to(Eigen::Matrix3d::Identity());
    return std::move(system_);
  }

 private:
  /// Media on the retina's side of a surface and on the other; null for air.
  struct Sides {
    const Medium *behind = nullptr, *front = nullptr;
  };

  void add_stop(const Surface& stop) {
    turn_to(stop.eye_from_surface().linear());
    begin(stop);
    add(Operation::stop, placed(stop, stop.stop_diameter_mm / 2), {});
  }

  void add_refraction(int i) {
    const Surface& surface = eye_.surfaces[i];
    const DeviceSurface& form = forms_[i];
    turn_to(surface.eye_from_surface().linear() *
            Eigen::AngleAxisd(form.axis_deg * degree, Eigen::Vector3d::UnitZ()));
    begin(surface);
    int before = i - 1;  // the medium in front is what follows the next refracting surface towards the light
    while (before >= 0 && eye_.surfaces[before].is_stop()) --before;
    const Sides sides{medium(surface.medium_after),
                      before < 0 ? nullptr : medium(eye_.surfaces[before].medium_after)};
    int flags = system_.has_body ? bodies_.flags(i) : 0;
    const double clear_radius_mm = (flags & enters_body) != 0
                                       ? std::min(form.clear_radius_mm, bodies_.edge_mm(i))
                                       : form.clear_radius_mm;
    Parameters p = placed(surface, clear_radius_mm);
    if (is_gradient(sides.behind) || is_gradient(sides.front)) {
      add_crossing(i, before, sides, p, flags);
      flags |= local_ratio;
    }
    store(form, p);
    p[15] = int_bits(flags);
    if (!form.note.empty()) system_.notes.push_back(surface.name + ": " + form.note);
    add(form.kind, p, sides);
  }

  /// The way through the gradients on either side to where the surface is met.
  void add_crossing(int i, int before, const Sides& sides, const Parameters& at, int flags) {
    const Surface& surface = eye_.surfaces[i];
    Parameters p = at;
    const double c = surface.shape->vertex_curvature().trace() / 2;
    const Eigen::Vector2d q = surface.shape->asphericity();
    const double k = c * (1 + (q.x() + q.y()) / 2);
    p[4] = static_cast<float>(c);
    p[5] = static_cast<float>(k);
    if (const auto departure = departure_from_conic(*surface.shape, forms_[i].axis_deg, c, k)) {
      std::transform(departure->begin(), departure->end(), p.begin() + 8,
                     [](double value) { return static_cast<float>(value); });
      p[14] = int_bits(1);
    }
    p[6] = int_bits(is_gradient(sides.behind) ? add_gradient(*sides.behind, surface) : -1);
    p[7] = int_bits(is_gradient(sides.front) ? add_gradient(*sides.front, eye_.surfaces[before]) : -1);
    p[15] = int_bits(flags & inside_body);
    add(Operation::gradient, p, sides);
  }

  /// What the surface's own kernel takes, its tables among the records.
  void store(const DeviceSurface& form, Parameters& p) {
    std::vector<float>& records = system_.records;
    std::transform(form.parameters.begin(), form.parameters.end(), p.begin() + 4,
                   [](double value) { return static_cast<float>(value); });
    if (!form.records.empty()) {
      p[11] = int_bits(form.columns);
      p[12] = int_bits(records.size());
      records.insert(records.end(), form.records.begin(), form.records.end());
    }
    if (!form.seeds.empty()) {
      p[14] = int_bits(records.size());
      records.insert(records.end(), form.seeds.begin(), form.seeds.end());
      records.resize((records.size() + 15) / 16 * 16);  // records are read at multiples of 64 bytes
    }
  }

  /// The next operation is the surface's first.
  void begin(const Surface& surface) {
    system_.operation_of[surface.name] = static_cast<int>(system_.kinds.size());
  }

  /// Turns the frame to that of the next surface.
  void turn_to(const Eigen::Matrix3d& eye_from_frame) {
    const Eigen::Matrix3d turn = eye_from_frame.transpose() * frame_;
    if ((turn - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() < 1e-12) return;
    Parameters p{};
    for (int i = 0; i < 9; ++i) p[i] = static_cast<float>(turn(i / 3, i % 3));
    add(Operation::rotate, p, {});
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

  void add(Operation kind, const Parameters& p, const Sides& sides) {
    system_.kinds.push_back(kind);
    system_.operations.insert(system_.operations.end(), p.begin(), p.end());
    for (const double wavelength : wavelength_nm_) {
      const double ratio = index(sides.behind, wavelength) / index(sides.front, wavelength);
      system_.ratios.push_back(static_cast<float>(ratio));
    }
  }

  /// The gradient as the kernel takes it, in the present frame; returns its number.
  /// \param owner  the surface whose vertex its depth is counted from
  int add_gradient(const Medium& medium, const Surface& owner) {
    std::array<float, OpticalSystem::gradient_floats> g{};
    for (const auto& term : medium.gradient->terms) {
      if (term.depth_power > 3 || term.radius_power > 4)
        throw unsupported_error("the gradient behind \"" + owner.name + "\" has powers beyond t^3 and r^4");
      g[3 * term.depth_power + term.radius_power / 2] += static_cast<float>(term.coefficient);
    }
    const Eigen::Vector3d origin = frame_.transpose() * owner.eye_from_surface().translation();
    for (int c = 0; c < 3; ++c) g[12 + c] = static_cast<float>(origin[c]);
    for (int w = 0; w < wavelength_count; ++w)
      g[OpticalSystem::gradient_shifts + w] =
          static_cast<float>(medium.index_at(wavelength_nm_[w], eye_.reference_wavelength_nm) - medium.index);
    const Eigen::Matrix3d owner_from_frame = owner.eye_from_surface().linear().transpose() * frame_;
    for (int i = 0; i < 9; ++i)
      g[OpticalSystem::gradient_turn + i] = static_cast<float>(owner_from_frame(i / 3, i % 3));
    system_.gradients.insert(system_.gradients.end(), g.begin(), g.end());
    return static_cast<int>(system_.gradients.size() / g.size()) - 1;
  }

  const Medium* medium(const std::string& name) const { return name.empty() ? nullptr : &eye_.medium(name); }
  static bool is_gradient(const Medium* medium) { return medium != nullptr && medium->gradient; }

  /// Of a gradient 1: the kernel multiplies by what it finds.
  double index(const Medium* medium, double wavelength_nm) const {
    return medium == nullptr || medium->gradient
               ? 1.0
               : medium->index_at(wavelength_nm, eye_.reference_wavelength_nm);
  }

  const EyeModel& eye_;
  const std::array<double, wavelength_count>& wavelength_nm_;
  Bodies bodies_;
  std::vector<DeviceSurface> forms_;  ///< by a surface's place in the eye
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
  return fmt::format("{} -DHAS_BODY={} -DGRADIENT_FLOATS={}", text, has_body ? 1 : 0, gradient_floats);
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
  return Builder(eye, wavelength_nm, wanted)();
}

}  // namespace emmetrope::raytrace
