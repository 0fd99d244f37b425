// The loops over vertices, triangles and samples, compiled for each instruction set and chosen at
// run time. Every set gives the same bytes: integers decide coverage, and floats are multiplied,
// added and divided one by one in one written order (no fused or approximate operation).
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/raster/visibility/cpu/tile_simd.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "render/raster/visibility/cpu/clip.hpp"
#include "render/raster/visibility/cpu/tile.hpp"
#include "render/raster/visibility/element/coverage.hpp"
#include "render/raster/visibility/element/word.hpp"
#include "throng/render/asset.hpp"

HWY_BEFORE_NAMESPACE();
namespace throng::render::visibility {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// 16 lanes at most: a 4x4 block is one AVX-512 register or two AVX2 ones.
using FloatTag = hn::CappedTag<float, 16>;
using IntTag = hn::Rebind<std::int32_t, FloatTag>;
using UintTag = hn::Rebind<std::uint32_t, FloatTag>;

Footprint ProjectVertices(const SampleGrid& grid, const BatchVertex* vertices, std::size_t begin,
                          std::size_t end, Projected& projected) {
  const FloatTag df;
  const IntTag di;
  const std::size_t lanes = hn::Lanes(df);
  static_assert(sizeof(BatchVertex) == 24);
  const glm::mat4& m = grid.clip_from_relative;
  const float half_width = static_cast<float>(grid.width) * (element::kSubUnit / 2);
  const float half_height = static_cast<float>(grid.height) * (element::kSubUnit / 2);
  const auto half_x = hn::Set(df, half_width);
  const auto half_y = hn::Set(df, half_height);
  const auto guard = hn::Set(df, static_cast<float>(element::kGuardUnits));
  const auto one = hn::Set(df, 1.0F);
  const auto zero = hn::Zero(df);
  const auto half = hn::Set(df, 0.5F);
  const auto stride = hn::Mul(hn::Iota(di, 0), hn::Set(di, 6));

  auto x_low = hn::Set(di, INT32_MAX), y_low = hn::Set(di, INT32_MAX);
  auto x_high = hn::Set(di, INT32_MIN), y_high = hn::Set(di, INT32_MIN);
  auto depth_high = zero;
  bool clipped = false;
  std::size_t i = begin;
  while (i + lanes <= end) {
    const float* base = &vertices[i].position_relative.x;
    const auto px = hn::GatherIndex(df, base, stride);
    const auto py = hn::GatherIndex(df, base + 1, stride);
    const auto pz = hn::GatherIndex(df, base + 2, stride);
    const auto row = [&](int r) HWY_ATTR {
      const auto a = hn::Mul(hn::Set(df, m[0][r]), px);
      const auto b = hn::Mul(hn::Set(df, m[1][r]), py);
      const auto c = hn::Mul(hn::Set(df, m[2][r]), pz);
      return hn::Add(hn::Add(hn::Add(a, b), c), hn::Set(df, m[3][r]));
    };
    const auto cx = row(0), cy = row(1), cz = row(2), cw = row(3);
    const auto inverse_w = hn::Div(one, cw);
    const auto x = hn::Mul(hn::Mul(cx, inverse_w), half_x);
    const auto y = hn::Mul(hn::Mul(cy, inverse_w), half_y);
    auto good = hn::And(hn::Gt(cw, zero), hn::And(hn::Le(cz, cw), hn::Ge(cz, zero)));
    good = hn::And(good, hn::And(hn::Lt(hn::Abs(x), guard), hn::Lt(hn::Abs(y), guard)));
    const auto good_int = hn::RebindMask(di, good);
    const auto sx = hn::ConvertTo(di, hn::Floor(hn::Add(hn::Add(x, half_x), half)));
    const auto sy = hn::ConvertTo(di, hn::Floor(hn::Add(hn::Sub(half_y, y), half)));
    const auto depth = hn::IfThenElse(good, hn::Mul(cz, inverse_w), zero);
    if (!hn::AllTrue(df, good)) clipped = true;
    x_low = hn::Min(x_low, hn::IfThenElse(good_int, sx, x_low));
    y_low = hn::Min(y_low, hn::IfThenElse(good_int, sy, y_low));
    x_high = hn::Max(x_high, hn::IfThenElse(good_int, sx, x_high));
    y_high = hn::Max(y_high, hn::IfThenElse(good_int, sy, y_high));
    depth_high = hn::Max(depth_high, depth);
    hn::StoreU(hn::IfThenElse(good_int, sx, hn::Set(di, kNeedsClip)), di, projected.x.data() + i);
    hn::StoreU(sy, di, projected.y.data() + i);
    hn::StoreU(depth, df, projected.depth.data() + i);
    hn::StoreU(inverse_w, df, projected.inverse_w.data() + i);
    // the last vector overlaps the one before: the same vertices give the same bytes
    const std::size_t done = i + lanes;
    i = done < end && done + lanes > end ? end - lanes : done;
  }
  std::int32_t x_min = hn::GetLane(hn::MinOfLanes(di, x_low));
  std::int32_t y_min = hn::GetLane(hn::MinOfLanes(di, y_low));
  std::int32_t x_max = hn::GetLane(hn::MaxOfLanes(di, x_high));
  std::int32_t y_max = hn::GetLane(hn::MaxOfLanes(di, y_high));
  float nearest = hn::GetLane(hn::MaxOfLanes(df, depth_high));
  for (; i < end; ++i) {
    SnappedVertex vertex{kNeedsClip, 0, 0.0F, 0.0F};
    if (snap(grid, to_clip(m, vertices[i].position_relative), vertex)) {
      x_min = std::min(x_min, vertex.x);
      y_min = std::min(y_min, vertex.y);
      x_max = std::max(x_max, vertex.x);
      y_max = std::max(y_max, vertex.y);
      nearest = std::max(nearest, vertex.depth);
    } else {
      vertex.x = kNeedsClip;
      clipped = true;
    }
    projected.x[i] = vertex.x;
    projected.y[i] = vertex.y;
    projected.depth[i] = vertex.depth;
    projected.inverse_w[i] = vertex.inverse_w;
  }
  Footprint footprint;
  footprint.clipped = clipped;
  if (clipped) {  // may reach anywhere and be as near as can be
    footprint.x_low = footprint.y_low = 0;
    footprint.x_high = grid.width - 1;
    footprint.y_high = grid.height - 1;
    footprint.depth_high = 1.0F;
    return footprint;
  }
  // samples whose centres lie between the outermost vertices
  constexpr std::int32_t kHalf = element::kSubUnit / 2;
  footprint.x_low = std::max(0, (x_min + kHalf - 1) >> element::kSubBits);
  footprint.y_low = std::max(0, (y_min + kHalf - 1) >> element::kSubBits);
  footprint.x_high = std::min(grid.width - 1, (x_max - kHalf) >> element::kSubBits);
  footprint.y_high = std::min(grid.height - 1, (y_max - kHalf) >> element::kSubBits);
  footprint.depth_high = nearest;
  return footprint;
}

/// A triangle that covers at least one sample of the tile's rectangle, ready for the blocks.
struct Setup {
  std::int32_t x_low, y_low, x_high, y_high;  // tile samples
  std::int32_t e[3], dx[3], dy[3];            // at the tile's first sample
  std::int32_t vx, vy;                        // vertex 0, sub-units from the tile's corner
  float z0, dzdx, dzdy, low, high;
  std::uint32_t id;
};

HWY_INLINE void DrawBlocks(const Setup& s, TilePlanes& planes) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const int lanes = static_cast<int>(hn::Lanes(df));
  const int block_x_low = s.x_low >> 2, block_x_high = s.x_high >> 2;
  const int block_y_low = s.y_low >> 2, block_y_high = s.y_high >> 2;
  const auto id = hn::Set(du, s.id);
  const auto z0 = hn::Set(df, s.z0), dzdx = hn::Set(df, s.dzdx), dzdy = hn::Set(df, s.dzdy);
  const auto low = hn::Set(df, s.low), high = hn::Set(df, s.high);
  const auto three = hn::Set(di, 3);
  for (int half = 0; half < 16; half += lanes) {
    const auto lane = hn::Iota(di, half);
    const auto lane_x = hn::And(lane, three);
    const auto lane_y = hn::ShiftRight<2>(lane);
    // edge values of each lane at the first block
    const auto at = [&](int k) HWY_ATTR {
      const std::int32_t base = s.e[k] + s.dx[k] * (block_x_low * 4) + s.dy[k] * (block_y_low * 4);
      return hn::Add(hn::Set(di, base), hn::Add(hn::Mul(hn::Set(di, s.dx[k]), lane_x),
                                                hn::Mul(hn::Set(di, s.dy[k]), lane_y)));
    };
    auto row0 = at(0), row1 = at(1), row2 = at(2);
    constexpr std::int32_t kHalf = element::kSubUnit / 2;
    const auto offset_x = hn::ShiftLeft<element::kSubBits>(lane_x);
    const auto offset_y = hn::ShiftLeft<element::kSubBits>(lane_y);
    for (int by = block_y_low; by <= block_y_high; ++by) {
      auto e0 = row0, e1 = row1, e2 = row2;
      const auto y_units = hn::ConvertTo(
          df, hn::Add(hn::Set(di, by * 4 * element::kSubUnit + kHalf - s.vy), offset_y));
      for (int bx = block_x_low; bx <= block_x_high; ++bx) {
        const auto inside = hn::Gt(hn::Or(hn::Or(e0, e1), e2), hn::Set(di, -1));
        if (!hn::AllFalse(di, inside)) {
          const auto x_units = hn::ConvertTo(
              df, hn::Add(hn::Set(di, bx * 4 * element::kSubUnit + kHalf - s.vx), offset_x));
          auto z = hn::Add(hn::Add(z0, hn::Mul(x_units, dzdx)), hn::Mul(y_units, dzdy));
          z = hn::Min(hn::Max(z, low), high);
          const std::size_t index =
              static_cast<std::size_t>(((by * (kTileSamples / 4) + bx) << 4) + half);
          const auto old_z = hn::Load(df, planes.depth + index);
          const auto old_id = hn::Load(du, planes.id + index);
          const auto nearer = hn::Gt(z, old_z);
          const auto tie = hn::And(hn::Eq(z, old_z), hn::RebindMask(df, hn::Gt(id, old_id)));
          const auto wins = hn::And(hn::RebindMask(df, inside), hn::Or(nearer, tie));
          if (!hn::AllFalse(df, wins)) {
            hn::Store(hn::IfThenElse(wins, z, old_z), df, planes.depth + index);
            hn::Store(hn::IfThenElse(hn::RebindMask(du, wins), id, old_id), du, planes.id + index);
          }
        }
        e0 = hn::Add(e0, hn::Set(di, s.dx[0] * 4));
        e1 = hn::Add(e1, hn::Set(di, s.dx[1] * 4));
        e2 = hn::Add(e2, hn::Set(di, s.dx[2] * 4));
      }
      row0 = hn::Add(row0, hn::Set(di, s.dy[0] * 4));
      row1 = hn::Add(row1, hn::Set(di, s.dy[1] * 4));
      row2 = hn::Add(row2, hn::Set(di, s.dy[2] * 4));
    }
  }
}

