#include "render/compute/cuda/kernel.hpp"
#include "render/compute/cuda/launch.hpp"

namespace throng::render::cuda {
namespace {

__global__ void advance_kernel(AdvanceJob job) {
  const std::uint32_t slot = blockIdx.x * blockDim.x + threadIdx.x;
  if (slot >= job.moment.shown.slots) {
    const std::uint32_t i = slot - job.moment.shown.slots;
    if (i >= job.surrounding) return;
    const std::uint32_t member = job.first_surrounding + i;
    job.state[slot] = element::standing_still(member);
    job.sphere_m[slot] = job.cast.character[member].bounds;
    return;
  }
  if (job.moment.shown.present[slot] == 0) {
    job.sphere_m[slot] = glm::vec4(0.0F, 0.0F, 0.0F, -1.0F);
    return;
  }
  const DeviceCharacter& character = job.cast.character[job.moment.shown.character[slot]];
  const element::InstanceState state = element::advance_slot(job.moment, character.gait, slot);
  job.state[slot] = state;
  job.sphere_m[slot] = element::place_sphere(
      state.placement, element::drawn_at(state),
      element::is_acting(state.pose) ? character.bounds : character.gait_bounds);
}

__global__ void probe_kernel() {}

}  // namespace

cudaError_t probe_kernels(cudaStream_t stream) {
  THRONG_LAUNCH_APART(probe_kernel, 1, 1, stream);
  return cudaGetLastError();
}

cudaError_t launch_advance(const AdvanceJob& job, cudaStream_t stream) {
  const std::uint32_t count = job.moment.shown.slots + job.surrounding;
  if (count == 0) return cudaSuccess;  // an empty grid is a launch error
  constexpr std::uint32_t kThreads = 256;
  THRONG_LAUNCH_APART(advance_kernel, (count + kThreads - 1) / kThreads, kThreads, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::cuda
