#include "raytrace/wavefront/pupil_function.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "pipeline/base/frames.hpp"
#include "pipeline/eye/surfaces/zernike.hpp"

namespace emmetrope::raytrace {
namespace {

/// A rim's distances at even angles, close enough to be read off between them.
class RimTable {
 public:
  explicit RimTable(const PupilRim& rim) {
    for (int k = 0; k <= angles; ++k) radius_mm_.push_back(rim.at(2 * pi * k / angles));
  }
  double at(double x, double y) const {
    const double place = (std::atan2(y, x) / (2 * pi) + 1) * angles;
    const auto whole = static_cast<int>(place);
    const double share = place - whole;
    return (1 - share) * radius_mm_[whole % angles] + share * radius_mm_[whole % angles + 1];
  }

 private:
  static constexpr int angles = 2048;
  std::vector<double> radius_mm_;
};

/// Share of a square of side `step_mm` about (x, y) that lies within the rim.
double coverage(const RimTable& rim, const Eigen::Vector2d& centre_mm, double step_mm) {
  // Twice the half diagonal: the rim of a flat ellipse runs slantwise across its spokes.
  const double reach = centre_mm.norm(), margin = step_mm * 1.42,
               rim_mm = rim.at(centre_mm.x(), centre_mm.y());
  if (reach + margin <= rim_mm) return 1;
  if (reach - margin >= rim_mm) return 0;
  constexpr int parts = 16;
  int inside = 0;
  for (int i = 0; i < parts; ++i)
    for (int j = 0; j < parts; ++j) {
      const double x = centre_mm.x() + step_mm * ((i + 0.5) / parts - 0.5),
                   y = centre_mm.y() + step_mm * ((j + 0.5) / parts - 0.5);
      if (std::hypot(x, y) <= rim.at(x, y)) ++inside;
    }
  return static_cast<double>(inside) / (parts * parts);
}

cv::Mat complex_matrix(const std::vector<std::complex<double>>& values, int size) {
  return cv::Mat(size, size, CV_64FC2, const_cast<std::complex<double>*>(values.data()));
}

}  // namespace

PupilFunction::PupilFunction(const Wavefront& wavefront, int samples_across, double padding,
                             const Eigen::Vector2d& up)
    : wavelength_um_(wavefront.wavelength_nm / 1000), radius_mm_(wavefront.pupil_mm / 2) {
  // A shift of the pupil by s is the frequency s / wavelength: one cycle a degree is a whole number of steps.
  const double one_cpd_mm = wavelength_um_ / 1000 / degree;
  per_cpd_ = std::max(1, static_cast<int>(std::ceil(samples_across * one_cpd_mm / wavefront.pupil_mm)));
  step_mm_ = one_cpd_mm / per_cpd_;
  const int half = static_cast<int>(std::ceil(radius_mm_ / step_mm_)) + 1;
  size_ = cv::getOptimalDFTSize(static_cast<int>(std::ceil(padding * (2 * half + 1))));

  int order = 0;
  while (zernike_count(order) < static_cast<int>(wavefront.zernike_um.size())) ++order;
  Eigen::VectorXd coefficients = Eigen::VectorXd::Zero(zernike_count(order));
  for (std::size_t j = 3; j < wavefront.zernike_um.size(); ++j)
    coefficients[static_cast<Eigen::Index>(j)] = wavefront.zernike_um[j];

  const RimTable rim(rim_of(wavefront));
  const Eigen::Vector2d right(up.y(), -up.x());
  for (int row = -half; row <= half; ++row)
    for (int column = -half; column <= half; ++column) {
      const Eigen::Vector2d place_mm = step_mm_ * (column * right + row * up);
      const double covered = coverage(rim, place_mm, step_mm_);
      if (covered == 0) continue;
      const double weight = wavefront.receptor_weight(place_mm);
      const Eigen::VectorXd z = zernike_values(order, place_mm.x() / radius_mm_, place_mm.y() / radius_mm_);
      const int index = ((row + size_) % size_) * size_ + (column + size_) % size_;
      points_.push_back({index, covered * std::sqrt(weight), coefficients.dot(z), z[4], z[5], z[3]});
      light_ += covered * weight;
    }
  level();
}

void PupilFunction::level() {
  // Zernike terms have no tilt over their circle, but over another pupil they have.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Matrix<double, 3, 4> right = Eigen::Matrix<double, 3, 4>::Zero();
  const auto row_of = [&](const Point& point) {
    return Eigen::Vector3d(1, signed_place(point.index % size_), signed_place(point.index / size_));
  };
  for (const Point& p : points_) {
    const Eigen::Vector3d row = row_of(p);
    normal += p.amplitude * row * row.transpose();
    right += p.amplitude * row * Eigen::RowVector4d(p.wavefront_um, p.defocus, p.straight, p.oblique);
  }
  const Eigen::Matrix<double, 3, 4> planes = normal.ldlt().solve(right);
  for (Point& p : points_) {
    const Eigen::RowVector4d plane = row_of(p).transpose() * planes;
    p.wavefront_um -= plane[0];
    p.defocus -= plane[1];
    p.straight -= plane[2];
    p.oblique -= plane[3];
  }
}

double PupilFunction::pitch_arcmin() const {
  return wavelength_um_ / 1000 / (size_ * step_mm_) / degree * 60;
}

std::vector<double> PupilFunction::transform(const std::vector<std::complex<double>>& field) const {
  cv::Mat spectrum;
  cv::dft(complex_matrix(field, size_), spectrum);
  const double scale = 1 / (light_ * size_ * size_);
  std::vector<double> result(field.size());
  const auto* value = spectrum.ptr<std::complex<double>>();
  for (std::size_t k = 0; k < result.size(); ++k) result[k] = std::norm(value[k]) * scale;
  return result;
}

std::vector<std::complex<double>> PupilFunction::amplitudes(const PowerVector& lens) const {
  // What the lens adds to the terms of second order: c = power r^2 / (4 sqrt 3), r^2 / (2 sqrt 6).
  const double square = radius_mm_ * radius_mm_;
  const double c4 = lens.M_D * square / (4 * std::sqrt(3.0));
  const double c5 = lens.J0_D * square / (2 * std::sqrt(6.0));
  const double c3 = lens.J45_D * square / (2 * std::sqrt(6.0));
  std::vector<std::complex<double>> result;
  result.reserve(points_.size());
  for (const Point& p : points_) {
    const double w = p.wavefront_um + c4 * p.defocus + c5 * p.straight + c3 * p.oblique;
    result.push_back(std::polar(p.amplitude, 2 * pi * w / wavelength_um_));
  }
  return result;
}

std::vector<double> PupilFunction::point_spread(const PowerVector& lens) const {
  const std::vector<std::complex<double>> amplitude = amplitudes(lens);
  std::vector<std::complex<double>> field(static_cast<std::size_t>(size_) * size_);
  for (std::size_t k = 0; k < points_.size(); ++k) field[points_[k].index] = amplitude[k];
  return transform(field);
}

double PupilFunction::strehl(const PowerVector& lens, const std::vector<double>& point_spread) const {
  const auto largest =
      static_cast<int>(std::max_element(point_spread.begin(), point_spread.end()) - point_spread.begin());
  Eigen::Vector2d angle(signed_place(largest % size_), signed_place(largest / size_));  // grid steps
  const std::vector<std::complex<double>> amplitude = amplitudes(lens);
  double perfect = 0, best = 0;
  for (const Point& point : points_) perfect += point.amplitude;
  for (int round = 0; round < 6; ++round) {
    // The field and its derivatives by the angle: sums of f, -i k f and -k k' f over the pupil.
    std::complex<double> field = 0;
    Eigen::Vector2cd first = Eigen::Vector2cd::Zero();
    Eigen::Matrix2cd second = Eigen::Matrix2cd::Zero();
    for (std::size_t i = 0; i < points_.size(); ++i) {
      const Eigen::Vector2d k =
          2 * pi / size_ *
          Eigen::Vector2d(signed_place(points_[i].index % size_), signed_place(points_[i].index / size_));
      const std::complex<double> f = amplitude[i] * std::polar(1.0, -k.dot(angle));
      field += f;
      first -= std::complex<double>(0, 1) * f * k;
      second -= f * (k * k.transpose());
    }
    if (std::norm(field) <= best) break;
    best = std::norm(field);
    const Eigen::Vector2d slope = 2 * (std::conj(field) * first).real();
    const Eigen::Matrix2d bend =
        2 * (first.conjugate() * first.transpose() + std::conj(field) * second).real();
    if (!(bend.trace() < 0 && bend.determinant() > 0)) break;  // no hilltop here
    const Eigen::Vector2d step = -bend.inverse() * slope;
    if (step.norm() < 1e-6 || step.norm() > 1) break;
    angle += step;
  }
  return best / (perfect * perfect);
}

std::vector<double> PupilFunction::perfect_point_spread() const {
  std::vector<std::complex<double>> field(static_cast<std::size_t>(size_) * size_);
  for (const Point& p : points_) field[p.index] = p.amplitude;
  return transform(field);
}

std::vector<std::complex<double>> PupilFunction::otf(const std::vector<double>& point_spread) const {
  std::vector<std::complex<double>> field(point_spread.begin(), point_spread.end());
  cv::Mat spectrum;
  cv::dft(complex_matrix(field, size_), spectrum, cv::DFT_INVERSE);
  const auto* value = spectrum.ptr<std::complex<double>>();
  std::vector<std::complex<double>> result(value, value + field.size());
  // Shifted by a step or more, coverages overlap as the pupil does; unshifted, the edge's squares would lose
  // a little.
  result[0] = 1;
  return result;
}

}  // namespace emmetrope::raytrace
