#include "pipeline/eye/surfaces/shape.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "pipeline/base/checked_object.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/surfaces/newton_hit.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope {
namespace {

/// Turns a rotationally incomplete form by axis_deg about z: the form is written in (u, v), u along the
/// meridian.
class Turn {
 public:
  explicit Turn(double axis_deg)
      : axis_deg_(axis_deg), cosine_(std::cos(axis_deg * degree)), sine_(std::sin(axis_deg * degree)) {}
  double axis_deg() const { return axis_deg_; }
  Eigen::Vector2d to_form(const Eigen::Vector2d& p) const {
    return {cosine_ * p.x() + sine_ * p.y(), -sine_ * p.x() + cosine_ * p.y()};
  }
  Eigen::Vector2d from_form(const Eigen::Vector2d& p) const {
    return {cosine_ * p.x() - sine_ * p.y(), sine_ * p.x() + cosine_ * p.y()};
  }
  /// In eye axes, the curvature matrix that is diagonal in (u, v).
  Eigen::Matrix2d from_form(double curvature_u, double curvature_v) const {
    const Eigen::Vector2d u(cosine_, sine_), v(-sine_, cosine_);
    return curvature_u * u * u.transpose() + curvature_v * v * v.transpose();
  }

 private:
  double axis_deg_, cosine_, sine_;
};

/// c_u u^2 + c_v v^2 + c_d d^2 - 2 d = 0: plane, sphere, conic, ellipsoid; the sheet with 1 - c_d d > 0 holds
/// the vertex.
class Quadric : public Shape {
 public:
  Quadric(double c_u, double c_v, double c_d, double axis_deg)
      : c_u_(c_u), c_v_(c_v), c_d_(c_d), turn_(axis_deg) {}

  std::optional<double> depth_mm(double x_mm, double y_mm) const override {
    const Eigen::Vector2d p = turn_.to_form({x_mm, y_mm});
    const double s = c_u_ * p.x() * p.x() + c_v_ * p.y() * p.y();
    const double root = 1 - c_d_ * s;
    if (root < 0) return std::nullopt;
    return s / (1 + std::sqrt(root));
  }

  std::optional<Eigen::Vector3d> normal(double x_mm, double y_mm) const override {
    const std::optional<double> depth = depth_mm(x_mm, y_mm);
    if (!depth) return std::nullopt;
    return normal_at({x_mm, y_mm, -*depth});
  }

  std::optional<ShapeHit> intersect(const Ray& ray) const override {
    const Eigen::Vector2d o = turn_.to_form(ray.origin.head<2>()), v = turn_.to_form(ray.direction.head<2>());
    const double depth = -ray.origin.z(), v_depth = -ray.direction.z();
    // a t^2 - 2 g t + f = 0
    const double f = c_u_ * o.x() * o.x() + c_v_ * o.y() * o.y() + c_d_ * depth * depth - 2 * depth;
    const double g = v_depth - (c_u_ * o.x() * v.x() + c_v_ * o.y() * v.y() + c_d_ * depth * v_depth);
    const double a = c_u_ * v.x() * v.x() + c_v_ * v.y() * v.y() + c_d_ * v_depth * v_depth;
    const double discriminant = g * g - a * f;
    if (discriminant < 0) return std::nullopt;
    // Both roots without cancellation; one lies at infinity on a plane.
    const double sum = g + std::copysign(std::sqrt(discriminant), g);
    const double infinity = std::numeric_limits<double>::infinity();
    std::array<double, 2> roots{sum != 0 ? f / sum : infinity, a != 0 ? sum / a : infinity};
    if (roots[1] < roots[0]) std::swap(roots[0], roots[1]);
    for (const double t : roots) {
      if (!std::isfinite(t) || t < -behind_mm) continue;
      const Eigen::Vector3d position = ray.origin + t * ray.direction;
      if (1 + c_d_ * position.z() > 0) return ShapeHit{t, position, normal_at(position)};
    }
    return std::nullopt;
  }

  Eigen::Matrix2d vertex_curvature() const override { return turn_.from_form(c_u_, c_v_); }

 protected:
  double axis_deg() const { return turn_.axis_deg(); }

 private:
  Eigen::Vector3d normal_at(const Eigen::Vector3d& p) const {
    const Eigen::Vector2d form = turn_.to_form(p.head<2>());
    const Eigen::Vector2d slope = turn_.from_form(Eigen::Vector2d(c_u_ * form.x(), c_v_ * form.y()));
    return Eigen::Vector3d(slope.x(), slope.y(), 1 + c_d_ * p.z()).normalized();
  }

