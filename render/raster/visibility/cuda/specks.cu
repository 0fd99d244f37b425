#include <cub/device/device_radix_sort.cuh>

#include "render/compute/cuda/kernel.hpp"
#include "render/compute/cuda/launch.hpp"
#include "render/raster/visibility/cuda/launch.hpp"
#include "render/raster/visibility/element/speck.hpp"

// Figures of a few pixels, blended front to back by the share of each pixel that they cover: the
// processor's lists, order and arithmetic, a tile by a block of threads.
namespace throng::render::visibility::cuda {
namespace {

constexpr std::uint32_t kFlat = 256;
constexpr std::uint32_t kThreads = 256;
constexpr std::uint32_t kPixels = element::kSpeckTilePx * element::kSpeckTilePx / kThreads;
// as many specks at a time as have no more slabs than there are threads
constexpr std::uint32_t kBatch = 32;
static_assert(SpeckLevels::kMostSlabs <= kThreads);
constexpr std::uint32_t kTileShift = 32;  // of a key; below it the depth

std::uint32_t blocks_for(std::uint32_t count) { return (count + kFlat - 1) / kFlat; }

/// Who throws a shadow and is drawn otherwise has none of the cast's pictures.
__device__ bool has_image(const element::PlacedSpeck& placed) {
  return placed.image != RasterJob::kOnlyShadow;
}
__device__ SpeckImage image_of(const RasterJob& job, const element::PlacedSpeck& placed) {
  return has_image(placed) ? job.speck_image[placed.image] : SpeckImage{-0.2F, 0.2F, 0.0F, 1.0F};
}

template <typename Visit>
__device__ void for_tiles(const RasterJob& job, const element::PlacedSpeck& placed,
                          const Visit& visit) {
  const element::SpeckTiles tiles =
      element::speck_tiles(placed, image_of(job, placed), job.scene.shadows,
                           static_cast<float>(job.width_px), static_cast<float>(job.height_px));
  for (std::uint32_t y = tiles.y_low; y <= tiles.y_high; ++y) {
    for (std::uint32_t x = tiles.x_low; x <= tiles.x_high; ++x) visit(y * job.speck_tiles_x + x);
  }
}

/// Rising is near to far.
__device__ std::uint32_t order_of(const element::PlacedSpeck& placed) {
  return ~element::float_bits(placed.depth);
}

__global__ void place_kernel(RasterJob job) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i > job.speck_count) return;
  std::uint32_t tiles = 0;
  if (i < job.speck_count) {
    element::PlacedSpeck placed = element::place_speck(job.specks[i], job.grid, job.scene);
    if (i >= job.first_shadow) placed.image = RasterJob::kOnlyShadow;
    job.placed_specks[i] = placed;
    const std::uint32_t order = order_of(placed);
    for_tiles(job, placed, [&](std::uint32_t tile) {
      ++tiles;
      atomicAdd(&job.first_of_tile[tile], 1U);
      if (order < job.nearest[tile]) atomicMin(&job.nearest[tile], order);
      if (order > job.farthest[tile]) atomicMax(&job.farthest[tile], order);
    });
  }
  job.first_entry[i] = tiles;
}

/// Of a long list 16 bits of the range of depths there is decide, as on the processor; equals stay
/// in the order of their numbers, as the sort is stable.
__global__ void key_kernel(RasterJob job) {
  constexpr std::uint32_t kFew = 128;
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= job.speck_count) return;
  const element::PlacedSpeck placed = job.placed_specks[i];
  const std::uint32_t order = order_of(placed);
  std::uint32_t entry = job.first_entry[i];
  for_tiles(job, placed, [&](std::uint32_t tile) {
    const std::uint32_t low = job.nearest[tile], range = job.farthest[tile] - low;
    std::uint32_t shift = 0;
    if (job.first_of_tile[tile + 1] - job.first_of_tile[tile] > kFew) {
      while ((range >> shift) > 0xffffU) ++shift;
    }
    job.speck_key[0][entry] = static_cast<Word>(tile) << kTileShift | ((order - low) >> shift);
    job.speck_number[0][entry] = i;
    ++entry;
  });
}

/// Four samples of a pixel.
struct Through {
  float of[4];
};
__device__ float sum_of(const Through& t) { return (t.of[0] + t.of[1]) + (t.of[2] + t.of[3]); }