/// Any triangle, one at a time: large ones, clipped ones.
void DrawOne(SnappedVertex a, SnappedVertex b, SnappedVertex c, std::uint32_t id, bool double_sided,
             int tile_x, int tile_y, TilePlanes& planes, TileCounters& counters) {
  const std::int32_t corner_x = tile_x * element::kSubUnit, corner_y = tile_y * element::kSubUnit;
  a.x -= corner_x, b.x -= corner_x, c.x -= corner_x;
  a.y -= corner_y, b.y -= corner_y, c.y -= corner_y;
  std::int64_t area = element::doubled_area(a.x, a.y, b.x, b.y, c.x, c.y);
  if (area < 0 && double_sided) {
    std::swap(b, c);
    area = -area;
  }
  if (area <= 0) return;
  constexpr std::int32_t kHalf = element::kSubUnit / 2;
  Setup s;
  s.x_low = std::max(0, (std::min({a.x, b.x, c.x}) + kHalf - 1) >> element::kSubBits);
  s.y_low = std::max(0, (std::min({a.y, b.y, c.y}) + kHalf - 1) >> element::kSubBits);
  s.x_high = std::min(kTileSamples - 1, (std::max({a.x, b.x, c.x}) - kHalf) >> element::kSubBits);
  s.y_high = std::min(kTileSamples - 1, (std::max({a.y, b.y, c.y}) - kHalf) >> element::kSubBits);
  if (s.x_low > s.x_high || s.y_low > s.y_high) return;
  const element::Edge edges[3] = {element::edge_between(a.x, a.y, b.x, b.y),
                                  element::edge_between(b.x, b.y, c.x, c.y),
                                  element::edge_between(c.x, c.y, a.x, a.y)};
  for (int k = 0; k < 3; ++k) {
    s.e[k] = edges[k].at_origin;
    s.dx[k] = edges[k].dx;
    s.dy[k] = edges[k].dy;
  }
  s.vx = a.x;
  s.vy = a.y;
  const element::DepthPlane plane = element::depth_plane(a.x, a.y, a.depth, b.x, b.y, b.depth, c.x,
                                                         c.y, c.depth, static_cast<float>(area));
  s.z0 = plane.z0;
  s.dzdx = plane.dzdx;
  s.dzdy = plane.dzdy;
  s.low = plane.low;
  s.high = plane.high;
  s.id = id;
  ++counters.surviving;
  DrawBlocks(s, planes);
}

/// A triangle with holes, sample by sample: cut-outs are few, and plain code keeps them exact.
void DrawCutout(const Cutout& cutout, SnappedVertex v[3], const glm::vec2 uv_corner[3],
                std::uint32_t id, bool double_sided, int tile_x, int tile_y, TilePlanes& planes,
                TileCounters& counters) {
  glm::vec2 uv[3] = {uv_corner[0], uv_corner[1], uv_corner[2]};
  for (int k = 0; k < 3; ++k) {
    v[k].x -= tile_x * element::kSubUnit;
    v[k].y -= tile_y * element::kSubUnit;
  }
  std::int64_t area = element::doubled_area(v[0].x, v[0].y, v[1].x, v[1].y, v[2].x, v[2].y);
  if (area < 0 && double_sided) {
    std::swap(v[1], v[2]);
    std::swap(uv[1], uv[2]);
    area = -area;
  }
  if (area <= 0) return;
  ++counters.surviving;
  constexpr std::int32_t kHalf = element::kSubUnit / 2;
  const int x_low =
      std::max(0, (std::min({v[0].x, v[1].x, v[2].x}) + kHalf - 1) >> element::kSubBits);
  const int y_low =
      std::max(0, (std::min({v[0].y, v[1].y, v[2].y}) + kHalf - 1) >> element::kSubBits);
  const int x_high =
      std::min(kTileSamples - 1, (std::max({v[0].x, v[1].x, v[2].x}) - kHalf) >> element::kSubBits);
  const int y_high =
      std::min(kTileSamples - 1, (std::max({v[0].y, v[1].y, v[2].y}) - kHalf) >> element::kSubBits);
  const element::CutoutLevel level = element::cutout_level(cutout, uv, area);
  const float inverse_w[3] = {v[0].inverse_w, v[1].inverse_w, v[2].inverse_w};
  const element::Edge edges[3] = {element::edge_between(v[1].x, v[1].y, v[2].x, v[2].y),
                                  element::edge_between(v[2].x, v[2].y, v[0].x, v[0].y),
                                  element::edge_between(v[0].x, v[0].y, v[1].x, v[1].y)};
  const element::DepthPlane plane =
      element::depth_plane(v[0].x, v[0].y, v[0].depth, v[1].x, v[1].y, v[1].depth, v[2].x, v[2].y,
                           v[2].depth, static_cast<float>(area));
  for (int y = y_low; y <= y_high; ++y) {
    for (int x = x_low; x <= x_high; ++x) {
      std::int32_t e[3];
      for (int k = 0; k < 3; ++k) e[k] = edges[k].at_origin + edges[k].dx * x + edges[k].dy * y;
      const bool inside = (e[0] | e[1] | e[2]) >= 0;
      if (!inside) continue;
      const float px = static_cast<float>(x * element::kSubUnit + kHalf - v[0].x);
      const float py = static_cast<float>(y * element::kSubUnit + kHalf - v[0].y);
      float z = (plane.z0 + px * plane.dzdx) + py * plane.dzdy;
      z = std::min(std::max(z, plane.low), plane.high);
      const std::size_t at = sample_index(x, y);
      if (z < planes.depth[at] || (z == planes.depth[at] && id <= planes.id[at])) continue;
      if (!element::cutout_covers(level, uv, e, inverse_w)) continue;
      planes.depth[at] = z;
      planes.id[at] = id;
    }
  }
}

/// What is left of a triangle in front of the near plane; `clip`: whether it was cut.
int PolygonOf(const InstanceTriangles& triangles, std::uint32_t t, const Projected& projected,
              const BatchVertex* vertices, const SampleGrid& grid,
              SnappedVertex polygon[kMaxClippedCorners], bool& clip) {
  const std::uint32_t* corner = triangles.indices + 3 * std::size_t{t};
  clip = false;
  for (int k = 0; k < 3; ++k) {
    const std::uint32_t v = corner[k];
    if (projected.x[v] == kNeedsClip) clip = true;
    polygon[k] = {projected.x[v], projected.y[v], projected.depth[v], projected.inverse_w[v]};
  }
  if (!clip) return 3;
  glm::vec4 clip_space[3];
  for (int k = 0; k < 3; ++k) {
    clip_space[k] = to_clip(grid.clip_from_relative, vertices[corner[k]].position_relative);
  }
  return clip_triangle(grid, clip_space, polygon);
}

