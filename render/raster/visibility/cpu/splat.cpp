#include "render/raster/visibility/cpu/splat.hpp"

#include <algorithm>
#include <cmath>

#include "render/compute/element/octahedral.hpp"
#include "render/raster/visibility/element/word.hpp"

namespace throng::render::visibility {
namespace {

/// Discs steeper than this are drawn as if they were not: thinner ones would leave the silhouette
/// to chance.
constexpr float kLeastFacing = 0.25F;
/// Far splats still meet a sample now and then.
constexpr float kLeastRadius = 0.5F;
constexpr std::uint32_t kClassBits = static_cast<std::uint32_t>(element::SampleClass::kPoint) << 30;
constexpr std::uint32_t kNumberBits = (1U << 30) - 1;

bool is_point(std::uint32_t id) { return (id & ~kNumberBits) == kClassBits; }

glm::vec3 towards_eye(const SceneFrame& scene, const glm::vec3& position_relative) {
  return scene.orthographic ? -scene.ray_direction : -position_relative;
}

PlacedSplat place_one(const Splat& splat, const SampleGrid& grid, const SceneFrame& scene,
                      const glm::mat3& view_from_relative) {
  PlacedSplat placed{};
  placed.radius = -1.0F;
  const glm::vec3& p = splat.position_relative;
  const glm::vec4 clip = grid.clip_from_relative * glm::vec4(p, 1.0F);
  if (!(clip.w > 0.0F) || !(clip.z > 0.0F) || !(clip.z <= clip.w)) return placed;
  const glm::vec3 n = element::unpack_octahedral(splat.normal);
  const glm::vec3 to_eye = towards_eye(scene, p);
  const float facing = glm::dot(n, to_eye);
  const bool has_side = splat.radius_m >= 0.0F;
  if (has_side && !(facing > 0.0F)) return placed;
  const float inverse_w = 1.0F / clip.w;
  placed.x = (1.0F + clip.x * inverse_w) * 0.5F * static_cast<float>(grid.width);
  placed.y = (1.0F - clip.y * inverse_w) * 0.5F * static_cast<float>(grid.height);
  placed.depth = std::min(clip.z * inverse_w, 1.0F);
  const float samples_per_m = 2.0F * scene.px_per_tangent * inverse_w;
  placed.radius = std::max(std::abs(splat.radius_m) * samples_per_m, kLeastRadius);
  if (!has_side) {
    if (splat.visible == kNobody && splat.regions > 0) {
      const float squeeze = 255.0F / static_cast<float>(std::min(splat.regions, 255U));
      placed.slope_x = std::sqrt(squeeze * squeeze - 1.0F);
    }
    return placed;
  }
  const glm::vec3 in_view = view_from_relative * n;
  const float steep = 1.0F / std::max(facing / glm::length(to_eye), kLeastFacing);
  // towards the eye where the surface rises: -n / n.z, y down on the picture
  placed.slope_x = -in_view.x * steep;
  placed.slope_y = in_view.y * steep;
  // what a sample's step towards the eye adds to the depth: along the view axis z / w changes by
  // its two gradients there
  const glm::mat4& m = grid.clip_from_relative;
  const glm::vec3 nearer =
      glm::vec3(view_from_relative[0].z, view_from_relative[1].z, view_from_relative[2].z);
  const float dz = glm::dot(glm::vec3(m[0].z, m[1].z, m[2].z), nearer);
  const float dw = glm::dot(glm::vec3(m[0].w, m[1].w, m[2].w), nearer);
  placed.depth_slope = (dz - placed.depth * dw) * inverse_w / std::max(samples_per_m, 1e-12F);
  return placed;
}

}  // namespace

void SplatStage::place(std::span<const Splat> splats, const SampleGrid& grid,
                       const SceneFrame& scene, const glm::mat3& view_from_relative,
                       std::uint32_t tiles_x, std::uint32_t tiles_y, WorkPool& pool) {
  constexpr std::size_t kChunk = 512;
  const std::size_t count = splats.size(), tiles = std::size_t{tiles_x} * tiles_y;
  if (placed_.size() < count) placed_.resize(count + count / 2);
  const auto width = static_cast<float>(grid.width), height = static_cast<float>(grid.height);
  const auto for_tiles = [&](const PlacedSplat& splat, const auto& visit) {
    const float x0 = splat.x - splat.radius, x1 = splat.x + splat.radius;
    const float y0 = splat.y - splat.radius, y1 = splat.y + splat.radius;
    if (!(x1 > 0.0F && y1 > 0.0F && x0 < width && y0 < height)) return;
    const auto tile_of = [](float at, float size) {
      return static_cast<std::uint32_t>(std::clamp(at, 0.0F, size - 1.0F)) / kTileSamples;
    };
    const std::uint32_t tx1 = tile_of(x1, width), ty1 = tile_of(y1, height);
    for (std::uint32_t ty = tile_of(y0, height); ty <= ty1; ++ty) {
      for (std::uint32_t tx = tile_of(x0, width); tx <= tx1; ++tx) visit(ty * tiles_x + tx);
    }
  };
  pool.for_chunks(count, kChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      placed_[i] = place_one(splats[i], grid, scene, view_from_relative);
    }
  });
  bins_.fill(tiles, count, pool, [&](std::size_t begin, std::size_t end, auto&& put) {
    for (std::size_t i = begin; i < end; ++i) {
      if (!(placed_[i].radius > 0.0F)) continue;
      for_tiles(placed_[i], [&](std::uint32_t tile) { put(tile, static_cast<std::uint32_t>(i)); });
    }
  });
}

