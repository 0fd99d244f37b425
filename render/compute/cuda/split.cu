#include "render/compute/cuda/block_sum.hpp"
#include "render/compute/cuda/kernel.hpp"
#include "render/compute/cuda/launch.hpp"
#include "render/compute/element/visible.hpp"

// The mixed frame's visible list without those that are drawn as specks, and the specks.
namespace throng::render::cuda {
namespace {

constexpr std::uint32_t kThreads = kSumThreads;
constexpr std::uint8_t kUnseen = 0;
constexpr std::uint8_t kListed = 1 + static_cast<std::uint8_t>(element::SpeckFate::kListed);
constexpr std::uint8_t kSpeck = 1 + static_cast<std::uint8_t>(element::SpeckFate::kSpeck);
constexpr std::uint8_t kLeftOut = 1 + static_cast<std::uint8_t>(element::SpeckFate::kLeftOut);

__device__ element::SpeckPlace place_of(const SplitJob& job, std::uint32_t slot) {
  const element::InstanceState& state = job.cull.state[slot];
  return element::speck_place(job.rule, state.position_m, state.placement.scale,
                              job.cast.character[state.character].height_m, job.cull.eye_offset_m);
}

__device__ bool acts(const SplitJob& job, std::uint32_t slot) {
  const std::uint32_t* motion = job.moment.shown.motion;
  return motion != nullptr && (motion[slot] & 0xffffU) != 0;
}

__device__ element::SpeckFate fate_of(const SplitJob& job, std::uint32_t slot,
                                      const element::SpeckPlace& place, float& larger) {
  const element::InstanceState& state = job.cull.state[slot];
  const std::uint32_t* counts =
      job.cast.error_count + std::size_t{state.character} * element::kErrorSteps;
  return element::speck_fate(job.rule, place, state.seed, acts(job, slot),
                             counts[element::error_step(job.rule.mixed.error_px / place.px_per_m)],
                             larger);
}

__global__ void fate_kernel(SplitJob job) {
  const std::uint32_t slot = blockIdx.x * blockDim.x + threadIdx.x;
  std::uint8_t fate = kUnseen;
  if (slot < job.cull.slots) {
    if (job.cull.mask[slot] != 0) {
      fate = kListed;
      if (slot < job.cull.agents && job.has_images[job.cull.state[slot].character] != 0) {
        const element::SpeckPlace place = place_of(job, slot);
        float larger = 1.0F;
        if (element::may_be_speck(job.rule, place)) {
          fate = 1 + static_cast<std::uint8_t>(fate_of(job, slot, place, larger));
        }
      }
    }
    job.fate[slot] = fate;
    job.cull.order[slot] = fate == kListed ? 1 : 0;
    job.speck_order[slot] = fate == kSpeck ? 1 : 0;
  }
  add_up(fate == kLeftOut ? 1 : 0, &job.cull.counters->left_out);
}

__global__ void list_kernel(SplitJob job) {
  const CullJob& cull = job.cull;
  const std::uint32_t slot = blockIdx.x * blockDim.x + threadIdx.x;
  if (slot >= cull.slots) return;
  const std::uint8_t fate = job.fate[slot];
  if (slot + 1 == cull.slots) {
    cull.counters->visible = cull.order[slot] + (fate == kListed ? 1 : 0);
    cull.counters->specks = job.speck_order[slot] + (fate == kSpeck ? 1 : 0);
    cull.counters->surrounding =
        cull.agents < cull.slots ? cull.counters->visible - cull.order[cull.agents] : 0;
  }
  if (fate == kListed) {
    const std::uint32_t i = cull.order[slot];
    const glm::vec4 sphere_m = cull.sphere_m[slot];
    cull.distance_m[i] =
        element::distance_of(element::relative_sphere(sphere_m, cull.eye_offset_m));
    cull.visible[i] = element::make_visible(cull.state[slot], sphere_m.w, slot, cull.eye_offset_m);
  } else if (fate == kSpeck) {
    const element::InstanceState& state = cull.state[slot];
    const element::Gait& gait = job.cast.character[state.character].gait;
    const element::SpeckPlace place = place_of(job, slot);
    float larger = 1.0F;
    fate_of(job, slot, place, larger);
    const element::Sample sample = element::sample_at(job.moment, gait, slot);
    const std::uint32_t pose =
        acts(job, slot) ? element::speck_pose(state.pose, gait)
                        : element::gait_speck_pose(gait, sample.speed_mps, sample.walked_cycles);
    job.specks[job.speck_order[slot]] =
        element::make_speck(job.rule, place, larger, state.character, pose, sample.heading_rad,
                            state.seed, state.channel);
  }
}

__global__ void clear_kernel(SplitJob job) { job.cull.counters->left_out = 0; }

}  // namespace

cudaError_t launch_split(const SplitJob& job, void* scratch, std::size_t scratch_bytes,
                         cudaStream_t stream) {
  if (job.cull.slots == 0) return cudaSuccess;  // launch_mask left zeros
  const std::uint32_t blocks = (job.cull.slots + kThreads - 1) / kThreads;
  THRONG_LAUNCH_APART(clear_kernel, 1, 1, stream, job);
  THRONG_LAUNCH(fate_kernel, blocks, kThreads, 0, stream, job);
  for (std::uint32_t* order : {job.cull.order, job.speck_order}) {
    if (const cudaError_t error =
            launch_scan(order, order, job.cull.slots, scratch, scratch_bytes, stream);
        error != cudaSuccess) {
      return error;
    }
  }
  THRONG_LAUNCH_APART(list_kernel, blocks, kThreads, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::cuda
