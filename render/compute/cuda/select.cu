#include "render/compute/cuda/block_sum.hpp"
#include "render/compute/cuda/kernel.hpp"
#include "render/compute/cuda/launch.hpp"

namespace throng::render::cuda {
namespace {

constexpr std::uint32_t kThreads = kSumThreads;

__device__ std::uint32_t own_index() { return blockIdx.x * blockDim.x + threadIdx.x; }

__device__ bool is_mesh(const SelectJob& job, std::uint32_t i) {
  return job.representation == nullptr || job.representation[i] == Representation::kMesh;
}

/// Impostors or points of all agents that were baked with them.
__device__ Representation form_of(const SelectJob& job, const VisibleInstance& instance) {
  const DeviceCharacter& character = job.cast.character[instance.character];
  if (instance.slot >= job.agents) return Representation::kMesh;
  if (job.form == FormRule::kImpostor) {
    return character.has_relief != 0 ? Representation::kImpostor : Representation::kMesh;
  }
  return character.point_count != 0 ? Representation::kPoints : Representation::kMesh;
}

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
    job.tier[i] = job.share_poses && character.first_level != DeviceCharacter::kNeverShares
                      ? element::shared_tier(instance, job.state[instance.slot].pose,
                                             job.distance_m[i], character.height_m, job.projection,
                                             job.frustum, job.pose_error_px)
                      : element::kOwnPose;
    if (job.representation != nullptr) {
      job.representation[i] = form_of(job, instance);
      if (!is_mesh(job, i)) share = least = most = 0;
    }
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
  for (std::uint64_t& drawn : job.counters->drawn_as) drawn = 0;
  job.counters->farthest = 0;
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
    if (is_mesh(job, i)) {
      const std::uint32_t dealt = element::deal(job.sums->search.rate, job.share[i], least, most);
      vertices = snapped(job, job.tier[i], character, dealt);
      if (dealt != least && dealt != most) free_shares = job.share[i];
    }
  }
  add_up(vertices, &job.sums->deal.vertices);
  add_up(free_shares, &job.sums->deal.free_shares);
}

__global__ void step_kernel(SelectJob job) {
  element::search_on(job.sums->search, job.sums->deal);
  job.sums->deal = element::Deal();
}

