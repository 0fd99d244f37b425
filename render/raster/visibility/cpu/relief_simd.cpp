// The search of relief impostors for whole blocks of samples; see tile_simd.cpp for the rule that
// keeps bytes equal.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/raster/visibility/cpu/relief_simd.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>

#include "render/raster/visibility/cpu/relief.hpp"
#include "render/raster/visibility/element/word.hpp"

HWY_BEFORE_NAMESPACE();
namespace throng::render::visibility {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using FloatTag = hn::CappedTag<float, 16>;
using IntTag = hn::Rebind<std::int32_t, FloatTag>;
using UintTag = hn::Rebind<std::uint32_t, FloatTag>;
using F = hn::Vec<FloatTag>;
using I = hn::Vec<IntTag>;
using U = hn::Vec<UintTag>;

/// A box as its rays need it.
struct BoxSetup {
  element::ReliefRays rays;
  // of the level that each face is searched in, and of the one that its colours come from
  struct Levels {
    std::int32_t first[8], width[8], height[8];
  } search, color;
};

BoxSetup SetUp(const ReliefBox& box, const PlacedBox& placed, const ReliefView& view,
               const ReliefSearch& search) {
  BoxSetup s{};
  s.rays = element::relief_rays(box, placed, view, search);
  for (int f = 0; f < 6; ++f) {
    const element::ReliefLevels levels = element::relief_levels_of(box, placed.px_per_m, f);
    const auto keep = [f](const element::ReliefLevel& from, BoxSetup::Levels& to) {
      to.first[f] = from.first;
      to.width[f] = from.width;
      to.height[f] = from.height;
    };
    keep(levels.search, s.search);
    keep(levels.color, s.color);
  }
  return s;
}

HWY_INLINE F Set(float value) { return hn::Set(FloatTag(), value); }
HWY_INLINE F Along(F at, F direction, F t) { return hn::Add(at, hn::Mul(direction, t)); }

void DrawBox(const std::uint32_t* shape, const BoxSetup& s, const PlacedBox& placed,
             std::uint32_t id, const ReliefView& view, int tile_x, int tile_y, TilePlanes& planes,
             std::uint32_t* texels) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const int lanes = static_cast<int>(hn::Lanes(df));
  const int x_low = std::max(placed.x_low - tile_x, 0) >> 2;
  const int x_high = std::min(placed.x_high - tile_x, kTileSamples - 1) >> 2;
  const int y_low = std::max(placed.y_low - tile_y, 0) >> 2;
  const int y_high = std::min(placed.y_high - tile_y, kTileSamples - 1) >> 2;
  const F zero = hn::Zero(df), one = Set(1.0F);
  const U byte = hn::Set(du, 255);
  for (int by = y_low; by <= y_high; ++by) {
    for (int bx = x_low; bx <= x_high; ++bx) {
      for (int half = 0; half < 16; half += lanes) {
        const std::size_t index =
            static_cast<std::size_t>(((by * (kTileSamples / 4) + bx) << 4) + half);
        const F old_z = hn::Load(df, planes.depth + index);
        const F bound = Set(placed.depth_high);
        if (hn::AllTrue(df, hn::Gt(old_z, bound))) continue;
        const I k = hn::Iota(di, half);
        const F sx =
            hn::ConvertTo(df, hn::Add(hn::And(k, hn::Set(di, 3)), hn::Set(di, tile_x + 4 * bx)));
        const F sy = hn::ConvertTo(df, hn::Add(hn::ShiftRight<2>(k), hn::Set(di, tile_y + 4 * by)));
        // where the ray is between the box's faces
        F at[3], direction[3];
        F t_in = Set(-1e30F), t_out = Set(1e30F);
        I axis = hn::Zero(di);
        for (int a = 0; a < 3; ++a) {
          at[a] = hn::Add(Set(s.rays.origin[a]), hn::Add(hn::Mul(Set(s.rays.origin_x[a]), sx),
                                                         hn::Mul(Set(s.rays.origin_y[a]), sy)));
          F d = hn::Add(Set(s.rays.direction[a]), hn::Add(hn::Mul(Set(s.rays.direction_x[a]), sx),
                                                          hn::Mul(Set(s.rays.direction_y[a]), sy)));
          d = hn::IfThenElse(hn::Lt(hn::Abs(d), Set(1e-9F)), Set(1e-9F), d);
          direction[a] = d;
          const F inverse = hn::Div(one, d);
          const F t0 = hn::Mul(hn::Neg(at[a]), inverse);
          const F t1 = hn::Mul(hn::Sub(one, at[a]), inverse);
          const F from = hn::Min(t0, t1);
          const auto later = hn::Gt(from, t_in);
          axis = hn::IfThenElse(hn::RebindMask(di, later), hn::Set(di, a), axis);
          t_in = hn::Max(t_in, from);
          t_out = hn::Min(t_out, hn::Max(t0, t1));
        }
        const auto depth_of = [&](F t) HWY_ATTR {
          return hn::Div(Along(Set(view.z0), Set(view.z1), t),
                         Along(Set(view.w0), Set(view.w1), t));
        };
        // not before the near plane
        if (!view.orthographic) {
          t_in = hn::Max(t_in, Set(view.z0));
        } else {
          t_in = hn::Max(t_in, Set((1.0F - view.z0) / view.z1));
        }
        auto open = hn::And(hn::Lt(t_in, t_out), hn::Ge(depth_of(t_in), old_z));
        if (hn::AllFalse(df, open)) continue;
        // u, v and depth along the ray, as the entry face counts them
        const auto is_x = hn::RebindMask(df, hn::Eq(axis, hn::Zero(di)));
        const auto is_y = hn::RebindMask(df, hn::Eq(axis, hn::Set(di, 1)));
        const auto pick = [&](const F* v, int shift) HWY_ATTR {
          return hn::IfThenElse(is_x, v[shift % 3],
                                hn::IfThenElse(is_y, v[(1 + shift) % 3], v[(2 + shift) % 3]));
        };
        F u0 = pick(at, 1), ud = pick(direction, 1);
        F v0 = pick(at, 2), vd = pick(direction, 2);
        F s0 = pick(at, 0), sd = pick(direction, 0);
        const auto is_far = hn::Lt(sd, zero);
        const I face = hn::Add(hn::Add(axis, axis),
                               hn::IfThenElseZero(hn::RebindMask(di, is_far), hn::Set(di, 1)));
        s0 = hn::Mul(hn::IfThenElse(is_far, hn::Sub(one, s0), s0), Set(255.0F));
        sd = hn::Mul(hn::IfThenElse(is_far, hn::Neg(sd), sd), Set(255.0F));
        const I first = hn::GatherIndex(di, s.search.first, face);
        const I width = hn::GatherIndex(di, s.search.width, face);
        const F width_f = hn::ConvertTo(df, width);
        const F height_f = hn::ConvertTo(df, hn::GatherIndex(di, s.search.height, face));
        const auto texel_in = [&](F t, I at_first, I at_width, F wide, F high) HWY_ATTR {
          const F u = hn::Floor(hn::Mul(Along(u0, ud, t), wide));
          const F v = hn::Floor(hn::Mul(Along(v0, vd, t), high));
          const I x = hn::ConvertTo(di, hn::Min(hn::Max(u, zero), hn::Sub(wide, one)));
          const I y = hn::ConvertTo(di, hn::Min(hn::Max(v, zero), hn::Sub(high, one)));
          return hn::Add(at_first, hn::Add(hn::Mul(y, at_width), x));
        };
        const auto texel_at = [&](F t)
                                  HWY_ATTR { return texel_in(t, first, width, width_f, height_f); };
        const auto byte_of = [&](U word) HWY_ATTR {
          return hn::ConvertTo(df, hn::BitCast(di, hn::And(word, byte)));
        };
        // linear search
        const F step = hn::Mul(hn::Sub(t_out, t_in), Set(1.0F / static_cast<float>(s.rays.linear)));
        F t = hn::Sub(t_in, hn::Mul(step, Set(0.5F)));
        F hit_t = t;
        auto found = hn::Lt(one, zero);
        auto before = hn::Lt(one, zero);  // in front of something at the last step
        for (int i = 0; i < s.rays.linear; ++i) {
          t = hn::Add(t, step);
          const U word = hn::GatherIndex(du, shape, texel_at(t));
          const F d = Along(s0, sd, t);
          const F front = byte_of(word), back = byte_of(hn::ShiftRight<8>(word));
          const auto is_something = hn::Lt(front, back);
          const auto behind_front = hn::And(is_something, hn::Ge(d, front));
          auto now = hn::And(behind_front, hn::Le(d, back));
          if (s.rays.crosses) {
            now = hn::Or(now, hn::And(behind_front, before));
            before = hn::And(is_something, hn::Lt(d, front));
          }
          now = hn::And(hn::AndNot(found, now), open);
          hit_t = hn::IfThenElse(now, t, hit_t);
          found = hn::Or(found, now);
          if (hn::AllFalse(df, hn::AndNot(found, open))) break;
        }
        if (hn::AllFalse(df, found)) continue;
        // binary search between the last step outside and the first inside
        F low = hn::Max(hn::Sub(hit_t, step), t_in), high = hit_t;
        for (int i = 0; i < s.rays.binary; ++i) {
          const F middle = hn::Mul(hn::Add(low, high), Set(0.5F));
          const U word = hn::GatherIndex(du, shape, texel_at(middle));
          const F d = Along(s0, sd, middle);
          const F front = byte_of(word), back = byte_of(hn::ShiftRight<8>(word));
          auto inside = hn::And(hn::Lt(front, back), hn::Ge(d, front));
          if (!s.rays.crosses) inside = hn::And(inside, hn::Le(d, back));
          high = hn::IfThenElse(inside, middle, high);
          low = hn::IfThenElse(inside, low, middle);
        }
        const F z = hn::Min(depth_of(high), one);
        const U old_id = hn::Load(du, planes.id + index);
        const U own_id = hn::Set(du, id);
        const auto tie = hn::And(hn::Eq(z, old_z), hn::RebindMask(df, hn::Gt(own_id, old_id)));
        const auto wins = hn::And(found, hn::Or(hn::Gt(z, old_z), tie));
        if (hn::AllFalse(df, wins)) continue;
        hn::Store(hn::IfThenElse(wins, z, old_z), df, planes.depth + index);
        const auto wins_u = hn::RebindMask(du, wins);
        hn::Store(hn::IfThenElse(wins_u, own_id, old_id), du, planes.id + index);
        // the coarser level shows less only where it shows nothing
        const I color_width = hn::GatherIndex(di, s.color.width, face);
        const I color = texel_in(high, hn::GatherIndex(di, s.color.first, face), color_width,
                                 hn::ConvertTo(df, color_width),
                                 hn::ConvertTo(df, hn::GatherIndex(di, s.color.height, face)));
        const U color_shape = hn::GatherIndex(du, shape, color);
        const auto shows = hn::RebindMask(
            di, hn::Lt(byte_of(color_shape), byte_of(hn::ShiftRight<8>(color_shape))));
        const U texel = hn::BitCast(du, hn::IfThenElse(shows, color, texel_at(high)));
        hn::Store(hn::IfThenElse(wins_u, texel, hn::Load(du, texels + index)), du, texels + index);
      }
    }
  }
}

