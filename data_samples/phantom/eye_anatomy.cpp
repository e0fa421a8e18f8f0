#include <algorithm>
#include <cmath>

#include "data_samples/phantom/anatomy.hpp"
#include "data_samples/phantom/ellipsoid_distance.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::Matrix2d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double displacement_sphere_mm = 11;  // u is a length on a sphere of this radius
constexpr double cornea_reach_mm = 5.5;        // deeper than this the globe alone is the eye
constexpr double lens_edge_mm = 0.6;           // half axis of the rounded equator

Matrix2d turn_to_meridian(double axis_deg) {
  return Eigen::Rotation2Dd(-axis_deg * degree).toRotationMatrix();
}

/// Direction so many degrees from the posterior pole, towards +x and +y.
Vector3d from_pole(double x_deg, double y_deg) {
  const double away = std::hypot(x_deg, y_deg) * degree;
  const double around = std::atan2(y_deg, x_deg);
  return {std::sin(away) * std::cos(around), std::sin(away) * std::sin(around), -std::cos(away)};
}

/// A smooth irregular pattern between -1 and 1 with cells of about 3 / k.
double pattern(const Vector3d& p, double k) {
  return std::sin(k * p.x() + 1.3 * std::sin(0.7 * k * p.y() + 0.4)) *
         std::sin(1.1 * k * p.y() + 1.1 * std::sin(0.6 * k * p.z() + 1.1) + 0.5) *
         std::cos(0.9 * k * p.z() + 1.2 * std::sin(0.8 * k * p.x()));
}

double biconic_depth(const Vector2d& p, double rx, double ry, double qx, double qy) {
  const double x = p.x() / rx;
  const double y = p.y() / ry;
  const double root = 1 - (1 + qx) * x * x - (1 + qy) * y * y;
  return root <= 0 ? 1e3 : (p.x() * x + p.y() * y) / (1 + std::sqrt(root));
}

double conic_depth(double r2, double radius, double q) {
  const double root = 1 - (1 + q) * r2 / (radius * radius);
  return root <= 0 ? 1e3 : r2 / radius / (1 + std::sqrt(root));
}

}  // namespace

EyeAnatomy::EyeAnatomy(const PlacedEye& eye)
    : eye_(eye), rotation_(eye.lps_from_eye.linear().transpose()), apex_(eye.lps_from_eye.translation()) {
  const EyeGeometry& g = eye.geometry;
  cornea_turn_ = turn_to_meridian(g.cornea_axis_deg);
  globe_turn_ = turn_to_meridian(g.globe_axis_deg);
  head_turn_ = turn_to_meridian(eye.turn_deg);
  inner_ = Vector3d(g.globe_semi_x_mm, g.globe_semi_y_mm, g.globe_semi_z_mm);
  outer_ = inner_ + Vector3d(g.wall_lateral_mm, g.wall_lateral_mm, g.wall_axial_mm);
  centre_depth_ = eye.globe_centre_depth_mm();
  bulge_direction_ = from_pole(g.bulge_x_deg, g.bulge_y_deg);
  tumour_centre_ = from_pole(g.tumour_x_deg, g.tumour_y_deg).cwiseProduct(inner_);
  lens_from_eye_ = (Eigen::AngleAxisd(g.lens_tilt_y_deg * degree, Vector3d::UnitY()) *
                    Eigen::AngleAxisd(g.lens_tilt_x_deg * degree, Vector3d::UnitX()))
                       .toRotationMatrix()
                       .transpose();
  lens_centre_ = Vector3d(g.lens_decentre_x_mm, g.lens_decentre_y_mm,
                          -(g.anterior_chamber_depth_mm + g.lens_thickness_mm / 2));
}

double EyeAnatomy::cornea_front_mm(double x, double y) const {
  const EyeGeometry& g = eye_.geometry;
  return biconic_depth(cornea_turn_ * Vector2d(x, y), g.cornea_radius_x_mm, g.cornea_radius_y_mm,
                       g.cornea_q_x, g.cornea_q_y) +
         cone_depth_mm(g, x, y);
}

double EyeAnatomy::cornea_back_mm(double x, double y) const {
  const EyeGeometry& g = eye_.geometry;
  const double k = g.cornea_back_ratio;
  return g.cornea_thickness_mm +
         biconic_depth(cornea_turn_ * Vector2d(x, y), k * g.cornea_radius_x_mm, k * g.cornea_radius_y_mm,
                       g.cornea_q_x, g.cornea_q_y) +
         g.cone_back_ratio * cone_depth_mm(g, x, y);
}

