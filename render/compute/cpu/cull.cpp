#include <algorithm>

#include "render/compute/common.hpp"
#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/speck_table.hpp"
#include "render/compute/cpu/stages.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kChunk = 2048;

CullJob job_of(CpuView& view) {
  CullJob job;
  job.frustum = element::frustum_from(view.clip_from_relative);
  job.eye_offset_m = view.eye_offset_m;
  job.far_m = view.far_m;
  job.is_near = view.is_near;
  job.agents = view.instances->count - view.instances->surrounding;
  job.instances = view.instances.get();
  job.mask = view.mask.data();
  view.visible.resize(view.mask_count);
  view.state.resize(view.mask_count);
  view.distance_m.resize(view.mask_count);
  job.visible = view.visible.data();
  job.state = view.state.data();
  job.distance_m = view.distance_m.data();
  return job;
}

}  // namespace

void cull(CpuView& view, const Camera& camera, const Viewport& viewport, Machine machine) {
  const CpuInstances& instances = *view.instances;
  const std::size_t slots = instances.count;
  view.projection = projection_of(camera, viewport);
  view.mask.resize(slots);
  view.clip_from_relative = clip_from_relative(camera, viewport);
  view.forward = -glm::vec3(glm::transpose(view_from_relative(camera))[2]);
  view.is_near = camera.ortho_height_m <= 0.0;
  view.eye_offset_m = camera.eye_world - instances.origin_world;
  view.mask_count = 0;
  const CullJob job = job_of(view);

  // mask and count, then a prefix sum over the chunks: visible lists keep the order of slots
  view.chunk_count.assign((slots + kChunk - 1) / kChunk, 0);
  machine.pool.for_chunks(slots, kChunk, [&](std::size_t begin, std::size_t end) {
    view.chunk_count[begin / kChunk] = machine.kernels.cull(job, begin, end);
  });
  for (std::uint32_t& count : view.chunk_count) {
    const std::uint32_t own = count;
    count = view.mask_count;
    view.mask_count += own;
  }
  view.visible_agents = view.mask_count;
  for (std::size_t slot = slots - instances.surrounding; slot < slots; ++slot) {
    view.visible_agents -= view.mask[slot];
  }
}

void list_visible(CpuView& view, WorkPool& pool, const Kernels& kernels) {
  const CullJob job = job_of(view);
  view.speck_runs.clear();
  view.speck_count = view.left_out = 0;
  pool.for_chunks(view.mask.size(), kChunk, [&](std::size_t begin, std::size_t end) {
    kernels.compact(job, begin, end, view.chunk_count[begin / kChunk]);
  });
}

void list_mixed(CpuView& view, const MixedForms& mixed, WorkPool& pool, const Kernels& kernels) {
  SplitJob job;
  job.cull = job_of(view);
  job.rule = {view.projection, view.forward, mixed};
  job.has_images = view.speck_table->has_images.data();
  view.specks.resize(view.mask_count);
  job.specks = view.specks.data();
  std::vector<Split> made(view.chunk_count.size());
  pool.for_chunks(view.mask.size(), kChunk, [&](std::size_t begin, std::size_t end) {
    made[begin / kChunk] = kernels.split(job, begin, end, view.chunk_count[begin / kChunk]);
  });
  // the visible list without its gaps; specks are too many to be moved
  view.speck_runs.clear();
  view.speck_count = view.left_out = 0;
  std::uint32_t listed = 0;
  for (std::size_t chunk = 0; chunk < made.size(); ++chunk) {
    const std::uint32_t first = view.chunk_count[chunk], own = made[chunk].listed;
    std::copy_n(view.visible.data() + first, own, view.visible.data() + listed);
    std::copy_n(view.state.data() + first, own, view.state.data() + listed);
    std::copy_n(view.distance_m.data() + first, own, view.distance_m.data() + listed);
    listed += own;
    if (made[chunk].specks != 0) view.speck_runs.push_back({first, made[chunk].specks});
    view.speck_count += made[chunk].specks;
    view.left_out += made[chunk].left_out;
  }
  view.visible.resize(listed);
  view.state.resize(listed);
  view.distance_m.resize(listed);
}

}  // namespace throng::render
