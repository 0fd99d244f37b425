#include "render/raster/visibility/cuda/draw.hpp"
#include "render/raster/visibility/cuda/launch.hpp"

namespace throng::render::visibility::cuda {
namespace {

constexpr std::uint32_t kThreads = 128;
constexpr std::uint32_t kFlat = 256;
constexpr std::uint32_t kChooseThreads = 256;
[[maybe_unused]] constexpr std::uint32_t kPersistentBlocks = 1024;
constexpr std::int32_t kThreadPixels = 64;  // a blob's box of at most so many is one thread's

__global__ void prepare_kernel(RasterJob job) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i > job.count) return;
  if (i == job.count) {
    job.block_count[i] = 0;
    return;
  }
  const VisibleInstance& instance = job.instance[i];
  const RasterCharacter& character = job.cast.character[instance.character];
  const InstanceShade shade =
      element::instance_shade(instance, character.height_m, character.toned_count, job.scene,
                              job.channel, job.cast.first_surrounding);
  job.shade[i] = shade;
  std::uint32_t triangles = job.triangle_offset[i + 1] - job.triangle_offset[i];
  const bool is_mesh = !is_relief(job, i), shares = is_mesh && is_shared(job, i);
  if (!is_mesh) {
    triangles = job.cast.relief_member[instance.character].box_count;
  } else if (shares) {
    const RasterLevel& level = job.cast.level[job.shared[i].level];
    triangles = level.triangle_count;
    if (level.vertex_count <= kWarpVertices) {
      job.small_units[atomicAdd(&job.counts->small_units, 1U)] = i;
    } else {
      job.large_units[atomicAdd(&job.counts->large_units, 1U)] = i;
    }
  }
  job.block_count[i] = (triangles + element::kBlockTriangles - 1) / element::kBlockTriangles;
  if (!job.scene.shadows) return;
  const bool is_surrounding = (character.flags & RasterCharacter::kSurrounding) != 0;
  if (job.figures.first != nullptr && !is_surrounding &&
      (job.representation == nullptr || job.representation[i] != Representation::kNone)) {
    const std::uint32_t list = element::figure_list(element::figure_cell(shade.feet_relative.x),
                                                    element::figure_cell(shade.feet_relative.y));
    job.figures.next[i] = atomicExch(&job.figures.first[list], i);
  }
  if (is_surrounding) {
    job.casters[atomicAdd(&job.counts->casters, 1U)] = i;
  } else if (is_mesh && !shares && triangles > 0 && shade.size_px > element::kCastShadowFromPx) {
    const unsigned long long key =
        static_cast<unsigned long long>(element::float_bits(shade.size_px)) << 32 | ~i;
    job.candidates[atomicAdd(&job.counts->candidates, 1U)] = {
        key, i, element::shadow_charge(triangles, shade.size_px)};
  }
}

/// The key that candidates must exceed: from the largest on they fit the room. Digit by digit: the
/// sum of each digit's triangles tells which one holds the candidate that doesn't fit.
__global__ void __launch_bounds__(kChooseThreads) choose_kernel(RasterJob job) {
  __shared__ unsigned long long sums[256];
  __shared__ unsigned long long prefix, used;
  __shared__ bool all_fit;
  const unsigned long long room = element::shadow_room(job.triangles_drawn);
  const std::uint32_t count = job.counts->candidates;
  if (threadIdx.x == 0) {
    prefix = used = 0;
    all_fit = false;
  }
  for (int shift = 56; shift >= 0; shift -= 8) {
    for (std::uint32_t k = threadIdx.x; k < 256; k += blockDim.x) sums[k] = 0;
    __syncthreads();
    for (std::uint32_t k = threadIdx.x; k < count; k += blockDim.x) {
      const unsigned long long key = job.candidates[k].key;
      if (shift == 56 || key >> (shift + 8) == prefix) {
        atomicAdd(&sums[(key >> shift) & 255U],
                  static_cast<unsigned long long>(job.candidates[k].triangles));
      }
    }
    __syncthreads();
    if (threadIdx.x == 0) {
      int digit = 255;
      for (; digit >= 0 && used + sums[digit] <= room; --digit) used += sums[digit];
      all_fit = digit < 0;  // in the first round only: later ones look at what doesn't fit
      prefix = prefix << 8 | static_cast<unsigned>(digit & 255);
    }
    __syncthreads();
    if (all_fit) break;
  }
  if (threadIdx.x == 0) job.counts->caster_key = all_fit ? 0 : prefix;
}

__global__ void chosen_kernel(RasterJob job) {
  const std::uint32_t count = job.counts->candidates;
  for (std::uint32_t k = blockIdx.x * blockDim.x + threadIdx.x; k < count;
       k += gridDim.x * blockDim.x) {
    const Candidate& candidate = job.candidates[k];
    if (candidate.key <= job.counts->caster_key) continue;
    InstanceShade& shade = job.shade[candidate.instance];
    shade.cast_shadow = element::cast_shadow_of(shade.size_px);
    job.casters[atomicAdd(&job.counts->casters, 1U)] = candidate.instance;
  }
}

