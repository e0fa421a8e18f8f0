#include "data_samples/phantom/true_optics.hpp"

#include "data_samples/phantom/truth.hpp"
#include "pipeline/base/frames.hpp"

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

/// Le Grand's (1956) dispersion n_inf + K / (lambda - 130 nm), of which only differences from 589.3 nm count.
Medium medium(double index, double n_infinite, double k_nm) {
  return {index, {Dispersion::Formula::cornu, {n_infinite, k_nm, 130}}, {}};
}

}  // namespace

EyeModel true_optics(const PlacedEye& eye, double lens_index) {
  const EyeGeometry& g = eye.geometry;
  EyeModel model;
  model.name = std::string("phantom ") + to_string(eye.laterality);
  model.reference_wavelength_nm = 589.3;
  model.media = {{"cornea", medium(1.376, 1.3610, 7.4147)},
                 {"aqueous", medium(1.336, 1.3221, 7.0096)},
                 {"lens", medium(lens_index, 1.3999, 9.2492)},
                 {"vitreous", medium(1.336, 1.3208, 6.9806)}};

  const auto cornea = [&](double ratio) {
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

  const Vector3d axes(g.globe_semi_x_mm + retinal_depth_mm, g.globe_semi_y_mm + retinal_depth_mm,
                      -g.globe_semi_z_mm - retinal_depth_mm);
  model.surfaces = {
      surface("cornea_anterior", cornea(1), 0, "cornea"),
      surface("cornea_posterior", cornea(g.cornea_back_ratio), g.cornea_thickness_mm, "aqueous"),
      iris,
      lens("lens_anterior", make_conic(g.lens_anterior_radius_mm, g.lens_anterior_q), g.lens_thickness_mm / 2,
           "lens"),
      lens("lens_posterior", make_conic(-g.lens_posterior_radius_mm, g.lens_posterior_q),
           -g.lens_thickness_mm / 2, "vitreous"),
      surface("retina", make_ellipsoid(axes, g.globe_axis_deg), pole_depth_mm(g) + retinal_depth_mm, "")};
  model.lps_from_eye = eye.lps_from_eye;
  return model;
}

}  // namespace emmetrope::phantom
