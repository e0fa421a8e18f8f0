#include "pipeline/eye/parametric/analytic_eye.hpp"

#include <cmath>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/media/ocular_media.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// The anterior cornea with its radii and its free form scaled.
ShapePtr scaled_cornea(const ParametricEye& eye, double scale, double form_scale) {
  const ParametricEye::Biconic b = eye.cornea_biconic();
  if (eye.has_irregular_cornea()) {
    constexpr int terms = corneal_form_first + corneal_form_terms;
    Eigen::VectorXd um = Eigen::VectorXd::Zero(terms);
    for (int i = 0; i < corneal_form_terms; ++i)
      um[corneal_form_first + i] = form_scale * eye.cornea_zernike_um[i];
    um[0] = -um.dot(zernike_values(corneal_form_order, 0, 0));  // the vertex stays the apex
    um = turned_zernike(um, b.steep_axis_deg * degree);
    return make_zernike(scale * b.steep_radius_mm, scale * b.flat_radius_mm, b.steep_q, b.flat_q,
                        b.steep_axis_deg, corneal_form_radius_mm, {um.data(), um.data() + um.size()});
  }
  return make_biconic(scale * b.steep_radius_mm, scale * b.flat_radius_mm, b.steep_q, b.flat_q,
                      b.steep_axis_deg);
}

Surface surface(std::string name, ShapePtr shape, double position_mm, std::string medium_after) {
  Surface s;
  s.name = std::move(name);
  s.shape = std::move(shape);
  s.position_mm = position_mm;
  s.medium_after = std::move(medium_after);
  return s;
}

}  // namespace

ShapePtr anterior_cornea_shape(const ParametricEye& eye) { return scaled_cornea(eye, 1, 1); }

std::vector<Surface> analytic_surfaces(const ParametricEye& eye, const ShapePtr& anterior_cornea,
                                       const OpticalDefaults& defaults) {
  Surface front =
      surface("cornea_anterior", anterior_cornea ? anterior_cornea : anterior_cornea_shape(eye), 0, "cornea");
  Surface back =
      surface("cornea_posterior", scaled_cornea(eye, eye.cornea_back_ratio, eye.cornea_back_form_ratio),
              eye.cornea_thickness_mm, "aqueous");

  Surface iris;
  iris.name = "iris";
  iris.position_mm = eye.anterior_chamber_depth_mm;
  iris.stop_diameter_mm = defaults.pupil_mm;

  // The lens is tilted about its middle; each of its surfaces is described from its own vertex.
  const Matrix3d turn = (Eigen::AngleAxisd(eye.lens_tilt_deg.y() * degree, Vector3d::UnitY()) *
                         Eigen::AngleAxisd(eye.lens_tilt_deg.x() * degree, Vector3d::UnitX()))
                            .toRotationMatrix();
  const Vector3d middle(eye.lens_decentre_mm.x(), eye.lens_decentre_mm.y(),
                        -eye.anterior_chamber_depth_mm - eye.lens_thickness_mm / 2);
  const auto lens_surface = [&](const char* name, ShapePtr shape, double along_axis_mm,
                                const char* medium_after) {
    const Vector3d vertex = middle + turn * Vector3d(0, 0, along_axis_mm);
    Surface s = surface(name, std::move(shape), -vertex.z(), medium_after);
    s.decentre_mm = vertex.head<2>();
    s.tilt_deg = eye.lens_tilt_deg;
    s.semi_diameter_mm = eye.lens_equator_radius_mm;
    return s;
  };
  Surface lens_front =
      lens_surface("lens_anterior", make_conic(eye.lens_anterior_radius_mm, eye.lens_anterior_q),
                   eye.lens_thickness_mm / 2, "lens");
  Surface lens_back =
      lens_surface("lens_posterior", make_conic(-eye.lens_posterior_radius_mm, eye.lens_posterior_q),
                   -eye.lens_thickness_mm / 2, "vitreous");

  const Vector3d axes = eye.globe_semi_axes_mm.array() + defaults.retinal_depth_mm;
  Surface retina = surface("retina", make_ellipsoid({axes.x(), axes.y(), -axes.z()}, 0),
                           eye.pole_depth_mm() + defaults.retinal_depth_mm, "");
  return {front, back, iris, lens_front, lens_back, retina};
}

LensOnAxis lens_on_axis(const ParametricEye& eye) {
  const auto depth = [](const Surface& lens) {
    const Eigen::Isometry3d surface_from_eye = lens.eye_from_surface().inverse();
    const Ray axis{surface_from_eye * Vector3d::Zero(), surface_from_eye.linear() * -Vector3d::UnitZ()};
    const auto hit = lens.shape->intersect(axis);
    if (!hit) throw no_result_error("the fitted lens lies beside the eye's axis");
    return hit->distance_mm;
  };
  const std::vector<Surface> surfaces = analytic_surfaces(eye);
  return {depth(surfaces[3]), depth(surfaces[4])};
}

EyeModel analytic_eye(const ParametricEye& eye, const ShapePtr& anterior_cornea,
                      const OpticalDefaults& defaults) {
  EyeModel model;
  model.name = std::string("measured ") + to_string(eye.laterality);
  model.reference_wavelength_nm = sodium_nm;
  model.media = ocular_media(defaults.lens_index);
  model.surfaces = analytic_surfaces(eye, anterior_cornea, defaults);
  model.lps_from_eye = eye.lps_from_eye;
  return model;
}

}  // namespace emmetrope