HWY_NOINLINE void DrawSpecial(const InstanceTriangles& triangles, std::uint32_t t, std::uint32_t id,
                              const Projected& projected, const BatchVertex* vertices,
                              const SampleGrid& grid, int tile_x, int tile_y, TilePlanes& planes,
                              TileCounters& counters) {
  SnappedVertex polygon[kMaxClippedCorners];
  bool clip = false;
  const int count = PolygonOf(triangles, t, projected, vertices, grid, polygon, clip);
  if (triangles.cutout != nullptr && !clip &&
      (triangles.cutout->flags[t] & kTriangleAlphaCutout) != 0) {
    glm::vec2 uv[3];
    for (int k = 0; k < 3; ++k) {
      uv[k] = glm::vec2(vertices[triangles.indices[3 * std::size_t{t} + k]].uv) / 65535.0F;
    }
    DrawCutout(*triangles.cutout, polygon, uv, id, triangles.double_sided, tile_x, tile_y, planes,
               counters);
    return;
  }
  for (int k = 1; k + 1 < count; ++k) {
    DrawOne(polygon[0], polygon[k], polygon[k + 1], id, triangles.double_sided, tile_x, tile_y,
            planes, counters);
  }
}

constexpr std::size_t kMaxLanes = 16;
using Float = hn::Vec<FloatTag>;
using Int = hn::Vec<IntTag>;
using Uint = hn::Vec<UintTag>;

/// Corners of one vector of triangles: sub-units from the tile's corner, and the vertices' numbers.
struct Corners {
  Int x0, y0, x1, y1, x2, y2, v0, v1, v2;
};

/// Triangles that may cover a sample, by columns, until there are enough for whole vectors: what
/// costs most is done for them only.
struct Survivors {
  static constexpr std::size_t kRoom = 2 * kMaxLanes;
  HWY_ALIGN std::int32_t x0[kRoom], y0[kRoom], x1[kRoom], y1[kRoom], x2[kRoom], y2[kRoom];
  HWY_ALIGN std::int32_t v0[kRoom], v1[kRoom], v2[kRoom], triangle[kRoom];
  std::size_t count = 0;
};

/// The samples between a triangle's outermost corners, within [0, last].
struct Box {
  Int x_low, y_low, x_high, y_high;
};

HWY_INLINE Box BoxOf(Int x_min, Int y_min, Int x_max, Int y_max, Int last_x, Int last_y) {
  const IntTag di;
  constexpr std::int32_t kHalf = element::kSubUnit / 2;
  const auto zero = hn::Zero(di);
  const auto up = hn::Set(di, kHalf - 1), half = hn::Set(di, kHalf);
  return {hn::Max(zero, hn::ShiftRight<element::kSubBits>(hn::Add(x_min, up))),
          hn::Max(zero, hn::ShiftRight<element::kSubBits>(hn::Add(y_min, up))),
          hn::Min(last_x, hn::ShiftRight<element::kSubBits>(hn::Sub(x_max, half))),
          hn::Min(last_y, hn::ShiftRight<element::kSubBits>(hn::Sub(y_max, half)))};
}

/// A few samples of one triangle a lane, at the same steps from each triangle's first sample.
struct SmallTriangles {
  Int x_low, y_low, width, height;  // of the boxes, in steps
  Int e[3], dx[3], dy[3];           // at the first sample
  Int vx, vy;
  Float z0, dzdx, dzdy, low, high;
  Uint id;
};

template <class Mask>
HWY_INLINE void DrawSmall(const SmallTriangles& s, Mask alive, TilePlanes& planes) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  constexpr std::int32_t kHalf = element::kSubUnit / 2;
  HWY_ALIGN float depth[kMaxLanes];
  HWY_ALIGN std::uint32_t id[kMaxLanes];
  HWY_ALIGN std::int32_t place[kMaxLanes];
  hn::Store(s.id, du, id);
  const auto none = hn::Set(di, -1);
  const auto columns = hn::IfThenElse(alive, s.width, none);
  const auto rows = hn::IfThenElse(alive, s.height, none);
  const std::int32_t most_x = hn::GetLane(hn::MaxOfLanes(di, columns));
  const std::int32_t most_y = hn::GetLane(hn::MaxOfLanes(di, rows));
  auto row0 = s.e[0], row1 = s.e[1], row2 = s.e[2];
  const auto first_x =
      hn::Sub(hn::Add(hn::ShiftLeft<element::kSubBits>(s.x_low), hn::Set(di, kHalf)), s.vx);
  const auto first_y =
      hn::Sub(hn::Add(hn::ShiftLeft<element::kSubBits>(s.y_low), hn::Set(di, kHalf)), s.vy);
  for (std::int32_t j = 0; j <= most_y; ++j) {
    auto e0 = row0, e1 = row1, e2 = row2;
    const auto in_row = hn::Gt(rows, hn::Set(di, j - 1));
    for (std::int32_t i = 0; i <= most_x; ++i) {
      const auto inside = hn::And(hn::And(in_row, hn::Gt(columns, hn::Set(di, i - 1))),
                                  hn::Gt(hn::Or(hn::Or(e0, e1), e2), none));
      if (!hn::AllFalse(di, inside)) {
        const auto x_units =
            hn::ConvertTo(df, hn::Add(first_x, hn::Set(di, i * element::kSubUnit)));
        const auto y_units =
            hn::ConvertTo(df, hn::Add(first_y, hn::Set(di, j * element::kSubUnit)));
        auto z = hn::Add(hn::Add(s.z0, hn::Mul(x_units, s.dzdx)), hn::Mul(y_units, s.dzdy));
        z = hn::Min(hn::Max(z, s.low), s.high);
        const auto x = hn::Add(s.x_low, hn::Set(di, i)), y = hn::Add(s.y_low, hn::Set(di, j));
        const auto three = hn::Set(di, 3);
        const auto block = hn::Add(hn::ShiftLeft<4>(hn::ShiftRight<2>(y)), hn::ShiftRight<2>(x));
        hn::Store(hn::Or(hn::ShiftLeft<4>(block),
                         hn::Or(hn::ShiftLeft<2>(hn::And(y, three)), hn::And(x, three))),
                  di, place);
        hn::Store(z, df, depth);
        std::uint8_t bits[8] = {};
        hn::StoreMaskBits(di, inside, bits);
        std::uint32_t rest =
            static_cast<std::uint32_t>(bits[0]) | static_cast<std::uint32_t>(bits[1]) << 8;
        // one after the other: two lanes may want the same sample
        for (; rest != 0; rest &= rest - 1) {
          const int lane = __builtin_ctz(rest);
          const auto at = static_cast<std::size_t>(place[lane]);
          const float old = planes.depth[at];
          if (depth[lane] > old || (depth[lane] == old && id[lane] > planes.id[at])) {
            planes.depth[at] = depth[lane];
            planes.id[at] = id[lane];
          }
        }
      }
      e0 = hn::Add(e0, s.dx[0]);
      e1 = hn::Add(e1, s.dx[1]);
      e2 = hn::Add(e2, s.dx[2]);
    }
    row0 = hn::Add(row0, s.dy[0]);
    row1 = hn::Add(row1, s.dy[1]);
    row2 = hn::Add(row2, s.dy[2]);
  }
}