/// A figure of the batch that is drawn next.
struct Drawn {
  element::PlacedSpeck placed;
  element::SpeckFigure figure;
  element::SpeckPixels box;
  std::uint32_t first;  // of its pieces
};

/// What of a pixel a figure covers, and in what colour: r g b times coverage, coverage.
__device__ glm::vec4 patch_of(const Drawn& drawn, const element::SpeckPiece* pieces, int x, int y,
                              int x_px, int y_px) {
  const element::SpeckFigure& figure = drawn.figure;
  const auto row_top = static_cast<float>(y + y_px), row_bottom = row_top + 1.0F;
  const auto column = static_cast<float>(x);
  glm::vec4 patch(0.0F, 0.0F, 0.0F, 0.0F);
  // slabs go up, rows down: those below the pixel's row are passed by
  std::uint32_t k = 0;
  const float below = (figure.bottom - row_bottom) / figure.step - 1.0F;
  if (below >= 1.0F) k = static_cast<std::uint32_t>(below) << figure.shift;
  for (; k < figure.count; ++k) {
    const element::SpeckPiece& piece = pieces[k];
    if (!(piece.bottom > row_top)) break;
    const float high = element::least(piece.bottom, row_bottom) - element::most(piece.top, row_top);
    if (!(high > 0.0F)) continue;
    const float from = piece.left - static_cast<float>(x_px);
    const float to = piece.right - static_cast<float>(x_px);
    if (column < std::floor(from) || column > std::floor(to)) continue;
    const float wide =
        element::most(element::least(to, column + 1.0F) - element::most(from, column), 0.0F);
    for (int c = 0; c < 4; ++c) patch[c] += (piece.color[c] * high) * wide;
  }
  return patch;
}

/// The tile's light, by the block's first threads.
__device__ void make_light(const RasterJob& job, float x_px, float y_px, element::SpeckView& view,
                           element::SpeckFit& fit, element::SpeckNormal* normals,
                           element::SpeckLight& light) {
  constexpr std::uint32_t kNormals = element::SpeckFit::kNormals;
  constexpr std::uint32_t kRow = element::SpeckFit::kRow;
  static_assert(kNormals + 6 <= kThreads && 6 * kRow <= kThreads);
  const std::uint32_t t = threadIdx.x;
  const glm::vec3 sun = job.scene.sun_direction;
  if (t == 0) view = element::speck_view(job.scene, job.camera_up, x_px, y_px);
  __syncthreads();
  if (t < kNormals) {
    normals[t] = element::speck_normal(static_cast<int>(t), view, sun);
  } else if (t < kNormals + 6) {
    element::begin_fit(fit, static_cast<int>(t - kNormals), view, sun);
  }
  __syncthreads();
  if (t < 6 * kRow) {
    const int k = static_cast<int>(t / kRow), j = static_cast<int>(t % kRow);
    double sum = fit.sum[k][j];
    for (std::uint32_t n = 0; n < kNormals; ++n) {
      if (normals[n].seen > 0.0F) sum += element::speck_term(normals[n], k, j);
    }
    fit.sum[k][j] = sum;
  }
  __syncthreads();
  if (t == 0) element::end_fit(fit);
  __syncthreads();
  if (t < 6) element::light_row(light, static_cast<int>(t), fit, job.scene);
  if (t == 6) {
    element::light_places(light, view, job.scene, job.grid, x_px, y_px);
    light.detail = job.speck_detail;
  }
  __syncthreads();
}

