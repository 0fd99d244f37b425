#include "render/raster/visibility/cuda/draw.hpp"
#include "render/raster/visibility/cuda/launch.hpp"

// What each pixel shows beside its colour (PixelFacts).
namespace throng::render::visibility::cuda {
namespace {

constexpr std::uint32_t kThreads = 128;
constexpr std::uint32_t kNothing = 0xffffffffU;

__device__ std::uint32_t shown_by(const RasterJob& job, std::uint32_t id) {
  if (element::class_of(id) != element::SampleClass::kPoint) {
    return job.block_instance[element::block_of(id)];
  }
  const std::uint32_t visible = job.splats[id & element::kSplatNumber].visible;
  return visible == kNobody ? kNothing : visible;
}

/// Of a pixel's samples the instance that most of them show decides, and of equals the nearer one.
__global__ void facts_kernel(RasterJob job) {
  const std::uint32_t pixel = blockIdx.x * blockDim.x + threadIdx.x;
  if (pixel >= job.width_px * job.height_px) return;
  std::uint32_t best = kNothing;
  int best_count = 0;
  float best_depth = -1.0F;
  if (!has_words(job)) {
    best_depth = 0.0F;
  } else {
    const std::size_t at =
        word_index(job.word_blocks_x, 2 * (pixel % job.width_px), 2 * (pixel / job.width_px));
    std::uint32_t shown[4];
    float depth[4];
    for (int k = 0; k < 4; ++k) {
      const Word word = job.words[at + k];
      depth[k] = element::bits_float(static_cast<std::uint32_t>(word >> 32));
      shown[k] = word == 0 ? kNothing : shown_by(job, static_cast<std::uint32_t>(word));
    }
    for (int k = 0; k < 4; ++k) {
      int count = 0;
      float nearest = 0.0F;
      for (int other = 0; other < 4; ++other) {
        if (shown[other] != shown[k]) continue;
        ++count;
        nearest = element::most(nearest, depth[other]);
      }
      if (count < best_count || (count == best_count && nearest <= best_depth)) continue;
      best = shown[k];
      best_count = count;
      best_depth = nearest;
    }
  }
  job.fact_instance[pixel] = best;
  job.fact_depth[pixel] = best_depth;
}

/// The pixels that an instance's vertices lie within, by a block of threads each; all of them where
/// one needs clipping.
__global__ void __launch_bounds__(kThreads) bounds_kernel(RasterJob job) {
  __shared__ int low_x, low_y, high_x, high_y;
  const std::uint32_t i = blockIdx.x;
  if (threadIdx.x == 0) {
    low_x = low_y = INT32_MAX;
    high_x = high_y = INT32_MIN;
  }
  __syncthreads();
  if (is_relief(job, i)) {
    const ReliefMember member = job.cast.relief_member[job.instance[i].character];
    for (std::uint32_t b = threadIdx.x; b < member.box_count; b += kThreads) {
      const element::PlacedBox box =
          element::place_box(job.cast.relief_box[member.first_box + b], job.instance[i],
                             job.jointed[i], job.joints, job.relief_view, job.grid);
      if (box.x_low > box.x_high) continue;
      atomicMin(&low_x, static_cast<int>(box.x_low));
      atomicMin(&low_y, static_cast<int>(box.y_low));
      atomicMax(&high_x, static_cast<int>(box.x_high));
      atomicMax(&high_y, static_cast<int>(box.y_high));
    }
    __syncthreads();
    if (threadIdx.x != 0) return;
    job.fact_bounds[i] = low_x > high_x ? FactBox{0, 0, -1, -1}
                                        : FactBox{low_x / 2, low_y / 2, high_x / 2, high_y / 2};
    return;
  }
  const bool shares = is_shared(job, i);
  const std::uint32_t first = shares ? 0 : job.vertex_offset[i];
  const std::uint32_t count =
      shares ? job.cast.level[job.shared[i].level].vertex_count : job.vertex_offset[i + 1] - first;
  bool clipped = false;
  for (std::uint32_t v = threadIdx.x; v < count; v += kThreads) {
    const element::SnappedVertex vertex =
        shares ? element::project(job.grid, placed_vertex(job, i, v)) : job.projected[first + v];
    if (vertex.x == element::kNeedsClip) {
      clipped = true;
      continue;
    }
    atomicMin(&low_x, vertex.x);
    atomicMin(&low_y, vertex.y);
    atomicMax(&high_x, vertex.x);
    atomicMax(&high_y, vertex.y);
  }
  const bool whole = __syncthreads_or(clipped ? 1 : 0) != 0;
  if (threadIdx.x != 0) return;
  FactBox box{0, 0, static_cast<std::int32_t>(job.width_px) - 1,
              static_cast<std::int32_t>(job.height_px) - 1};
  if (!whole) {
    const auto pixel = [](int units) { return units >> (element::kSubBits + 1); };
    if (count == 0) {
      box = {0, 0, -1, -1};
    } else {
      if (pixel(low_x) > box.x_low) box.x_low = pixel(low_x);
      if (pixel(low_y) > box.y_low) box.y_low = pixel(low_y);
      if (pixel(high_x) < box.x_high) box.x_high = pixel(high_x);
      if (pixel(high_y) < box.y_high) box.y_high = pixel(high_y);
      if (box.x_low > box.x_high || box.y_low > box.y_high) box = {0, 0, -1, -1};
    }
  }
  job.fact_bounds[i] = box;
}

}  // namespace

cudaError_t launch_facts(const RasterJob& job, cudaStream_t stream) {
  if (job.fact_depth == nullptr) return cudaSuccess;
  constexpr std::uint32_t kFlat = 256;
  const std::uint32_t pixels = job.width_px * job.height_px;
  THRONG_LAUNCH_APART(facts_kernel, (pixels + kFlat - 1) / kFlat, kFlat, stream, job);
  if (job.count > 0) THRONG_LAUNCH(bounds_kernel, job.count, kThreads, 0, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::visibility::cuda
