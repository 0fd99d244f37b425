#include <cmath>

#include "render/compute/cpu/stages.hpp"
#include "render/compute/element/frustum.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kChunk = 2048;

glm::vec3 relative(const glm::vec3& offset_m, const glm::dvec3& eye_offset_m) {
  return {static_cast<float>(static_cast<double>(offset_m.x) - eye_offset_m.x),
          static_cast<float>(static_cast<double>(offset_m.y) - eye_offset_m.y),
          static_cast<float>(static_cast<double>(offset_m.z) - eye_offset_m.z)};
}

}  // namespace

void cull(CpuView& view, const Camera& camera, const Viewport& viewport, WorkPool& pool) {
  const CpuInstances& instances = *view.instances;
  const std::size_t slots = instances.count;
  const glm::dvec3 eye_offset_m = camera.eye_world - instances.origin_world;
  const element::Frustum frustum = element::frustum_from(clip_from_relative(camera, viewport));
  view.projection.perspective = camera.ortho_height_m > 0.0 ? 0 : 1;
  view.projection.focal_px = static_cast<float>(
      camera.ortho_height_m > 0.0 ? viewport.height_px / camera.ortho_height_m
                                  : 0.5 * viewport.height_px / std::tan(0.5 * camera.fov_y_rad));
  view.projection.viewport_px2 =
      static_cast<float>(viewport.width_px) * static_cast<float>(viewport.height_px);

  // mask and count, then a prefix sum over the chunks: the visible list keeps the order of slots
  view.mask.resize(slots);
  const std::size_t chunks = (slots + kChunk - 1) / kChunk;
  view.chunk_count.assign(chunks, 0);
  pool.for_chunks(slots, kChunk, [&](std::size_t begin, std::size_t end) {
    std::uint32_t count = 0;
    for (std::size_t slot = begin; slot < end; ++slot) {
      const glm::vec4& sphere_m = instances.sphere_m[slot];
      const glm::vec4 sphere_relative(relative(glm::vec3(sphere_m), eye_offset_m), sphere_m.w);
      const std::uint8_t is_visible = element::touches(frustum, sphere_relative) ? 1 : 0;
      view.mask[slot] = is_visible;
      count += is_visible;
    }
    view.chunk_count[begin / kChunk] = count;
  });
  std::uint32_t visible = 0;
  for (std::uint32_t& count : view.chunk_count) {
    const std::uint32_t own = count;
    count = visible;
    visible += own;
  }

  view.visible.resize(visible);
  view.distance_m.resize(visible);
  pool.for_chunks(slots, kChunk, [&](std::size_t begin, std::size_t end) {
    std::uint32_t next = view.chunk_count[begin / kChunk];
    for (std::size_t slot = begin; slot < end; ++slot) {
      if (view.mask[slot] == 0) continue;
      const InstanceState& state = instances.state[slot];
      const glm::vec4& sphere_m = instances.sphere_m[slot];
      const glm::vec3 center = relative(glm::vec3(sphere_m), eye_offset_m);
      view.distance_m[next] = std::sqrt(element::fused(
          center.x, center.x, element::fused(center.y, center.y, center.z * center.z)));
      view.visible[next] = {relative(state.position_m, eye_offset_m),
                            state.heading_rad,
                            static_cast<std::uint32_t>(slot),
                            state.character,
                            state.seed,
                            state.placement.scale,
                            state.channel,
                            sphere_m.w,
                            0,
                            0};
      ++next;
    }
  });
}

}  // namespace throng::render
