#include "segmentation/fit/patient_frame.hpp"

#include <Eigen/QR>
#include <algorithm>
#include <utility>

#include "pipeline/base/even_points.hpp"
#include "pipeline/base/frames.hpp"
#include "segmentation/fit/eye_surfaces.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Index;
using Eigen::Matrix2d;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

/// From the parameters along the head's axes to those along the patient's.
class Turn {
 public:
  explicit Turn(const ForwardModel& model)
      : along_head_(model), layout_(model.layout()), bumps_(bump_directions()) {
    if (layout_.bumps == 0) return;
    constexpr int about = 800;
    const double front = std::max_element(bumps_.begin(), bumps_.end(), [](const auto& a, const auto& b) {
                           return a.z() < b.z();
                         })->z();
    for (const Vector3d& direction : mirrored_directions(about))
      if (direction.z() <= front) directions_.push_back(direction);
    MatrixXd values(static_cast<Index>(directions_.size()), layout_.bumps);
    for (Index i = 0; i < values.rows(); ++i) values.row(i) = bumps_at(directions_[i]).transpose();
    bumps_of_values_.compute(values);
  }

  VectorXd operator()(VectorXd a) const {
    const Vector3d axis = along_head_.axis(a);
    const Vector3d horizontal = along_head_.horizontal(a);
    a.segment<2>(gaze_horizontal) = gaze_deg(axis);
    const Matrix3d patient = lps_from_eye(Vector3d::Zero(), axis).linear();
    Matrix3d turn = Matrix3d::Identity();  // from the eye along the head's axes to that along the patient's
    turn.topLeftCorner<2, 2>() << patient.col(0).dot(horizontal), -patient.col(1).dot(horizontal),
        patient.col(1).dot(horizontal), patient.col(0).dot(horizontal);
    turn_front(a, turn.topLeftCorner<2, 2>());
    turn_globe(a, turn);
    return a;
  }

 private:
  VectorXd bumps_at(const Vector3d& direction) const {
    VectorXd values(layout_.bumps);
    for (Index i = 0; i < values.size(); ++i)
      values[i] = bump_at(direction.dot(bumps_[static_cast<std::size_t>(i)])).value;
    return values;
  }

  static void turn_front(VectorXd& a, const Matrix2d& turn) {
    for (const int across : {int(lens_decentre_x), int(lens_tilt_x), int(lid_tilt_x)})
      a.segment<2>(across) = turn * a.segment<2>(across);
    Matrix2d cylinder, lid_bend;
    cylinder << a[cornea_j0], a[cornea_j45], a[cornea_j45], -a[cornea_j0];
    cylinder = turn * cylinder * turn.transpose();
    a[cornea_j0] = cylinder(0, 0);
    a[cornea_j45] = cylinder(0, 1);
    lid_bend << a[lid_xx], a[lid_xy] / 2, a[lid_xy] / 2, a[lid_yy];
    lid_bend = turn * lid_bend * turn.transpose();
    a[lid_xx] = lid_bend(0, 0);
    a[lid_yy] = lid_bend(1, 1);
    a[lid_xy] = 2 * lid_bend(0, 1);
  }

  void turn_globe(VectorXd& a, const Matrix3d& turn) const {
    const Vector3d half_axes = a.segment<3>(globe_x);
    Vector3d turned;
    for (int i = 0; i < 3; ++i) turned[i] = 1 / Vector3d(turn.row(i)).cwiseQuotient(half_axes).norm();
    a.segment<3>(globe_x) = turned;
    if (layout_.bumps == 0) return;
    const auto displacement = a.segment(layout_.displacement(), layout_.bumps),
               background = a.segment(layout_.background(), layout_.bumps);
    MatrixXd fields(static_cast<Index>(directions_.size()), 2);
    for (Index i = 0; i < fields.rows(); ++i) {
      const Vector3d scaled =
          (turn.transpose() * turned.cwiseProduct(directions_[i])).cwiseQuotient(half_axes);
      const VectorXd bumps = bumps_at(scaled.normalized());
      const double radius = (1 + bumps.dot(displacement) / displacement_sphere_mm) / scaled.norm();
      fields.row(i) << displacement_sphere_mm * (radius - 1), bumps.dot(background);
    }
    const MatrixXd of_bumps = bumps_of_values_.solve(fields);
    a.segment(layout_.displacement(), layout_.bumps) = of_bumps.col(0);
    a.segment(layout_.background(), layout_.bumps) = of_bumps.col(1);
  }

  const ForwardModel& along_head_;
  ParameterLayout layout_;
  std::vector<Vector3d> bumps_, directions_;
  Eigen::ColPivHouseholderQR<MatrixXd> bumps_of_values_;
};

}  // namespace

EyeFit along_patient(EyeFit fit) {
  constexpr double same = 1e-9, step = 1e-4;
  if (fit.model.head_axes().isIdentity(same)) return fit;
  const Turn turn(fit.model);
  const VectorXd turned = turn(fit.parameters);
  const auto count = static_cast<Index>(fit.active.size());
  MatrixXd derivatives(count, count);
  for (Index j = 0; j < count; ++j) {
    VectorXd moved = fit.parameters;
    moved[fit.active[j]] += step;
    const VectorXd change = (turn(std::move(moved)) - turned) / step;
    for (Index i = 0; i < count; ++i) derivatives(i, j) = change[fit.active[i]];
  }
  for (MatrixXd* covariance : {&fit.covariance, &fit.shared_covariance, &fit.common_covariance})
    if (covariance->size() > 0) *covariance = derivatives * *covariance * derivatives.transpose();
  const Eigen::Vector2d gaze_expected = gaze_deg(fit.model.axis(fit.priors.mean));
  fit.priors.mean.segment<2>(gaze_horizontal) = fit.parameters.segment<2>(gaze_horizontal);
  fit.priors.mean = turn(std::move(fit.priors.mean));
  fit.priors.mean.segment<2>(gaze_horizontal) = gaze_expected;
  fit.parameters = turned;
  fit.turned_by = std::move(derivatives);
  fit.model = fit.model.along(Matrix3d::Identity());
  return fit;
}

}  // namespace emmetrope::segmentation
