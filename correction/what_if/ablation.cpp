#include "correction/what_if/ablation.hpp"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/model/mesh_shape.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"
#include "raytrace/system/sheet_mesh.hpp"
#include "raytrace/wavefront/wavefront.hpp"

namespace emmetrope::correction {
namespace {

using Eigen::Vector2d;

/// Depth of a surface that is a sphere in each meridian: S / (1 + sqrt(1 - T)), S = x'Cx, T = |Cx|^2.
double toric_depth_mm(const Eigen::Matrix2d& curvature, const Vector2d& at) {
  const double t = (curvature * at).squaredNorm();
  return at.dot(curvature * at) / (1 + std::sqrt(std::max(0.0, 1 - t)));
}

double cornea_index(const EyeModel& eye) {
  return eye.media.at(eye.surface("cornea_anterior").medium_after).index;
}

double corneal_thickness_mm(const EyeModel& eye) {
  const double front_mm = eye.surface("cornea_anterior").position_mm;
  const auto next = std::find_if(eye.surfaces.begin(), eye.surfaces.end(),
                                 [&](const Surface& surface) { return surface.position_mm > front_mm; });
  return next->position_mm - front_mm;
}

/// Where the line of sight leaves the cornea, from its apex (the cornea's own depth there is nothing).
Vector2d on_cornea_mm(const raytrace::Wavefront& wavefront) {
  const Vector2d slope(std::tan(wavefront.line_of_sight_deg.x() * degree),
                       std::tan(wavefront.line_of_sight_deg.y() * degree));
  return wavefront.pupil_centre_mm + wavefront.pupil_position_mm * slope;
}

/// The front cornea as a sheet in the eye's frame, fine enough for an ablation's rim: a measured cornea's own vertices lie
/// half a millimetre apart.
TriangleMesh fine_sheet(const Surface& cornea) {
  constexpr int vertices = 32000;
  constexpr double jitter = 0;
  return transformed(
      cornea.eye_from_surface(),
      raytrace::sheet_mesh(*cornea.shape, raytrace::default_semi_diameter_mm(cornea), vertices, jitter));
}

/// z is out of the eye: the sheet sinks, and its slope changes by the profile's.
void ablate(TriangleMesh& mesh, const AblationProfile& profile) {
  constexpr double step_mm = 1e-3;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    Eigen::Vector3d& vertex = mesh.vertices[i];
    const double x = vertex.x(), y = vertex.y();
    vertex.z() -= profile.depth_mm(x, y);
    Eigen::Vector3d& normal = mesh.normals[i];
    const Vector2d slope(
        (profile.depth_mm(x + step_mm, y) - profile.depth_mm(x - step_mm, y)) / (2 * step_mm),
        (profile.depth_mm(x, y + step_mm) - profile.depth_mm(x, y - step_mm)) / (2 * step_mm));
    normal /= normal.z();
    normal.head<2>() += slope;
    normal.normalize();
  }
}

}  // namespace

AblationProfile::AblationProfile(std::function<double(const Vector2d&)> shape_mm, const OpticalZone& zone)
    : shape_mm_(std::move(shape_mm)), zone_(zone) {
  constexpr int rings = 30, spokes = 90;
  double least = shape_mm_({0, 0}), most = least;
  for (int ring = 1; ring <= rings; ++ring)
    for (int spoke = 0; spoke < spokes; ++spoke) {
      const double r_mm = zone.diameter_mm / 2 * ring / rings, angle = 2 * pi * spoke / spokes;
      const double depth = shape_mm_(r_mm * Vector2d(std::cos(angle), std::sin(angle)));
      least = std::min(least, depth);
      most = std::max(most, depth);
    }
  shift_mm_ = -least;
  deepest_um_ = 1e3 * (most - least);
}

