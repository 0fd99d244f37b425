#include "render/compute/common.hpp"
#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/stages.hpp"

namespace throng::render {

void cull(CpuView& view, const Camera& camera, const Viewport& viewport, Machine machine) {
  constexpr std::size_t kChunk = 2048;
  const CpuInstances& instances = *view.instances;
  const std::size_t slots = instances.count;
  view.projection = projection_of(camera, viewport);
  view.mask.resize(slots);
  CullJob job;
  view.clip_from_relative = clip_from_relative(camera, viewport);
  job.frustum = element::frustum_from(view.clip_from_relative);
  job.eye_offset_m = camera.eye_world - instances.origin_world;
  job.sphere_m = instances.sphere_m.data();
  job.state = instances.state.data();
  job.mask = view.mask.data();

  // mask and count, then a prefix sum over the chunks: the visible list keeps the order of slots
  view.chunk_count.assign((slots + kChunk - 1) / kChunk, 0);
  machine.pool.for_chunks(slots, kChunk, [&](std::size_t begin, std::size_t end) {
    view.chunk_count[begin / kChunk] = machine.kernels.cull(job, begin, end);
  });
  std::uint32_t visible = 0;
  for (std::uint32_t& count : view.chunk_count) {
    const std::uint32_t own = count;
    count = visible;
    visible += own;
  }

  view.visible.resize(visible);
  view.distance_m.resize(visible);
  job.visible = view.visible.data();
  job.distance_m = view.distance_m.data();
  machine.pool.for_chunks(slots, kChunk, [&](std::size_t begin, std::size_t end) {
    machine.kernels.compact(job, begin, end, view.chunk_count[begin / kChunk]);
  });
}

}  // namespace throng::render
