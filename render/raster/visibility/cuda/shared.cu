#include "render/raster/visibility/cuda/draw.hpp"
#include "render/raster/visibility/cuda/launch.hpp"

// Figures that share a pose: their vertices are placed and projected once, in shared memory, and
// never leave it. Far figures have a few dozen, so that a warp each is enough.
namespace throng::render::visibility::cuda {
namespace {

constexpr std::uint32_t kThreads = 128;
constexpr std::uint32_t kWarps = kThreads / kWarp;
[[maybe_unused]] constexpr std::uint32_t kPersistentBlocks = 2112;

/// Corners of one figure on the sample grid.
template <std::uint32_t kMost>
struct PlacedVertices {
  std::int32_t x[kMost], y[kMost];
  float depth[kMost];
};

template <std::uint32_t kMost>
__device__ void place(const RasterJob& job, std::uint32_t i, PlacedVertices<kMost>& placed,
                      std::uint32_t first, std::uint32_t step) {
  const std::uint32_t count = job.cast.level[job.shared[i].level].vertex_count;
  for (std::uint32_t v = first; v < count; v += step) {
    const element::SnappedVertex vertex = element::project(job.grid, placed_vertex(job, i, v));
    placed.x[v] = vertex.x;
    placed.y[v] = vertex.y;
    placed.depth[v] = vertex.depth;
  }
}

/// Triangles by the unit's threads, a whole number of warps. Returns how many may be seen.
template <std::uint32_t kMost>
__device__ std::uint32_t draw(const RasterJob& job, std::uint32_t i,
                              const PlacedVertices<kMost>& placed, std::uint32_t first,
                              std::uint32_t step, const Target& target) {
  const RasterLevel level = job.cast.level[job.shared[i].level];
  const std::uint32_t first_block = job.first_block[i];
  LargeTriangle triangle;
  triangle.character = job.instance[i].character;
  triangle.flags =
      (job.cast.character[triangle.character].flags & RasterCharacter::kDoubleSided) != 0
          ? LargeTriangle::kDoubleSided
          : 0;
  triangle.first_corner = 0;
  std::uint32_t surviving = 0;
  const std::uint32_t lane = first % kWarp;
  for (std::uint32_t t0 = first - lane; t0 < level.triangle_count; t0 += step) {
    const std::uint32_t t = t0 + lane;
    bool has = t < level.triangle_count;
    triangle.id =
        element::sample_id(element::SampleClass::kMesh, first_block + t / element::kBlockTriangles,
                           t % element::kBlockTriangles);
    const std::uint32_t corners = has ? job.cast.level_corners[level.first_triangle + t] : 0;
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t v = (corners >> (10 * k)) & 1023U;
      triangle.v[k] = {placed.x[v], placed.y[v], placed.depth[v], 0.0F};
      has = has && placed.x[v] != element::kNeedsClip;  // shared figures need none
    }
    has = draw_by_warp(job, has, triangle, target);
    surviving += static_cast<std::uint32_t>(__popc(__ballot_sync(kAllLanes, has)));
  }
  return surviving;
}

/// A figure by a warp.
__global__ void __launch_bounds__(kThreads) small_kernel(RasterJob job) {
  __shared__ PlacedVertices<kWarpVertices> placed[kWarps];
  const Target target = target_of(job, false);
  const std::uint32_t warp = threadIdx.x / kWarp, lane = threadIdx.x % kWarp;
  const std::uint32_t units = job.counts->small_units;
  std::uint32_t surviving = 0;
  for (std::uint32_t n = blockIdx.x * kWarps + warp; n < units; n += gridDim.x * kWarps) {
    const std::uint32_t i = job.small_units[n];
    place(job, i, placed[warp], lane, kWarp);
    __syncwarp();
    surviving += draw(job, i, placed[warp], lane, kWarp, target);
    __syncwarp();
  }
  if (lane == 0 && surviving != 0) {
    atomicAdd(&job.counts->surviving, static_cast<unsigned long long>(surviving));
  }
}

/// A figure by a block of threads.
__global__ void __launch_bounds__(kThreads) large_kernel(RasterJob job) {
  __shared__ PlacedVertices<kMostLevelVertices> placed;
  const Target target = target_of(job, false);
  const std::uint32_t units = job.counts->large_units;
  std::uint32_t surviving = 0;
  for (std::uint32_t n = blockIdx.x; n < units; n += gridDim.x) {
    const std::uint32_t i = job.large_units[n];
    place(job, i, placed, threadIdx.x, kThreads);
    __syncthreads();
    surviving += draw(job, i, placed, threadIdx.x, kThreads, target);
    __syncthreads();
  }
  if (threadIdx.x % kWarp == 0 && surviving != 0) {
    atomicAdd(&job.counts->surviving, static_cast<unsigned long long>(surviving));
  }
}

}  // namespace

cudaError_t launch_shared(const RasterJob& job, cudaStream_t stream) {
  if (job.count == 0 || job.shared == nullptr) return cudaSuccess;
  // the larger ones first: what is begun late should be short
  THRONG_LAUNCH(large_kernel, THRONG_PERSISTENT(kPersistentBlocks), kThreads, 0, stream, job);
  THRONG_LAUNCH(small_kernel, THRONG_PERSISTENT(kPersistentBlocks), kThreads, 0, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::visibility::cuda