void DrawRelief(const ReliefStore& store, const ReliefStore::Member& member,
                const PlacedBox* placed, std::uint32_t first_block, const ReliefView& view,
                const ReliefSearch& search, int tile_x, int tile_y, TilePlanes& planes,
                std::uint32_t* texels, TileCounters& counters) {
  for (std::uint32_t b = 0; b < member.box_count; ++b) {
    const PlacedBox& own = placed[b];
    if (own.x_low > own.x_high || own.x_high < tile_x || own.x_low >= tile_x + kTileSamples ||
        own.y_high < tile_y || own.y_low >= tile_y + kTileSamples) {
      continue;
    }
    counters.triangles += 12;
    counters.surviving += 12;
    const ReliefBox& box = store.boxes[member.first_box + b];
    const std::uint32_t id = element::sample_id(element::SampleClass::kImpostor,
                                                first_block + b / element::kBlockTriangles,
                                                b % element::kBlockTriangles);
    DrawBox(store.shape.data(), SetUp(box, own, view, search), own, id, view, tile_x, tile_y,
            planes, texels);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace throng::render::visibility
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace throng::render::visibility {

HWY_EXPORT(DrawRelief);

void draw_relief(const ReliefStore& store, const ReliefStore::Member& member,
                 const PlacedBox* placed, std::uint32_t first_block, const ReliefView& view,
                 const ReliefSearch& search, int tile_x, int tile_y, TilePlanes& planes,
                 std::uint32_t* texels, TileCounters& counters) {
  HWY_DYNAMIC_DISPATCH(DrawRelief)
  (store, member, placed, first_block, view, search, tile_x, tile_y, planes, texels, counters);
}

}  // namespace throng::render::visibility
#endif
