#pragma once

#include <cmath>
#include <concepts>

namespace throng::render {

/// The transfer curve of sRGB (IEC 61966-2-1), exact; shaders have quicker ones within a code of
/// it.
/// @param coded  0 to 1
/// @return linear light, 0 to 1
template <std::floating_point T>
T srgb_to_linear(T coded) {
  return coded <= T(0.04045) ? coded / T(12.92) : std::pow((coded + T(0.055)) / T(1.055), T(2.4));
}

/// The inverse of `srgb_to_linear`.
template <std::floating_point T>
T linear_to_srgb(T linear) {
  return linear <= T(0.0031308) ? linear * T(12.92)
                                : T(1.055) * std::pow(linear, T(1.0 / 2.4)) - T(0.055);
}

}  // namespace throng::render
