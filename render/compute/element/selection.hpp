#pragma once

#include <cstring>
#include <glm/glm.hpp>

#include "render/compute/element/host_device.hpp"

namespace throng::render::element {

/// How big a sphere looks: for w_i = A_i / D_i of equation 1.
struct Projection {
  float focal_px = 1.0F;      // perspective: pixels of 1 m at 1 m; orthographic: pixels of 1 m
  float viewport_px2 = 1.0F;  // A_i is at most this
  std::uint32_t perspective = 1;
};

/// A_i / D_i of a sphere `distance_m` from the eye. A: area of the projected sphere in px^2, at
/// most the viewport. D: distance, at least the radius; 1 without perspective, where it says
/// nothing.
THRONG_HOST_DEVICE inline float selection_weight(const Projection& projection, float radius_m,
                                                 float distance_m) {
  const float d =
      projection.perspective != 0 ? (distance_m < radius_m ? radius_m : distance_m) : 1.0F;
  const float radius_px = projection.focal_px * radius_m / d;
  const float area_px2 = 3.14159265F * radius_px * radius_px;
  return (area_px2 < projection.viewport_px2 ? area_px2 : projection.viewport_px2) / d;
}

/// Cube root of a positive, normal number by Newton's method from a guess that divides the exponent
/// by three. Same bits everywhere; within 2 units in the last place.
THRONG_HOST_DEVICE inline float cube_root(float x) {
  std::uint32_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  bits = bits / 3 + 709921077U;
  float y;
  std::memcpy(&y, &bits, sizeof y);
  for (int i = 0; i < 3; ++i) y = fused(2.0F, y, x / (y * y)) * (1.0F / 3.0F);
  return y;
}

inline constexpr std::uint32_t kLargestShare = 0x7fffffffU;

/// w^(1/3) as an integer (2^-20 units), so that sums don't depend on their order. At least 1.
THRONG_HOST_DEVICE inline std::uint32_t selection_share(float weight) {
  const float root = cube_root(weight > 1e-30F ? weight : 1e-30F) * 1048576.0F;
  if (!(root < 2147483000.0F)) return kLargestShare;
  return root < 1.0F ? 1U : static_cast<std::uint32_t>(root);
}

/// Vertices for a share: clamp(floor(rate * share), least, most). `rate` = N / sum of shares with
/// 32 fractional bits.
THRONG_HOST_DEVICE inline std::uint32_t deal(std::uint64_t rate, std::uint32_t share,
                                             std::uint32_t least, std::uint32_t most) {
  // (rate * share) >> 32 in 64 bits, saturated
  const std::uint64_t low = ((rate & 0xffffffffU) * share) >> 32;
  const std::uint64_t high = (rate >> 32) * share;
  const std::uint64_t dealt = high + low;
  return dealt <= least ? least : (dealt >= most ? most : static_cast<std::uint32_t>(dealt));
}

}  // namespace throng::render::element