/// One caster by a block of threads: its triangles thrown on the ground. Where a point would need
/// clipping a wall's are cut, and of a figure none are drawn (a blob stands in for it).
__global__ void __launch_bounds__(kThreads) caster_kernel(RasterJob job) {
  const std::uint32_t casters = job.counts->casters;
  const Target target = target_of(job, true);
  for (std::uint32_t c = blockIdx.x; c < casters; c += gridDim.x) {
    const std::uint32_t i = job.casters[c];
    const std::uint32_t character = job.instance[i].character;
    const InstanceShade shade = job.shade[i];
    const std::uint32_t first_vertex = job.vertex_offset[i];
    std::uint32_t vertices = job.vertex_offset[i + 1] - first_vertex;
    std::uint32_t triangles = job.triangle_offset[i + 1] - job.triangle_offset[i];
    const std::uint32_t wanted =
        element::shadow_vertices(vertices, kMostLevelVertices, shade.size_px);
    std::uint32_t level = kNoLevel;
    if (wanted < vertices &&
        (job.cast.character[character].flags & RasterCharacter::kSurrounding) == 0) {
      level = job.cast.level_at[character * (kMostLevelVertices + 1) + wanted];
    }
    if (level != kNoLevel) {
      vertices = job.cast.level[level].vertex_count;
      triangles = job.cast.level[level].triangle_count;
    }
    bool clipped = false;
    for (std::uint32_t v = threadIdx.x; v < vertices; v += kThreads) {
      const element::ShadowPoint point =
          element::shadow_point(job.scene, shade, job.vertices[first_vertex + v].position_relative);
      clipped =
          clipped || element::project(job.grid, point.position_relative).x == element::kNeedsClip;
    }
    const bool cut = __syncthreads_or(clipped ? 1 : 0) != 0;
    if (cut && shade.cast_shadow != kNoBlob) {
      if (threadIdx.x == 0) job.shade[i].cast_shadow = 0.0F;
      continue;
    }
    const float share = element::cast_shadow_share(job.scene, shade);
    const std::uint32_t lane = threadIdx.x % kWarp;
    for (std::uint32_t first = threadIdx.x - lane; first < triangles; first += kThreads) {
      const std::uint32_t t = first + lane;
      LargeTriangle triangle;
      triangle.id = 0;
      triangle.flags = LargeTriangle::kShadow | LargeTriangle::kDoubleSided;
      triangle.first_corner = 0;
      triangle.character = character;
      element::ShadowPoint corner[3];
      float z[3];
      for (int k = 0; k < 3 && t < triangles; ++k) {
        const std::uint32_t vertex =
            level == kNoLevel
                ? job.indices[3 * (job.triangle_offset[i] + t) + k]
                : first_vertex +
                      ((job.cast.level_corners[job.cast.level[level].first_triangle + t] >>
                        (10 * k)) &
                       1023U);
        z[k] = job.vertices[vertex].position_relative.z;
        corner[k] = element::shadow_point(job.scene, shade, job.vertices[vertex].position_relative);
        if (cut) continue;
        triangle.v[k] = element::project(job.grid, corner[k].position_relative);
        triangle.v[k].depth = element::cast_shadow_strength(share, corner[k].height_share);
      }
      const bool throws = t < triangles && (shade.cast_shadow != kNoBlob ||
                                            element::throws_shadow(job.scene, z[0], z[1], z[2]));
      if (!cut) {
        draw_by_warp(job, throws, triangle, target);
        continue;
      }
      element::SnappedVertex polygon[element::kMaxClippedCorners];
      const int count = throws ? element::cut_shadow(job.grid, corner, share, polygon) : 0;
      for (int n = 2; __ballot_sync(kAllLanes, n < count) != 0; ++n) {
        if (n < count) {
          triangle.v[0] = polygon[0];
          triangle.v[1] = polygon[n - 1];
          triangle.v[2] = polygon[n];
        }
        draw_by_warp(job, n < count, triangle, target);
      }
    }
  }
}

/// Every `step`-th pixel of a blob's box within a tile.
__device__ void draw_blob(const RasterJob& job, const BlobRecord& record, std::int32_t x_low,
                          std::int32_t y_low, std::int32_t x_high, std::int32_t y_high,
                          std::uint32_t first, std::uint32_t step) {
  if (x_low > x_high || y_low > y_high) return;
  const auto width = static_cast<std::uint32_t>(x_high - x_low + 1);
  const auto height = static_cast<std::uint32_t>(y_high - y_low + 1);
  for (std::uint32_t k = first; k < width * height; k += step) {
    const std::int32_t x = x_low + static_cast<std::int32_t>(k % width);
    const std::int32_t y = y_low + static_cast<std::int32_t>(k / width);
    const float missing = element::shade_blob(job.scene, record.blob, x, y);
    if (!(missing > 0.0F)) continue;
    std::uint32_t* at =
        &job.blob_shadow[static_cast<std::size_t>(y) * job.width_px + static_cast<std::size_t>(x)];
    const std::uint32_t bits = element::float_bits(missing);
    if (*at < bits) atomicMax(at, bits);
  }
}

