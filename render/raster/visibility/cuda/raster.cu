#include "render/raster/visibility/cuda/draw.hpp"
#include "render/raster/visibility/cuda/launch.hpp"
#include "throng/render/vertex.hpp"

namespace throng::render::visibility::cuda {
namespace {

constexpr std::uint32_t kThreads = element::kBlockTriangles;  // a triangle block is one of threads
constexpr std::uint32_t kPersistentBlocks = 2048;
constexpr std::uint8_t kAlphaCutout = 2;  // kTriangleAlphaCutout of asset.hpp

/// Which instance each triangle block is of.
__global__ void number_kernel(RasterJob job) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= job.count) return;
  const std::uint32_t first = job.first_block[i], end = job.first_block[i + 1];
  for (std::uint32_t b = first; b < end; ++b) job.block_instance[b] = i;
  if (job.shared == nullptr || is_shared(job, i)) return;
  std::uint32_t at = atomicAdd(&job.counts->own_blocks, end - first);
  for (std::uint32_t b = first; b < end; ++b) job.own_blocks[at++] = b;
}

__global__ void project_kernel(RasterJob job) {
  const std::uint32_t v = blockIdx.x * blockDim.x + threadIdx.x;
  if (v >= job.vertices_total) return;
  job.projected[v] = element::project(job.grid, job.vertices[v].position_relative);
}

/// The triangle of an id, with the corners as they were projected.
struct Fetched {
  LargeTriangle triangle;
  bool needs_clip;
};
__device__ Fetched fetch(const RasterJob& job, std::uint32_t id) {
  const std::uint32_t block = element::block_of(id), i = job.block_instance[block];
  const std::uint32_t t =
      (block - job.first_block[i]) * element::kBlockTriangles + element::triangle_of(id);
  Fetched fetched;
  LargeTriangle& triangle = fetched.triangle;
  triangle.id = id;
  triangle.first_corner = 3 * (job.triangle_offset[i] + t);
  triangle.character = job.instance[i].character;
  const RasterCharacter& character = job.cast.character[triangle.character];
  triangle.flags =
      (character.flags & RasterCharacter::kDoubleSided) != 0 ? LargeTriangle::kDoubleSided : 0;
  // tones know no holes
  if ((character.flags & RasterCharacter::kHoles) != 0 &&
      job.instance[i].vertex_count > character.toned_count &&
      (job.cast.triangle_flags[character.first_flag + t] & kAlphaCutout) != 0) {
    triangle.flags |= LargeTriangle::kHoles;
  }
  fetched.needs_clip = false;
  for (int k = 0; k < 3; ++k) {
    triangle.v[k] = job.projected[job.indices[triangle.first_corner + k]];
    fetched.needs_clip = fetched.needs_clip || triangle.v[k].x == element::kNeedsClip;
  }
  return fetched;
}

/// A triangle block by a block of threads: small triangles alone, larger ones warp by warp.
__global__ void __launch_bounds__(kThreads) raster_kernel(RasterJob job) {
  const std::uint32_t blocks =
      job.shared == nullptr ? job.first_block[job.count] : job.counts->own_blocks;
  const Target target = target_of(job, false);
  std::uint32_t surviving = 0;
  for (std::uint32_t n = blockIdx.x; n < blocks; n += gridDim.x) {
    const std::uint32_t block = job.shared == nullptr ? n : job.own_blocks[n];
    const std::uint32_t i = job.block_instance[block];
    const std::uint32_t t = (block - job.first_block[i]) * element::kBlockTriangles + threadIdx.x;
    bool has = t < job.triangle_offset[i + 1] - job.triangle_offset[i];
    Fetched fetched;
    if (has) {
      fetched = fetch(job, element::sample_id(element::SampleClass::kMesh, block, threadIdx.x));
      if (fetched.needs_clip || (fetched.triangle.flags & LargeTriangle::kHoles) != 0) {
        job.special[atomicAdd(&job.counts->special, 1U)] = fetched.triangle.id;
        has = false;
      }
    }
    has = draw_by_warp(job, has, fetched.triangle, target);
    surviving += static_cast<std::uint32_t>(__popc(__ballot_sync(kAllLanes, has)));
  }
  if (threadIdx.x % kWarp == 0 && surviving != 0) {
    atomicAdd(&job.counts->surviving, static_cast<unsigned long long>(surviving));
  }
}

