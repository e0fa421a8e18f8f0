#pragma once
#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <vector>

#include "data_samples/phantom/geometry.hpp"
#include "data_samples/phantom/tissue.hpp"

namespace emmetrope::phantom {

/// A tube of elliptical cross-section along a polyline: a rectus muscle, the optic nerve. LPS, mm.
class Tube {
 public:
  struct Node {
    Eigen::Vector3d position;
    double half_thickness_mm;  ///< along the flattening direction
    double half_width_mm;      ///< across it
  };
  /// \param nodes  at least two; a smooth curve is drawn through them
  /// \param flattening  direction in which the tube is thin; need not be a unit vector
  Tube(const std::vector<Node>& nodes, const Eigen::Vector3d& flattening);
  /// Whether the tube, thickened all round by `margin_mm`, holds the point.
  bool contains(const Eigen::Vector3d& p, double margin_mm = 0) const;

 private:
  std::vector<Node> nodes_;
  Eigen::Vector3d flattening_;
  Eigen::AlignedBox3d box_;
};

/// One eye as inequalities in its own frame.
class EyeAnatomy {
 public:
  explicit EyeAnatomy(const PlacedEye& eye);
  const PlacedEye& placed() const { return eye_; }
  Eigen::Vector3d to_eye(const Eigen::Vector3d& lps) const { return rotation_ * (lps - apex_); }
  /// Whether the point (eye frame) lies in the globe or the cornea; then `tissue` says what is there.
  bool contains(const Eigen::Vector3d& p, Tissue& tissue) const;
  /// About the distance from the outer surface of globe and cornea, positive outside.
  double distance_outside_mm(const Eigen::Vector3d& p) const;
  /// Whether the point lies between the closed lids, 3.4 mm below the apex.
  bool in_fissure(const Eigen::Vector3d& p) const;
  /// Thickness of the closed lid in front of a point.
  double lid_thickness_mm(const Eigen::Vector3d& p) const;
  /// Whether a silicone band around the equator holds the point.
  bool in_buckle(const Eigen::Vector3d& p) const;
  /// Half the lateral extent of the outer globe at a depth, 0 beyond its poles.
  double outer_radius_mm(double depth_mm) const;
  double centre_depth_mm() const { return centre_depth_; }

 private:
  double cornea_front_mm(double x, double y) const;
  double cornea_back_mm(double x, double y) const;
  bool in_lens(const Eigen::Vector3d& p) const;
  Tissue content(const Eigen::Vector3d& p, double scaled_radius) const;
  Tissue vitreous(const Eigen::Vector3d& p) const;
  /// \param inner_norm, outer_norm  scaled radii for the inner and the outer surface of the wall
  Tissue wall(const Eigen::Vector3d& p, double inner_norm, double outer_norm) const;
  bool in_nucleus(const Eigen::Vector3d& p) const;
  bool in_tumour(const Eigen::Vector3d& p) const;
  double bulge(const Eigen::Vector3d& scaled) const;
  /// How much thicker than its mean the wall is in a direction: relative.
  double wall_swell(const Eigen::Vector3d& direction) const;

  PlacedEye eye_;
  Eigen::Matrix3d rotation_;
  Eigen::Vector3d apex_;
  Eigen::Matrix2d cornea_turn_, globe_turn_, head_turn_;
  Eigen::Vector3d inner_, outer_;  ///< half axes
  double centre_depth_;
  Eigen::Vector3d bulge_direction_, tumour_centre_;  ///< the tumour's from the globe's centre
  Eigen::Matrix3d lens_from_eye_;
  Eigen::Vector3d lens_centre_;
};

/// The whole object: the tissue at any point of space. Regions have sharp borders; blur is the scanner's
/// business.
class Anatomy {
 public:
  explicit Anatomy(const HeadGeometry& head);
  Tissue tissue_at(const Eigen::Vector3d& lps) const;
  const PlacedEye& eye(Laterality laterality) const {
    return eyes_[static_cast<std::size_t>(laterality)].placed();
  }
  /// Midpoint of the globes' centres, LPS.
  Eigen::Vector3d between_globes() const {
    return 0.5 * (eye(Laterality::od).globe_centre_lps() + eye(Laterality::os).globe_centre_lps());
  }
  /// Whether a point lies within 19 mm of a globe's centre: the eye, its wall and lid, and what borders on
  /// them.
  bool near_globe(const Eigen::Vector3d& lps) const;

 private:
  Tissue orbit_content(const Eigen::Vector3d& lps, std::size_t side) const;
  static Tissue deep_head(const Eigen::Vector3d& p);
  void add_muscles_and_nerve(std::size_t side, const HeadGeometry& head);

  Eigen::Isometry3d head_from_lps_;
  std::vector<EyeAnatomy> eyes_;
  std::array<std::vector<Tube>, 2> muscles_, tendons_;
  std::vector<Tube> nerves_;
};

}  // namespace emmetrope::phantom
