#include "data_samples/phantom/true_optics.hpp"

#include "data_samples/phantom/truth.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/media/ocular_media.hpp"
#include "pipeline/eye/parametric/corneal_metrics.hpp"
#include "pipeline/eye/population/population.hpp"

namespace emmetrope::phantom {
namespace {

using Eigen::Vector3d;

Surface surface(const std::string& name, ShapePtr shape, double position_mm,
                const std::string& medium_after) {
  Surface s;
  s.name = name;
  s.shape = std::move(shape);
  s.position_mm = position_mm;
  s.medium_after = medium_after;
  return s;
}

/// Zernike terms (um of depth) that describe a cone over the whole cornea to 0.1 um: OSA order over
/// `cone_zone_mm`, x along the cornea's meridian.
constexpr double cone_zone_mm = 12;
std::vector<double> cone_zernike_um(const EyeGeometry& eye, double scale) {
  constexpr int order = 16;
  const Eigen::Rotation2Dd eye_from_meridian(eye.cornea_axis_deg * degree);
  const Eigen::VectorXd height_um = corneal_zernike_um(
      [&](double x_mm, double y_mm) {
        const Eigen::Vector2d p = eye_from_meridian * Eigen::Vector2d(x_mm, y_mm);
        return scale * cone_depth_mm(eye, p.x(), p.y());
      },
      cone_zone_mm, order);
  std::vector<double> depth_um(height_um.size());
  for (Eigen::Index j = 0; j < height_um.size(); ++j) depth_um[static_cast<std::size_t>(j)] = -height_um[j];
  return depth_um;
}

}  // namespace

EyeModel true_optics(const PlacedEye& eye, double lens_index) {
  const EyeGeometry& g = eye.geometry;
  EyeModel model;
  model.name = std::string("phantom ") + to_string(eye.laterality);
  model.reference_wavelength_nm = sodium_nm;
  model.media = ocular_media(lens_index);

  const auto cornea = [&](double ratio, double cone_ratio) {
    if (g.cone_height_um != 0)
      return make_zernike(ratio * g.cornea_radius_x_mm, ratio * g.cornea_radius_y_mm, g.cornea_q_x,
                          g.cornea_q_y, g.cornea_axis_deg, cone_zone_mm / 2, cone_zernike_um(g, cone_ratio));
    return make_biconic(ratio * g.cornea_radius_x_mm, ratio * g.cornea_radius_y_mm, g.cornea_q_x,
                        g.cornea_q_y, g.cornea_axis_deg);
  };
  const Eigen::Matrix3d turn = (Eigen::AngleAxisd(g.lens_tilt_y_deg * degree, Vector3d::UnitY()) *
                                Eigen::AngleAxisd(g.lens_tilt_x_deg * degree, Vector3d::UnitX()))
                                   .toRotationMatrix();
  const Vector3d middle(g.lens_decentre_x_mm, g.lens_decentre_y_mm,
                        -g.anterior_chamber_depth_mm - g.lens_thickness_mm / 2);
  const auto lens = [&](const std::string& name, ShapePtr shape, double along_axis_mm,
                        const std::string& after) {
    const Vector3d vertex = middle + turn * Vector3d(0, 0, along_axis_mm);
    Surface s = surface(name, std::move(shape), -vertex.z(), after);
    s.decentre_mm = vertex.head<2>();
    s.tilt_deg = {g.lens_tilt_x_deg, g.lens_tilt_y_deg};
    s.semi_diameter_mm = g.lens_equator_radius_mm;
    return s;
  };
  Surface iris;
  iris.name = "iris";
  iris.position_mm = g.anterior_chamber_depth_mm;
  iris.stop_diameter_mm = g.iris_diameter_mm;

  const Vector3d axes(g.globe_semi_x_mm + usual_retinal_depth_mm, g.globe_semi_y_mm + usual_retinal_depth_mm,
                      -g.globe_semi_z_mm - usual_retinal_depth_mm);
  model.surfaces = {surface("cornea_anterior", cornea(1, 1), 0, "cornea"),
                    surface("cornea_posterior", cornea(g.cornea_back_ratio, g.cone_back_ratio),
                            g.cornea_thickness_mm, "aqueous"),
                    iris,
                    lens("lens_anterior", make_conic(g.lens_anterior_radius_mm, g.lens_anterior_q),
                         g.lens_thickness_mm / 2, "lens"),
                    lens("lens_posterior", make_conic(-g.lens_posterior_radius_mm, g.lens_posterior_q),
                         -g.lens_thickness_mm / 2, "vitreous"),
                    surface("retina", make_ellipsoid(axes, g.globe_axis_deg),
                            pole_depth_mm(g) + usual_retinal_depth_mm, "")};
  model.lps_from_eye = eye.lps_from_eye;
  return model;
}

}  // namespace emmetrope::phantom