/// Sets up and draws survivors [from, from + lanes), of which the first `valid` count.
/// @param depths  by vertex number; null: columns v0 to v2 are depths.
HWY_NOINLINE void DrawSurvivors(const Survivors& survivors, std::size_t from, std::size_t valid,
                                const float* depths, std::uint32_t first_id, TilePlanes& planes) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const std::size_t lanes = hn::Lanes(df);
  constexpr std::int32_t kHalf = element::kSubUnit / 2;
  constexpr std::int32_t kSmallBox = 4;  // samples a side: larger ones go by blocks
  const auto zero = hn::Zero(di);
  const auto column = [&](const std::int32_t* values)
                          HWY_ATTR { return hn::LoadU(di, values + from); };
  const auto x0 = column(survivors.x0), y0 = column(survivors.y0);
  const auto x1 = column(survivors.x1), y1 = column(survivors.y1);
  const auto x2 = column(survivors.x2), y2 = column(survivors.y2);
  const auto last = hn::Set(di, kTileSamples - 1);
  const Box box = BoxOf(hn::Min(x0, hn::Min(x1, x2)), hn::Min(y0, hn::Min(y1, y2)),
                        hn::Max(x0, hn::Max(x1, x2)), hn::Max(y0, hn::Max(y1, y2)), last, last);
  const auto area =
      hn::Sub(hn::Mul(hn::Sub(x2, x0), hn::Sub(y1, y0)), hn::Mul(hn::Sub(x1, x0), hn::Sub(y2, y0)));
  SmallTriangles s;
  // edges at the low corner of the triangle's own rectangle, where products are small
  const auto px = hn::Add(hn::ShiftLeft<element::kSubBits>(box.x_low), hn::Set(di, kHalf));
  const auto py = hn::Add(hn::ShiftLeft<element::kSubBits>(box.y_low), hn::Set(di, kHalf));
  const auto edge = [&](Int ax, Int ay, Int bx, Int by, int k) HWY_ATTR {
    const auto dx = hn::Sub(by, ay), dy = hn::Sub(ax, bx);
    auto value = hn::Add(hn::Mul(dx, hn::Sub(px, ax)), hn::Mul(dy, hn::Sub(py, ay)));
    const auto owns = hn::Or(hn::Gt(dx, zero), hn::And(hn::Eq(dx, zero), hn::Gt(dy, zero)));
    value = hn::Sub(value, hn::IfThenElse(owns, zero, hn::Set(di, 1)));
    s.e[k] = hn::ShiftRight<element::kSubBits>(value);
    s.dx[k] = dx;
    s.dy[k] = dy;
  };
  edge(x0, y0, x1, y1, 0);
  edge(x1, y1, x2, y2, 1);
  edge(x2, y2, x0, y0, 2);
  s.x_low = box.x_low;
  s.y_low = box.y_low;
  s.width = hn::Sub(box.x_high, box.x_low);
  s.height = hn::Sub(box.y_high, box.y_low);
  s.vx = x0;
  s.vy = y0;
  const auto depth_of = [&](Int v) HWY_ATTR {
    return depths == nullptr ? hn::BitCast(df, v) : hn::GatherIndex(df, depths, v);
  };
  const auto z0 = depth_of(column(survivors.v0));
  const auto z1 = depth_of(column(survivors.v1));
  const auto z2 = depth_of(column(survivors.v2));
  const auto inverse = hn::Div(hn::Set(df, 1.0F), hn::ConvertTo(df, area));
  const auto ux = hn::ConvertTo(df, hn::Sub(x1, x0)), uy = hn::ConvertTo(df, hn::Sub(y1, y0));
  const auto vx = hn::ConvertTo(df, hn::Sub(x2, x0)), vy = hn::ConvertTo(df, hn::Sub(y2, y0));
  const auto uz = hn::Sub(z1, z0), vz = hn::Sub(z2, z0);
  s.z0 = z0;
  s.dzdx = hn::Mul(hn::Sub(hn::Mul(vz, uy), hn::Mul(uz, vy)), inverse);
  s.dzdy = hn::Mul(hn::Sub(hn::Mul(uz, vx), hn::Mul(vz, ux)), inverse);
  s.low = hn::Min(z0, hn::Min(z1, z2));
  s.high = hn::Max(z0, hn::Max(z1, z2));
  s.id = hn::Add(hn::BitCast(du, column(survivors.triangle)), hn::Set(du, first_id));

  const auto is_valid = hn::FirstN(di, valid);
  const auto largest = hn::Max(s.width, s.height);
  const auto small = hn::And(is_valid, hn::Lt(largest, hn::Set(di, kSmallBox)));
  if (!hn::AllFalse(di, small)) DrawSmall(s, small, planes);
  const auto large = hn::AndNot(small, is_valid);
  if (hn::AllFalse(di, large)) return;

  HWY_ALIGN std::int32_t integer[15][kMaxLanes];
  HWY_ALIGN float number[5][kMaxLanes];
  HWY_ALIGN std::uint32_t id[kMaxLanes];
  for (int k = 0; k < 3; ++k) {
    // back to the tile's first sample: steps of up to 63 * 2 * 2^14
    const auto back = hn::Add(hn::Mul(s.dx[k], box.x_low), hn::Mul(s.dy[k], box.y_low));
    hn::Store(hn::Sub(s.e[k], back), di, integer[3 * k]);
    hn::Store(s.dx[k], di, integer[3 * k + 1]);
    hn::Store(s.dy[k], di, integer[3 * k + 2]);
  }
  hn::Store(box.x_low, di, integer[9]);
  hn::Store(box.y_low, di, integer[10]);
  hn::Store(box.x_high, di, integer[11]);
  hn::Store(box.y_high, di, integer[12]);
  hn::Store(x0, di, integer[13]);
  hn::Store(y0, di, integer[14]);
  hn::Store(s.z0, df, number[0]);
  hn::Store(s.dzdx, df, number[1]);
  hn::Store(s.dzdy, df, number[2]);
  hn::Store(s.low, df, number[3]);
  hn::Store(s.high, df, number[4]);
  hn::Store(s.id, du, id);
  std::uint8_t bits[8] = {};
  hn::StoreMaskBits(di, large, bits);
  std::uint32_t rest = static_cast<std::uint32_t>(bits[0]) | static_cast<std::uint32_t>(bits[1])
                                                                 << 8;
  static_cast<void>(lanes);
  for (; rest != 0; rest &= rest - 1) {
    const int lane = __builtin_ctz(rest);
    Setup one;
    for (int k = 0; k < 3; ++k) {
      one.e[k] = integer[3 * k][lane];
      one.dx[k] = integer[3 * k + 1][lane];
      one.dy[k] = integer[3 * k + 2][lane];
    }
    one.x_low = integer[9][lane];
    one.y_low = integer[10][lane];
    one.x_high = integer[11][lane];
    one.y_high = integer[12][lane];
    one.vx = integer[13][lane];
    one.vy = integer[14][lane];
    one.z0 = number[0][lane];
    one.dzdx = number[1][lane];
    one.dzdy = number[2][lane];
    one.low = number[3][lane];
    one.high = number[4][lane];
    one.id = id[lane];
    DrawBlocks(one, planes);
  }
}

/// Takes one vector of triangles, of which the first `batch` count, to the survivors. Returns the
/// lanes that need DrawSpecial: sides too long for 32-bit products.
HWY_INLINE std::uint32_t Cull(Corners c, std::uint32_t first_triangle, std::size_t batch,
                              std::uint32_t special_lanes, bool double_sided, Int last_x,
                              Int last_y, Survivors& survivors) {
  const IntTag di;
  const auto zero = hn::Zero(di);
  const auto small = hn::Set(di, element::kSmallUnits - 1);
  const auto x_min = hn::Min(c.x0, hn::Min(c.x1, c.x2));
  const auto x_max = hn::Max(c.x0, hn::Max(c.x1, c.x2));
  const auto y_min = hn::Min(c.y0, hn::Min(c.y1, c.y2));
  const auto y_max = hn::Max(c.y0, hn::Max(c.y1, c.y2));
  const Box box = BoxOf(x_min, y_min, x_max, y_max, last_x, last_y);
  auto alive = hn::Not(hn::Or(hn::Gt(box.x_low, box.x_high), hn::Gt(box.y_low, box.y_high)));
  const auto is_large = hn::And(
      alive, hn::Or(hn::Gt(hn::Sub(x_max, x_min), small), hn::Gt(hn::Sub(y_max, y_min), small)));
  alive = hn::AndNot(is_large, alive);
  // sides are under 2^14, so every product below fits 32 bits
  const auto area = hn::Sub(hn::Mul(hn::Sub(c.x2, c.x0), hn::Sub(c.y1, c.y0)),
                            hn::Mul(hn::Sub(c.x1, c.x0), hn::Sub(c.y2, c.y0)));
  if (double_sided) {
    const auto back = hn::Lt(area, zero);
    const auto swap = [&](Int& a, Int& b) HWY_ATTR {
      const Int kept = a;
      a = hn::IfThenElse(back, b, a);
      b = hn::IfThenElse(back, kept, b);
    };
    swap(c.x1, c.x2);
    swap(c.y1, c.y2);
    swap(c.v1, c.v2);
    alive = hn::And(alive, hn::Ne(area, zero));
  } else {
    alive = hn::And(alive, hn::Gt(area, zero));
  }
  const auto bits_of = [&](auto mask) HWY_ATTR {
    std::uint8_t bytes[8] = {};
    hn::StoreMaskBits(di, mask, bytes);
    return static_cast<std::uint32_t>(bytes[0]) | static_cast<std::uint32_t>(bytes[1]) << 8;
  };
  const std::uint32_t valid = (1U << batch) - 1U;
  std::uint32_t special = special_lanes;
  if (!hn::AllFalse(di, is_large)) special |= bits_of(is_large);
  special &= valid;
  if (batch < hn::Lanes(di)) alive = hn::And(alive, hn::FirstN(di, batch));
  if (special != 0) {
    HWY_ALIGN std::int32_t lane_special[kMaxLanes];
    for (std::size_t lane = 0; lane < hn::Lanes(di); ++lane) {
      lane_special[lane] = static_cast<std::int32_t>((special >> lane) & 1U);
    }
    alive = hn::And(alive, hn::Eq(hn::Load(di, lane_special), zero));
  }
  const std::size_t kept = hn::CountTrue(di, alive);
  if (kept == 0) return special;
  const std::size_t at = survivors.count;
  const auto keep = [&](Int values, std::int32_t* column)
                        HWY_ATTR { hn::StoreU(hn::Compress(values, alive), di, column + at); };
  keep(c.x0, survivors.x0);
  keep(c.y0, survivors.y0);
  keep(c.x1, survivors.x1);
  keep(c.y1, survivors.y1);
  keep(c.x2, survivors.x2);
  keep(c.y2, survivors.y2);
  keep(c.v0, survivors.v0);
  keep(c.v1, survivors.v1);
  keep(c.v2, survivors.v2);
  keep(hn::Add(hn::Iota(di, 0), hn::Set(di, static_cast<std::int32_t>(first_triangle))),
       survivors.triangle);
  survivors.count = at + kept;
  return special;
}

