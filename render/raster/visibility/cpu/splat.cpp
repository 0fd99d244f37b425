#include "render/raster/visibility/cpu/splat.hpp"

#include <algorithm>

namespace throng::render::visibility {
namespace {

bool is_point(std::uint32_t id) { return element::class_of(id) == element::SampleClass::kPoint; }

}  // namespace

void SplatStage::place(std::span<const Splat> splats, const SampleGrid& grid,
                       const SceneFrame& scene, const glm::mat3& view_from_relative,
                       std::uint32_t tiles_x, std::uint32_t tiles_y, WorkPool& pool) {
  constexpr std::size_t kChunk = 512;
  const std::size_t count = splats.size(), tiles = std::size_t{tiles_x} * tiles_y;
  if (placed_.size() < count) placed_.resize(count + count / 2);
  const auto width = static_cast<float>(grid.width), height = static_cast<float>(grid.height);
  const auto for_tiles = [&](const element::PlacedSplat& splat, const auto& visit) {
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
      placed_[i] = element::place_splat(splats[i], grid, scene, view_from_relative);
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
    const element::PlacedSplat& splat = placed_[number];
    const element::SplatBox box = element::splat_box(splat, tile_x, tile_y, kTileSamples);
    const std::uint32_t id = element::splat_id(number);
    for (int y = box.y_low; y <= box.y_high; ++y) {
      for (int x = box.x_low; x <= box.x_high; ++x) {
        const float depth = element::splat_depth(splat, box, x, y);
        if (depth == 0.0F) continue;
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
        const std::uint32_t number = ids[first] & element::kSplatNumber;
        const std::size_t n = items.count++;
        const Splat& splat = splats[number];
        items.instance[n] = static_cast<std::int32_t>(std::min(splat.visible, instances));
        items.base[n] = splat.base;
        items.regions[n] = splat.visible == kNobody ? 0 : splat.regions;
        const glm::vec3 normal = element::splat_normal(splat, scene);
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
