#include "correction/search/retinal_sharpness.hpp"

#include <cmath>
#include <functional>

#include "pipeline/base/error.hpp"
#include "pipeline/base/frames.hpp"
#include "pipeline/eye/optics/paraxial.hpp"

namespace emmetrope::correction {
namespace {

constexpr double pinhole_mm = 0.02;
constexpr int pinhole_samples = 16;  ///< they only average the scene over a pixel

GreyImage luminance(const raytrace::LinearImage& image) {
  GreyImage grey{image.width, image.height, {}};
  grey.values.reserve(static_cast<std::size_t>(image.width) * image.height);
  for (int row = 0; row < image.height; ++row)
    for (int column = 0; column < image.width; ++column)
      grey.values.push_back(image.channels == 1
                                ? image.at(column, row, 0)
                                : 0.2126 * image.at(column, row, 0) + 0.7152 * image.at(column, row, 1) +
                                      0.0722 * image.at(column, row, 2));
  return grey;
}

/// Energy of an image's detail and the derivative of its logarithm by the lens's parameters.
struct LogEnergy {
  double energy = 0;
  Eigen::VectorXd gradient;
};

LogEnergy log_energy(const SharpnessMeasure& measure, const raytrace::TraceResult& traced) {
  const SharpnessMeasure::Energy energy = measure(luminance(traced.image));
  LogEnergy result{energy.value, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(traced.derivatives.size()))};
  for (std::size_t k = 0; k < traced.derivatives.size(); ++k) {
    const GreyImage derivative = luminance(traced.derivatives[k]);
    double slope = 0;
    for (std::size_t i = 0; i < derivative.values.size(); ++i)
      slope += energy.gradient.values[i] * derivative.values[i];
    result.gradient[static_cast<Eigen::Index>(k)] = slope / energy.value;
  }
  return result;
}

}  // namespace

double arcmin_per_mm(const EyeModel& eye, double wavelength_nm) {
  const double nodal_to_retina_mm =
      eye.axial_length_mm() - cardinal_points(eye, wavelength_nm).image_nodal_mm;
  return 60 / (degree * nodal_to_retina_mm);
}

EyeModel with_pupil(EyeModel eye, double pupil_mm) {
  for (Surface& surface : eye.surfaces)
    if (surface.is_stop()) {
      surface.stop_diameter_mm = pupil_mm;
      return eye;
    }
  throw input_error("eye \"" + eye.name + "\" has no stop, so no pupil can be set",
                    "add a surface of type \"stop\" in front of the lens");
}

double ImagingLevel::depth_of_focus_D() const {
  // A disc of diameter D has the standard deviation D / 4 along a line; an error of 1 D makes the pupil's
  // width in metres the disc's diameter in radians.
  const double arcmin_per_D = 60 / degree * 1e-3 * pupil_mm / 4;
  return blur_arcmin / arcmin_per_D;
}

RetinalSharpness::RetinalSharpness(const raytrace::Tracer& tracer,
                                   std::shared_ptr<const raytrace::Scene> scene, EyeModel eye,
                                   LensFamily family, ImagingLevel level)
    : tracer_(tracer),
      scene_(std::move(scene)),
      eye_(with_pupil(eye, level.pupil_mm)),
      pinhole_eye_(with_pupil(std::move(eye), pinhole_mm)),
      family_(std::move(family)),
      level_(std::move(level)),
      pixel_arcmin_(arcmin_per_mm(eye_, level_.wavelength_nm) * level_.field_mm / level_.pixels),
      measure_(level_.criterion, level_.pixels, level_.pixels, pixel_arcmin_, level_.blur_arcmin) {}

raytrace::TraceResult RetinalSharpness::trace(const EyeModel& eye, const Eigen::VectorXd& lens, int samples,
                                              bool derivatives) const {
  raytrace::TraceSettings settings;
  settings.grid = {level_.pixels, level_.pixels, level_.field_mm, level_.field_mm, level_.centre_mm};
  settings.samples = samples;
  settings.seed = level_.seed;
  settings.wavelength_nm = level_.wavelength_nm;
  // Lenses as formulas, whose derivatives are exact; an eye's meshes are smooth patches in this
  // representation too.
  settings.representation = raytrace::Representation::analytic;
  settings.verbosity.quiet = true;
  raytrace::TraceResult traced =
      tracer_.trace(family_.before(eye, lens), *scene_, settings,
                    derivatives ? family_.tangents(eye, lens) : std::vector<raytrace::EyeTangent>{});
  rays_ += traced.rays;
  return traced;
}

SharpnessValue RetinalSharpness::operator()(const Eigen::VectorXd& lens) const {
  const LogEnergy image = log_energy(measure_, trace(eye_, lens, level_.samples, true));
  const LogEnergy pinhole = log_energy(measure_, trace(pinhole_eye_, lens, pinhole_samples, true));
  ++images_;
  if (!(pinhole.energy > 0))
    throw no_result_error("the chart shows no detail on the retina, so no lens can make it sharper",
                          "choose another --chart");
  const double sharpness = image.energy / pinhole.energy;
  return {sharpness, sharpness * (image.gradient - pinhole.gradient)};
}

std::array<double, all_criteria.size()> RetinalSharpness::by_all_criteria(const Eigen::VectorXd& lens) const {
  const GreyImage image = luminance(trace(eye_, lens, level_.samples, false).image);
  const GreyImage pinhole = luminance(trace(pinhole_eye_, lens, pinhole_samples, false).image);
  ++images_;
  std::array<double, all_criteria.size()> sharpness{};
  for (std::size_t i = 0; i < all_criteria.size(); ++i) {
    const SharpnessMeasure measure(all_criteria[i], level_.pixels, level_.pixels, pixel_arcmin_,
                                   level_.blur_arcmin);
    sharpness[i] = measure(image).value / measure(pinhole).value;
  }
  return sharpness;
}

Optimum ascend(const RetinalSharpness& sharpness, const Eigen::VectorXd& start, OptimiserSettings settings) {
  settings.depth_of_focus_D = sharpness.level().depth_of_focus_D();
  return ascend(std::cref(sharpness), start, sharpness.family().bounds, settings);
}

}  // namespace emmetrope::correction