/// Finishes the survivors that did not fill a vector.
HWY_INLINE void DrawRest(Survivors& survivors, const float* depths, std::uint32_t first_id,
                         TilePlanes& planes, TileCounters& counters) {
  if (survivors.count == 0) return;
  counters.surviving += survivors.count;
  // lanes without a triangle repeat a vertex that exists
  for (std::size_t i = survivors.count; i < hn::Lanes(IntTag()); ++i) {
    survivors.v0[i] = survivors.v1[i] = survivors.v2[i] = survivors.v0[0];
    survivors.x0[i] = survivors.x1[i] = survivors.x2[i] = 0;
    survivors.y0[i] = survivors.y1[i] = survivors.y2[i] = 0;
  }
  DrawSurvivors(survivors, 0, survivors.count, depths, first_id, planes);
}

/// Corners of triangles [t, t + lanes), of which the first `batch` count, from sub-units
/// (corner_x, corner_y). Lanes that Cull must not take are set in `special`.
HWY_INLINE Corners LoadCorners(const InstanceTriangles& triangles, const Projected& projected,
                               std::uint32_t t, std::size_t batch, Int corner_x, Int corner_y,
                               std::uint32_t& special) {
  const IntTag di;
  const std::size_t lanes = hn::Lanes(di);
  const std::int32_t* xs = projected.x.data();
  const std::int32_t* ys = projected.y.data();
  const auto* source =
      reinterpret_cast<const std::int32_t*>(triangles.indices) + 3 * std::size_t{t};
  HWY_ALIGN std::int32_t tail[3 * kMaxLanes];
  if (batch < lanes) {  // repeats its last triangle
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      std::memcpy(tail + 3 * lane, source + 3 * std::min(lane, batch - 1), 3 * sizeof(*tail));
    }
    source = tail;
  }
  Corners c;
  hn::LoadInterleaved3(di, source, c.v0, c.v1, c.v2);
  c.x0 = hn::GatherIndex(di, xs, c.v0);
  c.x1 = hn::GatherIndex(di, xs, c.v1);
  c.x2 = hn::GatherIndex(di, xs, c.v2);
  special = 0;
  if (triangles.clipped) {
    const auto needs_clip = hn::Set(di, kNeedsClip);
    const auto clip = hn::Or(hn::Eq(c.x0, needs_clip),
                             hn::Or(hn::Eq(c.x1, needs_clip), hn::Eq(c.x2, needs_clip)));
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(di, clip, bits);
    special = static_cast<std::uint32_t>(bits[0]) | static_cast<std::uint32_t>(bits[1]) << 8;
  }
  if (triangles.cutout != nullptr) {
    for (std::size_t lane = 0; lane < batch; ++lane) {
      if ((triangles.cutout->flags[t + lane] & kTriangleAlphaCutout) != 0) special |= 1U << lane;
    }
  }
  c.x0 = hn::Sub(c.x0, corner_x);
  c.x1 = hn::Sub(c.x1, corner_x);
  c.x2 = hn::Sub(c.x2, corner_x);
  c.y0 = hn::Sub(hn::GatherIndex(di, ys, c.v0), corner_y);
  c.y1 = hn::Sub(hn::GatherIndex(di, ys, c.v1), corner_y);
  c.y2 = hn::Sub(hn::GatherIndex(di, ys, c.v2), corner_y);
  return c;
}

void DrawInstance(const InstanceTriangles& triangles, const Projected& projected,
                  const BatchVertex* vertices, const SampleGrid& grid, int tile_x, int tile_y,
                  TilePlanes& planes, TileCounters& counters) {
  const IntTag di;
  const std::size_t lanes = hn::Lanes(di);
  const auto corner_x = hn::Set(di, tile_x * element::kSubUnit);
  const auto corner_y = hn::Set(di, tile_y * element::kSubUnit);
  const auto last = hn::Set(di, kTileSamples - 1);
  Survivors survivors;
  counters.triangles += triangles.count;
  const std::uint32_t first_id =
      element::sample_id(element::SampleClass::kMesh, triangles.first_block, 0);
  static_assert(element::kBlockTriangles == 128, "the triangle's number runs on into the block's");
  for (std::uint32_t t = 0; t < triangles.count; t += static_cast<std::uint32_t>(lanes)) {
    const std::size_t batch = std::min<std::size_t>(lanes, triangles.count - t);
    std::uint32_t special = 0;
    const Corners c = LoadCorners(triangles, projected, t, batch, corner_x, corner_y, special);
    special = Cull(c, t, batch, special, triangles.double_sided, last, last, survivors);
    if (survivors.count >= lanes) {
      survivors.count -= lanes;
      counters.surviving += lanes;
      DrawSurvivors(survivors, survivors.count, lanes, projected.depth.data(), first_id, planes);
    }
    for (; special != 0; special &= special - 1) {
      const std::uint32_t triangle = t + static_cast<std::uint32_t>(__builtin_ctz(special));
      DrawSpecial(triangles, triangle, first_id + triangle, projected, vertices, grid, tile_x,
                  tile_y, planes, counters);
    }
  }
  DrawRest(survivors, projected.depth.data(), first_id, planes, counters);
}

/// Appends survivors [from, from + lanes), of which the first `valid` count.
HWY_NOINLINE void ListSurvivors(const Survivors& survivors, std::size_t from, std::size_t valid,
                                const float* depths, Int last_x, Int last_y, TriangleList& list,
                                Footprint& footprint) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const auto column = [&](const std::int32_t* values)
                          HWY_ATTR { return hn::LoadU(di, values + from); };
  const auto x0 = column(survivors.x0), y0 = column(survivors.y0);
  const auto x1 = column(survivors.x1), y1 = column(survivors.y1);
  const auto x2 = column(survivors.x2), y2 = column(survivors.y2);
  const Box box = BoxOf(hn::Min(x0, hn::Min(x1, x2)), hn::Min(y0, hn::Min(y1, y2)),
                        hn::Max(x0, hn::Max(x1, x2)), hn::Max(y0, hn::Max(y1, y2)), last_x, last_y);
  const std::size_t lanes = hn::Lanes(di), at = list.used;
  if (list.low.size() < at + 2 * lanes) {  // so that whole vectors may be read
    const std::size_t size = std::max<std::size_t>(4096, 2 * at);
    list.low.resize(size);
    list.high.resize(size);
    list.small.resize(size);
  }
  const auto pair = [&](Int a, Int b) HWY_ATTR {
    return hn::Or(hn::And(a, hn::Set(di, 0xffff)), hn::ShiftLeft<16>(b));
  };
  hn::StoreU(hn::BitCast(du, pair(box.x_low, box.y_low)), du, list.low.data() + at);
  hn::StoreU(hn::BitCast(du, pair(box.x_high, box.y_high)), du, list.high.data() + at);
  const auto z0 = hn::GatherIndex(df, depths, column(survivors.v0));
  const auto z1 = hn::GatherIndex(df, depths, column(survivors.v1));
  const auto z2 = hn::GatherIndex(df, depths, column(survivors.v2));
  HWY_ALIGN std::int32_t places[4 * kMaxLanes], depth_words[4 * kMaxLanes];
  hn::StoreInterleaved4(x0, y0, pair(hn::Sub(x1, x0), hn::Sub(y1, y0)),
                        pair(hn::Sub(x2, x0), hn::Sub(y2, y0)), di, places);
  hn::StoreInterleaved4(hn::BitCast(di, z0), hn::BitCast(di, z1), hn::BitCast(di, z2),
                        column(survivors.triangle), di, depth_words);
  for (std::size_t lane = 0; lane < valid; ++lane) {
    auto* record = reinterpret_cast<char*>(&list.small[at + lane]);
    std::memcpy(record, places + 4 * lane, 16);
    std::memcpy(record + 16, depth_words + 4 * lane, 16);
  }
  list.used += valid;
  const auto counts = hn::FirstN(di, valid);
  const auto least = [&](Int v) HWY_ATTR {
    return hn::GetLane(hn::MinOfLanes(di, hn::IfThenElse(counts, v, hn::Set(di, INT32_MAX))));
  };
  const auto most = [&](Int v) HWY_ATTR {
    return hn::GetLane(hn::MaxOfLanes(di, hn::IfThenElse(counts, v, hn::Set(di, -1))));
  };
  footprint.x_low = std::min(footprint.x_low, least(box.x_low));
  footprint.y_low = std::min(footprint.y_low, least(box.y_low));
  footprint.x_high = std::max(footprint.x_high, most(box.x_high));
  footprint.y_high = std::max(footprint.y_high, most(box.y_high));
  const auto nearest = hn::Max(z0, hn::Max(z1, z2));
  footprint.depth_high = std::max(
      footprint.depth_high,
      hn::GetLane(hn::MaxOfLanes(df, hn::IfThenElseZero(hn::RebindMask(df, counts), nearest))));
}

