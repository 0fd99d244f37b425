#pragma once

#include "render/compute/cuda/kernel.hpp"
#include "render/raster/visibility/cuda/raster_types.hpp"
#include "render/raster/visibility/element/coverage.hpp"
#include "render/raster/visibility/element/word.hpp"

// How a triangle gets into the visibility words: alone by one thread, by a warp, or tile by tile.
// For .cu files. Edges and depths are those of the processor's tiles: integers that do not depend
// on where they are counted from, so the words are the same bits.
namespace throng::render::visibility::cuda {

constexpr std::uint32_t kWarp = 32;
constexpr std::uint32_t kAllLanes = 0xffffffffU;
constexpr std::int32_t kThreadSamples = 24;  // a box of at most so many is one thread's
constexpr std::int32_t kHalfUnit = element::kSubUnit / 2;

/// A triangle that faces the eye, with the samples between its outermost corners.
struct Facing {
  element::SnappedVertex a, b, c;
  std::int64_t area;
  element::SampleBox box;
};

/// False for what covers no sample of the picture.
__device__ inline bool faces(const RasterJob& job, const element::SnappedVertex& a,
                             const element::SnappedVertex& b, const element::SnappedVertex& c,
                             bool double_sided, Facing& facing) {
  const auto low = [](std::int32_t p, std::int32_t q, std::int32_t r) {
    const std::int32_t least = p < q ? (p < r ? p : r) : (q < r ? q : r);
    const std::int32_t sample = (least + kHalfUnit - 1) >> element::kSubBits;
    return sample < 0 ? 0 : sample;
  };
  const auto high = [](std::int32_t p, std::int32_t q, std::int32_t r, std::int32_t count) {
    const std::int32_t most = p > q ? (p > r ? p : r) : (q > r ? q : r);
    const std::int32_t sample = (most - kHalfUnit) >> element::kSubBits;
    return sample < count ? sample : count - 1;
  };
  facing.box = {low(a.x, b.x, c.x), low(a.y, b.y, c.y), high(a.x, b.x, c.x, job.grid.width),
                high(a.y, b.y, c.y, job.grid.height)};
  if (facing.box.x_low > facing.box.x_high || facing.box.y_low > facing.box.y_high) return false;
  facing.area = element::doubled_area(a.x, a.y, b.x, b.y, c.x, c.y);
  const bool turned = facing.area < 0 && double_sided;
  facing.a = a;
  facing.b = turned ? c : b;
  facing.c = turned ? b : c;
  if (turned) facing.area = -facing.area;
  return facing.area > 0;
}

/// Where samples go: the nearest surface, or on the ground the strongest shadow.
struct Target {
  Word* words;
  std::uint32_t* shadow;  // null: words
  std::uint32_t blocks_x;

  /// A plain read first: most samples of a crowd are hidden, and atomics are dear.
  __device__ void put(std::int32_t x, std::int32_t y, float z, std::uint32_t id) const {
    if (!(z > 0.0F)) return;
    const std::size_t at =
        word_index(blocks_x, static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
    const std::uint32_t bits = element::float_bits(z);
    if (shadow != nullptr) {
      if (shadow[at] < bits) atomicMax(&shadow[at], bits);
      return;
    }
    const Word word = static_cast<Word>(bits) << 32 | id;
    if (words[at] < word) atomicMax(&words[at], word);
  }
};

/// Edges and depth of a facing triangle, counted from one sample of the picture; right for samples
/// up to 63 beyond it.
struct Planes {
  element::Edge edge[3];
  element::DepthPlane depth;
  std::int32_t x, y;    // of that sample
  std::int32_t vx, vy;  // corner a

