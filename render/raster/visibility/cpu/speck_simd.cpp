// Figures of a few pixels as boxes of an even colour, blended by coverage; see tile_simd.cpp for
// the rule that keeps bytes equal.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/raster/visibility/cpu/speck_simd.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "render/compute/cpu/speck_table.hpp"
#include "render/raster/element/instance_shade.hpp"
#include "render/raster/visibility/cpu/speck.hpp"
#include "render/raster/visibility/element/shade.hpp"

#ifndef THRONG_SPECK_COMMON
#define THRONG_SPECK_COMMON
namespace throng::render::visibility {

using element::SpeckLight;

struct SpeckBatch {
  const Speck* specks;
  const SpeckTable* table;
  const PlacedSpeck* placed;  // in the order of `entries`
  const std::uint64_t* entries;
  std::size_t count;
};

}  // namespace throng::render::visibility
#endif

HWY_BEFORE_NAMESPACE();
namespace throng::render::visibility {
namespace HWY_NAMESPACE {

/// Four floats: r g b and coverage, or the samples of a pixel. Every processor has them.
typedef float Four __attribute__((vector_size(16)));

inline Four Load(const float* from) {
  Four result;
  std::memcpy(&result, from, sizeof result);
  return result;
}
inline void Store(const Four& value, float* to) { std::memcpy(to, &value, sizeof value); }
inline Four All(float value) { return Four{value, value, value, value}; }
inline float Sum(const Four& v) { return (v[0] + v[1]) + (v[2] + v[3]); }
/// A pixel's samples, `at` being the first one's place.
inline Four LoadSamples(const float* at) {
  typedef std::int64_t Halves __attribute__((vector_size(16)));
  std::int64_t low, high;
  std::memcpy(&low, at, 8);
  std::memcpy(&high, at + 4, 8);
  const Halves halves{low, high};  // in registers: halves stored and read as a whole would wait
  Four result;
  std::memcpy(&result, &halves, sizeof result);
  return result;
}
inline void StoreSamples(const Four& value, float* at) {
  std::memcpy(at, &value, 8);
  std::memcpy(at + 4, reinterpret_cast<const char*>(&value) + 8, 8);
}

void PlaceSpecks(const Speck* specks, std::size_t count, const SpeckScene& speck_scene,
                 PlacedSpeck* out) {
  // copies, which what is written can't be
  const SceneFrame scene = *speck_scene.scene;
  const element::SampleGrid grid = *speck_scene.grid;
  for (std::size_t i = 0; i < count; ++i) out[i] = element::place_speck(specks[i], grid, scene);
}

/// Of the tile whose top left pixel is given.
SpeckLight LightOf(const SpeckScene& speck_scene, int tile_x_px, int tile_y_px) {
  const auto x_px = static_cast<float>(tile_x_px + kTilePx / 2);
  const auto y_px = static_cast<float>(tile_y_px + kTilePx / 2);
  const SceneFrame& scene = *speck_scene.scene;
  const element::SpeckView view = element::speck_view(scene, speck_scene.camera_up, x_px, y_px);
  element::SpeckFit fit;
  for (int k = 0; k < 6; ++k) element::begin_fit(fit, k, view, scene.sun_direction);
  for (int i = 0; i < element::SpeckFit::kNormals; ++i) {
    const element::SpeckNormal normal = element::speck_normal(i, view, scene.sun_direction);
    if (!(normal.seen > 0.0F)) continue;
    for (int k = 0; k < 6; ++k) {
      for (int j = 0; j < element::SpeckFit::kRow; ++j) {
        fit.sum[k][j] += element::speck_term(normal, k, j);
      }
    }
  }
  element::end_fit(fit);
  SpeckLight light;
  for (int k = 0; k < 6; ++k) element::light_row(light, k, fit, scene);
  element::light_places(light, view, scene, *speck_scene.grid, x_px, y_px);
  light.detail = speck_scene.detail;
  return light;
}

/// Colours of a figure's slabs, and where they lie.
struct Figure {
  std::uint32_t count;
  static constexpr std::uint32_t kMost = SpeckTable::kMostSlabs;
  float top[kMost], bottom[kMost], left[kMost], right[kMost];
  alignas(16) float color[kMost][4];  // times its coverage; a: coverage
};

void ShadeFigure(const SpeckScene& scene, const SpeckLight& light, const SpeckTable& table,
                 const PlacedSpeck& placed, float channel, Figure& figure) {
  const element::SpeckFigure own =
      element::speck_figure(placed, table.image[placed.image], light, scene.range, channel);
  const SpeckSlab* slabs =
      table.slab.data() + std::size_t{placed.image} * SpeckTable::kSlabs + own.first;
  figure.count = own.count;
  for (std::uint32_t k = 0; k < own.count; ++k) {
    const element::SpeckPiece piece =
        element::speck_piece(own, k, slabs[k], placed, light, *scene.scene, scene.range.colors);
    figure.top[k] = piece.top;
    figure.bottom[k] = piece.bottom;
    figure.left[k] = piece.left;
    figure.right[k] = piece.right;
    std::memcpy(figure.color[k], piece.color, sizeof piece.color);
  }
}

template <bool kHasPlanes>
void DrawSpecks(const SpeckBatch& batch, const SpeckScene& scene, const SpeckLight& light, int x_px,
                int y_px, const TilePlanes* planes, SpeckTile& tile) {
  Figure figure;
  alignas(16) float patch[kTilePx][4];
  for (std::size_t e = 0; e < batch.count; ++e) {
    if (e + 6 < batch.count) {
      const PlacedSpeck& next = batch.placed[e + 6];
      __builtin_prefetch(&batch.table->image[next.image]);
      __builtin_prefetch(&batch.table->slab[std::size_t{next.image} * SpeckTable::kSlabs]);
    }
    const PlacedSpeck& placed = batch.placed[e];
    const SpeckImage& image = batch.table->image[placed.image];
    const float size_y = placed.size * light.tall[element::elevation_of_image(placed.image)];
    const element::SpeckPixels box = element::speck_pixels(placed, image, size_y, x_px, y_px);
    const int x0 = box.x_low, x1 = box.x_high, y0 = box.y_low, y1 = box.y_high;
    if (x0 > x1 || y0 > y1) continue;
    // is anything of it seen?
    const float depth = placed.depth;
    const auto places = [](int x, int y) { return sample_index(2 * x, 2 * y); };
    const auto seen_through = [&](std::size_t at) HWY_ATTR {
      Four through = LoadSamples(tile.through + at);
      if constexpr (kHasPlanes) {
        through = LoadSamples(planes->depth + at) < All(depth) ? through : Four{};
      }
      return through;
    };
    constexpr float kLeast = 4.0F * element::kSpeckLeastThrough;
    bool is_seen = false;
    for (int y = y0; y <= y1 && !is_seen; ++y) {
      for (int x = x0; x <= x1; ++x) {
        if (Sum(seen_through(places(x, y))) > kLeast) {
          is_seen = true;
          break;
        }
      }
    }
    if (!is_seen) continue;
    const auto number = static_cast<std::uint32_t>(batch.entries[e]);
    ShadeFigure(scene, light, *batch.table, placed,
                scene.range.colors ? batch.specks[number].channel : 0.0F, figure);
    std::uint32_t k_first = 0;  // slabs go up, rows down
    for (int y = y1; y >= y0; --y) {
      const auto row_top = static_cast<float>(y + y_px), row_bottom = row_top + 1.0F;
      for (int x = x0; x <= x1; ++x) Store(Four{}, patch[x]);
      while (k_first < figure.count && figure.top[k_first] >= row_bottom) ++k_first;
      for (std::uint32_t k = k_first; k < figure.count && figure.bottom[k] > row_top; ++k) {
        const float high =
            std::min(figure.bottom[k], row_bottom) - std::max(figure.top[k], row_top);
        if (!(high > 0.0F)) continue;
        const Four color = Load(figure.color[k]) * All(high);
        const float from = figure.left[k] - static_cast<float>(x_px);
        const float to = figure.right[k] - static_cast<float>(x_px);
        const int first = std::max(static_cast<int>(std::floor(from)), x0);
        const int last = std::min(static_cast<int>(std::floor(to)), x1);
        for (int x = first; x <= last; ++x) {
          const float wide =
              std::min(to, static_cast<float>(x + 1)) - std::max(from, static_cast<float>(x));
          Store(Load(patch[x]) + color * All(std::max(wide, 0.0F)), patch[x]);
        }
      }
      for (int x = x0; x <= x1; ++x) {
        float alpha = patch[x][3];
        if (!(alpha > 0.0F)) continue;
        Four color = Load(patch[x]);
        if (alpha > 1.0F) {
          color = color * All(1.0F / alpha);
          alpha = 1.0F;
        }
        const std::size_t at = places(x, y);
        const Four through = seen_through(at);
        if (!(Sum(through) > kLeast)) continue;  // so no pixel depends on its neighbours
        float* rgb = tile.rgb[y * kTilePx + x];
        Store(Load(rgb) + color * All(0.25F * Sum(through)), rgb);
        StoreSamples(LoadSamples(tile.through + at) - through * All(alpha), tile.through + at);
      }
    }
  }
}

void BlendSpecks(const SpeckBatch& batch, const SpeckScene& scene, const SpeckLight& light,
                 int x_px, int y_px, const TilePlanes* planes, SpeckTile& tile) {
  if (planes != nullptr) {
    DrawSpecks<true>(batch, scene, light, x_px, y_px, planes, tile);
  } else {
    DrawSpecks<false>(batch, scene, light, x_px, y_px, planes, tile);
  }
}

void ShadeSpecks(const SpeckBatch& batch, const SpeckLight& light, int x_px, int y_px,
                 float* missing) {
  const element::SpeckShadow shadow = element::speck_shadow(light);
  if (!shadow.falls) return;
  const bool is_tall = shadow.is_tall;
  const int stride_run = is_tall ? kTilePx : 1, stride_across = is_tall ? 1 : kTilePx;
  for (std::size_t e = 0; e < batch.count; ++e) {
    const PlacedSpeck& placed = batch.placed[e];
    const float strength = light.shadow * placed.clear;
    if (strength < 0.01F) continue;
    const float x = placed.x - static_cast<float>(x_px), y = placed.y - static_cast<float>(y_px);
    const float u = is_tall ? y : x, v = is_tall ? x : y;
    const float low = u + placed.size * shadow.low, high = u + placed.size * shadow.high;
    const int u0 = std::max(static_cast<int>(std::floor(low)), 0);
    const int u1 = std::min(static_cast<int>(std::floor(high)), kTilePx - 1);
    for (int i = u0; i <= u1; ++i) {
      const element::SpeckShade shade =
          element::speck_shade(shadow, strength, placed.size, u, v, static_cast<float>(i));
      const int v0 = std::max(static_cast<int>(std::floor(shade.from)), 0);
      const int v1 = std::min(static_cast<int>(std::floor(shade.to)), kTilePx - 1);
      for (int j = v0; j <= v1; ++j) {
        const float wide = std::min(shade.to, static_cast<float>(j + 1)) -
                           std::max(shade.from, static_cast<float>(j));
        float& out = missing[i * stride_run + j * stride_across];
        out = element::add_shade(out, shade.dark * std::max(wide, 0.0F));
      }
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace throng::render::visibility
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace throng::render::visibility {

HWY_EXPORT(PlaceSpecks);
HWY_EXPORT(LightOf);
HWY_EXPORT(BlendSpecks);
HWY_EXPORT(ShadeSpecks);

void SpeckStage::place(const FrameGeometry& geometry, const SpeckScene& scene,
                       std::uint32_t tiles_x, std::uint32_t tiles_y, WorkPool& pool) {
  const std::size_t tiles = std::size_t{tiles_x} * tiles_y;
  const std::span<const SpeckRun> runs = geometry.speck_runs;
  const SpeckTable& table = *geometry.speck_table;
  if (placed_.size() < geometry.specks.size()) {
    placed_.resize(geometry.specks.size() + geometry.specks.size() / 2);
  }
  const auto width = static_cast<float>(scene.grid->width) * 0.5F;
  const auto height = static_cast<float>(scene.grid->height) * 0.5F;
  const bool shadows = scene.scene->shadows;
  const auto for_tiles = [&](const PlacedSpeck& placed, const auto& visit) {
    const element::SpeckTiles tiles =
        element::speck_tiles(placed, table.image[placed.image], shadows, width, height);
    for (std::uint32_t ty = tiles.y_low; ty <= tiles.y_high; ++ty) {
      for (std::uint32_t tx = tiles.x_low; tx <= tiles.x_high; ++tx) visit(ty * tiles_x + tx);
    }
  };
  pool.run(runs.size(), [&](std::size_t r, unsigned) {
    HWY_DYNAMIC_DISPATCH(PlaceSpecks)
    (geometry.specks.data() + runs[r].first, runs[r].count, scene, placed_.data() + runs[r].first);
  });
  bins_.fill(tiles, runs.size(), pool, [&](std::size_t begin, std::size_t end, auto&& put) {
    for (std::size_t r = begin; r < end; ++r) {
      for (std::uint32_t i = runs[r].first; i < runs[r].first + runs[r].count; ++i) {
        if (!(placed_[i].depth > 0.0F)) continue;
        std::uint32_t depth = 0;  // positive floats are in the order of their bits
        std::memcpy(&depth, &placed_[i].depth, sizeof depth);
        const std::uint64_t entry = std::uint64_t{~depth} << 32 | i;
        for_tiles(placed_[i], [&](std::uint32_t tile) { put(tile, entry); });
      }
    }
  });
  lights_.resize(tiles);
  pool.run(tiles, [&](std::size_t tile, unsigned) {
    if (!bins_.any(tile)) return;
    lights_[tile] = HWY_DYNAMIC_DISPATCH(LightOf)(scene, static_cast<int>(tile % tiles_x) * kTilePx,
                                                  static_cast<int>(tile / tiles_x) * kTilePx);
  });
}

namespace {

/// Near to far, by 16 bits of the range of depths there is; equals stay in order.
void sort_by_depth(std::span<const std::uint64_t> entries, std::vector<std::uint64_t>& order) {
  const std::size_t count = entries.size();
  constexpr std::size_t kFew = 128;
  if (count <= kFew) {
    order.assign(entries.begin(), entries.end());
    std::sort(order.begin(), order.end());
    return;
  }
  std::uint32_t low = 0xffffffffU, high = 0;
  for (const std::uint64_t entry : entries) {
    const auto depth = static_cast<std::uint32_t>(entry >> 32);
    low = std::min(low, depth);
    high = std::max(high, depth);
  }
  int shift = 0;
  while (((high - low) >> shift) > 0xffffU) ++shift;
  order.resize(2 * count);
  const auto pass = [&](const std::uint64_t* from, std::uint64_t* to, int bits) {
    std::uint32_t next[256] = {};
    const auto digit = [&](std::uint64_t entry) {
      return ((static_cast<std::uint32_t>(entry >> 32) - low) >> (shift + bits)) & 255U;
    };
    for (std::size_t i = 0; i < count; ++i) ++next[digit(from[i])];
    std::uint32_t sum = 0;
    for (std::uint32_t& one : next) sum += std::exchange(one, sum);
    for (std::size_t i = 0; i < count; ++i) to[next[digit(from[i])]++] = from[i];
  };
  pass(entries.data(), order.data() + count, 0);
  pass(order.data() + count, order.data(), 8);
  order.resize(count);
}

}  // namespace

/// In a loop of their own many of them are on their way from memory at once.
void SpeckStage::gather(std::span<const std::uint64_t> entries,
                        std::vector<PlacedSpeck>& placed) const {
  placed.resize(entries.size());
  for (std::size_t e = 0; e < entries.size(); ++e) {
    placed[e] = placed_[static_cast<std::uint32_t>(entries[e])];
  }
}

void SpeckStage::draw(std::size_t tile, int x_px, int y_px, const FrameGeometry& geometry,
                      const SpeckScene& scene, const TilePlanes* planes, SpeckScratch& scratch,
                      SpeckTile& result) const {
  std::memset(result.rgb, 0, sizeof(result.rgb));
  std::fill(std::begin(result.through), std::end(result.through), 1.0F);
  sort_by_depth(bins_.of(tile), scratch.order);
  gather(scratch.order, scratch.placed);
  HWY_DYNAMIC_DISPATCH(BlendSpecks)
  ({geometry.specks.data(), geometry.speck_table, scratch.placed.data(), scratch.order.data(),
    scratch.order.size()},
   scene, lights_[tile], x_px, y_px, planes, result);
}

void SpeckStage::shade(std::size_t tile, int x_px, int y_px, const FrameGeometry& geometry,
                       SpeckScratch& scratch, float* missing) const {
  const std::span<const std::uint64_t> list = bins_.of(tile);
  gather(list, scratch.placed);
  HWY_DYNAMIC_DISPATCH(ShadeSpecks)
  ({geometry.specks.data(), geometry.speck_table, scratch.placed.data(), list.data(), list.size()},
   lights_[tile], x_px, y_px, missing);
}

}  // namespace throng::render::visibility
#endif
