#pragma once
#include <Eigen/Core>
#include <array>
#include <memory>
#include <optional>

#include "correction/search/lens_family.hpp"
#include "correction/search/optimise.hpp"
#include "correction/sharpness/sharpness.hpp"
#include "raytrace/scene/scene.hpp"
#include "raytrace/tracer/tracer.hpp"

namespace emmetrope::correction {

/// How a retinal image is made and judged. One level of the coarse-to-fine search.
struct ImagingLevel {
  SharpnessCriterion criterion = SharpnessCriterion::gradient_energy;
  int pixels = 192;        ///< width and height
  double field_mm = 1.2;   ///< width and height on the retina
  int samples = 32;        ///< rays a pixel
  double blur_arcmin = 1;  ///< detail finer than this does not count
  double pupil_mm = 3;     ///< iris aperture
  double wavelength_nm = 589.3;
  Eigen::Vector2d centre_mm{0, 0};  ///< on the retina from the pole
  std::uint64_t seed = 1;

  /// Error of focus that adds 1 to 1 / sharpness^2: where the disc of blur has, along a line, the standard
  /// deviation of `blur_arcmin`. Exact for gradient energy of a chart that falls as f^-3 with a Gaussian
  /// blur.
  double depth_of_focus_D() const;
};

/// Sharpness of the retinal image behind a lens of a family: the energy of the image's detail over that of
/// the same scene through the same lens and a pinhole. The pinhole's image has the same magnification,
/// distortion, brightness and scene but no blur, so the ratio is the mean of MTF^2 over the scene's detail,
/// and neither magnification nor brightness nor the choice of the scene's contrast can raise it. The same
/// rays serve every lens (common random numbers), so that it is a smooth function; its gradient comes from
/// the tracer's derivative images.
class RetinalSharpness {
 public:
  RetinalSharpness(const raytrace::Tracer& tracer, std::shared_ptr<const raytrace::Scene> scene, EyeModel eye,
                   LensFamily family, ImagingLevel level);

  SharpnessValue operator()(const Eigen::VectorXd& lens) const;

  /// The same image judged by each criterion, in the order of `all_criteria`.
  std::array<double, all_criteria.size()> by_all_criteria(const Eigen::VectorXd& lens) const;

  const LensFamily& family() const { return family_; }
  const ImagingLevel& level() const { return level_; }

  /// Retinal images traced until now (a pinhole's costs no more than a pixel's few rays and is not counted).
  int images() const { return images_; }
  std::uint64_t rays() const { return rays_; }

 private:
  raytrace::TraceResult trace(const EyeModel& eye, const Eigen::VectorXd& lens, int samples,
                              bool derivatives) const;

  const raytrace::Tracer& tracer_;
  std::shared_ptr<const raytrace::Scene> scene_;
  EyeModel eye_;  ///< with the level's pupil
  EyeModel pinhole_eye_;
  LensFamily family_;
  ImagingLevel level_;
  double pixel_arcmin_;
  SharpnessMeasure measure_;
  mutable int images_ = 0;
  mutable std::uint64_t rays_ = 0;
};

/// The ascent by retinal images, inside the family's bounds, with the level's depth of focus.
Optimum ascend(const RetinalSharpness& sharpness, const Eigen::VectorXd& start,
               OptimiserSettings settings = {});

/// The visual angle of a millimetre of retina on the axis, arcmin, by the distance from the image-side nodal
/// point.
double arcmin_per_mm(const EyeModel& eye, double wavelength_nm);

/// The eye with another iris aperture.
/// \throw Error (input_invalid) when it has no stop
EyeModel with_pupil(EyeModel eye, double pupil_mm);

}  // namespace emmetrope::correction
