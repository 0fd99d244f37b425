#include "render/compute/cuda/kernel.hpp"
#include "render/compute/cuda/launch.hpp"
#include "render/compute/element/visible.hpp"

// The far crowd (Larkin et al.): from how many points each agent gets to the points. The functions
// are the processor's (render/density/far.cpp).
namespace throng::render::cuda {
namespace {

constexpr std::uint32_t kThreads = 256;

std::uint32_t blocks_for(std::uint32_t count) { return (count + kThreads - 1) / kThreads; }

/// True where a share's agent is there and far enough from the eye.
__device__ bool is_far(const FarJob& job, std::uint32_t agent) {
  const element::SnapshotColumns& shown = job.moment.shown;
  if (agent >= shown.slots || shown.present[agent] == 0) return false;
  if (job.id != nullptr && job.id[agent] != shown.id[agent]) return false;
  return !(job.least_m > 0.0F &&
           element::feet_distance(job.state[agent].position_m, job.eye_offset_m) < job.least_m);
}

__global__ void place_kernel(FarJob job) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i > job.shares) return;
  std::uint32_t points = 0, drawn = 0;
  if (i < job.shares) {
    const FarShare share = job.share[i];
    if (is_far(job, share.agent)) {
      const element::InstanceState& state = job.state[share.agent];
      const glm::vec3& p = state.position_m;
      FarPlaced placed;
      placed.figure =
          element::far_figure(element::relative(p.x, p.y, p.z, job.eye_offset_m), state.heading_rad,
                              job.height_m[share.agent], share.radius);
      placed.first_point = 0;
      if (job.figure != nullptr) {
        placed.first_point = element::far_first_point(
            job.block[job.member[share.agent]],
            element::far_pose(state.pose, job.cast.character[state.character].gait), share.points);
      }
      job.place[i] = placed;
      points = share.points;
      drawn = 1;
    }
  }
  job.first[i] = points;
  job.order[i] = drawn;
}

__global__ void count_kernel(FarJob job) {
  job.counters->far_points = job.first[job.shares];
  job.counters->far_agents = job.order[job.shares];
}

/// The last share whose points begin at `point` or before; those of who is not there are none.
__device__ std::uint32_t share_of(const FarJob& job, std::uint32_t point) {
  std::uint32_t low = 0, high = job.shares;  // first[low] <= point < first[high]
  while (high - low > 1) {
    const std::uint32_t middle = low + (high - low) / 2;
    (job.first[middle] <= point ? low : high) = middle;
  }
  return low;
}

/// A point by a thread: shares are of 1 to 512.
__global__ void points_kernel(FarJob job) {
  const std::uint32_t point = blockIdx.x * blockDim.x + threadIdx.x;
  if (point >= job.points) return;
  const std::uint32_t i = share_of(job, point), k = point - job.first[i];
  const FarPlaced& placed = job.place[i];
  const std::uint32_t* colors = job.colors + std::size_t{4} * job.share[i].agent;
  if (job.figure != nullptr) {
    job.splats[point] =
        element::far_figure_splat(placed.figure, element::far_look(placed.figure, colors),
                                  job.figure[placed.first_point + k]);
  } else {
    job.splats[point] = element::far_cloud_splat(placed.figure, job.cloud_position[k],
                                                 job.cloud_normal[k], colors[job.cloud_region[k]]);
  }
}

__global__ void shadows_kernel(FarJob job) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= job.shares || job.order[i + 1] == job.order[i]) return;
  const element::FarFigure& figure = job.place[i].figure;
  job.shadows[job.order[i]] = {figure.feet_relative, figure.height_m, 0, 0, 0.0F, 0};
}

}  // namespace

cudaError_t launch_place_far(const FarJob& job, void* scratch, std::size_t scratch_bytes,
                             cudaStream_t stream) {
  if (job.shares == 0) return cudaSuccess;
  THRONG_LAUNCH_APART(place_kernel, blocks_for(job.shares + 1), kThreads, stream, job);
  if (const cudaError_t error = cudaGetLastError(); error != cudaSuccess) return error;
  for (std::uint32_t* sums : {job.first, job.order}) {
    if (const cudaError_t error =
            launch_scan(sums, sums, job.shares + 1, scratch, scratch_bytes, stream);
        error != cudaSuccess) {
      return error;
    }
  }
  THRONG_LAUNCH_APART(count_kernel, 1, 1, stream, job);
  return cudaGetLastError();
}

cudaError_t launch_make_far(const FarJob& job, cudaStream_t stream) {
  if (job.shares == 0 || job.points == 0) return cudaSuccess;
  THRONG_LAUNCH_APART(points_kernel, blocks_for(job.points), kThreads, stream, job);
  if (const cudaError_t error = cudaGetLastError(); error != cudaSuccess) return error;
  THRONG_LAUNCH_APART(shadows_kernel, blocks_for(job.shares), kThreads, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::cuda
