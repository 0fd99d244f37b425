#pragma once

#include <cstring>
#include <glm/glm.hpp>

#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/skinning.hpp"
#include "throng/render/vertex.hpp"

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

/// How a shared pose stands: larger than its agent where that one stands for several.
THRONG_HOST_DEVICE inline Placement shared_placement(const Placement& placement, float scale) {
  if (scale == placement.scale) return placement;
  const float larger = scale / placement.scale;
  return {larger * placement.cosine_scale, larger * placement.sine_scale, scale};
}

/// A point of a shared pose where its agent stands.
THRONG_HOST_DEVICE inline Splat shared_splat(const glm::vec3& feet_relative,
                                             const Placement& placed, const glm::vec3& p,
                                             const glm::i16vec2& normal, float radius_m,
                                             std::uint32_t base, std::uint32_t regions,
                                             std::uint32_t visible) {
  const float cosine = placed.cosine_scale / placed.scale;
  const float sine = placed.sine_scale / placed.scale;
  Splat splat;
  splat.position_relative =
      feet_relative + glm::vec3(p.x * placed.cosine_scale - p.y * placed.sine_scale,
                                p.x * placed.sine_scale + p.y * placed.cosine_scale,
                                p.z * placed.scale);
  splat.radius_m = radius_m;
  const glm::vec3 turned = unpack_octahedral(normal);
  const std::uint32_t code = pack_octahedral(turned.x * cosine - turned.y * sine,
                                             turned.x * sine + turned.y * cosine, turned.z);
  memcpy(&splat.normal, &code, sizeof code);
  splat.base = base;
  splat.regions = regions;
  splat.visible = visible;
  return splat;
}

}  // namespace throng::render::element
