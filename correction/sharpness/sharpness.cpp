#include "correction/sharpness/sharpness.hpp"

#include <cmath>
#include <numeric>
#include <opencv2/core.hpp>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "raytrace/wavefront/contrast_sensitivity.hpp"

namespace emmetrope::correction {
namespace {

/// Signed frequency of a bin of a discrete transform of `size` samples, cycles per sample.
double frequency(int bin, int size) { return static_cast<double>(bin <= size / 2 ? bin : bin - size) / size; }

double weight(SharpnessCriterion criterion, double cycles_per_degree) {
  const double angular = 2 * pi * cycles_per_degree;
  switch (criterion) {
    case SharpnessCriterion::gradient_energy:
      return angular * angular;
    case SharpnessCriterion::laplacian_variance:
      return std::pow(angular, 4);
    case SharpnessCriterion::mtf_weighted:
      return std::pow(cycles_per_degree * raytrace::contrast_sensitivity(cycles_per_degree), 2) *
             cycles_per_degree;
  }
  return 0;
}

}  // namespace

std::string to_string(SharpnessCriterion criterion) {
  switch (criterion) {
    case SharpnessCriterion::gradient_energy:
      return "gradient-energy";
    case SharpnessCriterion::laplacian_variance:
      return "laplacian-variance";
    case SharpnessCriterion::mtf_weighted:
      return "mtf-weighted";
  }
  return {};
}

SharpnessCriterion criterion_from_string(const std::string& name) {
  for (const SharpnessCriterion criterion : all_criteria)
    if (to_string(criterion) == name) return criterion;
  throw usage_error("--criterion \"" + name + "\" is not known",
                    "choose gradient-energy, laplacian-variance or mtf-weighted");
}

SharpnessMeasure::SharpnessMeasure(SharpnessCriterion criterion, int width, int height, double pixel_arcmin,
                                   double blur_arcmin)
    : width_(width), height_(height) {
  const std::size_t count = static_cast<std::size_t>(width) * height;
  window_.resize(count);
  weights_.resize(count);
  const double pixels_per_degree = 60 / pixel_arcmin;
  for (int row = 0; row < height; ++row)
    for (int column = 0; column < width; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * width + column;
      window_[i] = std::pow(std::sin(pi * (row + 0.5) / height) * std::sin(pi * (column + 0.5) / width), 2);
      const double f_cpd = std::hypot(frequency(row, height), frequency(column, width)) * pixels_per_degree;
      const double phase = 2 * pi * f_cpd * blur_arcmin / 60;
      weights_[i] = weight(criterion, f_cpd) * std::exp(-phase * phase);
    }
  const double window_sum = std::accumulate(window_.begin(), window_.end(), 0.0);
  for (double& w : window_) w /= window_sum;
}

SharpnessMeasure::Energy SharpnessMeasure::operator()(const GreyImage& image) const {
  const std::size_t count = window_.size();
  if (image.width != width_ || image.height != height_ || image.values.size() != count)
    throw Error(ExitStatus::fault, "a picture of another size was given to a sharpness measure");
  const double mean = std::inner_product(window_.begin(), window_.end(), image.values.begin(), 0.0);
  if (!(mean > 0)) throw no_result_error("the retinal image is black", "give a scene that the eye can see");

  cv::Mat detail(height_, width_, CV_64F);
  auto* pixels = detail.ptr<double>();
  for (std::size_t i = 0; i < count; ++i) pixels[i] = window_[i] * (image.values[i] / mean - 1);
  cv::Mat spectrum;
  cv::dft(detail, spectrum, cv::DFT_COMPLEX_OUTPUT);
  Energy energy;
  auto* bins = spectrum.ptr<cv::Vec2d>();
  for (std::size_t i = 0; i < count; ++i) {
    energy.value += weights_[i] * bins[i].dot(bins[i]);
    bins[i] *= weights_[i];
  }
  // The quadratic form's gradient is twice the filtered detail, back through the window and the division by
  // the mean.
  cv::Mat filtered;
  cv::dft(spectrum, filtered, cv::DFT_INVERSE | cv::DFT_REAL_OUTPUT);
  energy.gradient = {width_, height_, std::vector<double>(count)};
  const auto* back = filtered.ptr<double>();
  double along_image = 0;
  for (std::size_t i = 0; i < count; ++i) {
    energy.gradient.values[i] = 2 * window_[i] * back[i] / mean;
    along_image += energy.gradient.values[i] * image.values[i];
  }
  for (std::size_t i = 0; i < count; ++i) energy.gradient.values[i] -= along_image / mean * window_[i];
  return energy;
}

}  // namespace emmetrope::correction
