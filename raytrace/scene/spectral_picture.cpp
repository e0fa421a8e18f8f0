#include <algorithm>
#include <cmath>

#include "raytrace/picture/spectrum.hpp"
#include "raytrace/scene/scene_model.hpp"

namespace emmetrope::raytrace {

Texture SpectralPicture::at(double nm) const {
  Texture result = pages.front();
  const auto after = std::lower_bound(wavelength_nm.begin(), wavelength_nm.end(), nm);
  if (after == wavelength_nm.end() || (after == wavelength_nm.begin() && nm < *after)) {
    std::fill(result.values.begin(), result.values.end(), 0.F);
    return result;
  }
  const std::size_t next = after - wavelength_nm.begin();
  if (next == 0) return result;
  const auto share =
      static_cast<float>((nm - wavelength_nm[next - 1]) / (wavelength_nm[next] - wavelength_nm[next - 1]));
  for (std::size_t i = 0; i < result.values.size(); ++i)
    result.values[i] = (1 - share) * pages[next - 1].values[i] + share * pages[next].values[i];
  return result;
}

Texture SpectralPicture::coloured() const {
  const Eigen::Matrix3d rgb_from_xyz = srgb_from_xyz();
  Texture result{pages.front().width, pages.front().height, 3, {}};
  std::vector<Eigen::Vector3d> colours(pages.front().values.size(), Eigen::Vector3d::Zero());
  for (std::size_t page = 0; page < pages.size(); ++page) {
    // Trapezia over the wavelengths that there are.
    const double before = page > 0 ? wavelength_nm[page] - wavelength_nm[page - 1] : 0,
                 after = page + 1 < pages.size() ? wavelength_nm[page + 1] - wavelength_nm[page] : 0;
    const Eigen::Vector3d observer =
        (pages.size() > 1 ? 0.5 * (before + after) : 1) * cie_1931(wavelength_nm[page]);
    for (std::size_t i = 0; i < colours.size(); ++i) colours[i] += pages[page].values[i] * observer;
  }
  double brightest = 0;
  for (Eigen::Vector3d& value : colours) {
    value = rgb_from_xyz * value;
    brightest = std::max(brightest, value.maxCoeff());
  }
  // All texels by one factor: a channel cut off would be another colour.
  for (const Eigen::Vector3d& rgb : colours)
    for (int c = 0; c < 3; ++c)
      result.values.push_back(static_cast<float>(std::max(rgb[c], 0.0) / std::max(brightest, 1e-30)));
  return result;
}

}  // namespace emmetrope::raytrace