__global__ void __launch_bounds__(kThreads) blend_kernel(RasterJob job) {
  __shared__ element::SpeckView view;
  __shared__ element::SpeckFit fit;
  __shared__ element::SpeckNormal normals[element::SpeckFit::kNormals];
  __shared__ element::SpeckLight light;
  __shared__ Drawn drawn[kBatch];
  __shared__ element::SpeckPiece pieces[kThreads];
  __shared__ std::uint32_t in_batch;
  constexpr auto kSide = static_cast<int>(element::kSpeckTilePx);
  const std::uint32_t tile = blockIdx.x;
  const std::uint32_t begin = job.first_of_tile[tile], end = job.first_of_tile[tile + 1];
  if (begin == end) return;
  const int x_px = static_cast<int>(tile % job.speck_tiles_x) * kSide;
  const int y_px = static_cast<int>(tile / job.speck_tiles_x) * kSide;
  make_light(job, static_cast<float>(x_px + kSide / 2), static_cast<float>(y_px + kSide / 2), view,
             fit, normals, light);
  const std::uint32_t* list = job.speck_number[1];

  // a thread's pixels are a column of the tile, every eighth of its rows
  const int x = static_cast<int>(threadIdx.x) % kSide;
  const int y0 = static_cast<int>(threadIdx.x) / kSide;
  constexpr int kStep = static_cast<int>(kThreads) / kSide;
  float missing[kPixels];
  for (std::uint32_t p = 0; p < kPixels; ++p) missing[p] = 0.0F;
  const element::SpeckShadow shadow = element::speck_shadow(light);
  if (job.scene.shadows && shadow.falls) {
    for (std::uint32_t e = begin; e < end; ++e) {
      const element::PlacedSpeck& placed = job.placed_specks[list[e]];
      const float strength = light.shadow * placed.clear;
      if (strength < 0.01F) continue;
      for (std::uint32_t p = 0; p < kPixels; ++p) {
        missing[p] = element::add_shade(
            missing[p], element::speck_shadow_at(shadow, strength, placed.size,
                                                 placed.x - static_cast<float>(x_px),
                                                 placed.y - static_cast<float>(y_px), x,
                                                 y0 + static_cast<int>(p) * kStep));
      }
    }
  }

  glm::vec3 rgb[kPixels];
  Through through[kPixels], depth[kPixels];
  for (std::uint32_t p = 0; p < kPixels; ++p) {
    rgb[p] = glm::vec3(0.0F);
    const auto px = static_cast<std::uint32_t>(x_px + x);
    const auto py = static_cast<std::uint32_t>(y_px + y0 + static_cast<int>(p) * kStep);
    const bool inside = px < job.width_px && py < job.height_px;
    const std::size_t at = word_index(job.word_blocks_x, 2 * px, 2 * py);
    for (std::uint32_t k = 0; k < 4; ++k) {
      through[p].of[k] = inside ? 1.0F : 0.0F;
      depth[p].of[k] =
          inside && has_words(job)
              ? element::bits_float(static_cast<std::uint32_t>(job.words[at + k] >> 32))
              : 0.0F;
    }
  }
  for (std::uint32_t first = begin; first < end;) {
    const std::uint32_t most = end - first < kBatch ? end - first : kBatch;
    if (threadIdx.x < most) {
      const std::uint32_t number = list[first + threadIdx.x];
      Drawn& own = drawn[threadIdx.x];
      own.placed = job.placed_specks[number];
      const SpeckImage image = image_of(job, own.placed);
      own.figure = element::speck_figure(own.placed, image, light, job.channel,
                                         job.channel.colors ? job.specks[number].channel : 0.0F);
      own.box = element::speck_pixels(own.placed, image, own.figure.size_y, x_px, y_px);
      if (!has_image(own.placed)) {
        own.figure.count = 0;
        own.box = {1, 1, 0, 0};
      }
    }
    __syncthreads();
    if (threadIdx.x == 0) {
      std::uint32_t slabs = 0, n = 0;
      for (; n < most && slabs + drawn[n].figure.count <= kThreads; ++n) {
        drawn[n].first = slabs;
        slabs += drawn[n].figure.count;
      }
      in_batch = n;
    }
    __syncthreads();
    const std::uint32_t count = in_batch;
    std::uint32_t n = 0;
    while (n + 1 < count && drawn[n + 1].first <= threadIdx.x) ++n;
    const std::uint32_t k = threadIdx.x - drawn[n].first;
    if (k < drawn[n].figure.count) {
      const Drawn& own = drawn[n];
      const std::size_t slab =
          std::size_t{own.placed.image} * SpeckLevels::kSlabs + own.figure.first + k;
      pieces[threadIdx.x] = element::speck_piece(own.figure, k, job.speck_slab[slab], own.placed,
                                                 light, job.scene, job.channel.colors);
    }
    __syncthreads();
    bool is_open = false;
    for (std::uint32_t p = 0; p < kPixels; ++p) {
      const int y = y0 + static_cast<int>(p) * kStep;
      for (std::uint32_t s = 0; s < count; ++s) {
        const Drawn& own = drawn[s];
        if (x < own.box.x_low || x > own.box.x_high || y < own.box.y_low || y > own.box.y_high) {
          continue;
        }
        Through seen = through[p];
        for (std::uint32_t q = 0; q < 4; ++q) {
          if (!(depth[p].of[q] < own.placed.depth)) seen.of[q] = 0.0F;
        }
        const float open = sum_of(seen);
        if (!(open > 4.0F * element::kSpeckLeastThrough)) continue;
        glm::vec4 patch = patch_of(own, pieces + own.first, x, y, x_px, y_px);
        if (!(patch.w > 0.0F)) continue;
        float alpha = patch.w;
        if (alpha > 1.0F) {
          const float scale = 1.0F / alpha;
          for (int c = 0; c < 3; ++c) patch[c] *= scale;
          alpha = 1.0F;
        }
        const float weight = 0.25F * open;
        for (int c = 0; c < 3; ++c) rgb[p][c] += patch[c] * weight;
        for (std::uint32_t q = 0; q < 4; ++q) through[p].of[q] -= seen.of[q] * alpha;
      }
      is_open = is_open || sum_of(through[p]) > 4.0F * element::kSpeckLeastThrough;
    }
    if (__syncthreads_or(is_open ? 1 : 0) == 0) break;  // nothing more is seen of the tile
    first += count;
  }
  for (std::uint32_t p = 0; p < kPixels; ++p) {
    const auto px = static_cast<std::uint32_t>(x_px + x);
    const auto py = static_cast<std::uint32_t>(y_px + y0 + static_cast<int>(p) * kStep);
    if (px >= job.width_px || py >= job.height_px) continue;
    const std::size_t at = word_index(job.word_blocks_x, 2 * px, 2 * py);
    for (std::uint32_t k = 0; k < 4; ++k) job.speck_through[at + k] = through[p].of[k];
    job.speck_light[static_cast<std::size_t>(py) * job.width_px + px] =
        glm::vec4(rgb[p], missing[p]);
  }
}

}  // namespace

