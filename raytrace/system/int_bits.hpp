#pragma once
#include <cstdint>
#include <cstring>

namespace emmetrope::raytrace {

/// An integer among the floats of a kernel's table, which reads it with as_int.
template <typename Integer>
float int_bits(Integer value) {
  const auto integer = static_cast<std::int32_t>(value);
  float result = 0;
  std::memcpy(&result, &integer, sizeof result);
  return result;
}

}  // namespace emmetrope::raytrace