  double c_u_, c_v_, c_d_;
  Turn turn_;
};

class Plane : public Quadric {
 public:
  Plane() : Quadric(0, 0, 0, 0) {}
  std::string type() const override { return "plane"; }
  SurfaceFormula formula() const override { return PlaneFormula{}; }
  Json to_json() const override { return {{"type", type()}}; }
};

class Conic : public Quadric {
 public:
  Conic(double radius_mm, double q, bool sphere)
      : Quadric(1 / radius_mm, 1 / radius_mm, (1 + q) / radius_mm, 0),
        radius_(radius_mm),
        q_(q),
        sphere_(sphere) {}
  std::string type() const override { return sphere_ ? "sphere" : "conic"; }
  SurfaceFormula formula() const override {
    if (sphere_) return SphereFormula{radius_};
    return ConicFormula{radius_, q_};
  }
  Eigen::Vector2d asphericity() const override { return {q_, q_}; }
  Json to_json() const override {
    Json json{{"type", type()}, {"radius_mm", radius_}};
    if (!sphere_) json["q"] = q_;
    return json;
  }

 private:
  double radius_, q_;
  bool sphere_;
};

class Ellipsoid : public Quadric {
 public:
  Ellipsoid(const Eigen::Vector3d& semi_axes_mm, double axis_deg)
      : Quadric(semi_axes_mm.z() / (semi_axes_mm.x() * semi_axes_mm.x()),
                semi_axes_mm.z() / (semi_axes_mm.y() * semi_axes_mm.y()), 1 / semi_axes_mm.z(), axis_deg),
        semi_axes_(semi_axes_mm) {}
  std::string type() const override { return "ellipsoid"; }
  SurfaceFormula formula() const override { return EllipsoidFormula{semi_axes_, axis_deg()}; }
  Json to_json() const override {
    return {{"type", type()},
            {"semi_axes_mm", {semi_axes_.x(), semi_axes_.y(), semi_axes_.z()}},
            {"axis_deg", axis_deg()}};
  }

 private:
  Eigen::Vector3d semi_axes_;
};

/// A form that is known by its depth: rays are met by Newton's method from the osculating sphere at the
/// vertex.
class SagShape : public Shape {
 public:
  explicit SagShape(double axis_deg) : turn_(axis_deg) {}

  std::optional<double> depth_mm(double x_mm, double y_mm) const override {
    const std::optional<Sag> sag = sag_in_shape({x_mm, y_mm});
    if (!sag) return std::nullopt;
    return sag->depth_mm;
  }

  std::optional<Eigen::Vector3d> normal(double x_mm, double y_mm) const override {
    const std::optional<Sag> sag = sag_in_shape({x_mm, y_mm});
    if (!sag) return std::nullopt;
    return normal_from_slope(sag->slope);
  }

  std::optional<ShapeHit> intersect(const Ray& ray) const override {
    const auto sag = [&](const Eigen::Vector2d& p) { return sag_in_shape(p); };
    for (const double start : newton_starts(ray, vertex_curvature().trace() / 2)) {
      std::optional<ShapeHit> hit = newton_hit(ray, start, sag);
      if (hit && hit->distance_mm >= -behind_mm) return hit;
    }
    return std::nullopt;
  }

 protected:
  virtual std::optional<Sag> sag_at(const Eigen::Vector2d& p) const = 0;
  const Turn& turn() const { return turn_; }

 private:
  std::optional<Sag> sag_in_shape(const Eigen::Vector2d& p) const {
    std::optional<Sag> sag = sag_at(turn_.to_form(p));
    if (sag) sag->slope = turn_.from_form(sag->slope);
    return sag;
  }

  Turn turn_;
};

class Biconic : public SagShape {
 public:
  explicit Biconic(const BiconicFormula& formula)
      : SagShape(formula.axis_deg), radius_(formula.radius_mm), q_(formula.q) {}
  std::string type() const override { return "biconic"; }
  SurfaceFormula formula() const override { return biconic(); }
  Eigen::Vector2d asphericity() const override { return q_; }
  Eigen::Matrix2d vertex_curvature() const override {
    return turn().from_form(1 / radius_.x(), 1 / radius_.y());
  }
  Json to_json() const override {
    return {{"type", type()},
            {"radius_mm", {radius_.x(), radius_.y()}},
            {"q", {q_.x(), q_.y()}},
            {"axis_deg", turn().axis_deg()}};
  }

