#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/skinning.hpp"

namespace throng::render::element {

/// Columns of a posed mesh start on a cache line.
inline constexpr std::uint32_t kPosedLanes = 16;

/// A posed mesh's values for a stride of so many vertices (FrameGeometry::posed).
THRONG_HOST_DEVICE inline constexpr std::uint64_t posed_values(std::uint32_t stride) {
  return 16 + static_cast<std::uint64_t>(4) * stride;
}

/// A vertex of a shared pose where its agent stands, relative to the eye: in this order on every
/// backend, so that batched and fused geometry are the same bits.
THRONG_HOST_DEVICE inline glm::vec3 place_posed(const glm::vec3& feet_relative, float cosine_scale,
                                                float sine_scale, float scale, const glm::vec3& p) {
  return feet_relative + glm::vec3(p.x * cosine_scale - p.y * sine_scale,
                                   p.x * sine_scale + p.y * cosine_scale, p.z * scale);
}

/// Its normal, of any length.
THRONG_HOST_DEVICE inline glm::vec3 turn_posed(float cosine_scale, float sine_scale, float scale,
                                               const glm::vec3& n) {
  return glm::vec3(n.x * cosine_scale - n.y * sine_scale, n.x * sine_scale + n.y * cosine_scale,
                   n.z * scale);
}

}  // namespace throng::render::element
