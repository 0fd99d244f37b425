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
  // the mip level where a texel is about a sample
  const float texels = std::abs((uv[1].x - uv[0].x) * (uv[2].y - uv[0].y) -
                                (uv[2].x - uv[0].x) * (uv[1].y - uv[0].y)) *
                       static_cast<float>(cutout.width_px) * static_cast<float>(cutout.height_px);
  float samples = static_cast<float>(area) / (element::kSubUnit * element::kSubUnit);
  std::int32_t width = cutout.width_px, height = cutout.height_px;
  const std::uint32_t* level = cutout.texels;
  for (std::int32_t i = 1; i < cutout.levels && samples * 4.0F <= texels; ++i, samples *= 4.0F) {
    level += static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    width = std::max(1, width >> 1);
    height = std::max(1, height >> 1);
  }
  const element::Edge edges[3] = {element::edge_between(v[1].x, v[1].y, v[2].x, v[2].y),
                                  element::edge_between(v[2].x, v[2].y, v[0].x, v[0].y),
                                  element::edge_between(v[0].x, v[0].y, v[1].x, v[1].y)};
  const element::DepthPlane plane =
      element::depth_plane(v[0].x, v[0].y, v[0].depth, v[1].x, v[1].y, v[1].depth, v[2].x, v[2].y,
                           v[2].depth, static_cast<float>(area));
  for (int y = y_low; y <= y_high; ++y) {
    for (int x = x_low; x <= x_high; ++x) {
      float share[3], sum = 0.0F;
      bool inside = true;
      for (int k = 0; k < 3; ++k) {
        const std::int32_t e = edges[k].at_origin + edges[k].dx * x + edges[k].dy * y;
        inside = inside && e >= 0;
        share[k] = (static_cast<float>(e) + 0.5F) * v[k].inverse_w;  // perspective-correct
        sum += share[k];
      }
      if (!inside) continue;
      const float px = static_cast<float>(x * element::kSubUnit + kHalf - v[0].x);
      const float py = static_cast<float>(y * element::kSubUnit + kHalf - v[0].y);
      float z = (plane.z0 + px * plane.dzdx) + py * plane.dzdy;
      z = std::min(std::max(z, plane.low), plane.high);
      const std::size_t at = sample_index(x, y);
      if (z < planes.depth[at] || (z == planes.depth[at] && id <= planes.id[at])) continue;
      const glm::vec2 place = (uv[0] * share[0] + uv[1] * share[1] + uv[2] * share[2]) / sum;
      const auto texel = [](float c, std::int32_t size) {
        return std::min(std::max(static_cast<std::int32_t>(c * static_cast<float>(size)), 0),
                        size - 1);
      };
      const std::uint32_t color =
          level[static_cast<std::size_t>(texel(place.y, height)) * static_cast<std::size_t>(width) +
                static_cast<std::size_t>(texel(place.x, width))];
      if ((color >> 24) < 128U) continue;
      planes.depth[at] = z;
      planes.id[at] = id;
    }
  }
}

HWY_NOINLINE void DrawSpecial(const InstanceTriangles& triangles, std::uint32_t t, std::uint32_t id,
                              const Projected& projected, const BatchVertex* vertices,
                              const SampleGrid& grid, int tile_x, int tile_y, TilePlanes& planes,
                              TileCounters& counters) {
  const std::uint32_t* corner = triangles.indices + 3 * std::size_t{t};
  SnappedVertex polygon[kMaxClippedCorners];
  int count = 3;
  bool clip = false;
  for (int k = 0; k < 3; ++k) {
    const std::uint32_t v = corner[k];
    if (projected.x[v] == kNeedsClip) clip = true;
    polygon[k] = {projected.x[v], projected.y[v], projected.depth[v], projected.inverse_w[v]};
  }
  if (clip) {
    glm::vec4 clip_space[3];
    for (int k = 0; k < 3; ++k) {
      clip_space[k] = to_clip(grid.clip_from_relative, vertices[corner[k]].position_relative);
    }
    count = clip_triangle(grid, clip_space, polygon);
  }
  if (triangles.cutout != nullptr && !clip &&
      (triangles.cutout->flags[t] & kTriangleAlphaCutout) != 0) {
    glm::vec2 uv[3];
    for (int k = 0; k < 3; ++k) uv[k] = glm::vec2(vertices[corner[k]].uv) / 65535.0F;
    DrawCutout(*triangles.cutout, polygon, uv, id, triangles.double_sided, tile_x, tile_y, planes,
               counters);
    return;
  }
  for (int k = 1; k + 1 < count; ++k) {
    DrawOne(polygon[0], polygon[k], polygon[k + 1], id, triangles.double_sided, tile_x, tile_y,
            planes, counters);
  }
}