 protected:
  std::optional<Sag> sag_at(const Eigen::Vector2d& p) const override {
    const Eigen::Array2d c = radius_.array().inverse();
    const Eigen::Array2d s_terms = c * p.array().square();
    const Eigen::Array2d t_terms = (1 + q_.array()) * c.square() * p.array().square();
    const double s = s_terms.sum(), root_squared = 1 - t_terms.sum();
    if (root_squared <= 0) return std::nullopt;
    const double root = std::sqrt(root_squared), denominator = 1 + root;
    // d = S / (1 + sqrt(1 - T)): d' = S'/(1 + w) + S T' / (2 w (1 + w)^2)
    const Eigen::Array2d s_slope = 2 * c * p.array();
    const Eigen::Array2d t_slope = 2 * (1 + q_.array()) * c.square() * p.array();
    return Sag{s / denominator, s_slope / denominator + s * t_slope / (2 * root * denominator * denominator)};
  }
  BiconicFormula biconic() const { return {radius_, q_, turn().axis_deg()}; }

 private:
  Eigen::Vector2d radius_, q_;
};

class ZernikeSag : public Biconic {
 public:
  explicit ZernikeSag(ZernikeFormula formula)
      : Biconic(formula.biconic),
        norm_radius_(formula.norm_radius_mm),
        coefficients_um_(std::move(formula.coefficients_um)) {}
  std::string type() const override { return "zernike"; }
  SurfaceFormula formula() const override {
    return ZernikeFormula{biconic(), norm_radius_, coefficients_um_};
  }

  Eigen::Matrix2d vertex_curvature() const override {
    // Second differences of the polynomial part: exact to 1e-9 at this step for any order that is used.
    const double h = 1e-3 * norm_radius_;
    const auto slope = [&](double u, double v) { return polynomial({u, v}).slope; };
    const Eigen::Vector2d along_u = (slope(h, 0) - slope(-h, 0)) / (2 * h);
    const Eigen::Vector2d along_v = (slope(0, h) - slope(0, -h)) / (2 * h);
    Eigen::Matrix2d hessian;
    hessian << along_u.x(), (along_u.y() + along_v.x()) / 2, (along_u.y() + along_v.x()) / 2, along_v.y();
    Eigen::Matrix2d eye_from_form;
    eye_from_form.col(0) = turn().from_form(Eigen::Vector2d(1, 0));
    eye_from_form.col(1) = turn().from_form(Eigen::Vector2d(0, 1));
    return Biconic::vertex_curvature() + eye_from_form * hessian * eye_from_form.transpose();
  }

  Json to_json() const override {
    Json json = Biconic::to_json();
    json["type"] = type();
    json["norm_radius_mm"] = norm_radius_;
    json["zernike_um"] = coefficients_um_;
    return json;
  }

 protected:
  std::optional<Sag> sag_at(const Eigen::Vector2d& p) const override {
    std::optional<Sag> sag = Biconic::sag_at(p);
    if (!sag) return std::nullopt;
    const Sag extra = polynomial(p);
    return Sag{sag->depth_mm + extra.depth_mm, sag->slope + extra.slope};
  }

 private:
  Sag polynomial(const Eigen::Vector2d& p) const {
    Sag sum;
    for (std::size_t j = 0; j < coefficients_um_.size(); ++j) {
      if (coefficients_um_[j] == 0) continue;
      const ZernikeJet jet = zernike_jet(static_cast<int>(j), p.x() / norm_radius_, p.y() / norm_radius_);
      sum.depth_mm += 1e-3 * coefficients_um_[j] * jet.value;
      sum.slope += 1e-3 * coefficients_um_[j] * jet.gradient / norm_radius_;
    }
    return sum;
  }