/// Appends a triangle that Cull would not take, cut at the near plane if need be.
HWY_NOINLINE void ListLarge(const InstanceTriangles& triangles, std::uint32_t t,
                            const Projected& projected, const BatchVertex* vertices,
                            const SampleGrid& grid, TriangleList& list, Footprint& footprint) {
  SnappedVertex polygon[kMaxClippedCorners];
  bool clip = false;
  const int count = PolygonOf(triangles, t, projected, vertices, grid, polygon, clip);
  constexpr std::int32_t kHalf = element::kSubUnit / 2;
  for (int k = 1; k + 1 < count; ++k) {
    const SnappedVertex v[3] = {polygon[0], polygon[k], polygon[k + 1]};
    const std::int32_t x_low =
        std::max(0, (std::min({v[0].x, v[1].x, v[2].x}) + kHalf - 1) >> element::kSubBits);
    const std::int32_t y_low =
        std::max(0, (std::min({v[0].y, v[1].y, v[2].y}) + kHalf - 1) >> element::kSubBits);
    const std::int32_t x_high =
        std::min(grid.width - 1, (std::max({v[0].x, v[1].x, v[2].x}) - kHalf) >> element::kSubBits);
    const std::int32_t y_high = std::min(
        grid.height - 1, (std::max({v[0].y, v[1].y, v[2].y}) - kHalf) >> element::kSubBits);
    const std::int64_t area = element::doubled_area(v[0].x, v[0].y, v[1].x, v[1].y, v[2].x, v[2].y);
    if (x_low > x_high || y_low > y_high || area == 0 || (area < 0 && !triangles.double_sided)) {
      continue;
    }
    list.large.push_back({{v[0].x, v[1].x, v[2].x},
                          {v[0].y, v[1].y, v[2].y},
                          {v[0].depth, v[1].depth, v[2].depth},
                          t});
    footprint.x_low = std::min(footprint.x_low, x_low);
    footprint.y_low = std::min(footprint.y_low, y_low);
    footprint.x_high = std::max(footprint.x_high, x_high);
    footprint.y_high = std::max(footprint.y_high, y_high);
    footprint.depth_high = std::max({footprint.depth_high, v[0].depth, v[1].depth, v[2].depth});
  }
}

Footprint ListTriangles(const InstanceTriangles& triangles, const Projected& projected,
                        const BatchVertex* vertices, const SampleGrid& grid, TriangleList& list) {
  const IntTag di;
  const std::size_t lanes = hn::Lanes(di);
  const auto zero = hn::Zero(di);
  const auto last_x = hn::Set(di, grid.width - 1), last_y = hn::Set(di, grid.height - 1);
  const float* depths = projected.depth.data();
  Footprint footprint{INT32_MAX, INT32_MAX, -1, -1, 0.0F, false};
  Survivors survivors;
  for (std::uint32_t t = 0; t < triangles.count; t += static_cast<std::uint32_t>(lanes)) {
    const std::size_t batch = std::min<std::size_t>(lanes, triangles.count - t);
    std::uint32_t special = 0;
    const Corners c = LoadCorners(triangles, projected, t, batch, zero, zero, special);
    special = Cull(c, t, batch, special, triangles.double_sided, last_x, last_y, survivors);
    if (survivors.count >= lanes) {
      survivors.count -= lanes;
      ListSurvivors(survivors, survivors.count, lanes, depths, last_x, last_y, list, footprint);
    }
    for (; special != 0; special &= special - 1) {
      ListLarge(triangles, t + static_cast<std::uint32_t>(__builtin_ctz(special)), projected,
                vertices, grid, list, footprint);
    }
  }
  if (survivors.count > 0) {
    for (std::size_t i = survivors.count; i < lanes; ++i) {
      survivors.v0[i] = survivors.v1[i] = survivors.v2[i] = survivors.v0[0];
      survivors.x0[i] = survivors.x1[i] = survivors.x2[i] = 0;
      survivors.y0[i] = survivors.y1[i] = survivors.y2[i] = 0;
    }
    ListSurvivors(survivors, 0, survivors.count, depths, last_x, last_y, list, footprint);
  }
  return footprint;
}

void DrawListed(const TriangleList& list, TriangleList::Range small, TriangleList::Range large,
                std::uint32_t first_block, bool double_sided, int tile_x, int tile_y,
                TilePlanes& planes, TileCounters& counters) {
  const IntTag di;
  const UintTag du;
  const std::size_t lanes = hn::Lanes(di);
  const std::uint32_t first_id = element::sample_id(element::SampleClass::kMesh, first_block, 0);
  // two comparisons of 15 bits in one subtraction: a top bit that is set stays where a >= b
  const auto tops = hn::Set(du, 0x80008000U);
  const auto both = [&](int x, int y) HWY_ATTR {
    return hn::Set(du, static_cast<std::uint32_t>(x) | static_cast<std::uint32_t>(y) << 16);
  };
  const auto tile_low = both(tile_x, tile_y);
  const auto tile_high = hn::Or(both(tile_x + kTileSamples - 1, tile_y + kTileSamples - 1), tops);
  const auto corner_x = hn::Set(di, tile_x * element::kSubUnit);
  const auto corner_y = hn::Set(di, tile_y * element::kSubUnit);
  // far enough ahead for the records to come from memory
  constexpr std::size_t kAhead = 4 * kMaxLanes;
  HWY_ALIGN std::uint32_t chosen[kAhead + kMaxLanes];
  HWY_ALIGN std::int32_t places[4 * kMaxLanes], depths[4 * kMaxLanes];
  Survivors columns;
  std::size_t pending = 0;
  const auto draw = [&](std::size_t from, std::size_t valid) HWY_ATTR {
    for (std::size_t lane = 0; lane < lanes; ++lane) {
      const auto* record =
          reinterpret_cast<const char*>(&list.small[chosen[from + std::min(lane, valid - 1)]]);
      std::memcpy(places + 4 * lane, record, 16);
      std::memcpy(depths + 4 * lane, record + 16, 16);
    }
    Int x0, y0, step1, step2, z0, z1, z2, triangle;
    hn::LoadInterleaved4(di, places, x0, y0, step1, step2);
    hn::LoadInterleaved4(di, depths, z0, z1, z2, triangle);
    x0 = hn::Sub(x0, corner_x);
    y0 = hn::Sub(y0, corner_y);
    const auto x_step = [&](Int step)
                            HWY_ATTR { return hn::ShiftRight<16>(hn::ShiftLeft<16>(step)); };
    hn::Store(x0, di, columns.x0);
    hn::Store(y0, di, columns.y0);
    hn::Store(hn::Add(x0, x_step(step1)), di, columns.x1);
    hn::Store(hn::Add(y0, hn::ShiftRight<16>(step1)), di, columns.y1);
    hn::Store(hn::Add(x0, x_step(step2)), di, columns.x2);
    hn::Store(hn::Add(y0, hn::ShiftRight<16>(step2)), di, columns.y2);
    hn::Store(z0, di, columns.v0);
    hn::Store(z1, di, columns.v1);
    hn::Store(z2, di, columns.v2);
    hn::Store(triangle, di, columns.triangle);
    counters.surviving += valid;
    DrawSurvivors(columns, 0, valid, nullptr, first_id, planes);
  };
  for (std::uint32_t t = 0; t < small.count; t += static_cast<std::uint32_t>(lanes)) {
    const std::size_t batch = std::min<std::size_t>(lanes, small.count - t);
    const std::size_t at = std::size_t{small.first} + t;
    // beyond the last one others are read, or what was there before; the list has room
    const auto low = hn::LoadU(du, list.low.data() + at);
    const auto high = hn::Or(hn::LoadU(du, list.high.data() + at), tops);
    const auto reach = hn::And(hn::Sub(tile_high, low), hn::Sub(high, tile_low));
    auto here = hn::RebindMask(di, hn::Eq(hn::And(reach, tops), tops));
    if (batch < lanes) here = hn::And(here, hn::FirstN(di, batch));
    const std::size_t kept = hn::CountTrue(di, here);
    if (kept == 0) continue;
    const auto number = hn::Add(hn::Iota(du, 0), hn::Set(du, static_cast<std::uint32_t>(at)));
    hn::StoreU(hn::Compress(number, hn::RebindMask(du, here)), du, chosen + pending);
    for (std::size_t k = 0; k < kept; ++k) {
      __builtin_prefetch(&list.small[chosen[pending + k]]);
    }
    pending += kept;
    if (pending >= kAhead) {
      const std::size_t whole = pending / lanes * lanes;
      for (std::size_t from = 0; from < whole; from += lanes) draw(from, lanes);
      std::copy(chosen + whole, chosen + pending, chosen);
      pending -= whole;
    }
  }
  for (std::size_t from = 0; from < pending; from += lanes) {
    draw(from, std::min(lanes, pending - from));
  }
  for (std::uint32_t i = 0; i < large.count; ++i) {
    const TriangleList::Large& one = list.large[large.first + i];
    const auto corner = [&](int k) {
      return SnappedVertex{one.x[k], one.y[k], one.depth[k], 0.0F};
    };
    DrawOne(corner(0), corner(1), corner(2), first_id + one.triangle, double_sided, tile_x, tile_y,
            planes, counters);
  }
}