/// What all rules end with: the counters, and who has vertices in the batched arrays.
__device__ void list_counts(const SelectJob& job, std::uint32_t i, std::uint32_t vertices,
                            std::uint32_t triangles) {
  const bool listed = i < job.counters->visible;
  const bool shares = listed && job.tier[i] != element::kOwnPose;
  const bool meshes = listed && is_mesh(job, i);
  add_up(vertices, &job.counters->vertices);
  add_up(triangles, &job.counters->triangles);
  if (shares) atomicAdd(&job.counters->shared, 1U);
  if (job.representation != nullptr) {
    const bool is_agent = listed && job.visible[i].slot < job.agents;
    for (std::uint32_t form = 0; form < kRepresentations; ++form) {
      const bool is_one = is_agent && static_cast<std::uint32_t>(job.representation[i]) == form;
      add_up(is_one ? 1 : 0, &job.counters->drawn_as[form]);
    }
    if (is_agent) {
      std::uint32_t bits = 0;  // positive floats are in the order of their bits
      memcpy(&bits, &job.distance_m[i], sizeof bits);
      if (job.counters->farthest < bits) atomicMax(&job.counters->farthest, bits);
    }
  }
  if (!meshes || (shares && job.fused)) {
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

__global__ void assign_kernel(SelectJob job) {
  const std::uint32_t i = own_index();
  std::uint32_t vertices = 0, triangles = 0;
  if (i < job.counters->visible) {
    VisibleInstance& instance = job.visible[i];
    const DeviceCharacter& character = job.cast.character[instance.character];
    if (is_mesh(job, i)) {
      const std::uint32_t dealt = element::deal(job.sums->search.low, job.share[i],
                                                character.coarsest_count, character.vertex_count);
      // finer levels are not listed: too many vertices for others to have the same
      if (dealt > kMostLevelVertices) job.tier[i] = element::kOwnPose;
      vertices = snapped(job, job.tier[i], character, dealt);
      triangles = job.cast.triangle_count_at[character.first_count + vertices];
    } else if (job.representation[i] == Representation::kPoints) {
      vertices = element::points_for(
          job.projection, job.distance_m[i], instance.radius_m, instance.scale, job.point_size_px,
          job.cast.point_radius_m + character.first_point, character.point_count);
    }
    instance.vertex_count = vertices;
    instance.triangle_count = triangles;
  }
  list_counts(job, i, vertices, triangles);
}

// the mixed frame

/// Vertices that keep an agent within a step of its character's errors; where it shares its pose,
/// of the levels that are listed the next finer one.
__device__ std::uint32_t vertices_for(const SelectJob& job, std::uint32_t i, std::uint32_t step) {
  const std::uint32_t number = job.visible[i].character;
  const std::uint32_t* counts = job.cast.error_count + std::size_t{number} * element::kErrorSteps;
  if (job.tier[i] == element::kOwnPose) return counts[step];
  const std::uint32_t wanted = element::shared_step_count(counts, step, kMostLevelVertices);
  if (wanted > kMostLevelVertices) return wanted;
  const std::uint32_t* level_at = job.cast.level_at + job.cast.character[number].first_level;
  // coarsest first: the finest with at most so many, or the next one
  const std::uint32_t level = level_at[wanted];
  const bool too_coarse = job.cast.level[level].vertex_count < wanted;
  return job.cast.level[too_coarse && level < level_at[kMostLevelVertices] ? level + 1 : level]
      .vertex_count;
}

__global__ void mix_kernel(SelectJob job) {
  const std::uint32_t i = own_index();
  if (i == 0) {
    job.counters->effective_budget = job.vertex_budget;
    job.sums->error_search = element::ErrorSearch();
  }
  if (i >= job.counters->visible) return;
  VisibleInstance& instance = job.visible[i];
  const DeviceCharacter& character = job.cast.character[instance.character];
  job.tier[i] =
      job.share_poses && character.first_level != DeviceCharacter::kNeverShares
          ? element::shared_tier(instance, job.state[instance.slot].pose, job.distance_m[i],
                                 character.height_m, job.projection, job.frustum, job.pose_error_px)
          : element::kOwnPose;
  const float own = element::unit_from_seed(instance.seed, element::kSeedForm);
  const float px_per_m =
      element::form_px_per_m(job.projection, job.distance_m[i], instance.radius_m, own);
  const float height_px = px_per_m * instance.scale * character.height_m;
  const float error_px = element::near_error_of(job.mixed, job.projection, height_px);
  const std::uint32_t step = element::error_step(error_px / px_per_m);
  job.share[i] = step;
  job.representation[i] = Representation::kMesh;
  if (instance.slot >= job.agents) return;
  const std::uint32_t vertices = height_px < 1.0F ? 0 : vertices_for(job, i, step);
  job.representation[i] = element::mixed_form(job.mixed, own, height_px, character.has_relief != 0,
                                              vertices, instance.scale);
}

__device__ std::uint32_t mixed_vertices(const SelectJob& job, std::uint32_t i) {
  const std::uint32_t step = job.share[i] + job.sums->error_search.coarser;
  return vertices_for(job, i, step < element::kErrorSteps ? step : element::kErrorSteps - 1);
}

__global__ void error_kernel(SelectJob job) {
  if (job.sums->error_search.done) return;  // the same for all threads
  const std::uint32_t i = own_index();
  const bool counts = i < job.counters->visible && is_mesh(job, i);
  add_up(counts ? mixed_vertices(job, i) : 0, &job.sums->error_vertices);
}

__global__ void error_step_kernel(SelectJob job) {
  element::search_on(job.sums->error_search, job.sums->error_vertices, job.vertex_budget);
  job.sums->error_vertices = 0;
}

__global__ void mixed_assign_kernel(SelectJob job) {
  const std::uint32_t i = own_index();
  std::uint32_t vertices = 0, triangles = 0;
  if (i < job.counters->visible) {
    VisibleInstance& instance = job.visible[i];
    if (is_mesh(job, i)) {
      vertices = mixed_vertices(job, i);
      triangles =
          job.cast.triangle_count_at[job.cast.character[instance.character].first_count + vertices];
      // finer levels are not listed: too many vertices for others to have the same
      if (vertices > kMostLevelVertices) job.tier[i] = element::kOwnPose;
    }
    instance.vertex_count = vertices;
    instance.triangle_count = triangles;
  }
  list_counts(job, i, vertices, triangles);
}

/// Where a time was asked for, the error that keeps it is the budget.
__global__ void mixed_budget_kernel(SelectJob job) {
  const std::uint64_t asked = job.counters->vertices;
  job.counters->effective_budget =
      job.mixed.budget_ms > 0.0 || asked > job.vertex_budget ? asked : job.vertex_budget;
}

__global__ void command_kernel(AllocateJob job) {
  DrawCommand command;
  command.index_count = 3 * job.triangle_offset[job.slots];
  *job.command = command;
}

}  // namespace

cudaError_t launch_mix(const SelectJob& job, cudaStream_t stream) {
  cudaError_t error = cudaMemsetAsync(job.sums, 0, sizeof *job.sums, stream);
  if (error != cudaSuccess) return error;
  const std::uint32_t blocks = (job.slots + 1 + kThreads - 1) / kThreads;
  THRONG_LAUNCH_APART(begin_kernel, 1, 1, stream, job);
  THRONG_LAUNCH_APART(mix_kernel, blocks, kThreads, stream, job);
  for (int round = 0; round < element::ErrorSearch::kRounds; ++round) {
    THRONG_LAUNCH(error_kernel, blocks, kThreads, 0, stream, job);
    THRONG_LAUNCH_APART(error_step_kernel, 1, 1, stream, job);
  }
  THRONG_LAUNCH(mixed_assign_kernel, blocks, kThreads, 0, stream, job);
  THRONG_LAUNCH_APART(mixed_budget_kernel, 1, 1, stream, job);
  return cudaGetLastError();
}

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