  double norm_radius_;
  std::vector<double> coefficients_um_;
};

Eigen::Vector2d radii(CheckedObject& json) {
  const Eigen::Vector2d radius = json.one_or_two("radius_mm");
  json.require_magnitude("radius_mm", radius, 0.1, 1e9);  // 0.1 mm to what is flat
  return radius;
}

double radius_of(CheckedObject& json) {
  const double radius = json.number("radius_mm");
  json.require_magnitude("radius_mm", {radius, radius}, 0.1, 1e9);
  return radius;
}

Eigen::Vector2d asphericities(CheckedObject& json) {
  const Eigen::Vector2d q = json.has("q") ? json.one_or_two("q") : Eigen::Vector2d(0, 0);
  json.require_magnitude("q", q, 0, 1000);
  return q;
}

struct Reader {
  const char* type;
  ShapePtr (*read)(CheckedObject& json);
};

// A new form of surface is one line here.
constexpr Reader readers[] = {
    {"plane", [](CheckedObject&) { return make_plane(); }},
    {"sphere", [](CheckedObject& json) { return make_sphere(radius_of(json)); }},
    {"conic", [](CheckedObject& json) { return make_conic(radius_of(json), asphericities(json).x()); }},
    {"biconic",
     [](CheckedObject& json) {
       const Eigen::Vector2d radius = radii(json), q = asphericities(json);
       return make_biconic(radius.x(), radius.y(), q.x(), q.y(), json.number("axis_deg", 0));
     }},
    {"ellipsoid",
     [](CheckedObject& json) {
       const std::vector<double> axes = json.numbers("semi_axes_mm", 3);
       if (axes[0] <= 0 || axes[1] <= 0 || axes[2] == 0)
         throw json.fault("semi_axes_mm",
                          "the first two must be greater than 0, the third (along the axis) not 0");
       return make_ellipsoid({axes[0], axes[1], axes[2]}, json.number("axis_deg", 0));
     }},
    {"zernike",
     [](CheckedObject& json) {
       const Eigen::Vector2d radius = radii(json), q = asphericities(json);
       return make_zernike(radius.x(), radius.y(), q.x(), q.y(), json.number("axis_deg", 0),
                           json.positive("norm_radius_mm"), json.numbers("zernike_um"));
     }},
};

/// The osculating sphere of another form, only to be met by rays.
class OsculatingSphere : public Quadric {
 public:
  explicit OsculatingSphere(double curvature) : Quadric(curvature, curvature, curvature, 0) {}
  std::string type() const override { return "sphere"; }
  Json to_json() const override { return Json::object(); }
};

}  // namespace

std::vector<double> newton_starts(const Ray& ray, double mean_curvature_per_mm) {
  std::vector<double> starts;
  if (const std::optional<ShapeHit> sphere = OsculatingSphere(mean_curvature_per_mm).intersect(ray))
    starts.push_back(sphere->distance_mm);
  if (ray.direction.z() != 0) starts.push_back(-ray.origin.z() / ray.direction.z());
  return starts;
}

ShapePtr make_plane() { return std::make_shared<Plane>(); }
ShapePtr make_sphere(double radius_mm) { return std::make_shared<Conic>(radius_mm, 0, true); }
ShapePtr make_conic(double radius_mm, double q) { return std::make_shared<Conic>(radius_mm, q, false); }
ShapePtr make_biconic(double radius_x_mm, double radius_y_mm, double q_x, double q_y, double axis_deg) {
  return std::make_shared<Biconic>(BiconicFormula{{radius_x_mm, radius_y_mm}, {q_x, q_y}, axis_deg});
}
ShapePtr make_ellipsoid(const Eigen::Vector3d& semi_axes_mm, double axis_deg) {
  return std::make_shared<Ellipsoid>(semi_axes_mm, axis_deg);
}
ShapePtr make_zernike(double radius_x_mm, double radius_y_mm, double q_x, double q_y, double axis_deg,
                      double norm_radius_mm, const std::vector<double>& coefficients_um) {
  const BiconicFormula biconic{{radius_x_mm, radius_y_mm}, {q_x, q_y}, axis_deg};
  return std::make_shared<ZernikeSag>(ZernikeFormula{biconic, norm_radius_mm, coefficients_um});
}

ShapePtr turned_about_axis(const ShapePtr& shape, double angle_deg) {
  SurfaceFormula formula = shape->formula();
  if (auto* ellipsoid = std::get_if<EllipsoidFormula>(&formula))
    return make_ellipsoid(ellipsoid->semi_axes_mm, ellipsoid->axis_deg + angle_deg);
  if (auto* biconic = std::get_if<BiconicFormula>(&formula)) {
    biconic->axis_deg += angle_deg;
    return std::make_shared<Biconic>(*biconic);
  }
  if (auto* zernike = std::get_if<ZernikeFormula>(&formula)) {
    zernike->biconic.axis_deg += angle_deg;
    return std::make_shared<ZernikeSag>(std::move(*zernike));
  }
  return shape;  // the others are rotationally symmetric
}

ShapePtr shape_from_json(const std::string& type, CheckedObject& surface) {
  std::string known;
  for (const Reader& reader : readers) {
    if (type == reader.type) return reader.read(surface);
    known += std::string(reader.type) + ", ";
  }
  throw surface.fault("type", "\"" + type + "\" is not known; the types are " + known + "mesh, stop");
}

}  // namespace emmetrope
