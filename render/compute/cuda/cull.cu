#include <cub/device/device_scan.cuh>

#include "render/compute/cuda/kernel.hpp"
#include "render/compute/cuda/launch.hpp"
#include "render/compute/element/visible.hpp"

namespace throng::render::cuda {
namespace {

constexpr std::uint32_t kThreads = 256;

__global__ void mask_kernel(CullJob job) {
  const std::uint32_t slot = blockIdx.x * blockDim.x + threadIdx.x;
  if (slot >= job.slots) return;
  const glm::vec4 sphere = element::relative_sphere(job.sphere_m[slot], job.eye_offset_m);
  std::uint8_t is_visible = element::touches(job.frustum, sphere) ? 1 : 0;
  if (is_visible != 0 && job.far_m > 0.0F && slot < job.agents &&
      element::feet_distance(job.state[slot].position_m, job.eye_offset_m) >= job.far_m) {
    is_visible = 0;
  }
  if (is_visible != 0 && job.is_near && slot < job.agents) {
    const element::InstanceState& state = job.state[slot];
    const glm::vec4 place(state.position_m, state.placement.scale);
    if (element::is_at_eye(place, job.eye_offset_m)) is_visible = 0;
  }
  job.mask[slot] = is_visible;
  job.order[slot] = is_visible;
}

/// Every so many of the agents in view, in the order of slots.
__global__ void sample_kernel(CullJob job) {
  const std::uint32_t slot = blockIdx.x * blockDim.x + threadIdx.x;
  if (slot >= job.agents) return;
  const std::uint32_t last = job.agents - 1;
  const std::uint32_t in_view = job.order[last] + job.mask[last];
  if (slot == last) job.counters->in_view = in_view;
  const std::uint32_t every = element::work_step(in_view), place = job.order[slot];
  if (job.mask[slot] == 0 || place % every != 0) return;
  const element::InstanceState& state = job.state[slot];
  job.work_size[place / every] =
      element::work_size(job.projection, state, job.sphere_m[slot],
                         job.character[state.character].height_m, job.eye_offset_m);
}

__global__ void compact_kernel(CullJob job) {
  const std::uint32_t slot = blockIdx.x * blockDim.x + threadIdx.x;
  if (slot >= job.slots) return;
  if (slot + 1 == job.slots) {
    job.counters->visible = job.order[slot] + job.mask[slot];
    job.counters->surrounding =
        job.agents < job.slots ? job.counters->visible - job.order[job.agents] : 0;
  }
  if (job.mask[slot] == 0) return;
  const std::uint32_t i = job.order[slot];
  const glm::vec4 sphere_m = job.sphere_m[slot];
  job.distance_m[i] = element::distance_of(element::relative_sphere(sphere_m, job.eye_offset_m));
  job.visible[i] = element::make_visible(job.state[slot], sphere_m.w, slot, job.eye_offset_m);
}

}  // namespace

cudaError_t scan_scratch_bytes(std::uint32_t count, std::size_t& bytes) {
  bytes = 0;
  return cub::DeviceScan::ExclusiveSum(nullptr, bytes, static_cast<const std::uint32_t*>(nullptr),
                                       static_cast<std::uint32_t*>(nullptr), count);
}

cudaError_t launch_scan(const std::uint32_t* from, std::uint32_t* to, std::uint32_t count,
                        void* scratch, std::size_t scratch_bytes, cudaStream_t stream) {
  return cub::DeviceScan::ExclusiveSum(scratch, scratch_bytes, from, to, count, stream);
}

cudaError_t launch_mask(const CullJob& job, void* scratch, std::size_t scratch_bytes,
                        cudaStream_t stream) {
  if (job.slots == 0) return cudaMemsetAsync(job.counters, 0, sizeof *job.counters, stream);
  const std::uint32_t blocks = (job.slots + kThreads - 1) / kThreads;
  THRONG_LAUNCH_APART(mask_kernel, blocks, kThreads, stream, job);
  if (job.work_size == nullptr) return cudaGetLastError();
  if (const cudaError_t error =
          launch_scan(job.order, job.order, job.slots, scratch, scratch_bytes, stream);
      error != cudaSuccess) {
    return error;
  }
  THRONG_LAUNCH_APART(sample_kernel, blocks, kThreads, stream, job);
  return cudaGetLastError();
}

cudaError_t launch_cull(const CullJob& job, void* scratch, std::size_t scratch_bytes,
                        cudaStream_t stream) {
  if (const cudaError_t error = launch_mask(job, scratch, scratch_bytes, stream);
      error != cudaSuccess || job.slots == 0) {
    return error;
  }
  if (job.work_size == nullptr) {
    if (const cudaError_t error =
            launch_scan(job.order, job.order, job.slots, scratch, scratch_bytes, stream);
        error != cudaSuccess) {
      return error;
    }
  }
  const std::uint32_t blocks = (job.slots + kThreads - 1) / kThreads;
  THRONG_LAUNCH_APART(compact_kernel, blocks, kThreads, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::cuda
