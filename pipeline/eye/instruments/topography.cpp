#include "pipeline/eye/instruments/topography.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/even_points.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/population/population.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::VectorXd;

constexpr double fit_radius_mm = 4, irregularity_radius_mm = 3;
constexpr int departure_order = 6;
constexpr double asphericity_sigma = 0.05;
/// Coma of a conicoid (7.8 mm, Q -0.2) over 6 mm, as a height, about a point off its apex; a map that lies off
/// the apex may be shifted (and has it) or turned (and has not).
constexpr double coma_um_per_mm_off_apex = 3;
/// What instruments find the apex to, and farther than which no coma of an eye's (10 um over 8 mm are 0.11 mm)
/// moves the apex of the best conicoid.
constexpr double alignment_mm = 0.1, told_alignment_mm = 0.5, most_alignment_mm = 1.5;
/// Beside toric conicoid and Zernike terms: no cornea has such a step
constexpr double largest_residual_um = 50;
const char* const map_remedy =
    "give heights above a plane, not above a best-fit sphere, in the unit that the header names; leave gaps "
    "empty";

/// The apex, of which all is told, is not extrapolated to: points on all sides of it, and near it.
void check_that_the_apex_is_seen(const ElevationMap& centre) {
  if (centre.depth_mm.size() < fewest_elevations)
    throw input_error(
        fmt::format("the elevation map has fewer than {} points in its central 6 mm", fewest_elevations));
  constexpr double farthest_mm = 1;  // a ring instrument sees nothing within the first ring
  std::array<int, 4> in_quadrant{};
  for (const auto& p : centre.position_mm.rowwise())
    in_quadrant[(p.x() < 0 ? 1U : 0U) + (p.y() < 0 ? 2U : 0U)] += 1;
  const int fewest = *std::min_element(in_quadrant.begin(), in_quadrant.end());
  const double nearest_mm = centre.position_mm.rowwise().norm().minCoeff();
  if (fewest < 5 || nearest_mm > farthest_mm)
    throw input_error(
        fmt::format("the elevation map does not surround the apex: its nearest point is {:.1f} mm from "
                    "(0, 0), the emptiest quadrant of the central 6 mm has {} points",
                    nearest_mm, fewest),
        "positions are in mm from the corneal apex; give the map on all sides of it");
}

/// Curvature c, j0, j45, then Q, the apex's depth and where it lies in the map; coma along x and y (mm per
/// mm^3), which a turned conicoid has and an eye, and which is none of the conicoid.
using Fit = Eigen::Matrix<double, 9, 1>;

ParametricEye toric_conicoid(const Fit& fit) {
  ParametricEye eye;
  eye.cornea_c_per_mm = fit[0];
  eye.cornea_j0_per_mm = fit[1];
  eye.cornea_j45_per_mm = fit[2];
  eye.cornea_q = fit[3];
  return eye;
}

VectorXd conicoid_depths(const Fit& fit, const Eigen::MatrixX2d& position_mm) {
  const ParametricEye eye = toric_conicoid(fit);
  VectorXd depth(position_mm.rows());
  for (Index i = 0; i < depth.size(); ++i)
    depth[i] = fit[4] + eye.cornea_anterior_depth_mm(position_mm(i, 0) - fit[5], position_mm(i, 1) - fit[6]);
  return depth;
}

VectorXd depths(const Fit& fit, const Eigen::MatrixX2d& position_mm) {
  // As Zernike's, which has no tilt: over a disc the mean of r^2 is half of the radius's square.
  const VectorXd r2 = position_mm.rowwise().squaredNorm();
  const VectorXd balanced = r2.array() - 4.0 / 3 * r2.mean();
  return conicoid_depths(fit, position_mm) + balanced.cwiseProduct(position_mm * fit.tail<2>());
}

ElevationMap within(const ElevationMap& map, double radius_mm) {
  std::vector<ElevationPoint> points;
  for (Index i = 0; i < map.depth_mm.size(); ++i) {
    if (map.position_mm.row(i).norm() <= radius_mm)
      points.push_back({map.position_mm(i, 0), map.position_mm(i, 1), map.depth_mm[i]});
  }
  return elevation_map(points);
}