/// What needs clipping or has holes: few.
__global__ void special_kernel(RasterJob job) {
  const Target target = target_of(job, false);
  for (std::uint32_t n = blockIdx.x * blockDim.x + threadIdx.x; n < job.counts->special;
       n += gridDim.x * blockDim.x) {
    const Fetched fetched = fetch(job, job.special[n]);
    LargeTriangle triangle = fetched.triangle;
    element::SnappedVertex polygon[element::kMaxClippedCorners] = {triangle.v[0], triangle.v[1],
                                                                   triangle.v[2]};
    int corners = 3;
    if (fetched.needs_clip) {
      glm::vec4 clip[3];
      for (int k = 0; k < 3; ++k) {
        const BatchVertex& vertex = job.vertices[job.indices[triangle.first_corner + k]];
        clip[k] = element::to_clip(job.grid.clip_from_relative, vertex.position_relative);
      }
      corners = element::clip_triangle(job.grid, clip, polygon);
      triangle.flags &= ~LargeTriangle::kHoles;  // as on the processor
    }
    for (int k = 1; k + 1 < corners; ++k) {
      triangle.v[0] = polygon[0];
      triangle.v[1] = polygon[k];
      triangle.v[2] = polygon[k + 1];
      Facing f;
      if (!faces(job, triangle.v[0], triangle.v[1], triangle.v[2],
                 (triangle.flags & LargeTriangle::kDoubleSided) != 0, f)) {
        continue;
      }
      atomicAdd(&job.counts->surviving, 1ULL);
      const std::int32_t width = f.box.x_high - f.box.x_low + 1;
      const std::int32_t height = f.box.y_high - f.box.y_low + 1;
      const bool is_small = width <= kThreadSamples && width * height <= kThreadSamples;
      if (is_small && (triangle.flags & LargeTriangle::kHoles) == 0) {
        draw_small(f, triangle.id, target);
      } else {
        leave_to_tiles(job, triangle, f.box);
      }
    }
  }
}

__global__ void __launch_bounds__(kThreads) tile_kernel(RasterJob job) {
  const std::uint32_t count = job.counts->tiles < kTileRoom ? job.counts->tiles : kTileRoom;
  for (std::uint32_t n = blockIdx.x; n < count; n += gridDim.x) {
    const glm::uvec2 entry = job.tiles[n];
    const LargeTriangle& triangle = job.large[entry.x];
    draw_tile(job, triangle, entry.y & 0xffffU, entry.y >> 16,
              target_of(job, (triangle.flags & LargeTriangle::kShadow) != 0), threadIdx.x,
              blockDim.x);
  }
}

std::uint32_t blocks_for(std::uint32_t count, std::uint32_t threads) {
  return (count + threads - 1) / threads;
}

}  // namespace

cudaError_t launch_raster(const RasterJob& job, std::uint32_t most_blocks, cudaStream_t stream) {
  if (job.count == 0) return cudaSuccess;  // an empty grid is a launch error
  constexpr std::uint32_t kFlat = 256;
  THRONG_LAUNCH_APART(number_kernel, blocks_for(job.count, kFlat), kFlat, stream, job);
  if (job.vertices_total > 0) {
    THRONG_LAUNCH_APART(project_kernel, blocks_for(job.vertices_total, kFlat), kFlat, stream, job);
  }
  if (most_blocks > 0) {
    [[maybe_unused]] const std::uint32_t few =
        job.shared != nullptr && most_blocks > kPersistentBlocks ? kPersistentBlocks : most_blocks;
    THRONG_LAUNCH(raster_kernel, THRONG_PERSISTENT(few), kThreads, 0, stream, job);
    THRONG_LAUNCH_APART(special_kernel, THRONG_PERSISTENT(256), 64, stream, job);
  }
  return cudaGetLastError();
}

cudaError_t launch_large(const RasterJob& job, cudaStream_t stream) {
  if (job.count == 0) return cudaSuccess;
  THRONG_LAUNCH_APART(tile_kernel, THRONG_PERSISTENT(kPersistentBlocks), kThreads, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::visibility::cuda