/// Vertices of an agent, from the model frame to the sample grid; `result` holds the least x and y.
HWY_INLINE void PlaceVertices(const SharedTriangles& s, const SampleGrid& grid, int tile_x,
                              int tile_y, SharedScratch& scratch, std::int32_t& x_least,
                              std::int32_t& y_least) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const std::size_t lanes = hn::Lanes(df);
  const glm::mat4& m = grid.clip_from_relative;
  const auto half_x = hn::Set(df, static_cast<float>(grid.width) * (element::kSubUnit / 2));
  const auto half_y = hn::Set(df, static_cast<float>(grid.height) * (element::kSubUnit / 2));
  const auto one = hn::Set(df, 1.0F), half = hn::Set(df, 0.5F);
  const auto cosine = hn::Set(df, s.cosine_scale), sine = hn::Set(df, s.sine_scale);
  const auto scale = hn::Set(df, s.scale);
  const auto feet_x = hn::Set(df, s.feet_relative.x), feet_y = hn::Set(df, s.feet_relative.y);
  const auto feet_z = hn::Set(df, s.feet_relative.z);
  const auto corner_x = hn::Set(di, tile_x * element::kSubUnit);
  const auto corner_y = hn::Set(di, tile_y * element::kSubUnit);
  auto x_low = hn::Set(di, INT32_MAX), y_low = hn::Set(di, INT32_MAX);
  // whole vectors: the columns are padded with their last vertex
  for (std::size_t i = 0; i < s.vertex_count; i += lanes) {
    const auto x = hn::Load(df, s.posed + i);
    const auto y = hn::Load(df, s.posed + s.stride + i);
    const auto z = hn::Load(df, s.posed + 2 * std::size_t{s.stride} + i);
    // as place_posed: both geometries give the same bits
    const auto px = hn::Add(feet_x, hn::Sub(hn::Mul(x, cosine), hn::Mul(y, sine)));
    const auto py = hn::Add(feet_y, hn::Add(hn::Mul(x, sine), hn::Mul(y, cosine)));
    const auto pz = hn::Add(feet_z, hn::Mul(z, scale));
    const auto row = [&](int r) HWY_ATTR {
      const auto a = hn::Mul(hn::Set(df, m[0][r]), px);
      const auto b = hn::Mul(hn::Set(df, m[1][r]), py);
      const auto c = hn::Mul(hn::Set(df, m[2][r]), pz);
      return hn::Add(hn::Add(hn::Add(a, b), c), hn::Set(df, m[3][r]));
    };
    const auto inverse_w = hn::Div(one, row(3));
    const auto sx = hn::Mul(hn::Mul(row(0), inverse_w), half_x);
    const auto sy = hn::Mul(hn::Mul(row(1), inverse_w), half_y);
    const auto ix =
        hn::Sub(hn::ConvertTo(di, hn::Floor(hn::Add(hn::Add(sx, half_x), half))), corner_x);
    const auto iy =
        hn::Sub(hn::ConvertTo(di, hn::Floor(hn::Add(hn::Sub(half_y, sy), half))), corner_y);
    x_low = hn::Min(x_low, ix);
    y_low = hn::Min(y_low, iy);
    hn::Store(ix, di, scratch.x + i);
    hn::Store(iy, di, scratch.y + i);
    hn::Store(hn::Mul(row(2), inverse_w), df, scratch.depth + i);
  }
  x_least = hn::GetLane(hn::MinOfLanes(di, x_low));
  y_least = hn::GetLane(hn::MinOfLanes(di, y_low));
  const auto low_x = hn::Set(di, x_least), low_y = hn::Set(di, y_least);
  for (std::size_t i = 0; i < s.vertex_count; i += lanes) {
    const auto x = hn::Sub(hn::Load(di, scratch.x + i), low_x);
    const auto y = hn::Sub(hn::Load(di, scratch.y + i), low_y);
    hn::Store(hn::BitCast(du, hn::Or(x, hn::ShiftLeft<16>(y))), du, scratch.place + i);
  }
}

/// The packed places of one vector of corners. kTables: vertices are in that many registers.
template <int kTables>
HWY_INLINE Uint LookUp(const std::uint32_t* place, const Uint* tables, Int corner) {
  const IntTag di;
  const UintTag du;
  if constexpr (kTables == 0) {
    return hn::GatherIndex(du, place, corner);
  } else {
    const auto within = hn::IndicesFromVec(du, hn::And(corner, hn::Set(di, 15)));
    auto result = hn::TableLookupLanes(tables[0], within);
    for (int k = 1; k < kTables; ++k) {
      const auto here = hn::Gt(corner, hn::Set(di, 16 * k - 1));
      result =
          hn::IfThenElse(hn::RebindMask(du, here), hn::TableLookupLanes(tables[k], within), result);
    }
    return result;
  }
}

template <int kTables>
HWY_INLINE void DrawPlaced(const SharedTriangles& triangles, const SharedScratch& scratch,
                           std::int32_t x_least, std::int32_t y_least, TilePlanes& planes,
                           TileCounters& counters) {
  const IntTag di;
  const UintTag du;
  const std::size_t lanes = hn::Lanes(di);
  const std::uint32_t first_id =
      element::sample_id(element::SampleClass::kMesh, triangles.first_block, 0);
  Uint tables[kTables == 0 ? 1 : kTables];
  for (int k = 0; k < kTables; ++k) tables[k] = hn::Load(du, scratch.place + 16 * k);
  const auto low_x = hn::Set(di, x_least), low_y = hn::Set(di, y_least);
  const auto ten = hn::Set(du, 1023), low_half = hn::Set(du, 0xffff);
  const auto last = hn::Set(di, kTileSamples - 1);
  Survivors survivors;
  for (std::uint32_t t = 0; t < triangles.count; t += static_cast<std::uint32_t>(lanes)) {
    // beyond the last triangle others are read, or padding, and not drawn
    const std::size_t batch = std::min<std::size_t>(lanes, triangles.count - t);
    const auto word = hn::LoadU(du, triangles.corners + t);
    Corners c;
    c.v0 = hn::BitCast(di, hn::And(word, ten));
    c.v1 = hn::BitCast(di, hn::And(hn::ShiftRight<10>(word), ten));
    c.v2 = hn::BitCast(di, hn::ShiftRight<20>(word));
    const auto p0 = LookUp<kTables>(scratch.place, tables, c.v0);
    const auto p1 = LookUp<kTables>(scratch.place, tables, c.v1);
    const auto p2 = LookUp<kTables>(scratch.place, tables, c.v2);
    const auto x_of = [&](Uint p) HWY_ATTR {
      return hn::Add(hn::BitCast(di, hn::And(p, low_half)), low_x);
    };
    const auto y_of = [&](Uint p) HWY_ATTR {
      return hn::Add(hn::BitCast(di, hn::ShiftRight<16>(p)), low_y);
    };
    c.x0 = x_of(p0);
    c.x1 = x_of(p1);
    c.x2 = x_of(p2);
    c.y0 = y_of(p0);
    c.y1 = y_of(p1);
    c.y2 = y_of(p2);
    std::uint32_t special = Cull(c, t, batch, 0, triangles.double_sided, last, last, survivors);
    for (; special != 0; special &= special - 1) {
      const std::uint32_t triangle = t + static_cast<std::uint32_t>(__builtin_ctz(special));
      SnappedVertex corner[3];
      for (int k = 0; k < 3; ++k) {
        const std::size_t v = (triangles.corners[triangle] >> (10 * k)) & 1023U;
        corner[k] = {scratch.x[v], scratch.y[v], scratch.depth[v], 0.0F};
      }
      DrawOne(corner[0], corner[1], corner[2], first_id + triangle, triangles.double_sided, 0, 0,
              planes, counters);
    }
    if (survivors.count >= lanes) {
      survivors.count -= lanes;
      counters.surviving += lanes;
      DrawSurvivors(survivors, survivors.count, lanes, scratch.depth, first_id, planes);
    }
  }
  DrawRest(survivors, scratch.depth, first_id, planes, counters);
}