MatrixXd jacobian_of(const Fit& fit, const Eigen::MatrixX2d& position_mm) {
  MatrixXd jacobian(position_mm.rows(), fit.size());
  for (Index p = 0; p < fit.size(); ++p) {
    const double step = p == 3 ? 1e-4 : 1e-6;
    Fit above = fit, below = fit;
    above[p] += step;
    below[p] -= step;
    jacobian.col(p) = (depths(above, position_mm) - depths(below, position_mm)) / (2 * step);
  }
  return jacobian;
}

Fit fit_toric(const ElevationMap& map) {
  Fit fit;
  fit << 1 / 7.8, 0, 0, -0.2, 0, 0, 0, 0, 0;
  for (int iteration = 0; iteration < 20; ++iteration) {
    const Fit change = jacobian_of(fit, map.position_mm)
                           .colPivHouseholderQr()
                           .solve(map.depth_mm - depths(fit, map.position_mm));
    fit += change;
    if (!fit.allFinite())
      throw input_error(
          "the elevation map is no cornea: no toric conicoid fits its centre (a gap written as 0?)",
          map_remedy);
    if (fit[0] < 0.05 || fit[0] > 0.3)
      throw input_error(
          fmt::format(
              "the elevation map is no cornea: its mean radius would be {:.2f} mm (a gap written as 0?)",
              1 / fit[0]),
          map_remedy);
    if (change.cwiseAbs().maxCoeff() < 1e-10) break;
  }
  return fit;
}

/// What a toric conicoid leaves of a map, as Zernike terms.
struct Departure {
  VectorXd coefficients_um;
  double noise_um = 0;         ///< of a point
  double largest_left_um = 0;  ///< of a point, beside the terms
  MatrixXd covariance_um2;     ///< of the coefficients, by the noise of the points
};

/// The terms' values, a row a point.
MatrixXd terms_at(const ElevationMap& map, double radius_mm) {
  MatrixXd terms(map.position_mm.rows(), zernike_count(departure_order));
  for (Index i = 0; i < terms.rows(); ++i)
    terms.row(i) =
        zernike_values(departure_order, map.position_mm(i, 0) / radius_mm, map.position_mm(i, 1) / radius_mm);
  return terms;
}

/// \pre more points than terms
Departure depart(const ElevationMap& map, const Fit& fit, double radius_mm) {
  const VectorXd left_um = 1e3 * (map.depth_mm - conicoid_depths(fit, map.position_mm));
  if (!left_um.allFinite())
    throw input_error(
        "the elevation map is no cornea: a point lies outside the conicoid that fits its centre", map_remedy);
  const auto points = static_cast<double>(left_um.size());
  const MatrixXd terms = terms_at(map, radius_mm);
  const auto count = static_cast<double>(terms.cols());
  const VectorXd closest_um = terms * terms.completeOrthogonalDecomposition().solve(left_um);
  Departure departure;
  departure.noise_um = std::sqrt((left_um - closest_um).squaredNorm() / (points - count));
  // Where a lid hides a part of the disc no term may be larger than what is seen of all.
  constexpr double least_noise_um = 0.01;  // digits of a file
  const double least = least_noise_um * least_noise_um;
  const double ridge =
      (departure.noise_um * departure.noise_um + least) / (left_um.squaredNorm() / points + least);
  MatrixXd normal = terms.transpose() * terms;
  normal.diagonal().array() += ridge;
  const Eigen::LDLT<MatrixXd> solver(normal);
  departure.coefficients_um = solver.solve(terms.transpose() * left_um);
  departure.covariance_um2 =
      departure.noise_um * departure.noise_um * solver.solve(MatrixXd::Identity(terms.cols(), terms.cols()));
  const VectorXd smooth_um = terms * departure.coefficients_um;
  departure.largest_left_um = (left_um - smooth_um).cwiseAbs().maxCoeff();
  return departure;
}

/// A cornea as a map of points spread evenly over a disc.
/// \param is_seen  whether a point of the disc is taken
template <typename IsSeen>
ElevationMap sampled(const CornealDepth& cornea, double radius_mm, const IsSeen& is_seen) {
  constexpr int count = 600;
  std::vector<ElevationPoint> points;
  for (int i = 0; i < count; ++i)
    if (const Vector2d at = radius_mm * sunflower_point(i, count); is_seen(at))
      points.push_back({at.x(), at.y(), cornea(at.x(), at.y())});
  return elevation_map(points);
}

