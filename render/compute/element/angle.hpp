#pragma once

#include "render/compute/element/host_device.hpp"

namespace throng::render::element {

inline constexpr float kPi = 3.14159265358979F;
inline constexpr float kTwoPi = 6.28318530717959F;

struct SinCos {
  float sine, cosine;
};

/// Sine and cosine by their Taylor series around the nearest multiple of pi/2. The argument is a
/// wrapped angle (|angle_rad| < 100); the error stays under 1e-6. Written out because the
/// libraries of two backends differ in the last bit.
THRONG_HOST_DEVICE inline SinCos sin_cos(float angle_rad) {
  const float quarter = std::floor(fused(angle_rad, 0.636619772F, 0.5F));
  // pi/2 in two parts: the first has few enough bits for quarter * part to be exact
  float r = fused(-quarter, 1.5703125F, angle_rad);
  r = fused(-quarter, 4.83826794897e-4F, r);
  const float r2 = r * r;
  float s = fused(r2, 1.0F / 362880.0F, -1.0F / 5040.0F);
  s = fused(s, r2, 1.0F / 120.0F);
  s = fused(s, r2, -1.0F / 6.0F);
  s = fused(s * r2, r, r);
  float c = fused(r2, 1.0F / 40320.0F, -1.0F / 720.0F);
  c = fused(c, r2, 1.0F / 24.0F);
  c = fused(c, r2, -0.5F);
  c = fused(c, r2, 1.0F);
  const int quadrant = static_cast<int>(quarter) & 3;
  const float sine = (quadrant & 1) != 0 ? c : s;
  const float cosine = (quadrant & 1) != 0 ? s : c;
  return {quadrant >= 2 ? -sine : sine, quadrant == 1 || quadrant == 2 ? -cosine : cosine};
}

/// The angle in [-pi, pi] that differs by whole turns.
THRONG_HOST_DEVICE inline float wrap_angle(float angle_rad) {
  return fused(-kTwoPi, std::floor(fused(angle_rad, 1.0F / kTwoPi, 0.5F)), angle_rad);
}

/// From `from_rad` to `to_rad` along the shorter arc.
THRONG_HOST_DEVICE inline float lerp_angle(float from_rad, float to_rad, float t) {
  return wrap_angle(fused(t, wrap_angle(to_rad - from_rad), from_rad));
}

}  // namespace throng::render::element
