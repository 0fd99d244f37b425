#pragma once

#include <cmath>
#include <glm/glm.hpp>

#include "render/compute/element/host_device.hpp"
#include "throng/render/representation.hpp"
#include "throng/render/vertex.hpp"

namespace throng::render::element {

/// Where a slot's vertices were in the frame before.
struct HeldVertices {
  static constexpr std::uint32_t kNothing = 0xffffffffU;
  std::uint32_t first = kNothing;  // in the vertices of that frame
  std::uint32_t count = 0, character = 0, seed = 0;
  glm::vec3 position_relative{0.0F};
};

/// True where the agent's pose is not due and was drawn just so in the frame before, from where its
/// vertices are moved (MotionUpdate).
/// @param vertices  of the frame before, in all.
THRONG_HOST_DEVICE inline bool keeps_pose(const MotionUpdate& motion, float distance_m,
                                          const VisibleInstance& instance, const HeldVertices& held,
                                          std::uint64_t vertices) {
  const float beyond_m = distance_m - motion.distance_m;
  if (!(beyond_m > 0.0F) || held.first == HeldVertices::kNothing ||
      held.count != instance.vertex_count || held.character != instance.character ||
      held.seed != instance.seed ||
      static_cast<std::uint64_t>(held.first) + held.count > vertices) {
    return false;
  }
  const float steps = std::floor(motion.k_per_m * beyond_m);
  const float most = steps < 1.0e6F ? steps : 1.0e6F;
  const std::uint64_t every = 1 + static_cast<std::uint64_t>(most > 0.0F ? most : 0.0F);
  return (motion.frame + instance.slot) % every != 0;
}

/// A vertex of the frame before, where its agent is now.
THRONG_HOST_DEVICE inline BatchVertex moved_vertex(BatchVertex vertex,
                                                   const VisibleInstance& instance,
                                                   const HeldVertices& held,
                                                   std::uint32_t visible) {
  vertex.position_relative += instance.position_relative - held.position_relative;
  vertex.visible = visible;
  return vertex;
}

}  // namespace throng::render::element