ElevationMap sampled(const CornealDepth& cornea, double radius_mm) {
  return sampled(cornea, radius_mm, [](const Vector2d&) { return true; });
}

/// The smooth surface of a map, each area of what is seen counting alike: the points of rings crowd in the middle, and
/// the best conicoid of crowded points is another.
ElevationMap evened(const ElevationMap& map, double radius_mm) {
  const Fit fit = fit_toric(map);
  const VectorXd terms_um = depart(map, fit, radius_mm).coefficients_um;
  const double usual_gap_mm = radius_mm * std::sqrt(pi / static_cast<double>(map.depth_mm.size()));
  const double reach_mm = std::max(0.5, 1.5 * usual_gap_mm);
  const auto depth_mm = [&](double x_mm, double y_mm) {
    return conicoid_depths(fit, Eigen::RowVector2d(x_mm, y_mm))[0] +
           1e-3 * terms_um.dot(zernike_values(departure_order, x_mm / radius_mm, y_mm / radius_mm));
  };
  return sampled(depth_mm, radius_mm, [&](const Vector2d& at) {
    return (map.position_mm.rowwise() - at.transpose()).rowwise().squaredNorm().minCoeff() <
           reach_mm * reach_mm;
  });
}

/// The eye with what a topographer's toric part describes: an irregular cornea gives way to its best toric
/// conicoid.
ParametricEye with_toric_cornea(const ParametricEye& eye) {
  if (!eye.has_irregular_cornea()) return eye;
  const ParametricEye toric = toric_conicoid(fit_toric(sampled(anterior_cornea(eye), fit_radius_mm)));
  ParametricEye result = eye;
  for (const char* name : {"cornea_c_per_mm", "cornea_j0_per_mm", "cornea_j45_per_mm", "cornea_q"})
    result.set(name, toric.get(name));
  result.cornea_q_split = 0;
  result.cornea_zernike_um = {};
  return result;
}

VectorXd toric_functional(const ParametricEye& eye) {
  const ParametricEye toric = with_toric_cornea(eye);
  const CornealPower power = corneal_power(anterior_cornea(toric));
  return Eigen::Vector4d(power.M_D, power.J0_D, power.J45_D, toric.cornea_q);
}

/// A map about the apex of its own best conicoid.
struct LaidOnApex {
  ElevationMap map;
  Vector2d apex_mm{0, 0};  ///< in the map as it was given
};

LaidOnApex laid_on_apex(const ElevationMap& map) {
  LaidOnApex laid{map};
  constexpr double settled_mm = 1e-4;
  constexpr int most_rounds = 10;  // what is within the central 8 mm changes with the apex
  for (int round = 0; round < most_rounds; ++round) {
    const ElevationMap centre = within(laid.map, fit_radius_mm);
    if (centre.depth_mm.size() < fewest_elevations)
      throw input_error(
          fmt::format("the elevation map has fewer than {} points in its central 8 mm", fewest_elevations));
    const Vector2d shift_mm = fit_toric(evened(centre, fit_radius_mm)).segment<2>(5);
    laid.apex_mm += shift_mm;
    if (!(laid.apex_mm.norm() <= most_alignment_mm))
      throw input_error(
          fmt::format(
              "the elevation map is not about the apex of the cornea that it shows, which lies {:.1f} "
              "mm from its origin, at ({:.1f}, {:.1f})",
              laid.apex_mm.norm(), laid.apex_mm.x(), laid.apex_mm.y()),
          "positions are in mm from the corneal apex");
    laid.map.position_mm.rowwise() -= shift_mm.transpose();
    if (shift_mm.norm() < settled_mm) break;
  }
  return laid;
}

