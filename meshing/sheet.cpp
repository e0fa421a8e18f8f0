#include "meshing/sheet.hpp"

#include <algorithm>
#include <cmath>

#include "meshing/paper_vertices.hpp"
#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"

namespace emmetrope::meshing {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double cornea_anterior_radius_mm = 6.0;
constexpr double cornea_posterior_radius_mm = 5.5;
constexpr double retina_polar_angle_rad = 105 * degree;

class HeightSheet : public Sheet {
 public:
  HeightSheet(const Isometry3d& eye_from_surface, ShapePtr shape, double radius_mm)
      : eye_from_surface_(eye_from_surface), shape_(std::move(shape)), radius_mm_(radius_mm) {}

  Vector3d at(double reach, double azimuth) const override {
    return on_surface(radius_mm_ * reach * std::cos(azimuth), radius_mm_ * reach * std::sin(azimuth));
  }

  Vector3d project(const Vector3d& close_to_it) const override {
    const Vector3d local = eye_from_surface_.inverse() * close_to_it;
    const double shrink = std::min(1.0, radius_mm_ / std::max(local.head<2>().norm(), 1e-12));
    return on_surface(shrink * local.x(), shrink * local.y());
  }

  Vector3d normal(const Vector3d& on_it) const override {
    const Vector3d local = eye_from_surface_.inverse() * on_it;
    return eye_from_surface_.linear() * shape_->normal(local.x(), local.y()).value();
  }

 private:
  Vector3d on_surface(double x_mm, double y_mm) const {
    return eye_from_surface_ * Vector3d(x_mm, y_mm, -shape_->depth_mm(x_mm, y_mm).value());
  }

  Isometry3d eye_from_surface_;
  ShapePtr shape_;
  double radius_mm_;
};

class GlobeSheet : public Sheet {
 public:
  GlobeSheet(const ParametricEye& eye, double polar_angle_rad)
      : eye_(eye), polar_angle_rad_(polar_angle_rad) {}

  Vector3d at(double reach, double azimuth) const override {
    const double polar = reach * polar_angle_rad_;
    return eye_.retina_point(
        {std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth), -std::cos(polar)});
  }

  Vector3d project(const Vector3d& close_to_it) const override {
    const Vector3d n = direction(close_to_it);
    const double polar = std::acos(std::clamp(-n.z(), -1.0, 1.0));
    return polar > polar_angle_rad_ ? at(1, std::atan2(n.y(), n.x())) : eye_.retina_point(n);
  }

  Vector3d normal(const Vector3d& on_it) const override { return eye_.retina_normal(direction(on_it)); }

 private:
  Vector3d direction(const Vector3d& point) const {
    return (point - eye_.globe_centre_mm()).cwiseQuotient(eye_.globe_semi_axes_mm).normalized();
  }

  ParametricEye eye_;
  double polar_angle_rad_;
};

/// Depth of one surface at its rim, all the way round.
bool reaches(const Shape& shape, double radius_mm) {
  for (int i = 0; i < 36; ++i) {
    const double azimuth = i * pi / 18;
    if (!shape.depth_mm(radius_mm * std::cos(azimuth), radius_mm * std::sin(azimuth))) return false;
  }
  return true;
}

/// The largest radius up to the wanted one for which `fits`.
template <typename Condition>
double largest_radius(double wanted_mm, const std::string& surface, const Condition& fits) {
  for (double radius = wanted_mm; radius > 2; radius -= 0.05) {
    if (fits(radius)) return radius;
  }
  throw no_result_error("the fitted " + surface + " does not even reach 2 mm from its axis");
}

}  // namespace

std::unique_ptr<Sheet> make_height_sheet(const Isometry3d& eye_from_surface, ShapePtr shape,
                                         double radius_mm) {
  return std::make_unique<HeightSheet>(eye_from_surface, std::move(shape), radius_mm);
}

std::unique_ptr<Sheet> make_globe_sheet(const ParametricEye& eye, double polar_angle_rad) {
  return std::make_unique<GlobeSheet>(eye, polar_angle_rad);
}

std::vector<NamedSheet> make_sheets(const ParametricEye& eye, const ShapePtr& anterior_cornea,
                                    double cornea_known_to_mm) {
  const std::vector<Surface> surfaces = analytic_surfaces(eye, anterior_cornea);
  const auto surface = [&](const std::string& name) -> const Surface& {
    return *std::find_if(surfaces.begin(), surfaces.end(), [&](const Surface& s) { return s.name == name; });
  };
  const auto cornea_radius = [&](const std::string& name, double wanted_mm) {
    return largest_radius(wanted_mm, name, [&](double r) { return reaches(*surface(name).shape, r); });
  };
  // The lens' two conics share one axis, so that their distance at its equator is a difference of depths.
  const Shape& front = *surface("lens_anterior").shape;
  const Shape& back = *surface("lens_posterior").shape;
  const double lens_radius = largest_radius(eye.lens_equator_radius_mm, "lens", [&](double r) {
    return reaches(front, r) && reaches(back, r) &&
           eye.lens_thickness_mm - *front.depth_mm(r, 0) + *back.depth_mm(r, 0) > 0.1;
  });

  std::vector<NamedSheet> sheets;
  const auto add = [&](const std::string& name, int vertices, double radius_mm) {
    sheets.push_back({name, vertices,
                      make_height_sheet(surface(name).eye_from_surface(), surface(name).shape, radius_mm)});
  };
  const double cornea_wanted_mm =
      anterior_cornea ? std::min(cornea_anterior_radius_mm, cornea_known_to_mm) : cornea_anterior_radius_mm;
  add("cornea_anterior", paper_vertices::cornea_anterior, cornea_radius("cornea_anterior", cornea_wanted_mm));
  add("cornea_posterior", paper_vertices::cornea_posterior,
      cornea_radius("cornea_posterior", cornea_posterior_radius_mm));
  add("lens_anterior", paper_vertices::lens_anterior, lens_radius);
  add("lens_posterior", paper_vertices::lens_posterior, lens_radius);
  sheets.push_back({"retina", paper_vertices::retina, make_globe_sheet(eye, retina_polar_angle_rad)});
  return sheets;
}

}  // namespace emmetrope::meshing