void DrawShared(const SharedTriangles& triangles, const SampleGrid& grid, int tile_x, int tile_y,
                SharedScratch& scratch, TilePlanes& planes, TileCounters& counters) {
  counters.triangles += triangles.count;
  std::int32_t x_least = 0, y_least = 0;
  PlaceVertices(triangles, grid, tile_x, tile_y, scratch, x_least, y_least);
  if (hn::Lanes(IntTag()) == 16 && triangles.vertex_count <= 32) {
    DrawPlaced<2>(triangles, scratch, x_least, y_least, planes, counters);
  } else if (hn::Lanes(IntTag()) == 16 && triangles.vertex_count <= 64) {
    DrawPlaced<4>(triangles, scratch, x_least, y_least, planes, counters);
  } else {
    DrawPlaced<0>(triangles, scratch, x_least, y_least, planes, counters);
  }
}

void UpdateCells(TilePlanes& planes) {
  const FloatTag df;
  const std::size_t lanes = hn::Lanes(df);
  for (int cy = 0; cy < kCells; ++cy) {
    for (int cx = 0; cx < kCells; ++cx) {
      auto low = hn::Set(df, 1.0F);
      for (int by = 0; by < 2; ++by) {
        for (int bx = 0; bx < 2; ++bx) {
          const float* block = planes.depth + sample_index(cx * 8 + bx * 4, cy * 8 + by * 4);
          for (std::size_t i = 0; i < 16; i += lanes) low = hn::Min(low, hn::Load(df, block + i));
        }
      }
      planes.cell_low[cy * kCells + cx] = hn::GetLane(hn::MinOfLanes(df, low));
    }
  }
}

void ClassifyBlocks(const TilePlanes& planes, BlockKind* kinds) {
  const FloatTag df;
  const UintTag du;
  const std::size_t lanes = hn::Lanes(df);
  constexpr std::size_t kBlocks = (kTileSamples / 4) * (kTileSamples / 4);
  for (std::size_t block = 0; block < kBlocks; ++block) {
    const float* depth = planes.depth + 16 * block;
    const std::uint32_t* id = planes.id + 16 * block;
    const auto first = hn::Set(du, id[0]);
    bool is_empty = true, is_one = true;
    for (std::size_t i = 0; i < 16; i += lanes) {
      const auto nothing = hn::Eq(hn::Load(df, depth + i), hn::Zero(df));
      is_empty = is_empty && hn::AllTrue(df, nothing);
      is_one = is_one && hn::AllFalse(df, nothing) &&
               hn::AllTrue(du, hn::Eq(hn::Load(du, id + i), first));
    }
    kinds[block] = is_empty ? BlockKind::kEmpty
                   : is_one ? BlockKind::kOneTriangle
                            : BlockKind::kMixed;
  }
}

const char* SimdName() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace throng::render::visibility
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace throng::render::visibility {

HWY_EXPORT(ProjectVertices);
HWY_EXPORT(DrawInstance);
HWY_EXPORT(DrawShared);
HWY_EXPORT(ListTriangles);
HWY_EXPORT(DrawListed);
HWY_EXPORT(UpdateCells);
HWY_EXPORT(ClassifyBlocks);
HWY_EXPORT(SimdName);

Footprint project_vertices(const SampleGrid& grid, const BatchVertex* vertices, std::size_t begin,
                           std::size_t end, Projected& projected) {
  // who is drawn in another form, or not at all, falls nowhere
  if (begin == end) return {0, 0, -1, -1, 0.0F, false};
  return HWY_DYNAMIC_DISPATCH(ProjectVertices)(grid, vertices, begin, end, projected);
}

void draw_instance(const InstanceTriangles& triangles, const Projected& projected,
                   const BatchVertex* vertices, const SampleGrid& grid, int tile_x, int tile_y,
                   TilePlanes& planes, TileCounters& counters) {
  HWY_DYNAMIC_DISPATCH(DrawInstance)
  (triangles, projected, vertices, grid, tile_x, tile_y, planes, counters);
}

void draw_shared(const SharedTriangles& triangles, const SampleGrid& grid, int tile_x, int tile_y,
                 SharedScratch& scratch, TilePlanes& planes, TileCounters& counters) {
  HWY_DYNAMIC_DISPATCH(DrawShared)(triangles, grid, tile_x, tile_y, scratch, planes, counters);
}

Footprint list_triangles(const InstanceTriangles& triangles, const Projected& projected,
                         const BatchVertex* vertices, const SampleGrid& grid, TriangleList& list) {
  return HWY_DYNAMIC_DISPATCH(ListTriangles)(triangles, projected, vertices, grid, list);
}

void draw_listed(const TriangleList& list, TriangleList::Range small, TriangleList::Range large,
                 std::uint32_t first_block, bool double_sided, int tile_x, int tile_y,
                 TilePlanes& planes, TileCounters& counters) {
  HWY_DYNAMIC_DISPATCH(DrawListed)
  (list, small, large, first_block, double_sided, tile_x, tile_y, planes, counters);
}

Footprint project_box(const SampleGrid& grid, const glm::vec3& low, const glm::vec3& high,
                      const SharedTriangles& placement) {
  const glm::mat4& m = grid.clip_from_relative;
  // the box's corners in clip space by its edges; what is in it lies between them on the picture
  const float c = placement.cosine_scale, s = placement.sine_scale;
  const glm::vec3 extent = high - low;
  const glm::vec3 base =
      placement.feet_relative +
      glm::vec3(low.x * c - low.y * s, low.x * s + low.y * c, low.z * placement.scale);
  const glm::vec4 origin = to_clip(m, base);
  const glm::vec4 along_x = (m[0] * c + m[1] * s) * extent.x;
  const glm::vec4 along_y = (m[1] * c - m[0] * s) * extent.y;
  const glm::vec4 along_z = m[2] * (placement.scale * extent.z);
  float x_low = 1e30F, y_low = 1e30F, x_high = -1e30F, y_high = -1e30F, nearest = 0.0F;
  for (int corner = 0; corner < 8; ++corner) {
    glm::vec4 p = origin;
    if ((corner & 1) != 0) p += along_x;
    if ((corner & 2) != 0) p += along_y;
    if ((corner & 4) != 0) p += along_z;
    const float inverse_w = 1.0F / p.w;
    const float x = p.x * inverse_w, y = p.y * inverse_w;
    x_low = std::min(x_low, x);
    x_high = std::max(x_high, x);
    y_low = std::min(y_low, y);
    y_high = std::max(y_high, y);
    nearest = std::max(nearest, p.z * inverse_w);
  }
  const float half_x = 0.5F * static_cast<float>(grid.width);
  const float half_y = 0.5F * static_cast<float>(grid.height);
  // half a sample for the centres, and a sixteenth for every rounding on the way
  constexpr float kSlack = 0.0625F - 0.5F;
  const auto clamped = [](float value, std::int32_t last) {
    return static_cast<std::int32_t>(std::clamp(value, -1.0F, static_cast<float>(last) + 1.0F));
  };
  Footprint footprint;
  footprint.clipped = false;
  footprint.x_low =
      std::max(0, clamped(std::ceil((1.0F + x_low) * half_x - 0.5F - 0.0625F), grid.width));
  footprint.y_low =
      std::max(0, clamped(std::ceil((1.0F - y_high) * half_y - 0.5F - 0.0625F), grid.height));
  footprint.x_high =
      std::min(grid.width - 1, clamped(std::floor((1.0F + x_high) * half_x + kSlack), grid.width));
  footprint.y_high =
      std::min(grid.height - 1, clamped(std::floor((1.0F - y_low) * half_y + kSlack), grid.height));
  footprint.depth_high = nearest * (1.0F + 1e-6F);
  return footprint;
}

void update_cells(TilePlanes& planes) { HWY_DYNAMIC_DISPATCH(UpdateCells)(planes); }

void classify_blocks(const TilePlanes& planes, BlockKind* kinds) {
  HWY_DYNAMIC_DISPATCH(ClassifyBlocks)(planes, kinds);
}

const char* simd_name() { return HWY_DYNAMIC_DISPATCH(SimdName)(); }

void Projected::resize(std::size_t count) {
  if (x.size() >= count) return;  // grow only
  x.resize(count);
  y.resize(count);
  depth.resize(count);
  inverse_w.resize(count);
}

void clear_tile(TilePlanes& planes) {
  std::memset(planes.depth, 0, sizeof(planes.depth));
  std::memset(planes.id, 0, sizeof(planes.id));
  std::memset(planes.cell_low, 0, sizeof(planes.cell_low));
}

bool hidden(const TilePlanes& planes, int x_low, int y_low, int x_high, int y_high,
            float depth_high) {
  for (int cy = y_low / kCellSamples; cy <= y_high / kCellSamples; ++cy) {
    for (int cx = x_low / kCellSamples; cx <= x_high / kCellSamples; ++cx) {
      // an equal depth may still win by its id
      if (planes.cell_low[cy * kCells + cx] <= depth_high) return false;
    }
  }
  return true;
}

}  // namespace throng::render::visibility
#endif  // HWY_ONCE