/// Radius of the farthest ring of which the map has half: a lid may hide the rest, and a point may stray.
double surrounding_radius_mm(const ElevationMap& map) {
  constexpr std::size_t sectors = 12;
  constexpr double ring = 0.9;  // inner over outer radius
  std::vector<std::pair<double, std::size_t>> by_radius;
  for (const auto& p : map.position_mm.rowwise()) {
    const double turn = (std::atan2(p.y(), p.x()) + pi) / (2 * pi);
    by_radius.emplace_back(p.norm(), std::min(sectors - 1, static_cast<std::size_t>(turn * sectors)));
  }
  std::sort(by_radius.rbegin(), by_radius.rend());
  std::array<int, sectors> in_sector{};
  auto inner = by_radius.begin();
  for (const auto& [outer_mm, sector] : by_radius) {
    for (; inner != by_radius.end() && inner->first >= ring * outer_mm; ++inner) ++in_sector[inner->second];
    if (std::count(in_sector.begin(), in_sector.end(), 0) <= static_cast<int>(sectors / 2)) return outer_mm;
    --in_sector[sector];
  }
  return 0;
}

double zone_radius_mm(const ElevationMap& map) {
  const double radius_mm = surrounding_radius_mm(map);
  if (radius_mm < irregularity_radius_mm)
    throw input_error(fmt::format("the elevation map is {:.1f} mm wide, 6 mm are needed", 2 * radius_mm));
  return radius_mm;
}

/// Points beyond the zone are not used, but are the cornea's.
void check_what_lies_beyond(const ElevationMap& map, const Fit& fit, double radius_mm) {
  constexpr double most_mm = 0.5;
  const VectorXd left_mm = map.depth_mm - conicoid_depths(fit, map.position_mm);
  for (Index i = 0; i < left_mm.size(); ++i)
    if (map.position_mm.row(i).norm() > radius_mm && !(std::abs(left_mm[i]) <= most_mm))
      throw input_error(
          fmt::format("the elevation map is no cornea: a point {:.1f} mm from the apex, beyond the "
                      "{:.1f} mm that it surrounds, is none of the surface",
                      map.position_mm.row(i).norm(), radius_mm),
          map_remedy);
}

/// Of what toric_functional() gives, by the noise of the map's points.
MatrixXd covariance_of_noise(const Fit& fit, const Eigen::MatrixX2d& position_mm, double noise_mm) {
  const MatrixXd jacobian = jacobian_of(fit, position_mm);
  const MatrixXd of_fit =
      noise_mm * noise_mm *
      MatrixXd(jacobian.transpose() * jacobian).ldlt().solve(MatrixXd::Identity(fit.size(), fit.size()));
  MatrixXd slopes(4, 4);
  for (Index p = 0; p < 4; ++p) {
    const double step = 1e-5;
    Fit above = fit, below = fit;
    above[p] += step;
    below[p] -= step;
    slopes.col(p) =
        (toric_functional(toric_conicoid(above)) - toric_functional(toric_conicoid(below))) / (2 * step);
  }
  return slopes * of_fit.topLeftCorner(4, 4) * slopes.transpose();
}

double departure_mm(const Topography& topography, double x_mm, double y_mm) {
  const double radius = topography.zone_mm / 2;
  return 1e-3 * topography.departure_um.dot(zernike_values(departure_order, x_mm / radius, y_mm / radius));
}

}  // namespace

