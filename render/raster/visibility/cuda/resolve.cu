#include "render/compute/cuda/kernel.hpp"
#include "render/raster/visibility/cuda/launch.hpp"
#include "render/raster/visibility/element/word.hpp"

namespace throng::render::visibility::cuda {
namespace {

constexpr std::uint32_t kTileX = 16, kTileY = 8;  // pixels of a block of threads

/// Where a toned instance's tones begin.
__device__ const std::uint32_t* tones_of(const RasterJob& job, std::uint32_t instance) {
  const VisibleInstance& visible = job.instance[instance];
  const RasterCharacter& character = job.cast.character[visible.character];
  return job.cast.corner_tones + element::first_tone(job.cast.band + character.first_band,
                                                     character.band_count, visible.vertex_count);
}

__device__ element::ShadeCorners shared_corners(const RasterJob& job, std::uint32_t i,
                                                std::uint32_t t) {
  const SharedInstance shared = job.shared[i];
  const VisibleInstance& instance = job.instance[i];
  const std::uint32_t word =
      job.cast.level_corners[job.cast.level[shared.level].first_triangle + t];
  const float* column = job.posed + shared.posed + kPosedHeader;
  const std::uint32_t* uv = job.cast.uv + job.cast.character[instance.character].first_uv;
  element::ShadeCorners corners;
  for (int k = 0; k < 3; ++k) {
    const std::uint32_t v = (word >> (10 * k)) & 1023U;
    corners.p[k] = placed_vertex(job, i, v);
    corners.n[k] = element::turn_posed(
        shared.cosine_scale, shared.sine_scale, instance.scale,
        element::rough_octahedral(element::float_bits(column[3 * shared.stride + v])));
    corners.uv[k] = uv[v];
  }
  return corners;
}

__device__ element::ShadeCorners corners_of(const RasterJob& job, std::uint32_t instance,
                                            std::uint32_t t) {
  if (is_shared(job, instance)) return shared_corners(job, instance, t);
  const std::uint32_t* index = job.indices + 3 * (job.triangle_offset[instance] + t);
  element::ShadeCorners corners;
  for (int k = 0; k < 3; ++k) {
    const BatchVertex& vertex = job.vertices[index[k]];
    corners.p[k] = vertex.position_relative;
    corners.n[k] = element::rough_octahedral(
        static_cast<std::uint32_t>(static_cast<std::uint16_t>(vertex.normal.x)) |
        static_cast<std::uint32_t>(static_cast<std::uint16_t>(vertex.normal.y)) << 16);
    corners.uv[k] =
        static_cast<std::uint32_t>(vertex.uv.x) | static_cast<std::uint32_t>(vertex.uv.y) << 16;
  }
  return corners;
}

/// What an instance shows at pixel coordinates (x, y): tone-mapped, linear.
/// @param ground_missing  share of the ground's light that shadows take there.
__device__ glm::vec3 shade_figure(const RasterJob& job, std::uint32_t i, std::uint32_t id, float x,
                                  float y, float ground_missing) {
  const InstanceShade& shade = job.shade[i];
  const std::uint32_t t = (element::block_of(id) - job.first_block[i]) * element::kBlockTriangles +
                          element::triangle_of(id);
  if (is_shared(job, i)) {
    const SharedInstance& shared = job.shared[i];
    const VisibleInstance& instance = job.instance[i];
    const RasterLevel& level = job.cast.level[shared.level];
    if (element::is_flat(shade.size_px, level.triangle_count, instance.seed)) {
      const std::uint32_t triangle = level.first_triangle + t;
      return element::shade_flat(
          job.scene, shade, job.cast.tones[triangle], shared, instance.scale,
          (job.cast.character[instance.character].flags & RasterCharacter::kDoubleSided) != 0,
          job.posed + shared.posed + kPosedHeader + 2 * shared.stride,
          job.cast.level_corners[triangle]);
    }
  }
  element::ShadeCorners corners = corners_of(job, i, t);
  if ((shade.character & kToned) != 0) {
    const std::uint32_t* tone = tones_of(job, i) + 3 * t;
    for (int k = 0; k < 3; ++k) corners.uv[k] = tone[k];
  }
  const glm::vec3 color = element::shade_triangle(
      job.scene, shade, job.cast.character[shade.character & ~kToned].texture, job.cast.texels,
      corners, x, y);
  if (job.figures.first == nullptr || shade.cast_shadow != kNoBlob) return color;
  return color * element::surface_kept(
                     element::surface_shadow(job.scene, element::sunward(job.scene), job.figures,
                                             job.shade, corners.p, x, y, ground_missing));
}

/// What a point shows.
__device__ glm::vec3 shade_point(const RasterJob& job, std::uint32_t number) {
  const Splat& splat = job.splats[number];
  const bool is_nobody = splat.visible >= job.count;
  InstanceShade shade{};
  if (is_nobody) {
    shade.feet_relative.z = job.scene.ground_relative_m;
    shade.channel = kNoChannel;
  } else {
    shade = job.shade[splat.visible];
  }
  return element::shade_surface(job.scene, shade, splat.base,
                                splat.visible == kNobody ? 0 : splat.regions,
                                element::splat_normal(splat, job.scene), splat.position_relative);
}

/// What an impostor shows at a sample: its ray is looked along once more.
__device__ glm::vec3 shade_relief(const RasterJob& job, std::uint32_t i, std::uint32_t id,
                                  std::uint32_t x, std::uint32_t y, float depth) {
  const VisibleInstance& instance = job.instance[i];
  const JointedInstance& jointed = job.jointed[i];
  const std::uint32_t b = (element::block_of(id) - job.first_block[i]) * element::kBlockTriangles +
                          element::triangle_of(id);
  const ReliefBox& box =
      job.cast.relief_box[job.cast.relief_member[instance.character].first_box + b];
  const element::PlacedBox placed =
      element::place_box(box, instance, jointed, job.joints, job.relief_view, job.grid);
  const element::ReliefRays rays =
      element::relief_rays(box, placed, job.relief_view, job.relief_search);
  const std::uint32_t texel =
      element::search_relief(job.cast.relief_shape, box, rays, placed.px_per_m, job.relief_view,
                             static_cast<int>(x), static_cast<int>(y), 0.0F)
          .texel;
  const element::ReliefHit hit =
      element::relief_hit(box, job.cast.relief_shape[texel], instance, jointed, job.joints,
                          job.relief_view, static_cast<int>(x), static_cast<int>(y), depth);
  return element::shade_surface(job.scene, job.shade[i], job.cast.relief_base[texel],
                                job.cast.relief_regions[texel], hit.normal, hit.relative);
}

/// Whether a pixel's tile has specks.
__device__ bool has_specks(const RasterJob& job, std::uint32_t x, std::uint32_t y) {
  if (job.speck_entries == 0) return false;
  const std::uint32_t tile =
      y / element::kSpeckTilePx * job.speck_tiles_x + x / element::kSpeckTilePx;
  return job.first_of_tile[tile + 1] != job.first_of_tile[tile];
}

/// One pixel: each instance seen in its four samples is shaded once, where its samples are on the
/// average; the rest is ground or sky.
__global__ void __launch_bounds__(kTileX* kTileY) resolve_kernel(RasterJob job) {
  const std::uint32_t tiles_x = (job.width_px + kTileX - 1) / kTileX;
  const std::uint32_t x = blockIdx.x % tiles_x * kTileX + threadIdx.x % kTileX;
  const std::uint32_t y = blockIdx.x / tiles_x * kTileY + threadIdx.x / kTileX;
  if (x >= job.width_px || y >= job.height_px) return;
  const std::size_t at = word_index(job.word_blocks_x, 2 * x, 2 * y);
  float missing = 0.0F;
  if (job.count > 0 && job.scene.shadows) {
    float d[4];
    for (std::uint32_t k = 0; k < 4; ++k) d[k] = element::bits_float(job.shadow[at + k]);
    missing = element::most(
        0.25F * (((d[0] + d[1]) + d[2]) + d[3]),
        element::bits_float(job.blob_shadow[static_cast<std::size_t>(y) * job.width_px + x]));
  }
  glm::vec3 color(0.0F, 0.0F, 0.0F);
  float background = 1.0F;
  if (has_words(job)) {
    std::uint32_t id[4], instance[4], rest = 0;  // of a point its id, which no instance has
    for (std::uint32_t k = 0; k < 4; ++k) {
      const Word word = job.words[at + k];
      id[k] = static_cast<std::uint32_t>(word);
      instance[k] = 0;
      if (word == 0) continue;
      rest |= 1U << k;
      background -= 0.25F;
      instance[k] = element::class_of(id[k]) == element::SampleClass::kPoint
                        ? id[k]
                        : job.block_instance[element::block_of(id[k])];
    }
    while (rest != 0) {
      const std::uint32_t first = (rest & 1U) != 0   ? 0
                                  : (rest & 2U) != 0 ? 1
                                  : (rest & 4U) != 0 ? 2
                                                     : 3;
      std::uint32_t same = 0;
      float samples = 0.0F, sum_x = 0.0F, sum_y = 0.0F;
      for (std::uint32_t k = 0; k < 4; ++k) {
        if ((rest >> k & 1U) == 0 || instance[k] != instance[first]) continue;
        same |= 1U << k;
        samples += 1.0F;
        sum_x += (k & 1U) != 0 ? 0.75F : 0.25F;
        sum_y += (k & 2U) != 0 ? 0.75F : 0.25F;
      }
      rest &= ~same;
      glm::vec3 one;
      switch (element::class_of(id[first])) {
        case element::SampleClass::kPoint:
          one = shade_point(job, id[first] & element::kSplatNumber);
          break;
        case element::SampleClass::kImpostor:
          one = shade_relief(
              job, instance[first], id[first], 2 * x + (first & 1U), 2 * y + (first >> 1),
              element::bits_float(static_cast<std::uint32_t>(job.words[at + first] >> 32)));
          break;
        default:
          one =
              shade_figure(job, instance[first], id[first], static_cast<float>(x) + sum_x / samples,
                           static_cast<float>(y) + sum_y / samples, missing);
      }
      color = color + one * (0.25F * samples);
    }
  }
  float covered = 0.0F;  // by the shadows of specks
  if (has_specks(job, x, y)) {
    float behind = 0.0F, figures = 0.0F, samples = 0.0F;
    for (std::uint32_t k = 0; k < 4; ++k) {
      const bool is_figure = has_words(job) && job.words[at + k] != 0;
      (is_figure ? figures : behind) += job.speck_through[at + k];
      samples += is_figure ? 1.0F : 0.0F;
    }
    const glm::vec4 light = job.speck_light[static_cast<std::size_t>(y) * job.width_px + x];
    color = color * (samples > 0.0F ? figures / samples : 1.0F) + glm::vec3(light);
    background = 0.25F * behind;
    covered = light.w;
  }
  if (background > 0.0F) {
    missing = element::add_shade(missing, covered);
    const glm::vec3 ground =
        element::shade_background(job.scene, static_cast<int>(x), static_cast<int>(y));
    color = color + (ground * (1.0F - missing)) * background;
  }
  std::uint32_t code = 0xff000000U;
  for (int c = 0; c < 3; ++c) code |= element::srgb_code(color[c]) << (8 * c);
  job.pixels[static_cast<std::size_t>(y) * job.width_px + x] = code;
}

/// r g b x of four pixels to r g b.
__global__ void pack_kernel(const std::uint32_t* rgbx, std::uint32_t* rgb, std::uint32_t groups) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i >= groups) return;
  const std::uint32_t a = rgbx[4 * i] & 0xffffffU, b = rgbx[4 * i + 1] & 0xffffffU;
  const std::uint32_t c = rgbx[4 * i + 2] & 0xffffffU, d = rgbx[4 * i + 3] & 0xffffffU;
  rgb[3 * i] = a | b << 24;
  rgb[3 * i + 1] = b >> 8 | c << 16;
  rgb[3 * i + 2] = c >> 16 | d << 8;
}

}  // namespace

cudaError_t launch_pack(const std::uint32_t* rgbx, std::uint32_t* rgb, std::uint32_t groups,
                        cudaStream_t stream) {
  if (groups == 0) return cudaSuccess;
  constexpr std::uint32_t kThreads = 256;
  THRONG_LAUNCH_APART(pack_kernel, (groups + kThreads - 1) / kThreads, kThreads, stream, rgbx, rgb,
                      groups);
  return cudaGetLastError();
}

cudaError_t launch_resolve(const RasterJob& job, cudaStream_t stream) {
  const std::uint32_t blocks =
      (job.width_px + kTileX - 1) / kTileX * ((job.height_px + kTileY - 1) / kTileY);
  THRONG_LAUNCH_APART(resolve_kernel, blocks, kTileX * kTileY, stream, job);
  return cudaGetLastError();
}

}  // namespace throng::render::visibility::cuda
