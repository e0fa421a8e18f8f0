#include "data_samples/phantom/anatomy.hpp"

#include <algorithm>
#include <cmath>

#include "data_samples/phantom/ellipsoid_distance.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::Vector3d;

constexpr double near_globe_mm = 19;

/// The smaller of two distances, with the groove between the bodies filled to a radius of about k.
double smooth_union(double a, double b, double k) {
  const double h = std::max(k - std::abs(a - b), 0.0) / k;
  return std::min(a, b) - h * h * k / 4;
}

/// Skin surface without the eyes, head frame: cranium, face, brow and nose.
double face_distance(const Vector3d& p) {
  double d = ellipsoid_distance(p - Vector3d(0, 78, 45), {76, 96, 85});
  d = smooth_union(d, ellipsoid_distance(p - Vector3d(0, 39, -38), {64, 54, 78}), 8);
  // Lateral rim of the orbit and temple, 15 mm behind the cornea.
  d = smooth_union(d, ellipsoid_distance({std::abs(p.x()) - 41, p.y() - 26, p.z() + 2}, {23, 27, 36}), 8);
  if (p.y() > 30) return d;
  d = smooth_union(d, ellipsoid_distance(p - Vector3d(0, 4, 24), {47, 16, 10}), 8);
  return smooth_union(d, ellipsoid_distance(p - Vector3d(0, -6, -26), {10, 25, 32}), 6);
}

/// Scaled radius within the pear-shaped orbit (below 1: inside) and its mean radius there; head frame
/// mirrored so that the side looked at has positive x.
double orbit_radius(const Vector3d& p, double& mean_radius) {
  const Vector3d opening(33.5, -4, 0);
  const Vector3d apex(14.5, 42, 2);
  const Vector3d axis = (apex - opening).normalized();
  const double along = (p - opening).dot(axis) / (apex - opening).norm();
  if (along >= 1) {
    mean_radius = 1;
    return 1e3;
  }
  const double s = std::max(0.0, along);
  const double root = std::sqrt(1 - s);
  const double taper =
      root * std::sqrt(root) * (1 + 0.55 * s);  // (1 - s)^(3/4), widest a little behind the rim
  const Vector3d across = p - (opening + along * (apex - opening));
  mean_radius = 18 * taper;
  return Vector3d(across.x() / 18.5, across.y() / 18.5, across.z() / 17.5).norm() / taper;
}

/// A smooth irregular pattern between -1 and 1 with cells of about pi / k mm.
double waves(const Vector3d& p, double k) {
  const double x = k * p.x() + 1.2 * std::sin(0.61 * k * p.z() + 0.9) + 0.8 * std::sin(0.43 * k * p.y());
  const double y = 1.1 * k * p.y() + 1.2 * std::sin(0.57 * k * p.x() + 0.3) + 0.7;
  const double z = 0.9 * k * p.z() + 1.2 * std::sin(0.53 * k * p.y() + 1.7);
  return std::sin(x) * std::sin(y) * std::sin(z);
}

}  // namespace

Tube::Tube(const std::vector<Node>& nodes, const Vector3d& flattening)
    : flattening_(flattening.normalized()) {
  // Catmull-Rom through the nodes, four pieces between neighbours.
  constexpr int pieces = 4;
  const int last = static_cast<int>(nodes.size()) - 1;
  for (int i = 0; i < last; ++i) {
    const Node& before = nodes[std::max(0, i - 1)];
    const Node& from = nodes[i];
    const Node& to = nodes[i + 1];
    const Node& after = nodes[std::min(last, i + 2)];
    for (int k = 0; k < pieces; ++k) {
      const double t = double(k) / pieces;
      const auto cubic = [t](auto a, auto b, auto c, auto d) {
        return (0.5 * (2 * b + t * (c - a) + t * t * (2 * a - 5 * b + 4 * c - d) +
                       t * t * t * (3 * b - 3 * c + d - a)));
      };
      const Vector3d position = cubic(before.position, from.position, to.position, after.position);
      nodes_.push_back({position, (1 - t) * from.half_thickness_mm + t * to.half_thickness_mm,
                        (1 - t) * from.half_width_mm + t * to.half_width_mm});
    }
  }
  nodes_.push_back(nodes.back());
  for (const Node& node : nodes_) {
    const double reach = std::max(node.half_thickness_mm, node.half_width_mm);
    box_.extend(node.position - Vector3d::Constant(reach));
    box_.extend(node.position + Vector3d::Constant(reach));
  }
}

