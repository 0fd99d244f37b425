#include "render/raster/visibility/cuda/draw.hpp"
#include "render/raster/visibility/cuda/launch.hpp"

// What is no mesh, into the visibility words: points as discs, relief impostors as boxes that rays
// look into. The functions are those of the processor's tiles.
namespace throng::render::visibility::cuda {
namespace {

constexpr std::uint32_t kThreads = 128;
constexpr std::uint32_t kWarps = kThreads / kWarp;
[[maybe_unused]] constexpr std::uint32_t kPersistentBlocks = 2112;
constexpr float kThreadRadius = 4.0F;  // samples: a larger disc is a warp's

/// Every `step`-th sample of a disc. Its middle is counted from each tile's corner, as it is on the
/// processor: a float has not the same bits counted from elsewhere.
__device__ void draw_splat(const RasterJob& job, const element::PlacedSplat& splat,
                           std::uint32_t number, const Target& target, std::uint32_t first,
                           std::uint32_t step) {
  constexpr auto kSide = static_cast<int>(kTileSide);
  const auto width = static_cast<float>(job.grid.width);
  const auto height = static_cast<float>(job.grid.height);
  const float x0 = splat.x - splat.radius, x1 = splat.x + splat.radius;
  const float y0 = splat.y - splat.radius, y1 = splat.y + splat.radius;
  if (!(x1 > 0.0F && y1 > 0.0F && x0 < width && y0 < height)) return;
  const auto tile_of = [](float at, float size) {
    return static_cast<int>(element::least(element::most(at, 0.0F), size - 1.0F)) / kSide;
  };
  const std::uint32_t id = element::splat_id(number);
  for (int ty = tile_of(y0, height); ty <= tile_of(y1, height); ++ty) {
    for (int tx = tile_of(x0, width); tx <= tile_of(x1, width); ++tx) {
      const int tile_x = tx * kSide, tile_y = ty * kSide;
      element::SplatBox box = element::splat_box(splat, tile_x, tile_y, kSide);
      if (box.x_high > job.grid.width - 1 - tile_x) box.x_high = job.grid.width - 1 - tile_x;
      if (box.y_high > job.grid.height - 1 - tile_y) box.y_high = job.grid.height - 1 - tile_y;
      if (box.x_low > box.x_high || box.y_low > box.y_high) continue;
      const auto columns = static_cast<std::uint32_t>(box.x_high - box.x_low + 1);
      const auto rows = static_cast<std::uint32_t>(box.y_high - box.y_low + 1);
      for (std::uint32_t k = first; k < columns * rows; k += step) {
        const int x = box.x_low + static_cast<int>(k % columns);
        const int y = box.y_low + static_cast<int>(k / columns);
        target.put(tile_x + x, tile_y + y, element::splat_depth(splat, box, x, y), id);
      }
    }
  }
}

/// A splat by a thread, a large one by its warp.
__global__ void __launch_bounds__(kThreads) splat_kernel(RasterJob job) {
  const Target target = target_of(job, false);
  const std::uint32_t number = blockIdx.x * blockDim.x + threadIdx.x;
  element::PlacedSplat splat{};
  splat.radius = -1.0F;
  if (number < job.splat_count) {
    splat = element::place_splat(job.splats[number], job.grid, job.scene, job.view_from_relative);
  }
  const bool by_warp = splat.radius > kThreadRadius;
  if (splat.radius > 0.0F && !by_warp) draw_splat(job, splat, number, target, 0, 1);
  const std::uint32_t lane = threadIdx.x % kWarp;
  for (std::uint32_t rest = __ballot_sync(kAllLanes, by_warp); rest != 0; rest &= rest - 1) {
    const std::uint32_t one =
        number - lane + static_cast<std::uint32_t>(__ffs(static_cast<int>(rest)) - 1);
    draw_splat(job,
               element::place_splat(job.splats[one], job.grid, job.scene, job.view_from_relative),
               one, target, lane, kWarp);
  }
}

/// An impostor by a block of threads, a box by a warp.
__global__ void __launch_bounds__(kThreads) relief_kernel(RasterJob job) {
  __shared__ element::PlacedBox placed[kWarps];
  __shared__ element::ReliefRays rays[kWarps];
  const Target target = target_of(job, false);
  const std::uint32_t warp = threadIdx.x / kWarp, lane = threadIdx.x % kWarp;
  for (std::uint32_t i = blockIdx.x; i < job.count; i += gridDim.x) {
    if (!is_relief(job, i)) continue;
    const ReliefMember member = job.cast.relief_member[job.instance[i].character];
    for (std::uint32_t b = warp; b < member.box_count; b += kWarps) {
      const ReliefBox& box = job.cast.relief_box[member.first_box + b];
      if (lane == 0) {
        placed[warp] = element::place_box(box, job.instance[i], job.jointed[i], job.joints,
                                          job.relief_view, job.grid);
        rays[warp] = element::relief_rays(box, placed[warp], job.relief_view, job.relief_search);
      }
      __syncwarp();
      const element::PlacedBox& own = placed[warp];
      if (own.x_low <= own.x_high) {
        const std::uint32_t id = element::sample_id(
            element::SampleClass::kImpostor, job.first_block[i] + b / element::kBlockTriangles,
            b % element::kBlockTriangles);
        const std::uint32_t columns = own.x_high - own.x_low + 1U;
        const std::uint32_t samples = columns * (own.y_high - own.y_low + 1U);
        for (std::uint32_t k = lane; k < samples; k += kWarp) {
          const std::uint32_t x = own.x_low + k % columns, y = own.y_low + k / columns;
          const Word seen = job.words[word_index(job.word_blocks_x, x, y)];
          const float nearest = element::bits_float(static_cast<std::uint32_t>(seen >> 32));
          if (nearest > own.depth_high) continue;
          const element::ReliefFound found = element::search_relief(
              job.cast.relief_shape, box, rays[warp], own.px_per_m, job.relief_view,
              static_cast<int>(x), static_cast<int>(y), nearest);
          target.put(static_cast<std::int32_t>(x), static_cast<std::int32_t>(y), found.depth, id);
        }
      }
      __syncwarp();
    }
  }
}

}  // namespace

cudaError_t launch_forms(const RasterJob& job, cudaStream_t stream) {
  if (job.representation != nullptr && job.count > 0) {
    THRONG_LAUNCH(relief_kernel, THRONG_PERSISTENT(kPersistentBlocks), kThreads, 0, stream, job);
  }
  if (job.splat_count > 0) {
    const std::uint32_t blocks = (job.splat_count + kThreads - 1) / kThreads;
    THRONG_LAUNCH(splat_kernel, blocks, kThreads, 0, stream, job);
  }
  return cudaGetLastError();
}

}  // namespace throng::render::visibility::cuda