double AblationProfile::depth_mm(double x_mm, double y_mm) const {
  const Vector2d from_centre = Vector2d(x_mm, y_mm) - zone_.centre_mm;
  const double r_mm = from_centre.norm(), radius_mm = zone_.diameter_mm / 2;
  if (r_mm <= radius_mm) return shift_mm_ + shape_mm_(from_centre);
  const double t = (r_mm - radius_mm) / zone_.transition_mm;
  if (t >= 1) return 0;
  const double falling = 1 - t * t * t * (10 - 15 * t + 6 * t * t);  // C2 at both ends
  return falling * (shift_mm_ + shape_mm_(radius_mm / r_mm * from_centre));
}

AblationProfile munnerlyn_profile(const Eigen::Matrix2d& curvature_per_mm, const PowerVector& correction,
                                  double index_step, const OpticalZone& zone) {
  Eigen::Matrix2d change;
  change << correction.M_D + correction.J0_D, correction.J45_D, correction.J45_D,
      correction.M_D - correction.J0_D;
  const Eigen::Matrix2d after = curvature_per_mm + 1e-3 / index_step * change;
  if (!(Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(after).eigenvalues().minCoeff() > 0))
    throw no_result_error("an ablation by that much would leave no convex cornea");
  return {
      [=](const Vector2d& at) { return toric_depth_mm(after, at) - toric_depth_mm(curvature_per_mm, at); },
      zone};
}

AblationProfile munnerlyn_profile(const EyeModel& eye, const PowerVector& correction) {
  return munnerlyn_profile(eye.surface("cornea_anterior").shape->vertex_curvature(), correction,
                           cornea_index(eye) - 1);
}

AblationProfile wavefront_guided_profile(const EyeModel& eye, double wavelength_nm, const Vector2d& fovea_mm,
                                         int rounds) {
  OpticalZone zone;
  raytrace::WavefrontSettings settings;
  settings.wavelength_nm = wavelength_nm;
  settings.entrance_pupil_mm = zone.diameter_mm;
  settings.fovea_mm = fovea_mm;
  Eigen::VectorXd shape_um = Eigen::VectorXd::Zero(zernike_count(settings.order));
  std::optional<AblationProfile> profile;
  for (int round = 0; round < rounds; ++round) {
    const raytrace::Wavefront wavefront =
        raytrace::measure_wavefront(profile ? with_ablation(eye, *profile) : eye, settings);
    if (!profile) zone.centre_mm = on_cornea_mm(wavefront);
    const Eigen::Map<const Eigen::VectorXd> zernike_um(wavefront.zernike_um.data(), shape_um.size());
    shape_um -= zernike_um / (cornea_index(eye) - 1);
    shape_um.head<3>().setZero();  // a constant and a prism correct nothing
    profile.emplace(
        [=](const Vector2d& at) {
          const Vector2d place = at / (zone.diameter_mm / 2);
          return 1e-3 * shape_um.dot(zernike_values(settings.order, place.x(), place.y()));
        },
        zone);
  }
  return *profile;
}

EyeModel with_ablation(EyeModel eye, const AblationProfile& profile) {
  constexpr double least_left_um = 250;  // below it corneas give way: Seiler, Koufala and Richter 1998
  const double left_um = 1e3 * corneal_thickness_mm(eye) - profile.deepest_um();
  if (left_um < least_left_um)
    throw no_result_error(
        fmt::format("the ablation would be {:.0f} um deep and leave {:.0f} um of cornea, less than the "
                    "{:.0f} um that keep its shape",
                    profile.deepest_um(), left_um, least_left_um));
  Surface& front = eye.surface("cornea_anterior");
  const double semi_diameter_mm = front.semi_diameter_mm;
  TriangleMesh sheet = fine_sheet(front);
  ablate(sheet, profile);
  // Slopes jump at the zone's rim: a C2 patch would ripple about it, by 0.2 um of the wavefront.
  front = make_mesh_surface(front.name, sheet, front.medium_after, MeshInterpolation::triangles);
  front.semi_diameter_mm = semi_diameter_mm;
  return eye;
}

}  // namespace emmetrope::correction