bool Tube::contains(const Vector3d& p, double margin_mm) const {
  if (box_.squaredExteriorDistance(p) > margin_mm * margin_mm) return false;
  for (std::size_t i = 0; i + 1 < nodes_.size(); ++i) {
    const Vector3d piece = nodes_[i + 1].position - nodes_[i].position;
    const Vector3d from = p - nodes_[i].position;
    const double t = std::clamp(from.dot(piece) / piece.squaredNorm(), 0.0, 1.0);
    const Vector3d off = from - t * piece;
    const double thickness =
        margin_mm + (1 - t) * nodes_[i].half_thickness_mm + t * nodes_[i + 1].half_thickness_mm;
    const double width = margin_mm + (1 - t) * nodes_[i].half_width_mm + t * nodes_[i + 1].half_width_mm;
    const double thin = off.dot(flattening_);
    const double wide2 = off.squaredNorm() - thin * thin;
    if (thin * thin / (thickness * thickness) + wide2 / (width * width) < 1) return true;
  }
  return false;
}

Anatomy::Anatomy(const HeadGeometry& head) : head_from_lps_(lps_from_head(head).inverse()) {
  check(head);
  for (const Laterality laterality : both_eyes) eyes_.emplace_back(place(head, laterality));
  for (std::size_t side = 0; side < 2; ++side) add_muscles_and_nerve(side, head);
}

void Anatomy::add_muscles_and_nerve(std::size_t side, const HeadGeometry& head) {
  const EyeAnatomy& eye = eyes_[side];
  const Eigen::Isometry3d lps_from_eye = eye.placed().lps_from_turned_eye();
  const double sign = side == 0 ? -1 : 1;  // of the head's x
  const Vector3d apex = lps_from_head(head) * Vector3d(sign * 15.5, 40, 2);
  const double centre = eye.centre_depth_mm();

  // Four recti: tendon 7 mm behind the limbus, along the globe to its equator, belly, tendinous ring.
  for (const Vector3d& towards :
       {Vector3d(1, 0, 0), Vector3d(-1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, -1, 0)}) {
    const auto on_globe = [&](double depth, double off) {
      return Vector3d(lps_from_eye *
                      Vector3d((eye.outer_radius_mm(depth) + off) * towards - depth * Vector3d::UnitZ()));
    };
    const Vector3d outward = lps_from_eye.linear() * towards;
    const Vector3d leaving = on_globe(centre + 4, 1.3);
    std::vector<Tube::Node> nodes{{on_globe(centre - 4, 0.2), 0.35, 4.6},
                                  {on_globe(centre, 0.7), 0.7, 4.6},
                                  {leaving, 1.3, 4.4},
                                  {0.55 * leaving + 0.45 * apex + 1.2 * outward, 2.1, 4.2},
                                  {0.2 * leaving + 0.8 * apex + 0.8 * outward, 1.5, 2.2},
                                  {apex + 1.5 * outward, 0.8, 1.0}};
    muscles_[side].emplace_back(nodes, outward);
    if (const double tendon = eye.placed().geometry.tendon_mm; tendon > 0)
      tendons_[side].emplace_back(
          std::vector<Tube::Node>{{on_globe(centre - 6, 0.3 * tendon), tendon / 2, 5.2},
                                  {on_globe(centre - 3, tendon / 2), tendon / 2, 5.2},
                                  {on_globe(centre + 1, tendon / 2), tendon / 2, 4.8}},
          outward);
  }

  // Optic nerve: leaves the globe 15 deg nasally, sags on its way to the canal.
  const double nasal = 15 * degree;
  const double radius = eye.outer_radius_mm(centre);
  const Vector3d disc =
      lps_from_eye * Vector3d(-sign * radius * std::sin(nasal), 0, -centre - 0.96 * radius * std::cos(nasal));
  const Vector3d sag = 1.5 * (lps_from_head(head).linear() * Vector3d(sign, 0, -0.6));
  nerves_.emplace_back(std::vector<Tube::Node>{{disc, 1.5, 1.5},
                                               {0.7 * disc + 0.3 * apex + sag, 1.5, 1.5},
                                               {0.3 * disc + 0.7 * apex + sag, 1.5, 1.5},
                                               {apex, 1.6, 1.6}},
                       Vector3d::UnitZ());
}

