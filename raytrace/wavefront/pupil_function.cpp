#include "raytrace/wavefront/pupil_function.hpp"

#include <cmath>
#include <opencv2/core.hpp>

#include "pipeline/base/frames.hpp"
#include "raytrace/eye/zernike.hpp"

namespace emmetrope {
namespace {

/// Share of a square of side `step` about (x, y), in units of the radius, that lies in the unit circle.
double coverage(double x, double y, double step) {
  const double reach = std::hypot(x, y), half = step * 0.7072;
  if (reach + half <= 1) return 1;
  if (reach - half >= 1) return 0;
  constexpr int parts = 16;
  int inside = 0;
  for (int i = 0; i < parts; ++i)
    for (int j = 0; j < parts; ++j) {
      const double u = x + step * ((i + 0.5) / parts - 0.5), v = y + step * ((j + 0.5) / parts - 0.5);
      if (u * u + v * v <= 1) ++inside;
    }
  return static_cast<double>(inside) / (parts * parts);
}

cv::Mat complex_matrix(const std::vector<std::complex<double>>& values, int size) {
  return cv::Mat(size, size, CV_64FC2, const_cast<std::complex<double>*>(values.data()));
}

}  // namespace

PupilFunction::PupilFunction(const Wavefront& wavefront, int samples_across, double padding)
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

  const double step = step_mm_ / radius_mm_;
  for (int row = -half; row <= half; ++row)
    for (int column = -half; column <= half; ++column) {
      const double x = column * step, y = row * step;
      const double amplitude = coverage(x, y, step);
      if (amplitude == 0) continue;
      const Eigen::VectorXd z = zernike_values(order, x, y);
      const int index = ((row + size_) % size_) * size_ + (column + size_) % size_;
      points_.push_back({index, amplitude, coefficients.dot(z), z[4], z[5], z[3]});
    }
}

double PupilFunction::pitch_arcmin() const {
  return wavelength_um_ / 1000 / (size_ * step_mm_) / degree * 60;
}

std::vector<double> PupilFunction::transform(const std::vector<std::complex<double>>& field) const {
  cv::Mat spectrum;
  cv::dft(complex_matrix(field, size_), spectrum);
  double area = 0;
  for (const Point& point : points_) area += point.amplitude;
  const double scale = 1 / (area * size_ * size_);
  std::vector<double> result(field.size());
  const auto* value = spectrum.ptr<std::complex<double>>();
  for (std::size_t k = 0; k < result.size(); ++k) result[k] = std::norm(value[k]) * scale;
  return result;
}

std::vector<double> PupilFunction::point_spread(const PowerVector& lens) const {
  // What the lens adds to the terms of second order: c = power r^2 / (4 sqrt 3), r^2 / (2 sqrt 6).
  const double square = radius_mm_ * radius_mm_;
  const double c4 = lens.M_D * square / (4 * std::sqrt(3.0));
  const double c5 = lens.J0_D * square / (2 * std::sqrt(6.0));
  const double c3 = lens.J45_D * square / (2 * std::sqrt(6.0));
  std::vector<std::complex<double>> field(static_cast<std::size_t>(size_) * size_);
  for (const Point& p : points_) {
    const double w = p.wavefront_um + c4 * p.defocus + c5 * p.straight + c3 * p.oblique;
    field[p.index] = std::polar(p.amplitude, 2 * pi * w / wavelength_um_);
  }
  return transform(field);
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

}  // namespace emmetrope
