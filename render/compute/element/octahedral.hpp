#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/host_device.hpp"

namespace throng::render::element {

/// Octahedral snorm16 coding of a direction (Meyer et al. 2010). The vector need not have unit
/// length; the zero vector becomes +Z.
THRONG_HOST_DEVICE inline std::uint32_t pack_octahedral(float x, float y, float z) {
  const float sum = std::fabs(x) + std::fabs(y) + std::fabs(z);
  const float scale = sum > 0.0F ? 1.0F / sum : 0.0F;
  float u = x * scale;
  float v = y * scale;
  if (z < 0.0F) {
    const float folded_u = u < 0.0F ? std::fabs(v) - 1.0F : 1.0F - std::fabs(v);
    const float folded_v = v < 0.0F ? std::fabs(u) - 1.0F : 1.0F - std::fabs(u);
    u = folded_u;
    v = folded_v;
  }
  // half away from zero, by truncation; |u| <= 1 up to rounding, so 32767 is not exceeded
  const int iu = static_cast<int>(fused(u, 32767.0F, u < 0.0F ? -0.5F : 0.5F));
  const int iv = static_cast<int>(fused(v, 32767.0F, v < 0.0F ? -0.5F : 0.5F));
  return (static_cast<std::uint32_t>(iu) & 0xffffU) | (static_cast<std::uint32_t>(iv) << 16);
}

/// The direction of a code, of length 1.
THRONG_HOST_DEVICE inline glm::vec3 unpack_octahedral(const glm::i16vec2& code) {
  float x = static_cast<float>(code.x) * (1.0F / 32767.0F);
  float y = static_cast<float>(code.y) * (1.0F / 32767.0F);
  const float z = 1.0F - std::fabs(x) - std::fabs(y);
  if (z < 0.0F) {
    const float folded_x = (1.0F - std::fabs(y)) * (x < 0.0F ? -1.0F : 1.0F);
    const float folded_y = (1.0F - std::fabs(x)) * (y < 0.0F ? -1.0F : 1.0F);
    x = folded_x;
    y = folded_y;
  }
  const float length = std::sqrt(fused(x, x, fused(y, y, z * z)));
  const float scale = 1.0F / length;
  return glm::vec3(x * scale, y * scale, z * scale);
}

}  // namespace throng::render::element
