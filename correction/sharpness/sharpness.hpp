#pragma once
#include <array>
#include <string>
#include <vector>

namespace emmetrope::correction {

/// A picture in linear light, row after row.
struct GreyImage {
  int width = 0, height = 0;
  std::vector<double> values;
};

/// How sharpness is measured. Each is a quadratic form of the picture: the sum over spatial frequencies f of
/// weight(f) times the squared modulus of the picture's spectrum.
enum class SharpnessCriterion {
  gradient_energy,     ///< weight (2 pi f)^2: mean squared slope
  laplacian_variance,  ///< weight (2 pi f)^4: mean squared Laplacian
  mtf_weighted,  ///< weight f^3 CSF(f)^2: on a chart of edges, whose power falls as f^-3, the mean of MTF^2
                 ///< under the eye's contrast sensitivity, the image-domain relative of VSMTF (Thibos et al.
                 ///< 2004)
};
inline constexpr std::array all_criteria{SharpnessCriterion::gradient_energy,
                                         SharpnessCriterion::laplacian_variance,
                                         SharpnessCriterion::mtf_weighted};
std::string to_string(SharpnessCriterion criterion);
/// \throw Error (usage) listing the criteria
SharpnessCriterion criterion_from_string(const std::string& name);

/// Energy of the detail in a picture, and its derivative. The picture is divided by its mean, so brightness
/// does not count, and windowed (Hann), so that what leaves the frame does not count either.
class SharpnessMeasure {
 public:
  /// \param pixel_arcmin  visual angle of a pixel
  /// \param blur_arcmin  standard deviation of a Gaussian that is applied first: detail much finer than it
  ///   does not count; it keeps sampling noise out and makes coarse levels
  SharpnessMeasure(SharpnessCriterion criterion, int width, int height, double pixel_arcmin,
                   double blur_arcmin);

  struct Energy {
    double value = 0;
    GreyImage gradient;  ///< d value / d pixel
  };
  /// \pre the picture has the size given at construction
  Energy operator()(const GreyImage& image) const;

 private:
  int width_, height_;
  std::vector<double> window_;   ///< sums to 1
  std::vector<double> weights_;  ///< by frequency, in the layout of a full complex spectrum
};

}  // namespace emmetrope::correction
