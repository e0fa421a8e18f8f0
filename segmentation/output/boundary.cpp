#include "segmentation/output/boundary.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "pipeline/base/even_points.hpp"
#include "pipeline/base/files.hpp"
#include "pipeline/base/frames.hpp"

namespace emmetrope::segmentation {
namespace {

using Eigen::Vector3d;

struct SurfaceRange {
  OpticalSurface surface;
  double radius_mm;
};

/// Foot of the normal: Newton's steps along the gradient of the signed distance.
Vector3d project(const ForwardModel::AtParameters& eye, OpticalSurface surface, Vector3d p) {
  for (int i = 0; i < 8; ++i) {
    const auto at = eye.at_surface(surface, p, nullptr);
    p += at.distance * at.outward;
    if (std::abs(at.distance) < 1e-9) break;
  }
  return p;
}

void append_float(std::string& bytes, double value) {
  const auto number = static_cast<float>(value);
  bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
}

}  // namespace

void write_boundary(const std::filesystem::path& file, const EyeFit& fit) {
  const ForwardModel::AtParameters eye(fit.model, fit.parameters);
  const Eigen::VectorXd& a = fit.parameters;
  std::vector<int> place(fit.layout.size(), -1);
  for (std::size_t i = 0; i < fit.active.size(); ++i) place[fit.active[i]] = static_cast<int>(i);

  SparseRow row(fit.layout.size());
  std::string bytes;
  std::size_t count = 0;
  const Eigen::Matrix3d lps_from_eye_axes =
      lps_from_eye(a.segment<3>(apex_x), gaze_axis(a[gaze_horizontal], a[gaze_vertical])).linear();
  const auto add = [&](OpticalSurface surface, const Vector3d& near) {
    const Vector3d p = project(eye, surface, near);
    const auto at = eye.at_surface(surface, p, &row);
    double variance = 0;
    for (const int i : row.touched()) {
      if (place[i] < 0) continue;
      for (const int j : row.touched())
        if (place[j] >= 0) variance += row[i] * fit.covariance(place[i], place[j]) * row[j];
    }
    const Vector3d in_lps = a.segment<3>(apex_x) + lps_from_eye_axes * p,
                   normal = lps_from_eye_axes * at.outward;
    for (const double v : {in_lps.x(), in_lps.y(), in_lps.z(), normal.x(), normal.y(), normal.z()})
      append_float(bytes, v);
    bytes.push_back(static_cast<char>(surface));
    append_float(bytes, std::sqrt(std::max(variance, 0.0)));
    ++count;
  };

  // Sunflower discs on the four front surfaces, a Fibonacci lattice on the retina.
  const double lens_front = a[anterior_chamber_depth], lens_back = lens_front + a[lens_thickness];
  const std::array<std::pair<SurfaceRange, double>, 4> discs{
      {{{OpticalSurface::cornea_anterior, 5.0}, 0},
       {{OpticalSurface::cornea_posterior, 5.0}, a[cornea_thickness]},
       {{OpticalSurface::lens_anterior, 3.8}, lens_front},
       {{OpticalSurface::lens_posterior, 3.8}, lens_back}}};
  for (const auto& [range, depth] : discs) {
    if (fit.front_is_blanked()) break;
    constexpr int points = 400;
    for (int i = 0; i < points; ++i) {
      const Eigen::Vector2d at = range.radius_mm * sunflower_point(i, points);
      add(range.surface, {at.x(), at.y(), -depth});
    }
  }
  constexpr int retina_points = 2400;
  const Vector3d half_axes = a.segment<3>(globe_x), centre(0, 0, a[globe_z] - a[axial_length]);
  for (int i = 0; i < retina_points; ++i) {
    const Vector3d direction = fibonacci_direction(i, retina_points);
    if (direction.z() > 0.4) continue;  // in front of the ora serrata there is no retina
    add(OpticalSurface::retina, centre + half_axes.cwiseProduct(direction));
  }
  const std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment SPACE=LPS\n"
      "comment label 0 cornea_anterior 1 cornea_posterior 2 lens_anterior 3 lens_posterior 4 retina\n"
      "element vertex {}\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\nproperty "
      "float ny\n"
      "property float nz\nproperty uchar label\nproperty float sigma_mm\nend_header\n",
      count);
  write_file(file, header + bytes);
}

}  // namespace emmetrope::segmentation