  __device__ Planes(const Facing& f, std::int32_t x_first, std::int32_t y_first)
      : x(x_first), y(y_first), vx(f.a.x), vy(f.a.y) {
    const std::int32_t ox = x * element::kSubUnit, oy = y * element::kSubUnit;
    edge[0] = element::edge_between(f.a.x - ox, f.a.y - oy, f.b.x - ox, f.b.y - oy);
    edge[1] = element::edge_between(f.b.x - ox, f.b.y - oy, f.c.x - ox, f.c.y - oy);
    edge[2] = element::edge_between(f.c.x - ox, f.c.y - oy, f.a.x - ox, f.a.y - oy);
    depth = element::depth_plane(f.a.x, f.a.y, f.a.depth, f.b.x, f.b.y, f.b.depth, f.c.x, f.c.y,
                                 f.c.depth, static_cast<float>(f.area));
  }
  __device__ std::int32_t edge_at(int k, std::int32_t i, std::int32_t j) const {
    return edge[k].at_origin + edge[k].dx * i + edge[k].dy * j;
  }
  __device__ bool covers(std::int32_t i, std::int32_t j) const {
    return (edge_at(0, i, j) | edge_at(1, i, j) | edge_at(2, i, j)) >= 0;
  }
  __device__ float depth_at(std::int32_t i, std::int32_t j) const {
    const auto px = static_cast<float>((x + i) * element::kSubUnit + kHalfUnit - vx);
    const auto py = static_cast<float>((y + j) * element::kSubUnit + kHalfUnit - vy);
    const float z = (depth.z0 + px * depth.dzdx) + py * depth.dzdy;
    return element::least(element::most(z, depth.low), depth.high);
  }
};

/// Every `step`-th sample of a box of at most 64 a side, from the `first`-th on.
__device__ inline void draw_box(const Facing& f, const element::SampleBox& box, std::uint32_t id,
                                const Target& target, std::uint32_t first, std::uint32_t step) {
  const Planes planes(f, box.x_low, box.y_low);
  const auto width = static_cast<std::uint32_t>(box.x_high - box.x_low + 1);
  const auto height = static_cast<std::uint32_t>(box.y_high - box.y_low + 1);
  for (std::uint32_t k = first; k < width * height; k += step) {
    const auto i = static_cast<std::int32_t>(k % width), j = static_cast<std::int32_t>(k / width);
    if (planes.covers(i, j)) target.put(box.x_low + i, box.y_low + j, planes.depth_at(i, j), id);
  }
}

/// All samples of a small box, by one thread: additions only.
__device__ inline void draw_small(const Facing& f, std::uint32_t id, const Target& target) {
  const Planes planes(f, f.box.x_low, f.box.y_low);
  std::int32_t row[3] = {planes.edge[0].at_origin, planes.edge[1].at_origin,
                         planes.edge[2].at_origin};
  for (std::int32_t j = 0; j <= f.box.y_high - f.box.y_low; ++j) {
    std::int32_t e[3] = {row[0], row[1], row[2]};
    for (std::int32_t i = 0; i <= f.box.x_high - f.box.x_low; ++i) {
      if ((e[0] | e[1] | e[2]) >= 0) {
        target.put(f.box.x_low + i, f.box.y_low + j, planes.depth_at(i, j), id);
      }
      for (int k = 0; k < 3; ++k) e[k] += planes.edge[k].dx;
    }
    for (int k = 0; k < 3; ++k) row[k] += planes.edge[k].dy;
  }
}

/// Every `step`-th sample of a tile of a large triangle.
__device__ inline void draw_tile(const RasterJob& job, const LargeTriangle& triangle,
                                 std::uint32_t tile_x, std::uint32_t tile_y, const Target& target,
                                 std::uint32_t first, std::uint32_t step) {
  Facing f;
  const element::SnappedVertex* v = triangle.v;
  if (!faces(job, v[0], v[1], v[2], (triangle.flags & LargeTriangle::kDoubleSided) != 0, f)) {
    return;
  }
  const auto x0 = static_cast<std::int32_t>(tile_x * kTileSide);
  const auto y0 = static_cast<std::int32_t>(tile_y * kTileSide);
  const auto last = static_cast<std::int32_t>(kTileSide - 1);
  element::SampleBox& box = f.box;
  if (box.x_low < x0) box.x_low = x0;
  if (box.y_low < y0) box.y_low = y0;
  if (box.x_high > x0 + last) box.x_high = x0 + last;
  if (box.y_high > y0 + last) box.y_high = y0 + last;
  if (box.x_low > box.x_high || box.y_low > box.y_high) return;
  if ((triangle.flags & LargeTriangle::kHoles) == 0) {
    draw_box(f, box, triangle.id, target, first, step);
    return;
  }
  // holes: counted from the tile's corner as on the processor, whose far edges are cut off there
  const bool turned = f.b.x != v[1].x || f.b.y != v[1].y;
  glm::vec2 uv[3];
  for (int k = 0; k < 3; ++k) {
    const std::uint32_t corner = k == 0 ? 0 : (turned ? 3 - k : k);
    const BatchVertex& vertex = job.vertices[job.indices[triangle.first_corner + corner]];
    uv[k] = glm::vec2(static_cast<float>(vertex.uv.x), static_cast<float>(vertex.uv.y)) / 65535.0F;
  }
  const RasterCharacter& character = job.cast.character[triangle.character];
  const element::Cutout cutout{nullptr, job.cast.texels + character.texture.base_first,
                               character.texture.base_width, character.texture.base_height,
                               character.texture.base_levels};
  const element::CutoutLevel level = element::cutout_level(cutout, uv, f.area);
  const float inverse_w[3] = {f.a.inverse_w, f.b.inverse_w, f.c.inverse_w};
  const Planes planes(f, x0, y0);
  const auto width = static_cast<std::uint32_t>(box.x_high - box.x_low + 1);
  const auto height = static_cast<std::uint32_t>(box.y_high - box.y_low + 1);
  for (std::uint32_t k = first; k < width * height; k += step) {
    const std::int32_t i = box.x_low - x0 + static_cast<std::int32_t>(k % width);
    const std::int32_t j = box.y_low - y0 + static_cast<std::int32_t>(k / width);
    if (!planes.covers(i, j)) continue;
    // opposite to the corners: bc, ca, ab
    const std::int32_t e[3] = {planes.edge_at(1, i, j), planes.edge_at(2, i, j),
                               planes.edge_at(0, i, j)};
    if (!element::cutout_covers(level, uv, e, inverse_w)) continue;
    target.put(x0 + i, y0 + j, planes.depth_at(i, j), triangle.id);
  }
}

__device__ inline Target target_of(const RasterJob& job, bool shadow) {
  return {job.words, shadow ? job.shadow : nullptr, job.word_blocks_x};
}

/// Leaves a triangle to launch_large; what finds no room is drawn here and now, slowly.
__device__ inline void leave_to_tiles(const RasterJob& job, const LargeTriangle& triangle,
                                      const element::SampleBox& box) {
  const auto tile = [](std::int32_t sample) {
    return static_cast<std::uint32_t>(sample) / kTileSide;
  };
  const std::uint32_t x_low = tile(box.x_low), x_high = tile(box.x_high);
  const std::uint32_t y_low = tile(box.y_low), y_high = tile(box.y_high);
  const std::uint32_t columns = x_high - x_low + 1, tiles = columns * (y_high - y_low + 1);
  std::uint32_t first = kTileRoom;
  const std::uint32_t number = atomicAdd(&job.counts->large, 1U);
  if (number < kLargeRoom) {
    job.large[number] = triangle;
    first = atomicAdd(&job.counts->tiles, tiles);
  }
  for (std::uint32_t k = 0; k < tiles; ++k) {
    const std::uint32_t x = x_low + k % columns, y = y_low + k / columns;
    if (first < kTileRoom && k < kTileRoom - first) {
      job.tiles[first + k] = glm::uvec2(number, x | y << 16);
    } else {
      draw_tile(job, triangle, x, y, target_of(job, (triangle.flags & LargeTriangle::kShadow) != 0),
                0, 1);
    }
  }
}

__device__ inline element::SnappedVertex from_lane(const element::SnappedVertex& v, int lane) {
  return {__shfl_sync(kAllLanes, v.x, lane), __shfl_sync(kAllLanes, v.y, lane),
          __shfl_sync(kAllLanes, v.depth, lane), __shfl_sync(kAllLanes, v.inverse_w, lane)};
}

/// Draws the triangle of each lane. All lanes of the warp call it; `has` is false for those without
/// one. Returns true where the triangle may cover a sample.
__device__ inline bool draw_by_warp(const RasterJob& job, bool has, const LargeTriangle& triangle,
                                    const Target& target) {
  Facing f;
  has = has && faces(job, triangle.v[0], triangle.v[1], triangle.v[2],
                     (triangle.flags & LargeTriangle::kDoubleSided) != 0, f);
  bool by_warp = false;
  if (has) {
    const std::int32_t width = f.box.x_high - f.box.x_low + 1;
    const std::int32_t height = f.box.y_high - f.box.y_low + 1;
    const auto side = static_cast<std::int32_t>(kTileSide);
    if (width > side || height > side) {
      leave_to_tiles(job, triangle, f.box);
    } else if (width * height <= kThreadSamples) {
      draw_small(f, triangle.id, target);
    } else {
      by_warp = true;
    }
  }
  for (std::uint32_t rest = __ballot_sync(kAllLanes, by_warp); rest != 0; rest &= rest - 1) {
    const int lane = __ffs(static_cast<int>(rest)) - 1;
    Facing one;
    one.a = from_lane(f.a, lane);
    one.b = from_lane(f.b, lane);
    one.c = from_lane(f.c, lane);
    one.area = __shfl_sync(kAllLanes, static_cast<long long>(f.area), lane);
    one.box = {__shfl_sync(kAllLanes, f.box.x_low, lane), __shfl_sync(kAllLanes, f.box.y_low, lane),
               __shfl_sync(kAllLanes, f.box.x_high, lane),
               __shfl_sync(kAllLanes, f.box.y_high, lane)};
    const std::uint32_t id = __shfl_sync(kAllLanes, triangle.id, lane);
    draw_box(one, one.box, id, target, threadIdx.x % kWarp, kWarp);
  }
  return has;
}

}  // namespace throng::render::visibility::cuda
