#include "meshing/retinal_shape.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "pipeline/base/frames.hpp"
#include "pipeline/base/measured.hpp"
#include "pipeline/eye/parametric/analytic_eye.hpp"
#include "pipeline/eye/parametric/retinal_metrics.hpp"
#include "pipeline/eye/population/population.hpp"

namespace emmetrope::meshing {
namespace {

using Eigen::Index;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::VectorXd;

constexpr double narrow_cap_deg = 120, wide_cap_deg = 240;
constexpr double grid_step_deg = 10, grid_end_deg = 60, meridian_step_deg = 30;

/// Places of the map: the pole, then ring by ring.
std::vector<Vector3d> grid() {
  std::vector<Vector3d> directions{-Vector3d::UnitZ()};
  for (double eccentricity = grid_step_deg; eccentricity <= grid_end_deg; eccentricity += grid_step_deg)
    for (double meridian = 0; meridian < 360; meridian += meridian_step_deg)
      directions.push_back(retinal_direction(eccentricity * degree, meridian * degree));
  return directions;
}

LensBack back_of_lens(const ParametricEye& eye) {
  return {lens_on_axis(eye).back_mm, eye.lens_posterior_radius_mm, eye.lens_posterior_q,
          eye.lens_equator_radius_mm};
}

/// Numbers of a best ellipsoid, in this order.
enum EllipsoidNumber : Index {
  radius_horizontal,
  radius_vertical,
  asphericity,
  axis_horizontal,
  axis_vertical,
  ellipsoid_numbers
};
using EllipsoidNumbers = Eigen::Matrix<double, ellipsoid_numbers, 1>;

EllipsoidNumbers numbers_of(const Quadric& quadric) {
  const BestEllipsoid best = as_ellipsoid(quadric);
  EllipsoidNumbers v;
  v << best.vertex_radius_mm, best.q, best.axis_deg;
  return v;
}

constexpr Index quadric_terms = Quadric::RowsAtCompileTime;

enum ShapeNumber : Index {
  wide_ellipsoid = 0,
  narrow_ellipsoid = wide_ellipsoid + ellipsoid_numbers,
  wide_quadric = narrow_ellipsoid + ellipsoid_numbers,
  narrow_quadric = wide_quadric + quadric_terms,
  depth = narrow_quadric + quadric_terms,
  tilt_horizontal,
  tilt_vertical,
  volume,
  area,
  staphyloma,
  staphyloma_of_ellipsoid,
  shapes
};

/// Its globe is the ellipsoid alone.
ParametricEye without_bulges(ParametricEye eye) {
  std::fill(eye.displacement_mm.begin(), eye.displacement_mm.end(), 0.0);
  return eye;
}

VectorXd whole_shape(const ParametricEye& eye) {
  const ParametricEye ellipsoid = without_bulges(eye);
  const InterfaceDistance interface = vitreoretinal_interface(eye);
  const Quadric wide = best_quadric(interface, wide_cap_deg),
                narrow = best_quadric(interface, narrow_cap_deg);
  VectorXd v(shapes);
  v << numbers_of(wide), numbers_of(narrow), wide, narrow, globe_extent_mm(interface, Vector3d::UnitZ()),
      rim_tilt_deg(interface, narrow_cap_deg),
      vitreous_volume_mm3(interface, -eye.globe_centre_mm().z(), back_of_lens(eye)),
      retinal_area_mm2(interface, wide_cap_deg), macular_curvature_index(interface),
      macular_curvature_index(vitreoretinal_interface(ellipsoid));
  return v;
}

/// Heights over the best sphere of the cap that the grid covers, then curvatures.
VectorXd local_shape(const ParametricEye& eye) {
  const InterfaceDistance interface = vitreoretinal_interface(eye);
  const BestSphere sphere = best_sphere(interface, 2 * grid_end_deg);
  const std::vector<Vector3d> directions = grid();
  const Index n = static_cast<Index>(directions.size());
  VectorXd v(2 * n);
  for (Index i = 0; i < n; ++i) {
    const Vector3d& direction = directions[static_cast<std::size_t>(i)];
    v[i] = (interface(direction) * direction - sphere.centre_mm).norm() - sphere.radius_mm;
    v[n + i] = mean_curvature_per_mm(interface, direction);
  }
  return v;
}

Measured number(const Propagated& p, Index i, double model_sigma = 0) {
  return Measured::from_sigma(p.value[i], std::hypot(p.sigma(i), model_sigma),
                              p.origin[static_cast<std::size_t>(i)], "fit");
}

/// The globe is an ellipsoid of which images show the back and the sides, and an eye has no such front: what two scans of
/// a person have its depth apart beyond what their fits say, over root two (docs/evidence/real-scans.md). Phantoms,
/// whose globes are ellipsoids, have 0.13.
constexpr double unseen_front_sigma_mm = 0.6;

/// What a globe that is so much deeper, its pole kept, has otherwise. Not for radii and Q, which are those of the surface
/// that is seen; the cap of the area is about the middle of the depth.
VectorXd of_unseen_front(ParametricEye eye) {
  const VectorXd before = whole_shape(eye);
  eye.globe_semi_axes_mm.z() += unseen_front_sigma_mm / 2;
  return whole_shape(eye) - before;
}

/// Waves finer than those of the fit are rounded off: a bulge is sharper than it looks, by no more than most of what
/// it adds to the index of the ellipsoid. Phantoms' bulges of 12 to 25 degrees (docs/evidence/accuracy.md).
constexpr double lost_share_of_bulge = 0.6;

Measured staphyloma_number(const Propagated& p) {
  Measured index = number(p, staphyloma);
  const double bulge = std::max(0.0, p.value[staphyloma] - p.value[staphyloma_of_ellipsoid]);
  index.ci95[1] = index.value + std::hypot(index.ci95[1] - index.value, lost_share_of_bulge * bulge);
  return index;
}

/// A best ellipsoid's numbers with the quantiles of what its quadric may be, which the eye's parameters move nearly
/// linearly: which of its axes is nearest to the eye's may change within the interval, and no derivative tells of that.
std::vector<Measured> ellipsoid_measured(const Propagated& p, Index ellipsoid, Index quadric) {
  const Propagated terms{p.value.segment(quadric, quadric_terms),
                         p.covariance.block(quadric, quadric, quadric_terms, quadric_terms),
                         {}};
  std::array<std::vector<double>, ellipsoid_numbers> drawn;
  const Eigen::MatrixXd draws = terms.draws();
  for (Index k = 0; k < draws.cols(); ++k) {
    const EllipsoidNumbers v = numbers_of(draws.col(k));
    if (!v.allFinite()) continue;  // a quadric without a centre
    for (Index i = 0; i < ellipsoid_numbers; ++i) drawn[static_cast<std::size_t>(i)].push_back(v[i]);
  }
  std::vector<Measured> measured;
  for (Index i = 0; i < ellipsoid_numbers; ++i) {
    Measured m = number(p, ellipsoid + i);
    const auto [low, high] = ci95_of(drawn[static_cast<std::size_t>(i)]);
    m.ci95 = {std::min(low, m.value), std::max(high, m.value)};
    measured.push_back(m);
  }
  return measured;
}

Json two_json(const Measured& horizontal, const Measured& vertical) {
  return {{"horizontal", horizontal}, {"vertical", vertical}};
}

/// Numbers of the grid, ring by ring; the first ring is the pole.
Json rings_json(const VectorXd& values) {
  Json rings = Json::array({Json::array({values[0]})});
  constexpr auto around = static_cast<Index>(360 / meridian_step_deg);
  for (Index first = 1; first < values.size(); first += around) {
    Json ring = Json::array();
    for (Index i = first; i < first + around; ++i) ring.push_back(values[i]);
    rings.push_back(ring);
  }
  return rings;
}

Json map_json(const Propagated& p) {
  Json eccentricity_deg = Json::array(), meridian_deg = Json::array();
  for (double e = 0; e <= grid_end_deg; e += grid_step_deg) eccentricity_deg.push_back(e);
  for (double m = 0; m < 360; m += meridian_step_deg) meridian_deg.push_back(m);
  const Index n = p.value.size() / 2;
  const double half_width_per_sigma = Measured::from_sigma(0, 1, "mri").ci95[1];
  const VectorXd half_width = half_width_per_sigma * p.covariance.diagonal().cwiseMax(0).cwiseSqrt();
  return {{"eccentricity_deg", eccentricity_deg},
          {"meridian_deg", meridian_deg},
          {"height_mm", rings_json(p.value.head(n))},
          {"height_half_ci95_mm", rings_json(half_width.head(n))},
          {"curvature_per_mm", rings_json(p.value.tail(n))},
          {"curvature_half_ci95_per_mm", rings_json(half_width.tail(n))}};
}

}  // namespace

Json retinal_shape_json(const UncertainEye& estimate) {
  const Propagated p = estimate.propagate(whole_shape);
  const VectorXd front = of_unseen_front(estimate.eye());
  const std::vector<Measured> wide = ellipsoid_measured(p, wide_ellipsoid, wide_quadric),
                              narrow = ellipsoid_measured(p, narrow_ellipsoid, narrow_quadric);
  return {{"globe_depth_mm", number(p, depth, front[depth])},
          {"retina",
           {{"vertex_radius_mm", two_json(wide[radius_horizontal], wide[radius_vertical])},
            {"vertex_radius_120_mm", two_json(narrow[radius_horizontal], narrow[radius_vertical])},
            {"q_120", narrow[asphericity]},
            {"q_240", wide[asphericity]},
            {"axis_120_deg", two_json(narrow[axis_horizontal], narrow[axis_vertical])},
            {"axis_240_deg", two_json(wide[axis_horizontal], wide[axis_vertical])},
            {"tilt_deg", two_json(number(p, tilt_horizontal), number(p, tilt_vertical))},
            {"volume_mm3", number(p, volume, front[volume])},
            {"area_mm2", number(p, area, front[area])},
            {"staphyloma_index", staphyloma_number(p)},
            {"map", map_json(estimate.propagate(local_shape))}}}};
}

Json ellipsoid_shape_json(const Json& globe, const std::string& reason) {
  // A usual eye about the globe that was read: its lens is the population's.
  ParametricEye eye;
  const std::vector<std::string> axes{"globe_width_mm", "globe_height_mm", "globe_depth_mm"};
  const std::vector<const char*> lens{"anterior_chamber_depth_mm", "lens_thickness_mm",
                                      "lens_posterior_radius_mm"};
  eye.covariance = Eigen::MatrixXd::Zero(7, 7);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto extent = globe.at(axes[i]).get<Measured>();
    const auto row = static_cast<Index>(i);
    eye.globe_semi_axes_mm[row] = extent.value / 2;
    eye.parameter_names.push_back(std::string("globe_semi_axis_") + "xyz"[i] + "_mm");
    eye.covariance(row, row) = extent.sigma() * extent.sigma() / 4;
  }
  for (std::size_t i = 0; i < 3; ++i) {
    const PopulationValue& usual = population_value(lens[i]);
    const auto row = static_cast<Index>(3 + i);
    eye.set(lens[i], usual.mean);
    eye.parameter_names.emplace_back(lens[i]);
    eye.covariance(row, row) = usual.sigma * usual.sigma;
    eye.source[lens[i]] = "prior";
  }
  // How deep the globe lies behind the cornea, and with it how much of it the lens's plane cuts off.
  constexpr double apex_to_centre_sigma_mm = 0.5;  // between eyes; chosen
  constexpr Index z = 2, length = 6;
  eye.parameter_names.emplace_back("axial_length_mm");
  if (const Json& read = globe.at("axial_length_mm"); !is_withheld(read)) {
    const auto axial = read.get<Measured>();
    eye.axial_length_mm = axial.value;
    eye.covariance(length, length) = axial.sigma() * axial.sigma();
  } else {
    const auto centre_lps_mm = globe.at("globe_centre_lps_mm").get<std::array<double, 3>>();
    const Vector3d centre =
        isometry_from_json(globe.at("lps_from_eye")).inverse() * Vector3d::Map(centre_lps_mm.data());
    eye.axial_length_mm = eye.globe_semi_axes_mm.z() - centre.z();
    eye.covariance(length, z) = eye.covariance(z, length) = eye.covariance(z, z);
    eye.covariance(length, length) = eye.covariance(z, z) + apex_to_centre_sigma_mm * apex_to_centre_sigma_mm;
  }
  const Propagated p = UncertainEye(eye).propagate(whole_shape);
  const auto edges = [&](Index i) {
    return Measured::from_sigma(p.value[i], p.sigma(i), Origin::of_images("mri", 1), "edges");
  };
  const Json nothing = withheld(reason);
  const Json no_axis{{"horizontal", nothing}, {"vertical", nothing}};
  return {{"globe_depth_mm", globe.at("globe_depth_mm")},
          {"retina",
           {{"vertex_radius_mm",
             two_json(edges(wide_ellipsoid + radius_horizontal), edges(wide_ellipsoid + radius_vertical))},
            {"vertex_radius_120_mm", no_axis},
            {"q_120", nothing},
            {"q_240", edges(wide_ellipsoid + asphericity)},
            {"axis_120_deg", no_axis},
            {"axis_240_deg", no_axis},
            {"tilt_deg", no_axis},
            {"volume_mm3", edges(volume)},
            {"area_mm2", edges(area)},
            {"staphyloma_index", nothing},
            {"map", nothing}}}};
}

}  // namespace emmetrope::meshing