Topography analyse_topography(const ElevationMap& map, double sigma_D) {
  Topography result;
  check_that_the_apex_is_seen(within(map, irregularity_radius_mm));
  zone_radius_mm(map);
  const auto [about_apex, apex_mm] = laid_on_apex(map);
  result.apex_mm = apex_mm;
  const double radius_mm = zone_radius_mm(about_apex);
  result.zone_mm = 2 * radius_mm;
  const ElevationMap centre = within(about_apex, irregularity_radius_mm);
  check_that_the_apex_is_seen(centre);
  const ElevationMap fitted = within(about_apex, fit_radius_mm);
  const Fit fit = fit_toric(evened(fitted, fit_radius_mm));
  check_what_lies_beyond(about_apex, fit, radius_mm);
  const Departure whole = depart(within(about_apex, radius_mm), fit, radius_mm);
  if (whole.largest_left_um > largest_residual_um)
    throw input_error(
        fmt::format("the elevation map is no smooth cornea: a point lies {:.0f} um off it (a gap "
                    "written as 0?)",
                    whole.largest_left_um),
        map_remedy);
  result.departure_um = whole.coefficients_um;

  result.toric.source = result.toric.quantity = "topography";
  result.toric.of_eye = toric_functional;
  result.toric.value = toric_functional(toric_conicoid(fit));
  result.toric.covariance = covariance_of_noise(fit, fitted.position_mm, 1e-3 * whole.noise_um);
  result.toric.covariance.diagonal().head<3>().array() += sigma_D * sigma_D / 2;
  // A map may be turned, not shifted: then what is seen is by Q c^2 r^2 flatter than the apex, its J by half
  // of that.
  const double flatter_D =
      keratometric_D_mm * fit[0] * fit[3] * fit[0] * fit[0] * result.apex_mm.squaredNorm();
  result.toric.covariance(0, 0) += flatter_D * flatter_D;
  result.toric.covariance.diagonal().segment<2>(1).array() += flatter_D * flatter_D / 4;
  result.toric.covariance(3, 3) += asphericity_sigma * asphericity_sigma;

  const ElevationMap even_centre = evened(centre, irregularity_radius_mm);
  const Fit of_centre = fit_toric(even_centre);
  const MatrixXd covariance_um2 = depart(centre, of_centre, irregularity_radius_mm).covariance_um2;
  // Over what is seen: behind a lid the terms would tell anything.
  const MatrixXd terms = terms_at(even_centre, irregularity_radius_mm);
  const auto points = static_cast<double>(terms.rows());
  const VectorXd smooth_um = terms * depart(even_centre, of_centre, irregularity_radius_mm).coefficients_um;
  // The terms share the noise of the points, which makes their sum of squares larger.
  const double noise_um = std::sqrt((terms * covariance_um2).cwiseProduct(terms).sum() / points);
  result.coma_sigma_um = coma_um_per_mm_off_apex * std::max(alignment_mm, result.apex_mm.norm());
  result.term_noise_um = std::sqrt(covariance_um2.trace() / static_cast<double>(terms.cols()));
  result.irregularity_um =
      Measured::from_sigma(std::sqrt(std::max(0.0, smooth_um.squaredNorm() / points - noise_um * noise_um)),
                           std::hypot(noise_um, result.coma_sigma_um), "topography");
  result.irregularity_um.ci95[0] = std::max(0.0, result.irregularity_um.ci95[0]);
  return result;
}

std::string alignment_warning(const Topography& topography) {
  const double off_mm = topography.apex_mm.norm();
  if (off_mm <= told_alignment_mm) return {};
  return fmt::format(
      "topography: the apex of the cornea that it shows lies {:.1f} mm from the map's origin, at ({:.1f}, "
      "{:.1f}); the map is laid on the eye's apex by it",
      off_mm, topography.apex_mm.x(), topography.apex_mm.y());
}

VectorXd corneal_departure_um(const CornealDepth& cornea) {
  const ElevationMap map = sampled(cornea, irregularity_radius_mm);
  return depart(map, fit_toric(map), irregularity_radius_mm).coefficients_um;
}

double irregularity_um(const CornealDepth& cornea) { return corneal_departure_um(cornea).norm(); }

CornealDepth anterior_cornea(const ParametricEye& fitted, const Topography& topography) {
  return [eye = with_toric_cornea(fitted), &topography](double x_mm, double y_mm) {
    return eye.cornea_anterior_depth_mm(x_mm, y_mm) + departure_mm(topography, x_mm, y_mm) -
           departure_mm(topography, 0, 0);
  };
}

ShapePtr anterior_cornea_shape(const ParametricEye& eye, const Topography& topography) {
  const ParametricEye::Biconic b = with_toric_cornea(eye).cornea_biconic();
  VectorXd coefficients = turned_zernike(topography.departure_um, b.steep_axis_deg * degree);
  coefficients[0] -= 1e3 * departure_mm(topography, 0, 0);  // the vertex stays the apex
  return make_zernike(b.steep_radius_mm, b.flat_radius_mm, b.steep_q, b.flat_q, b.steep_axis_deg,
                      topography.zone_mm / 2,
                      {coefficients.data(), coefficients.data() + coefficients.size()});
}

}  // namespace emmetrope
