#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/advance.hpp"
#include "render/compute/element/hash.hpp"
#include "render/compute/element/selection.hpp"
#include "render/compute/element/visible.hpp"

namespace throng::render::element {

/// The time of a frame is estimated from at most so many of the agents in view.
inline constexpr std::uint32_t kWorkSamples = 4096;

/// Every so many of `visible` agents are looked at.
THRONG_HOST_DEVICE inline std::uint32_t work_step(std::uint32_t visible) {
  return visible / kWorkSamples + 1;
}

/// How large an agent in view is.
struct WorkSize {
  float px_per_m, height_px, radius_px;
  float limit;  // of the agent: about 1
  std::uint32_t character;
};

/// @param height_m  of the character, unscaled.
THRONG_HOST_DEVICE inline WorkSize work_size(const Projection& projection,
                                             const InstanceState& state, const glm::vec4& sphere_m,
                                             float height_m, const glm::dvec3& eye_offset_m) {
  const float distance_m = distance_of(relative_sphere(sphere_m, eye_offset_m));
  const float depth_m =
      projection.perspective != 0 ? (distance_m < sphere_m.w ? sphere_m.w : distance_m) : 1.0F;
  WorkSize size;
  size.px_per_m = projection.focal_px / depth_m;
  size.height_px = size.px_per_m * state.placement.scale * height_m;
  size.radius_px = size.px_per_m * sphere_m.w;
  size.limit = 0.9F + 0.2F * unit_from_seed(state.seed, kSeedForm);
  size.character = state.character;
  return size;
}

}  // namespace throng::render::element