void DrawInstance(const InstanceTriangles& triangles, const Projected& projected,
                  const BatchVertex* vertices, const SampleGrid& grid, int tile_x, int tile_y,
                  TilePlanes& planes, TileCounters& counters) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const std::size_t lanes = hn::Lanes(df);
  constexpr std::size_t kMaxLanes = 16;
  constexpr std::int32_t kHalf = element::kSubUnit / 2;
  const auto corner_x = hn::Set(di, tile_x * element::kSubUnit);
  const auto corner_y = hn::Set(di, tile_y * element::kSubUnit);
  const auto zero = hn::Zero(di);
  const auto last = hn::Set(di, kTileSamples - 1);
  const auto small = hn::Set(di, element::kSmallUnits - 1);
  // columns of the survivors of one batch of triangles
  HWY_ALIGN std::int32_t column[15][kMaxLanes];
  HWY_ALIGN float number[5][kMaxLanes];
  HWY_ALIGN std::uint32_t index[3][kMaxLanes];
  std::uint32_t t = 0;
  counters.triangles += triangles.count;
  const auto id_of = [&](std::uint32_t triangle) {
    return element::sample_id(element::SampleClass::kMesh,
                              triangles.first_block + triangle / element::kBlockTriangles,
                              triangle % element::kBlockTriangles);
  };
  for (; t < triangles.count; t += static_cast<std::uint32_t>(lanes)) {
    const std::size_t batch = std::min<std::size_t>(lanes, triangles.count - t);
    auto i0 = hn::Zero(di), i1 = i0, i2 = i0;
    if (batch == lanes) {
      const auto* source =
          reinterpret_cast<const std::int32_t*>(triangles.indices) + 3 * std::size_t{t};
      hn::LoadInterleaved3(di, source, i0, i1, i2);
    } else {
      // the tail repeats its last triangle, which changes nothing
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        const std::size_t from = 3 * (std::size_t{t} + std::min(lane, batch - 1));
        for (std::size_t k = 0; k < 3; ++k) index[k][lane] = triangles.indices[from + k];
      }
      i0 = hn::BitCast(di, hn::Load(du, index[0]));
      i1 = hn::BitCast(di, hn::Load(du, index[1]));
      i2 = hn::BitCast(di, hn::Load(du, index[2]));
    }
    const std::int32_t* xs = projected.x.data();
    const std::int32_t* ys = projected.y.data();
    const auto raw0 = hn::GatherIndex(di, xs, i0);
    const auto raw1 = hn::GatherIndex(di, xs, i1);
    const auto raw2 = hn::GatherIndex(di, xs, i2);
    auto special = hn::Or(
        hn::Eq(raw0, hn::Set(di, kNeedsClip)),
        hn::Or(hn::Eq(raw1, hn::Set(di, kNeedsClip)), hn::Eq(raw2, hn::Set(di, kNeedsClip))));
    if (triangles.cutout != nullptr) {
      for (std::size_t lane = 0; lane < lanes; ++lane) {
        const std::uint8_t flags = triangles.cutout->flags[t + std::min(lane, batch - 1)];
        index[0][lane] = (flags & kTriangleAlphaCutout) != 0 ? 1U : 0U;
      }
      special = hn::Or(special, hn::Gt(hn::BitCast(di, hn::Load(du, index[0])), zero));
    }
    const auto x0 = hn::Sub(raw0, corner_x);
    auto x1 = hn::Sub(raw1, corner_x);
    auto x2 = hn::Sub(raw2, corner_x);
    const auto y0 = hn::Sub(hn::GatherIndex(di, ys, i0), corner_y);
    auto y1 = hn::Sub(hn::GatherIndex(di, ys, i1), corner_y);
    auto y2 = hn::Sub(hn::GatherIndex(di, ys, i2), corner_y);
    const auto x_min = hn::Min(x0, hn::Min(x1, x2)), x_max = hn::Max(x0, hn::Max(x1, x2));
    const auto y_min = hn::Min(y0, hn::Min(y1, y2)), y_max = hn::Max(y0, hn::Max(y1, y2));
    const auto rounding = hn::Set(di, kHalf - 1), half_unit = hn::Set(di, kHalf);
    const auto x_low = hn::Max(zero, hn::ShiftRight<element::kSubBits>(hn::Add(x_min, rounding)));
    const auto y_low = hn::Max(zero, hn::ShiftRight<element::kSubBits>(hn::Add(y_min, rounding)));
    const auto x_high = hn::Min(last, hn::ShiftRight<element::kSubBits>(hn::Sub(x_max, half_unit)));
    const auto y_high = hn::Min(last, hn::ShiftRight<element::kSubBits>(hn::Sub(y_max, half_unit)));
    auto alive = hn::Not(hn::Or(hn::Gt(x_low, x_high), hn::Gt(y_low, y_high)));
    const auto large =
        hn::Or(hn::Gt(hn::Sub(x_max, x_min), small), hn::Gt(hn::Sub(y_max, y_min), small));
    special = hn::Or(special, hn::And(large, alive));
    alive = hn::AndNot(special, alive);
    // sides are under 2^14, so every product below fits 32 bits
    auto area = hn::Sub(hn::Mul(hn::Sub(x2, x0), hn::Sub(y1, y0)),
                        hn::Mul(hn::Sub(x1, x0), hn::Sub(y2, y0)));
    if (triangles.double_sided) {
      const auto back = hn::Lt(area, zero);
      const auto sx = x1, sy = y1, si = i1;
      x1 = hn::IfThenElse(back, x2, x1);
      y1 = hn::IfThenElse(back, y2, y1);
      i1 = hn::IfThenElse(back, i2, i1);
      x2 = hn::IfThenElse(back, sx, x2);
      y2 = hn::IfThenElse(back, sy, y2);
      i2 = hn::IfThenElse(back, si, i2);
      area = hn::Abs(area);
    }
    alive = hn::And(alive, hn::Gt(area, zero));
    if (hn::AllFalse(di, alive) && hn::AllFalse(di, special)) continue;

    if (!hn::AllFalse(di, alive)) {
      // edges at the low corner of the triangle's own rectangle, where products are small
      const auto px = hn::Add(hn::ShiftLeft<element::kSubBits>(x_low), half_unit);
      const auto py = hn::Add(hn::ShiftLeft<element::kSubBits>(y_low), half_unit);
      const auto edge = [&](auto ax, auto ay, auto bx, auto by, int k) HWY_ATTR {
        const auto dx = hn::Sub(by, ay), dy = hn::Sub(ax, bx);
        auto value = hn::Add(hn::Mul(dx, hn::Sub(px, ax)), hn::Mul(dy, hn::Sub(py, ay)));
        const auto owns = hn::Or(hn::Gt(dx, zero), hn::And(hn::Eq(dx, zero), hn::Gt(dy, zero)));
        value = hn::Sub(value, hn::IfThenElse(owns, zero, hn::Set(di, 1)));
        value = hn::ShiftRight<element::kSubBits>(value);
        // back to the tile's first sample: steps of up to 63 * 2 * 2^14
        value = hn::Sub(value, hn::Add(hn::Mul(dx, x_low), hn::Mul(dy, y_low)));
        hn::Store(value, di, column[3 * k]);
        hn::Store(dx, di, column[3 * k + 1]);
        hn::Store(dy, di, column[3 * k + 2]);
      };
      edge(x0, y0, x1, y1, 0);
      edge(x1, y1, x2, y2, 1);
      edge(x2, y2, x0, y0, 2);
      hn::Store(x_low, di, column[9]);
      hn::Store(y_low, di, column[10]);
      hn::Store(x_high, di, column[11]);
      hn::Store(y_high, di, column[12]);
      hn::Store(x0, di, column[13]);
      hn::Store(y0, di, column[14]);
      const float* depths = projected.depth.data();
      const auto z0 = hn::GatherIndex(df, depths, i0);
      const auto z1 = hn::GatherIndex(df, depths, i1);
      const auto z2 = hn::GatherIndex(df, depths, i2);
      const auto inverse = hn::Div(hn::Set(df, 1.0F), hn::ConvertTo(df, area));
      const auto ux = hn::ConvertTo(df, hn::Sub(x1, x0)), uy = hn::ConvertTo(df, hn::Sub(y1, y0));
      const auto vx = hn::ConvertTo(df, hn::Sub(x2, x0)), vy = hn::ConvertTo(df, hn::Sub(y2, y0));
      const auto uz = hn::Sub(z1, z0), vz = hn::Sub(z2, z0);
      hn::Store(z0, df, number[0]);
      hn::Store(hn::Mul(hn::Sub(hn::Mul(vz, uy), hn::Mul(uz, vy)), inverse), df, number[1]);
      hn::Store(hn::Mul(hn::Sub(hn::Mul(uz, vx), hn::Mul(vz, ux)), inverse), df, number[2]);
      hn::Store(hn::Min(z0, hn::Min(z1, z2)), df, number[3]);
      hn::Store(hn::Max(z0, hn::Max(z1, z2)), df, number[4]);
    }
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(di, alive, bits);
    std::uint32_t alive_bits =
        static_cast<std::uint32_t>(bits[0]) | static_cast<std::uint32_t>(bits[1]) << 8;
    std::memset(bits, 0, sizeof(bits));
    hn::StoreMaskBits(di, special, bits);
    std::uint32_t special_bits =
        static_cast<std::uint32_t>(bits[0]) | static_cast<std::uint32_t>(bits[1]) << 8;
    const std::uint32_t valid = batch >= 32 ? ~0U : (1U << batch) - 1U;
    alive_bits &= valid;
    special_bits &= valid;
    counters.surviving += static_cast<std::uint64_t>(__builtin_popcount(alive_bits));
    while (alive_bits != 0) {
      const int lane = __builtin_ctz(alive_bits);
      alive_bits &= alive_bits - 1;
      Setup s;
      for (int k = 0; k < 3; ++k) {
        s.e[k] = column[3 * k][lane];
        s.dx[k] = column[3 * k + 1][lane];
        s.dy[k] = column[3 * k + 2][lane];
      }
      s.x_low = column[9][lane];
      s.y_low = column[10][lane];
      s.x_high = column[11][lane];
      s.y_high = column[12][lane];
      s.vx = column[13][lane];
      s.vy = column[14][lane];
      s.z0 = number[0][lane];
      s.dzdx = number[1][lane];
      s.dzdy = number[2][lane];
      s.low = number[3][lane];
      s.high = number[4][lane];
      s.id = id_of(t + static_cast<std::uint32_t>(lane));
      DrawBlocks(s, planes);
    }
    while (special_bits != 0) {
      const int lane = __builtin_ctz(special_bits);
      special_bits &= special_bits - 1;
      const std::uint32_t triangle = t + static_cast<std::uint32_t>(lane);
      DrawSpecial(triangles, triangle, id_of(triangle), projected, vertices, grid, tile_x, tile_y,
                  planes, counters);
    }
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

const char* SimdName() { return hwy::TargetName(HWY_TARGET); }

}  // namespace HWY_NAMESPACE
}  // namespace throng::render::visibility
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace throng::render::visibility {

HWY_EXPORT(ProjectVertices);
HWY_EXPORT(DrawInstance);
HWY_EXPORT(UpdateCells);
HWY_EXPORT(SimdName);

Footprint project_vertices(const SampleGrid& grid, const BatchVertex* vertices, std::size_t begin,
                           std::size_t end, Projected& projected) {
  return HWY_DYNAMIC_DISPATCH(ProjectVertices)(grid, vertices, begin, end, projected);
}

void draw_instance(const InstanceTriangles& triangles, const Projected& projected,
                   const BatchVertex* vertices, const SampleGrid& grid, int tile_x, int tile_y,
                   TilePlanes& planes, TileCounters& counters) {
  HWY_DYNAMIC_DISPATCH(DrawInstance)
  (triangles, projected, vertices, grid, tile_x, tile_y, planes, counters);
}

void update_cells(TilePlanes& planes) { HWY_DYNAMIC_DISPATCH(UpdateCells)(planes); }

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
