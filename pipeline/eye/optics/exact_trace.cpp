#include "pipeline/eye/optics/exact_trace.hpp"

#include <cmath>

namespace emmetrope {
namespace {

/// A ray that starts on a surface is neither before nor behind it.
constexpr double on_surface_mm = 1e-6;
/// Surfaces whose vertices are nearer than this form a thin lens; how far its surfaces may cross each other.
constexpr double coincident_mm = 1e-9, thin_lens_reach_mm = 5;

/// Snell's law; nothing for total internal reflection. The normal may point either way.
std::optional<Eigen::Vector3d> refract(const Eigen::Vector3d& direction, Eigen::Vector3d normal,
                                       double n_before, double n_after) {
  if (normal.dot(direction) > 0) normal = -normal;
  const double ratio = n_before / n_after;
  const double cosine = -normal.dot(direction);
  const double square = 1 - ratio * ratio * (1 - cosine * cosine);
  if (square < 0) return std::nullopt;
  return (ratio * direction + (ratio * cosine - std::sqrt(square)) * normal).normalized();
}

/// Depth of a shape at (x, y), or at its edge on the way there where it does not reach so far.
double depth_or_edge_mm(const Shape& shape, double x, double y) {
  if (const std::optional<double> depth = shape.depth_mm(x, y)) return *depth;
  double inside = 0, outside = 1, edge_mm = 0;
  for (int halving = 0; halving < 30; ++halving) {
    const double middle = 0.5 * (inside + outside);
    const std::optional<double> depth = shape.depth_mm(middle * x, middle * y);
    (depth ? inside : outside) = middle;
    if (depth) edge_mm = *depth;
  }
  return edge_mm;
}

/// n and n grad n of a gradient at a point of its own frame (z out of the eye).
struct GradientValue {
  double n = 0;
  Eigen::Vector3d n_gradient{0, 0, 0};
};

double power(double base, int exponent) {
  double result = 1;
  for (; exponent > 0; --exponent) result *= base;
  return result;
}

GradientValue gradient_value(const GradientIndex& gradient, double shift, const Eigen::Vector3d& p) {
  const double t = -p.z(), r2 = p.x() * p.x() + p.y() * p.y();
  double n = shift, by_t = 0, by_r2 = 0;
  for (const GradientIndex::Term& term : gradient.terms) {
    const int i = term.depth_power, k = term.radius_power / 2;
    const double t_power = power(t, i), r_power = power(r2, k);
    n += term.coefficient * t_power * r_power;
    if (i > 0) by_t += term.coefficient * i * power(t, i - 1) * r_power;
    if (k > 0) by_r2 += term.coefficient * k * t_power * power(r2, k - 1);
  }
  return {n, n * Eigen::Vector3d(2 * p.x() * by_r2, 2 * p.y() * by_r2, -by_t)};
}

/// State of Sharma's equations d2R/dt2 = n grad n with T = n dR/ds, dt = ds/n.
struct GradientState {
  Eigen::Vector3d r, t;
  double opl = 0;
};

template <typename Value>
GradientState sharma_step(const GradientState& s, double dt, const Value& value) {
  const GradientValue at_start = value(s.r);
  const Eigen::Vector3d a = dt * at_start.n_gradient;
  const GradientValue at_middle = value(s.r + dt / 2 * s.t + dt / 8 * a);
  const Eigen::Vector3d b = dt * at_middle.n_gradient;
  const GradientValue at_end = value(s.r + dt * s.t + dt / 2 * b);
  const Eigen::Vector3d c = dt * at_end.n_gradient;
  GradientState next;
  next.r = s.r + dt * (s.t + (a + 2 * b) / 6);
  next.t = s.t + (a + 4 * b + c) / 6;
  // The optical path is the integral of n^2 dt; Simpson's rule has the scheme's order.
  const double n_end = value(next.r).n;
  next.opl = s.opl + dt / 6 * (at_start.n * at_start.n + 4 * at_middle.n * at_middle.n + n_end * n_end);
  return next;
}

}  // namespace

const char* to_string(RayState state) {
  switch (state) {
    case RayState::reached:
      return "reached";
    case RayState::vignetted:
      return "vignetted";
    case RayState::tir:
      return "tir";
    case RayState::missed_surface:
      return "missed_surface";
    case RayState::missed_scene:
      return "missed_scene";
  }
  return "";
}

ExactTracer::ExactTracer(const EyeModel& eye, double wavelength_nm, double gradient_step_mm)
    : gradient_step_mm_(gradient_step_mm) {
  int before = -1;
  std::vector<std::string> medium_name_before;
  for (const Surface& surface : eye.surfaces) {
    Step step;
    step.shape = surface.shape;
    step.name = surface.name;
    step.position_mm = surface.position_mm;
    step.semi_diameter_mm = surface.semi_diameter_mm;
    step.stop_radius_mm = surface.stop_diameter_mm / 2;
    step.eye_from_surface = surface.eye_from_surface();
    step.surface_from_eye = step.eye_from_surface.inverse();
    step.medium_before = before;
    medium_name_before.push_back(before < 0 ? "air" : eye.surfaces[before].medium_after);
    if (!surface.is_stop()) {
      if (!surface.medium_after.empty()) step.medium_after = eye.medium(surface.medium_after);
      step.index_after = step.medium_after.index_at(wavelength_nm, eye.reference_wavelength_nm);
      before = static_cast<int>(steps_.size());
    }
    steps_.push_back(step);
  }
  // Bodies that may be missed: from surface i to the first j behind it that leads back into the same medium.
  for (std::size_t i = 0; i < steps_.size(); ++i) {
    if (eye.surfaces[i].is_stop()) continue;
    for (std::size_t j = i + 1; j < steps_.size(); ++j)
      if (eye.surfaces[j].medium_after == medium_name_before[i] && !eye.surfaces[j].is_stop()) {
        const bool thin = steps_[j].position_mm - steps_[i].position_mm < coincident_mm;
        if (!thin && steps_[i].partner < 0 && steps_[j].partner < 0) {
          steps_[i].partner = static_cast<int>(j);
          steps_[j].partner = static_cast<int>(i);
        }
        break;
      }
  }
}

double ExactTracer::index_at(int owner, const Eigen::Vector3d& position) const {
  if (owner < 0) return 1;
  const Step& step = steps_[owner];
  if (!step.medium_after.gradient) return step.index_after;
  const double dispersion = step.index_after - step.medium_after.index;
  return gradient_value(*step.medium_after.gradient, dispersion, step.surface_from_eye * position).n;
}

bool ExactTracer::lies_behind(const Step& step, const Eigen::Vector3d& position) const {
  const Eigen::Vector3d p = step.surface_from_eye * position;
  return -p.z() > (step.shape ? depth_or_edge_mm(*step.shape, p.x(), p.y()) : 0) + on_surface_mm;
}

std::optional<ShapeHit> ExactTracer::hit(const Step& step, const Ray& ray, bool may_lie_behind) const {
  const double back = may_lie_behind ? thin_lens_reach_mm : 0;
  const Ray local{step.surface_from_eye * (ray.origin - back * ray.direction),
                  step.surface_from_eye.linear() * ray.direction};
  std::optional<ShapeHit> result = step.shape->intersect(local);
  if (!result) return result;
  if (step.semi_diameter_mm > 0 && result->position.head<2>().norm() > step.semi_diameter_mm)
    return std::nullopt;
  result->distance_mm -= back;
  result->position = step.eye_from_surface * result->position;
  result->normal = step.eye_from_surface.linear() * result->normal;
  return result;
}

/// Whether a hit on one end of a body really is on the body: on the right side of its other end.
bool ExactTracer::inside_body(int partner, const Eigen::Vector3d& position, bool inward) const {
  const Step& other = steps_[partner];
  const Eigen::Vector3d p = other.surface_from_eye * position;
  const std::optional<double> depth = other.shape->depth_mm(p.x(), p.y());
  if (!depth) return false;
  if (other.semi_diameter_mm > 0 && p.head<2>().norm() > other.semi_diameter_mm) return false;
  return inward ? -p.z() < *depth : -p.z() > *depth;
}

std::optional<ExactTracer::Arrival> ExactTracer::run_straight(const Step& target, const Ray& ray, int medium,
                                                              bool may_lie_behind) const {
  const std::optional<ShapeHit> met = hit(target, ray, may_lie_behind);
  if (!met) return std::nullopt;
  return Arrival{
      {met->position, ray.direction}, met->normal, index_at(medium, ray.origin) * met->distance_mm};
}

std::optional<ExactTracer::Arrival> ExactTracer::cross_gradient(int owner, const Step& target, const Ray& ray,
                                                                bool inward) const {
  const Step& frame = steps_[owner];
  const Medium& medium = frame.medium_after;
  const double shift = frame.index_after - medium.index;
  const auto value = [&](const Eigen::Vector3d& p) { return gradient_value(*medium.gradient, shift, p); };
  // How far a point lies beyond the target, along the axis.
  const Eigen::Isometry3d target_from_frame = target.surface_from_eye * frame.eye_from_surface;
  const auto beyond = [&](const Eigen::Vector3d& r) -> std::optional<double> {
    const Eigen::Vector3d p = target_from_frame * r;
    const std::optional<double> depth = target.shape->depth_mm(p.x(), p.y());
    if (!depth) return std::nullopt;
    return (inward ? 1 : -1) * (-p.z() - *depth);
  };

  GradientState state;
  state.r = frame.surface_from_eye * ray.origin;
  state.t = frame.surface_from_eye.linear() * ray.direction * value(state.r).n;
  const double dt = gradient_step_mm_ / value(state.r).n;
  std::optional<double> distance = beyond(state.r);
  if (!distance || *distance > on_surface_mm) return std::nullopt;
  constexpr double longest_path_mm = 60;
  const int steps = static_cast<int>(longest_path_mm / gradient_step_mm_);
  for (int k = 0; k < steps; ++k) {
    GradientState next = sharma_step(state, dt, value);
    const std::optional<double> next_distance = beyond(next.r);
    if (!next_distance) return std::nullopt;
    if (*next_distance < 0) {
      state = next;
      distance = next_distance;
      continue;
    }
    // The last step ends on the surface: false position on its length.
    double low = 0, low_value = *distance, high = dt, high_value = *next_distance;
    for (int iteration = 0; iteration < 60 && high - low > 1e-15; ++iteration) {
      double middle =
          high_value > low_value ? low - low_value * (high - low) / (high_value - low_value) : low;
      if (iteration % 3 == 2) middle = (low + high) / 2;
      next = sharma_step(state, middle, value);
      const double middle_value = beyond(next.r).value_or(0);
      if (std::abs(middle_value) < 1e-13) break;
      (middle_value < 0 ? low : high) = middle;
      (middle_value < 0 ? low_value : high_value) = middle_value;
    }
    const Eigen::Vector3d p = target_from_frame * next.r;
    if (target.semi_diameter_mm > 0 && p.head<2>().norm() > target.semi_diameter_mm) return std::nullopt;
    const Ray arrived{frame.eye_from_surface * next.r,
                      (frame.eye_from_surface.linear() * next.t).normalized()};
    const Eigen::Vector3d at = target.surface_from_eye * arrived.origin;
    const std::optional<Eigen::Vector3d> normal = target.shape->normal(at.x(), at.y());
    if (!normal) return std::nullopt;
    return Arrival{arrived, target.eye_from_surface.linear() * *normal, next.opl};
  }
  return std::nullopt;
}

/// A stop only looks at the ray: a decentred lens may bulge through its plane.
bool ExactTracer::passes_stop(const Step& stop, const Ray& ray) const {
  const Ray local{stop.surface_from_eye * ray.origin, stop.surface_from_eye.linear() * ray.direction};
  const Eigen::Vector3d crossing = local.origin - local.origin.z() / local.direction.z() * local.direction;
  return crossing.head<2>().norm() <= stop.stop_radius_mm;
}

int ExactTracer::first_ahead(const Eigen::Vector3d& origin, bool inward) const {
  const int count = static_cast<int>(steps_.size());
  int first = inward ? 0 : count - 2;
  if (inward)
    while (first < count && lies_behind(steps_[first], origin)) ++first;
  else
    while (first >= 0 && !lies_behind(steps_[first], origin)) --first;
  return first;
}

int ExactTracer::medium_before(int first, bool inward) const {
  const int count = static_cast<int>(steps_.size());
  if (inward) return first < count ? steps_[first].medium_before : count - 1;
  if (first < 0) return -1;
  return steps_[first].shape ? first : steps_[first].medium_before;
}

template <typename Report>
ExactTracer::End ExactTracer::walk(const Ray& ray_in_eye, bool inward, const Report& report) const {
  const int count = static_cast<int>(steps_.size());
  const int retina = count - 1;
  const int first = first_ahead(ray_in_eye.origin, inward);

  End end{RayState::reached, -1, ray_in_eye.origin, ray_in_eye.direction, 0};
  Ray ray = ray_in_eye;
  int medium = medium_before(first, inward);
  int last_hit = -1;
  const auto ended = [&](RayState state, int surface) {
    end.state = state;
    end.surface = surface;
    return end;
  };

  for (int k = first; inward ? k < count : k >= 0; k += inward ? 1 : -1) {
    const Step& step = steps_[k];
    if (!step.shape) {
      if (!passes_stop(step, ray)) return ended(RayState::vignetted, k);
      continue;
    }
    const bool in_gradient = medium >= 0 && steps_[medium].medium_after.gradient.has_value();
    const bool thin = last_hit >= 0 &&
                      std::abs(steps_[last_hit].position_mm - step.position_mm) < coincident_mm &&
                      k != retina;
    const std::optional<Arrival> arrival =
        in_gradient ? cross_gradient(medium, step, ray, inward) : run_straight(step, ray, medium, thin);
    const bool enters_body =
        !in_gradient && step.partner >= 0 && (inward ? step.partner > k : step.partner < k);
    if (enters_body && (!arrival || !inside_body(step.partner, arrival->ray.origin, inward))) {
      k = step.partner;  // past the whole body, in the medium around it
      continue;
    }
    if (!arrival) return ended(RayState::missed_surface, k);
    ray = arrival->ray;
    end.opl_mm += arrival->opl_mm;
    last_hit = k;
    const int next_medium = inward ? k : step.medium_before;
    if (k != retina) {
      const std::optional<Eigen::Vector3d> direction = refract(
          ray.direction, arrival->normal, index_at(medium, ray.origin), index_at(next_medium, ray.origin));
      if (!direction) {
        end.position_mm = ray.origin;
        return ended(RayState::tir, k);
      }
      ray.direction = *direction;
    }
    medium = next_medium;
    end.position_mm = ray.origin;
    end.direction = ray.direction;
    report(k, end);
  }
  if (last_hit < 0) return ended(RayState::missed_surface, inward ? retina : 0);  // away from the eye
  return ended(RayState::reached, last_hit);
}

RayPath ExactTracer::path_of(const Ray& ray_in_eye, bool inward) const {
  RayPath path;
  const End end =
      walk({ray_in_eye.origin, ray_in_eye.direction.normalized()}, inward, [&](int k, const End& at) {
        path.hits.push_back({steps_[k].name, at.position_mm, at.direction, at.opl_mm});
      });
  path.state = end.state;
  if (end.surface >= 0) path.at = steps_[end.surface].name;
  return path;
}

RayPath ExactTracer::trace(const Ray& ray_in_eye) const {
  return path_of(ray_in_eye, ray_in_eye.direction.z() < 0);
}

RayPath ExactTracer::trace_inward(const Ray& ray_in_eye) const { return path_of(ray_in_eye, true); }

ExactTracer::End ExactTracer::trace_end(const Ray& ray_in_eye) const {
  return walk({ray_in_eye.origin, ray_in_eye.direction.normalized()}, ray_in_eye.direction.z() < 0,
              [](int, const End&) {});
}

RayPath trace_exact(const EyeModel& eye, const Ray& ray_in_eye, double wavelength_nm,
                    double gradient_step_mm) {
  return ExactTracer(eye, wavelength_nm, gradient_step_mm).trace(ray_in_eye);
}

}  // namespace emmetrope
