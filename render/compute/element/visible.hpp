#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/advance.hpp"
#include "throng/render/vertex.hpp"

namespace throng::render::element {

/// A point seen from the eye; subtracted in float64, so that a crowd far out stays exact.
THRONG_HOST_DEVICE inline glm::vec3 relative(float x, float y, float z,
                                             const glm::dvec3& eye_offset_m) {
  return glm::vec3(static_cast<float>(static_cast<double>(x) - eye_offset_m.x),
                   static_cast<float>(static_cast<double>(y) - eye_offset_m.y),
                   static_cast<float>(static_cast<double>(z) - eye_offset_m.z));
}

/// The bounding sphere (xyz, radius), relative to the eye.
THRONG_HOST_DEVICE inline glm::vec4 relative_sphere(const glm::vec4& sphere_m,
                                                    const glm::dvec3& eye_offset_m) {
  const glm::vec3 center = relative(sphere_m.x, sphere_m.y, sphere_m.z, eye_offset_m);
  return glm::vec4(center.x, center.y, center.z, sphere_m.w);
}

THRONG_HOST_DEVICE inline float distance_of(const glm::vec4& relative_sphere) {
  const glm::vec4& s = relative_sphere;
  return std::sqrt(fused(s.x, s.x, fused(s.y, s.y, s.z * s.z)));
}

/// From the eye to an agent's feet: what decides who is drawn as a part of the far crowd.
THRONG_HOST_DEVICE inline float feet_distance(const glm::vec3& p, const glm::dvec3& eye_offset_m) {
  const glm::vec3 feet = relative(p.x, p.y, p.z, eye_offset_m);
  return distance_of(glm::vec4(feet.x, feet.y, feet.z, 0.0F));
}

/// Whether the eye is within somebody: nearer than the near plane keeps whole, a head would be cut
/// open. Such an agent is not drawn.
/// @param place  feet, from the crowd's origin, and scale.
THRONG_HOST_DEVICE inline bool is_at_eye(const glm::vec4& place, const glm::dvec3& eye_offset_m) {
  constexpr float kWithinM = 0.35F, kTallestM = 2.0F;
  const glm::vec3 feet = relative(place.x, place.y, place.z, eye_offset_m);
  return fused(feet.x, feet.x, feet.y * feet.y) < kWithinM * kWithinM && feet.z < kWithinM &&
         -feet.z < fused(kTallestM, place.w, kWithinM);
}

/// What a slot that is seen becomes, before LOD selection.
THRONG_HOST_DEVICE inline VisibleInstance make_visible(const InstanceState& state, float radius_m,
                                                       std::uint32_t slot,
                                                       const glm::dvec3& eye_offset_m) {
  VisibleInstance visible;
  const glm::vec3 drawn_m = drawn_at(state);
  visible.position_relative = relative(drawn_m.x, drawn_m.y, drawn_m.z, eye_offset_m);
  visible.heading_rad = state.heading_rad;
  visible.slot = slot;
  visible.character = state.character;
  visible.seed = state.seed;
  visible.scale = state.placement.scale;
  visible.channel = state.channel;
  visible.radius_m = radius_m;
  visible.vertex_count = 0;
  visible.triangle_count = 0;
  return visible;
}

}  // namespace throng::render::element
