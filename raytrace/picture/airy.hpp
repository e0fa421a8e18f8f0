#pragma once
#include <array>
#include <vector>

#include "raytrace/picture/spectrum.hpp"

namespace emmetrope::raytrace {

/// What kernels/light.cl takes to bend rays as a round pupil diffracts them: the Airy disc's encircled
/// energy 1 - J0(v)^2 - J1(v)^2 (Rayleigh 1881; Born and Wolf 8.5.2), v = pi pupil angle / wavelength,
/// inverted.
std::vector<float> airy_table(const std::array<double, wavelength_count>& wavelength_nm, double pupil_mm);

}  // namespace emmetrope::raytrace
