// Where the forward model's surfaces are.
#include <algorithm>
#include <cmath>

#include "pipeline/base/frames.hpp"
#include "segmentation/fit/eye_surfaces.hpp"
#include "segmentation/fit/forward_model.hpp"

namespace emmetrope::segmentation {

using Eigen::Vector3d;

double ForwardModel::AtParameters::displacement(const Vector3d& direction) const {
  double u = 0;
  for (int i = 0; i < model_.layout_.bumps; ++i)
    u += a_[model_.layout_.displacement() + i] * bump_at(direction.dot(model_.bumps_[i])).value;
  return u;
}

ForwardModel::AtParameters::Distances ForwardModel::AtParameters::distances(const Vector3d& p) const {
  const auto distance = [](const EyeSurface& s) { return s.f / s.gradient.norm(); };
  Distances d;
  d.lid = distance(lid_surface(a_, p));
  d.cornea_front = distance(cornea_at(p, false));
  d.cornea_back = distance(cornea_at(p, true));
  EyeSurface front, back, equator;
  lens_surfaces(a_, p, front, back, equator);
  d.lens_front = distance(front);
  d.lens = std::min({distance(front), distance(back), distance(equator)});
  EyeSurface top, bottom, pupil;
  iris_surfaces(a_, p, top, bottom, pupil);
  d.iris = std::min({distance(top), -distance(bottom), distance(pupil)});
  const Vector3d r(a_[globe_x], a_[globe_y], a_[globe_z]);
  const Vector3d q = (p + Vector3d(0, 0, a_[axial_length] - a_[globe_z])).cwiseQuotient(r);
  d.direction = q.squaredNorm() > 1e-12 ? q.normalized() : Vector3d(-Vector3d::UnitZ());
  WallFields wall_at;
  // Far from the wall a displacement of tenths of a millimetre decides nothing.
  if (std::abs(distance(globe_surface(a_, p, WallSide::inner, nullptr))) < 5)
    wall_at.displacement = displacement(d.direction);
  d.globe = distance(globe_surface(a_, p, WallSide::inner, &wall_at));
  d.outer = distance(globe_surface(a_, p, WallSide::outer, &wall_at));
  return d;
}

double ForwardModel::AtParameters::limbus_misfit(int quadrant, SparseRow* row) const {
  constexpr double limbus_radius_mm = 5.85;  // half the white-to-white distance of adults
  const double angle = (quadrant + 0.5) * pi / 2;
  Vector3d p(limbus_radius_mm * std::cos(angle), limbus_radius_mm * std::sin(angle), 0);
  const EyeSurface front = cornea_at(p, false);
  p.z() = front.f;  // front.f is minus the sag here: on the cornea
  const EyeSurface globe = globe_surface(a_, p, WallSide::outer, nullptr);
  const double per_f = 1 / globe.gradient.norm();
  if (row) {
    row->clear();
    for (int i = 0; i < globe.count; ++i) row->add(globe.parameter[i], per_f * globe.derivative[i]);
    for (int i = 0; i < front.count; ++i)
      row->add(front.parameter[i], per_f * globe.gradient.z() * front.derivative[i]);
  }
  return per_f * globe.f;
}

ForwardModel::AtParameters::SurfacePoint ForwardModel::AtParameters::at_surface(OpticalSurface which,
                                                                                const Vector3d& p,
                                                                                SparseRow* row) const {
  EyeSurface surface;
  Sample everywhere;
  WallFields wall_at;
  if (which == OpticalSurface::cornea_anterior || which == OpticalSurface::cornea_posterior) {
    surface = cornea_at(p, which == OpticalSurface::cornea_posterior);
  } else if (which == OpticalSurface::retina) {
    for (int i = 0; i < model_.layout_.bumps; ++i) everywhere.bumps.push_back(static_cast<std::uint8_t>(i));
    wall_at = wall_fields(everywhere.bumps, p);
    surface = globe_surface(a_, p, WallSide::inner, &wall_at);
  } else {
    EyeSurface front, back, equator;
    lens_surfaces(a_, p, front, back, equator);
    surface = which == OpticalSurface::lens_anterior ? front : back;
  }
  const double per_f = 1 / surface.gradient.norm();
  if (row) {
    row->clear();
    for (int i = 0; i < surface.count; ++i) row->add(surface.parameter[i], per_f * surface.derivative[i]);
    for (std::size_t k = 0; k < everywhere.bumps.size(); ++k)
      row->add(model_.layout_.displacement() + everywhere.bumps[k], per_f * wall_at.bump[k]);
    const Vector3d arm = eye_from_lps_.transpose() * p;
    const Vector3d in_lps = eye_from_lps_.transpose() * surface.gradient * per_f;
    for (int i = 0; i < 3; ++i) row->add(apex_x + i, -in_lps[i]);
    row->add(gaze_horizontal, per_f * surface.gradient.dot(d_eye_from_lps_d_horizontal_ * arm));
    row->add(gaze_vertical, per_f * surface.gradient.dot(d_eye_from_lps_d_vertical_ * arm));
  }
  return {per_f * surface.f, -per_f * surface.gradient};
}

}  // namespace emmetrope::segmentation