double EyeAnatomy::bulge(const Vector3d& scaled) const {
  const EyeGeometry& g = eye_.geometry;
  if (g.bulge_height_mm == 0 || scaled.z() > 0.5 * scaled.norm()) return 0;
  const double angle = std::acos(std::clamp(scaled.normalized().dot(bulge_direction_), -1.0, 1.0));
  const double width = g.bulge_width_deg * degree;
  return g.bulge_height_mm * std::exp(-0.5 * angle * angle / (width * width)) / displacement_sphere_mm;
}

bool EyeAnatomy::in_lens(const Vector3d& p) const {
  const EyeGeometry& g = eye_.geometry;
  const Vector3d q = lens_from_eye_ * (p - lens_centre_);
  const double r2 = q.x() * q.x() + q.y() * q.y();
  const double reach = g.lens_equator_radius_mm;
  if (r2 > reach * reach) return false;
  const double front =
      g.lens_thickness_mm / 2 - conic_depth(r2, g.lens_anterior_radius_mm, g.lens_anterior_q);
  const double back =
      -g.lens_thickness_mm / 2 + conic_depth(r2, g.lens_posterior_radius_mm, g.lens_posterior_q);
  if (q.z() > front || q.z() < back) return false;
  const double r = std::sqrt(r2);
  const double beyond = (r - (reach - lens_edge_mm)) / lens_edge_mm;
  if (beyond <= 0) return true;
  const double half = (q.z() - (front + back) / 2) / std::max(0.05, (front - back) / 2);
  return half * half + beyond * beyond < 1;
}

bool EyeAnatomy::in_nucleus(const Vector3d& p) const {
  const EyeGeometry& g = eye_.geometry;
  if (g.nucleus_share == 0) return false;
  const Vector3d half_axes(g.lens_equator_radius_mm, g.lens_equator_radius_mm, g.lens_thickness_mm / 2);
  return (lens_from_eye_ * (p - lens_centre_)).cwiseQuotient(half_axes).norm() < g.nucleus_share;
}

bool EyeAnatomy::in_tumour(const Vector3d& p) const {
  const double radius = eye_.geometry.tumour_mm;
  return (p + Vector3d(0, 0, centre_depth_) - tumour_centre_).squaredNorm() < radius * radius;
}

Tissue EyeAnatomy::vitreous(const Vector3d& p) const {
  const EyeGeometry& g = eye_.geometry;
  if (in_tumour(p)) return Tissue::melanoma;
  if (g.oil != 0) return Tissue::silicone_oil;
  // The pattern's quantiles are not even: 0.1 makes 18 % of a globe, 0.3 28 %, 0.5 52 %.
  if (g.liquefied_share > 0 && pattern(p, 0.6) > 0.8 * (0.5 - g.liquefied_share))
    return Tissue::liquefied_vitreous;
  return Tissue::vitreous;
}

Tissue EyeAnatomy::wall(const Vector3d& p, double inner_norm, double outer_norm) const {
  const EyeGeometry& g = eye_.geometry;
  if (in_tumour(p)) return Tissue::melanoma;
  if (g.choroid_mm == 0) return Tissue::wall;
  // Both scaled radii grow by about the same per mm: the wall's thickness is shared between them.
  const double outwards = inner_norm - 1, inwards = 1 - outer_norm;
  return outwards * g.wall_lateral_mm < g.choroid_mm * (outwards + inwards) ? Tissue::choroid
                                                                            : Tissue::sclera;
}

double EyeAnatomy::wall_swell(const Vector3d& direction) const {
  return eye_.geometry.wall_variation * pattern(direction, 2.5);
}

double EyeAnatomy::lid_thickness_mm(const Vector3d& p) const {
  const EyeGeometry& g = eye_.geometry;
  const double up_mm = (head_turn_ * p.head<2>()).y();
  return g.lid_thickness_mm * (1 + g.lid_slope * std::clamp(up_mm / 10, -1.0, 1.0));
}

bool EyeAnatomy::in_buckle(const Vector3d& p) const {
  const EyeGeometry& g = eye_.geometry;
  return g.buckle_mm > 0 && std::abs(p.z() + centre_depth_) < 3 && distance_outside_mm(p) < g.buckle_mm;
}

