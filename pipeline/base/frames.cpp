#include "pipeline/base/frames.hpp"

#include <algorithm>
#include <cmath>

#include "pipeline/base/error.hpp"

namespace emmetrope {

Eigen::Isometry3d lps_from_eye(const Eigen::Vector3d& apex_in_lps, const Eigen::Vector3d& axis_in_lps) {
  const Eigen::Vector3d z = axis_in_lps.normalized();
  const Eigen::Vector3d superior = Eigen::Vector3d::UnitZ();
  // x has no superior component; it points to the patient's left when the eye looks forward (-y).
  const Eigen::Vector3d across = superior.cross(z);
  if (!(across.norm() > 1e-6))
    throw input_error("the eye's axis is vertical: its horizontal direction is undefined");
  const Eigen::Vector3d x = across.normalized();
  Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
  transform.linear() << x, z.cross(x), z;
  transform.translation() = apex_in_lps;
  return transform;
}

Eigen::Vector3d gaze_axis(double horizontal_deg, double vertical_deg) {
  const double h = horizontal_deg * degree, v = vertical_deg * degree;
  return {std::sin(h) * std::cos(v), -std::cos(h) * std::cos(v), std::sin(v)};
}

Eigen::Vector2d gaze_deg(const Eigen::Vector3d& axis_in_lps) {
  return {std::atan2(axis_in_lps.x(), -axis_in_lps.y()) / degree,
          std::asin(std::clamp(axis_in_lps.z() / axis_in_lps.norm(), -1.0, 1.0)) / degree};
}

Json to_json_vector(const Eigen::Vector3d& vector) {
  return Json::array({vector.x(), vector.y(), vector.z()});
}

Json to_json_matrix(const Eigen::Isometry3d& transform) {
  Json rows = Json::array();
  for (int row = 0; row < 4; ++row) {
    Json columns = Json::array();
    for (int column = 0; column < 4; ++column) columns.push_back(transform.matrix()(row, column));
    rows.push_back(columns);
  }
  return rows;
}

Eigen::Isometry3d isometry_from_json(const Json& json) {
  Eigen::Matrix4d matrix;
  try {
    if (json.size() != 4) throw input_error("");
    for (int row = 0; row < 4; ++row) {
      if (json.at(row).size() != 4) throw input_error("");
      for (int column = 0; column < 4; ++column) matrix(row, column) = json.at(row).at(column).get<double>();
    }
  } catch (const std::exception&) {
    throw input_error("a transform must be 4 rows of 4 numbers, found " + json.dump());
  }
  const Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const bool rigid = (rotation.transpose() * rotation - Eigen::Matrix3d::Identity()).norm() < 1e-6 &&
                     rotation.determinant() > 0 && matrix.row(3) == Eigen::RowVector4d(0, 0, 0, 1);
  if (!rigid) throw input_error("a transform must be rigid (rotation and shift), found " + json.dump());
  Eigen::Isometry3d transform = Eigen::Isometry3d::Identity();
  transform.matrix() = matrix;
  return transform;
}

double normalise_axis_deg(double axis_deg) {
  const double wrapped = std::fmod(axis_deg, 180.0);
  const double positive = wrapped < 0 ? wrapped + 180 : wrapped;
  return positive >= 180 ? 0 : positive;
}

}  // namespace emmetrope