__device__ void draw_blob_tile(const RasterJob& job, const BlobRecord& record, std::uint32_t tile_x,
                               std::uint32_t tile_y, std::uint32_t first, std::uint32_t step) {
  const auto side = static_cast<std::int32_t>(kBlobTileSide);
  const auto x0 = static_cast<std::int32_t>(tile_x) * side;
  const auto y0 = static_cast<std::int32_t>(tile_y) * side;
  const auto low = [](std::int32_t a, std::int32_t b) { return a < b ? a : b; };
  const auto high = [](std::int32_t a, std::int32_t b) { return a > b ? a : b; };
  draw_blob(job, record, high(x0, record.box.x_low / 2), high(y0, record.box.y_low / 2),
            low(x0 + side - 1, record.box.x_high / 2), low(y0 + side - 1, record.box.y_high / 2),
            first, step);
}

__global__ void blob_kernel(RasterJob job) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= job.count) return;
  if (job.representation != nullptr && job.representation[i] == Representation::kNone) return;
  BlobRecord record;
  record.blob = element::make_blob(job.scene, job.shade[i]);
  record.box = element::blob_box(job.grid, record.blob, job.scene.ground_relative_m);
  const element::SampleBox& box = record.box;
  if (box.x_low > box.x_high || box.y_low > box.y_high) return;
  const std::int32_t x_low = box.x_low / 2, x_high = box.x_high / 2;
  const std::int32_t y_low = box.y_low / 2, y_high = box.y_high / 2;
  if ((x_high - x_low + 1) * (y_high - y_low + 1) <= kThreadPixels) {
    draw_blob(job, record, x_low, y_low, x_high, y_high, 0, 1);
    return;
  }
  job.blobs[i] = record;
  const auto tile = [](std::int32_t px) { return static_cast<std::uint32_t>(px) / kBlobTileSide; };
  const std::uint32_t columns = tile(x_high) - tile(x_low) + 1;
  const std::uint32_t tiles = columns * (tile(y_high) - tile(y_low) + 1);
  const std::uint32_t first = atomicAdd(&job.counts->blob_tiles, tiles);
  for (std::uint32_t k = 0; k < tiles; ++k) {
    const std::uint32_t x = tile(x_low) + k % columns, y = tile(y_low) + k / columns;
    if (first < kTileRoom && k < kTileRoom - first) {
      job.blob_tiles[first + k] = glm::uvec2(i, x | y << 16);
    } else {
      draw_blob_tile(job, record, x, y, 0, 1);
    }
  }
}

__global__ void blob_tile_kernel(RasterJob job) {
  const std::uint32_t count =
      job.counts->blob_tiles < kTileRoom ? job.counts->blob_tiles : kTileRoom;
  for (std::uint32_t n = blockIdx.x; n < count; n += gridDim.x) {
    const glm::uvec2 entry = job.blob_tiles[n];
    draw_blob_tile(job, job.blobs[entry.x], entry.y & 0xffffU, entry.y >> 16, threadIdx.x,
                   blockDim.x);
  }
}

}  // namespace

cudaError_t launch_prepare(const RasterJob& job, cudaStream_t stream) {
  if (job.count == 0) return cudaSuccess;  // an empty grid is a launch error
  THRONG_LAUNCH_APART(prepare_kernel, job.count / kFlat + 1, kFlat, stream, job);
  return cudaGetLastError();
}

cudaError_t launch_shadows(const RasterJob& job, cudaStream_t stream) {
  if (job.count == 0 || !job.scene.shadows) return cudaSuccess;
  THRONG_LAUNCH(choose_kernel, 1, kChooseThreads, 0, stream, job);
  THRONG_LAUNCH_APART(chosen_kernel, THRONG_PERSISTENT(64), kFlat, stream, job);
  THRONG_LAUNCH(caster_kernel, THRONG_PERSISTENT(kPersistentBlocks), kThreads, 0, stream, job);
  THRONG_LAUNCH_APART(blob_kernel, (job.count + kThreads - 1) / kThreads, kThreads, stream, job);
  THRONG_LAUNCH_APART(blob_tile_kernel, THRONG_PERSISTENT(kPersistentBlocks), kThreads, stream,
                      job);
  return cudaGetLastError();
}

}  // namespace throng::render::visibility::cuda
