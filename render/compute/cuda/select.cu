#include "render/compute/cuda/block_sum.hpp"
#include "render/compute/cuda/kernel.hpp"
#include "render/compute/cuda/launch.hpp"

namespace throng::render::cuda {
namespace {

constexpr std::uint32_t kThreads = kSumThreads;

__device__ std::uint32_t own_index() { return blockIdx.x * blockDim.x + threadIdx.x; }

__global__ void share_kernel(SelectJob job) {
  const std::uint32_t i = own_index();
  std::uint32_t share = 0, least = 0, most = 0;
  if (i < job.counters->visible) {
    const VisibleInstance& instance = job.visible[i];
    const DeviceCharacter& character = job.cast.character[instance.character];
    share = element::selection_share(
        element::selection_weight(job.projection, instance.radius_m, job.distance_m[i]));
    least = character.coarsest_count;
    most = character.vertex_count;
    job.share[i] = share;
    job.tier[i] =
        job.share_poses && character.first_level != DeviceCharacter::kNeverShares
            ? element::shared_tier(instance, job.state[instance.slot].pose, job.distance_m[i],
                                   character.height_m, job.projection, job.frustum)
            : element::kOwnPose;
  }
  add_up(share, &job.sums->shares);
  add_up(least, &job.sums->least);
  add_up(most, &job.sums->most);
}

/// Vertices of a legal count, or of a listed level for who shares a pose.
__device__ std::uint32_t snapped(const SelectJob& job, std::uint8_t tier,
                                 const DeviceCharacter& character, std::uint32_t dealt) {
  if (tier == element::kOwnPose || dealt > kMostLevelVertices) {
    return job.cast.legal_count[character.first_count + dealt];
  }
  return job.cast.level[job.cast.level_at[character.first_level + dealt]].vertex_count;
}

__global__ void begin_kernel(SelectJob job) {
  SelectSums& sums = *job.sums;
  // a budget beyond the crowd's full detail changes nothing, and this keeps products in 64 bits
  const std::uint64_t budget = job.vertex_budget < 0xffffffffU ? job.vertex_budget : 0xffffffffU;
  job.counters->effective_budget = job.vertex_budget > sums.least ? job.vertex_budget : sums.least;
  job.counters->vertices = 0;
  job.counters->triangles = 0;
  job.counters->own_vertices = 0;
  job.counters->own_triangles = 0;
  job.counters->own = 0;
  job.counters->shared = 0;
  job.counters->held_before = job.counters->held;
  job.counters->held = 0;
  const std::uint64_t rate = element::rate_of(budget, sums.shares);
  if (job.deal_again && job.counters->visible > 0) {
    sums.search = element::begin_search(budget > sums.least ? budget : sums.least, rate, sums.least,
                                        sums.most);
  } else {
    sums.search = element::RateSearch();
    sums.search.low = rate;
    sums.search.done = true;
  }
  sums.deal = element::Deal();
}

__global__ void deal_kernel(SelectJob job) {
  if (job.sums->search.done) return;  // the same for all threads
  const std::uint32_t i = own_index();
  std::uint64_t vertices = 0, free_shares = 0;
  if (i < job.counters->visible) {
    const DeviceCharacter& character = job.cast.character[job.visible[i].character];
    const std::uint32_t least = character.coarsest_count, most = character.vertex_count;
    const std::uint32_t dealt = element::deal(job.sums->search.rate, job.share[i], least, most);
    vertices = snapped(job, job.tier[i], character, dealt);
    if (dealt != least && dealt != most) free_shares = job.share[i];
  }
  add_up(vertices, &job.sums->deal.vertices);
  add_up(free_shares, &job.sums->deal.free_shares);
}

__global__ void step_kernel(SelectJob job) {
  element::search_on(job.sums->search, job.sums->deal);
  job.sums->deal = element::Deal();
}

__global__ void assign_kernel(SelectJob job) {
  const std::uint32_t i = own_index();
  std::uint32_t vertices = 0, triangles = 0, shares = 0;
  if (i < job.counters->visible) {
    VisibleInstance& instance = job.visible[i];
    const DeviceCharacter& character = job.cast.character[instance.character];
    const std::uint32_t dealt = element::deal(job.sums->search.low, job.share[i],
                                              character.coarsest_count, character.vertex_count);
    // finer levels are not listed: too many vertices for others to have the same
    if (dealt > kMostLevelVertices) job.tier[i] = element::kOwnPose;
    shares = job.tier[i] != element::kOwnPose ? 1 : 0;
    vertices = snapped(job, job.tier[i], character, dealt);
    triangles = job.cast.triangle_count_at[character.first_count + vertices];
    instance.vertex_count = vertices;
    instance.triangle_count = triangles;
  }
  add_up(vertices, &job.counters->vertices);
  add_up(triangles, &job.counters->triangles);
  if (shares != 0) atomicAdd(&job.counters->shared, 1U);
  if (shares != 0 && job.fused) {
    vertices = triangles = 0;
  } else if (vertices != 0) {
    job.own[atomicAdd(&job.counters->own, 1U)] = i;
  }
  if (i <= job.slots) {
    job.vertex_count[i] = vertices;
    job.triangle_count[i] = triangles;
  }
  add_up(vertices, &job.counters->own_vertices);
  add_up(triangles, &job.counters->own_triangles);
}

__global__ void command_kernel(AllocateJob job) {
  DrawCommand command;
  command.index_count = 3 * job.triangle_offset[job.slots];
  *job.command = command;
}

}  // namespace

cudaError_t launch_select(const SelectJob& job, cudaStream_t stream) {
  cudaError_t error = cudaMemsetAsync(job.sums, 0, sizeof *job.sums, stream);
  if (error != cudaSuccess) return error;
  const std::uint32_t blocks = (job.slots + 1 + kThreads - 1) / kThreads;
  THRONG_LAUNCH(share_kernel, blocks, kThreads, 0, stream, job);
  THRONG_LAUNCH_APART(begin_kernel, 1, 1, stream, job);
  if (job.deal_again) {
    for (int round = 0; round <= element::kDealRounds; ++round) {
      THRONG_LAUNCH(deal_kernel, blocks, kThreads, 0, stream, job);
      THRONG_LAUNCH_APART(step_kernel, 1, 1, stream, job);
    }
  }
  THRONG_LAUNCH(assign_kernel, blocks, kThreads, 0, stream, job);
  return cudaGetLastError();
}

cudaError_t launch_allocate(const AllocateJob& job, void* scratch, std::size_t scratch_bytes,
                            cudaStream_t stream) {
  const std::uint32_t count = job.slots + 1;
  if (const cudaError_t error =
          launch_scan(job.vertex_count, job.vertex_offset, count, scratch, scratch_bytes, stream);
      error != cudaSuccess) {
    return error;
  }
  if (const cudaError_t error = launch_scan(job.triangle_count, job.triangle_offset, count, scratch,
                                            scratch_bytes, stream);
      error != cudaSuccess) {
    return error;
  }
  THRONG_LAUNCH_APART(command_kernel, 1, 1, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::cuda