void SplatStage::draw(std::size_t tile, int tile_x, int tile_y, TilePlanes& planes) const {
  const std::span<const std::uint32_t> list = bins_.of(tile);
  for (std::size_t e = 0; e < list.size(); ++e) {
    if (e + 8 < list.size()) __builtin_prefetch(&placed_[list[e + 8]]);
    const std::uint32_t number = list[e];
    const PlacedSplat& splat = placed_[number];
    // sample centres are at halves
    const float cx = splat.x - static_cast<float>(tile_x) - 0.5F;
    const float cy = splat.y - static_cast<float>(tile_y) - 0.5F;
    constexpr auto kLast = static_cast<float>(kTileSamples - 1);
    const int x0 = static_cast<int>(std::ceil(std::max(cx - splat.radius, 0.0F)));
    const int x1 = static_cast<int>(std::floor(std::min(cx + splat.radius, kLast)));
    const int y0 = static_cast<int>(std::ceil(std::max(cy - splat.radius, 0.0F)));
    const int y1 = static_cast<int>(std::floor(std::min(cy + splat.radius, kLast)));
    const float limit = splat.radius * splat.radius;
    const std::uint32_t id = kClassBits | number;
    for (int y = y0; y <= y1; ++y) {
      const float j = static_cast<float>(y) - cy;
      for (int x = x0; x <= x1; ++x) {
        const float i = static_cast<float>(x) - cx;
        const float rise = splat.slope_x * i + splat.slope_y * j;
        if (i * i + j * j + rise * rise > limit) continue;
        const float depth = std::clamp(splat.depth + splat.depth_slope * rise, 1e-30F, 1.0F);
        const std::size_t at = sample_index(x, y);
        const bool wins =
            depth > planes.depth[at] || (depth == planes.depth[at] && id > planes.id[at]);
        if (!wins) continue;
        planes.depth[at] = depth;
        planes.id[at] = id;
      }
    }
  }
}

void SplatStage::collect(const TilePlanes& planes, std::span<const Splat> splats,
                         const SceneFrame& scene, int width, int height, std::uint32_t instances,
                         SurfaceItems& items) {
  items.count = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const std::size_t at = sample_index(2 * x, 2 * y);
      const std::uint32_t ids[4] = {planes.id[at], planes.id[at + 1], planes.id[at + 4],
                                    planes.id[at + 5]};
      unsigned rest = 0;
      for (unsigned k = 0; k < 4; ++k) rest |= static_cast<unsigned>(is_point(ids[k])) << k;
      while (rest != 0) {
        const int first = __builtin_ctz(rest);
        unsigned same = 0;
        for (unsigned k = 0; k < 4; ++k) {
          same |= static_cast<unsigned>(ids[k] == ids[first]) << k;
        }
        same &= rest;
        rest &= ~same;
        const std::uint32_t number = ids[first] & kNumberBits;
        const std::size_t n = items.count++;
        const Splat& splat = splats[number];
        items.instance[n] = static_cast<std::int32_t>(std::min(splat.visible, instances));
        items.base[n] = splat.base;
        items.regions[n] = splat.visible == kNobody ? 0 : splat.regions;
        glm::vec3 normal = element::unpack_octahedral(splat.normal);
        // a disc without a side shows the one it is seen from
        if (splat.radius_m < 0.0F &&
            glm::dot(normal, towards_eye(scene, splat.position_relative)) < 0.0F) {
          normal = -normal;
        }
        for (int c = 0; c < 3; ++c) {
          items.normal[c][n] = normal[c];
          items.relative[c][n] = splat.position_relative[c];
        }
        items.weight[n] = 0.25F * static_cast<float>(__builtin_popcount(same));
        items.pixel[n] = static_cast<std::uint16_t>(y * (kTileSamples / 2) + x);
      }
    }
  }
}

}  // namespace throng::render::visibility