bool Anatomy::near_globe(const Vector3d& lps) const {
  return std::any_of(eyes_.begin(), eyes_.end(), [&](const EyeAnatomy& eye) {
    const Vector3d from_centre = eye.to_eye(lps) + Vector3d(0, 0, eye.centre_depth_mm());
    return from_centre.squaredNorm() < near_globe_mm * near_globe_mm;
  });
}

Tissue Anatomy::tissue_at(const Vector3d& lps) const {
  const Vector3d p = head_from_lps_ * lps;
  const std::size_t side = p.x() < 0 ? 0 : 1;
  const EyeAnatomy& eye = eyes_[side];
  const Vector3d in_eye = eye.to_eye(lps);
  const bool near_eye = in_eye.squaredNorm() < 45 * 45;
  Tissue tissue{};
  if (near_eye && eye.contains(in_eye, tissue)) return tissue;
  if (near_eye && eye.in_buckle(in_eye)) return Tissue::silicone_rubber;

  double mean_radius = 0;
  const double orbit = orbit_radius({std::abs(p.x()), p.y(), p.z()}, mean_radius);
  if (orbit < 1 && p.y() > 12) return orbit_content(lps, side);  // far behind the skin

  double skin = face_distance(p);
  if (near_eye && in_eye.z() > -20) {
    const double lid = eye.lid_thickness_mm(in_eye);
    const double outside = eye.distance_outside_mm(in_eye);
    skin = smooth_union(skin, outside - lid, 3);
    if (outside < lid && in_eye.z() > -9)
      return outside > 0.5 * lid && eye.in_fissure(in_eye) ? Tissue::air : Tissue::lid;
  }
  if (skin > 0) return Tissue::air;

  if (orbit < 1 && p.y() > -12) return skin > -1.6 ? Tissue::skin : orbit_content(lps, side);
  if (skin > -1.8) return Tissue::skin;
  if (orbit < 1 + 1.6 / mean_radius && p.y() > -4) return Tissue::bone;
  if (skin > -5.5) return Tissue::fat;
  return deep_head(p);
}

Tissue Anatomy::orbit_content(const Vector3d& lps, std::size_t side) const {
  if (nerves_[side].contains(lps)) return Tissue::nerve;
  if (nerves_[side].contains(lps, 0.9)) return Tissue::nerve_sheath;
  for (const Tube& tendon : tendons_[side])
    if (tendon.contains(lps)) return Tissue::tendon;
  for (const Tube& muscle : muscles_[side])
    if (muscle.contains(lps)) return Tissue::muscle;
  return Tissue::fat;
}

Tissue Anatomy::deep_head(const Vector3d& p) {
  const double brain = ellipsoid_distance(p - Vector3d(0, 82, 44), {66, 82, 70});
  if (brain < 0 && (p.z() > 16 || p.y() > 46)) {
    const double fold = waves(p, 0.40);
    if (-brain < 1.5 + 12 * std::max(0.0, fold - 0.45)) return Tissue::csf;
    if (ellipsoid_distance(Vector3d(std::abs(p.x()) - 9, p.y() - 75, p.z() - 52), {5, 28, 8}) < 0)
      return Tissue::csf;
    return -brain < 4.5 + 14 * std::max(0.0, fold - 0.2) ? Tissue::grey_matter : Tissue::white_matter;
  }
  if (brain < 6 && p.z() > 10) return brain < 1.5 || brain > 4.5 ? Tissue::bone : Tissue::marrow;

  // Ethmoid cells and nasal cavity between the orbits, maxillary sinuses below them.
  if (std::abs(p.x()) < 11 && p.y() > -6 && p.y() < 44 && p.z() > -40 && p.z() < 13)
    return std::abs(waves(p, 0.5)) > 0.08 ? Tissue::air : Tissue::mucosa;
  const double sinus =
      ellipsoid_distance(Vector3d(std::abs(p.x()) - 28, p.y() - 18, p.z() + 36), {12, 15, 14});
  if (sinus < 0) return sinus < -1 ? Tissue::air : Tissue::mucosa;
  if (sinus < 1.2) return Tissue::bone;
  return waves(p, 0.23) > 0.25 ? Tissue::fat : Tissue::muscle;
}

}  // namespace emmetrope::phantom