Tissue EyeAnatomy::content(const Vector3d& p, double scaled_radius) const {
  const EyeGeometry& g = eye_.geometry;
  const double d = -p.z();
  const double lens_equator = g.anterior_chamber_depth_mm + 0.4 * g.lens_thickness_mm;
  if (d > lens_equator + 4.5) return vitreous(p);
  if (in_lens(p))
    return g.implant != 0 ? Tissue::acrylic : in_nucleus(p) ? Tissue::lens_nucleus : Tissue::lens;

  const double r = p.head<2>().norm();
  // The iris rests on the lens at the pupil and runs slightly forward towards its root.
  const double iris_back = g.anterior_chamber_depth_mm + 0.12 - 0.04 * (r - g.iris_diameter_mm / 2);
  if (r > g.iris_diameter_mm / 2 && d < iris_back && d > iris_back - g.iris_thickness_mm) return Tissue::iris;
  if (d < iris_back) return Tissue::aqueous;

  // Ciliary body: a wedge on the wall around the lens, thick behind the iris root, running out towards the
  // ora serrata. In front of the lens, where a short globe's ellipsoid comes near the iris, there is none.
  const double along = (d - iris_back) / 4.5;
  if (along < 1 && r > g.lens_equator_radius_mm + 0.3) {
    const double from_wall = (1 - scaled_radius) * inner_.x();
    if (from_wall < g.ciliary_thickness_mm * (1 - along)) return Tissue::ciliary_body;
  }
  const Vector3d q = p - lens_centre_;
  return -q.z() < -0.1 * g.lens_thickness_mm ? Tissue::aqueous : vitreous(p);
}

bool EyeAnatomy::contains(const Vector3d& p, Tissue& tissue) const {
  const EyeGeometry& g = eye_.geometry;
  const double d = -p.z();
  const Vector2d across = globe_turn_ * p.head<2>();
  const Vector3d from_centre(across.x(), across.y(), centre_depth_ - d);
  if (d < -0.1 || from_centre.squaredNorm() > 400) return false;

  const Vector3d scaled_in = from_centre.cwiseQuotient(inner_);
  const Vector3d outer =
      g.wall_variation == 0 ? outer_
                            : Vector3d(inner_ + (1 + wall_swell(scaled_in.normalized())) * (outer_ - inner_));
  const double inner_norm = scaled_in.norm(), outer_norm = from_centre.cwiseQuotient(outer).norm();
  const double reach = std::abs(g.bulge_height_mm) / displacement_sphere_mm;
  double swell = 1;
  if (inner_norm >= 1 - reach && outer_norm < 1 + reach) {
    // The bulge's direction is told in scaled space with the eye's x and y.
    const Vector2d scaled_across = globe_turn_.transpose() * scaled_in.head<2>();
    swell += bulge(Vector3d(scaled_across.x(), scaled_across.y(), scaled_in.z()));
  }
  const double rho_in = inner_norm / swell;
  const bool near_cornea = d < cornea_reach_mm && p.head<2>().squaredNorm() < 64;
  const bool in_cornea_front = near_cornea && d > cornea_front_mm(p.x(), p.y());
  const bool in_cornea_back = in_cornea_front && d > cornea_back_mm(p.x(), p.y());
  if (rho_in < 1 || in_cornea_back) {
    tissue = content(p, rho_in);
    return true;
  }
  if (in_cornea_front || outer_norm < swell) {
    const bool cornea =
        in_cornea_front && p.head<2>().squaredNorm() < g.limbus_radius_mm * g.limbus_radius_mm;
    tissue = cornea ? Tissue::cornea : wall(p, rho_in, outer_norm / swell);
    return true;
  }
  return false;
}

double EyeAnatomy::distance_outside_mm(const Vector3d& p) const {
  const EyeGeometry& g = eye_.geometry;
  const double d = -p.z();
  const Vector2d across = globe_turn_ * p.head<2>();
  const double to_globe = ellipsoid_distance(Vector3d(across.x(), across.y(), centre_depth_ - d), outer_);
  // The cornea's mean conic as an ellipsoid: a lid need not follow the cylinder.
  const double radius = 0.5 * (g.cornea_radius_x_mm + g.cornea_radius_y_mm);
  const double p_value = std::max(0.6, 1 + 0.5 * (g.cornea_q_x + g.cornea_q_y));
  const double across_mm = radius / std::sqrt(p_value);
  const double along_mm = radius / p_value;
  return std::min(to_globe,
                  ellipsoid_distance(Vector3d(p.x(), p.y(), along_mm - d), {across_mm, across_mm, along_mm}));
}

bool EyeAnatomy::in_fissure(const Vector3d& p) const {
  const Vector2d q = head_turn_ * p.head<2>();
  return std::abs(q.x()) < 11 && std::abs(q.y() + 3.4 - 0.02 * q.x() * q.x()) < 0.15;
}

double EyeAnatomy::outer_radius_mm(double depth_mm) const {
  const double t = (depth_mm - centre_depth_) / outer_.z();
  return std::abs(t) < 1 ? 0.5 * (outer_.x() + outer_.y()) * std::sqrt(1 - t * t) : 0;
}

}  // namespace emmetrope::phantom