cudaError_t launch_place_specks(const RasterJob& job, void* scratch, std::size_t scratch_bytes,
                                cudaStream_t stream) {
  const std::size_t tile_bytes = std::size_t{job.speck_tiles} * sizeof(std::uint32_t);
  const struct {
    void* to;
    int value;
    std::size_t size_bytes;
  } clears[] = {{job.first_of_tile, 0, tile_bytes + sizeof(std::uint32_t)},
                {job.nearest, 0xff, tile_bytes},
                {job.farthest, 0, tile_bytes}};
  for (const auto& clear : clears) {
    if (const cudaError_t error = cudaMemsetAsync(clear.to, clear.value, clear.size_bytes, stream);
        error != cudaSuccess) {
      return error;
    }
  }
  THRONG_LAUNCH_APART(place_kernel, blocks_for(job.speck_count + 1), kFlat, stream, job);
  if (const cudaError_t error = cudaGetLastError(); error != cudaSuccess) return error;
  if (const cudaError_t error = render::cuda::launch_scan(
          job.first_entry, job.first_entry, job.speck_count + 1, scratch, scratch_bytes, stream);
      error != cudaSuccess) {
    return error;
  }
  return render::cuda::launch_scan(job.first_of_tile, job.first_of_tile, job.speck_tiles + 1,
                                   scratch, scratch_bytes, stream);
}

cudaError_t speck_scratch_bytes(std::uint32_t entries, std::size_t& bytes) {
  bytes = 0;
  return cub::DeviceRadixSort::SortPairs(nullptr, bytes, static_cast<const Word*>(nullptr),
                                         static_cast<Word*>(nullptr),
                                         static_cast<const std::uint32_t*>(nullptr),
                                         static_cast<std::uint32_t*>(nullptr), entries, 0, 64);
}

cudaError_t launch_specks(const RasterJob& job, void* scratch, std::size_t scratch_bytes,
                          cudaStream_t stream) {
  if (job.speck_entries == 0) return cudaSuccess;
  THRONG_LAUNCH_APART(key_kernel, blocks_for(job.speck_count), kFlat, stream, job);
  if (const cudaError_t error = cudaGetLastError(); error != cudaSuccess) return error;
  int bits = kTileShift;
  while (job.speck_tiles >> (bits - static_cast<int>(kTileShift)) != 0) ++bits;
  if (const cudaError_t error = cub::DeviceRadixSort::SortPairs(
          scratch, scratch_bytes, static_cast<const Word*>(job.speck_key[0]), job.speck_key[1],
          static_cast<const std::uint32_t*>(job.speck_number[0]), job.speck_number[1],
          job.speck_entries, 0, bits, stream);
      error != cudaSuccess) {
    return error;
  }
  THRONG_LAUNCH(blend_kernel, job.speck_tiles, kThreads, 0, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::visibility::cuda
