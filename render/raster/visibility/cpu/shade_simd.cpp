// Shading of whole vectors of pixels; see tile_simd.cpp for the rule that keeps bytes equal.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/raster/visibility/cpu/shade_simd.cpp"
#include <hwy/foreach_target.h>
// foreach_target.h must come before highway.h
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "render/raster/element/color.hpp"
#include "render/raster/element/tone.hpp"
#include "render/raster/visibility/cpu/shade.hpp"

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

struct V3 {
  F x, y, z;
};

HWY_INLINE F Set(float value) { return hn::Set(FloatTag(), value); }
HWY_INLINE F Times(F a, float b) { return hn::Mul(a, Set(b)); }
HWY_INLINE V3 Set3(const glm::vec3& v) { return {Set(v.x), Set(v.y), Set(v.z)}; }
HWY_INLINE V3 Sub3(const V3& a, const V3& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE V3 Add3(const V3& a, const V3& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE V3 Scale3(const V3& a, F s) {
  return {hn::Mul(a.x, s), hn::Mul(a.y, s), hn::Mul(a.z, s)};
}
HWY_INLINE F Dot3(const V3& a, const V3& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
HWY_INLINE V3 Cross3(const V3& a, const V3& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)),
          hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
HWY_INLINE F Clamp01(F v) { return hn::Min(hn::Max(v, hn::Zero(FloatTag())), Set(1.0F)); }
HWY_INLINE F Lerp(F a, F b, F t) { return hn::Add(a, hn::Mul(hn::Sub(b, a), t)); }
HWY_INLINE V3 Unit3(const V3& a) {
  const F length = hn::Sqrt(hn::Max(Dot3(a, a), Set(1e-30F)));
  return Scale3(a, hn::Div(Set(1.0F), length));
}

/// 2^x for x <= 0, to 1e-5: the whole part into the exponent, a cubic for the rest.
HWY_INLINE F Exp2Negative(F x) {
  const FloatTag df;
  const IntTag di;
  x = hn::Max(x, Set(-60.0F));
  const F whole = hn::Floor(x);
  const F part = hn::Sub(x, whole);
  F p = hn::Add(Times(part, 0.0135557F), Set(0.0520323F));
  p = hn::Add(hn::Mul(p, part), Set(0.2413793F));
  p = hn::Add(hn::Mul(p, part), Set(0.6930321F));
  p = hn::Add(hn::Mul(p, part), Set(1.0F));
  const I bits = hn::ShiftLeft<23>(hn::Add(hn::ConvertTo(di, whole), hn::Set(di, 127)));
  return hn::Mul(p, hn::BitCast(df, bits));
}

/// log2 to 0.01, enough to choose a mip level.
HWY_INLINE F Log2Rough(F x) {
  const FloatTag df;
  const IntTag di;
  const I bits = hn::BitCast(di, hn::Max(x, Set(1e-30F)));
  const F exponent = hn::ConvertTo(df, hn::Sub(hn::ShiftRight<23>(bits), hn::Set(di, 127)));
  const F mantissa =
      hn::BitCast(df, hn::Or(hn::And(bits, hn::Set(di, 0x7fffff)), hn::Set(di, 0x3f800000)));
  // quadratic through 1, sqrt(2) and 2
  const F q = hn::Add(hn::Mul(hn::Add(Times(mantissa, -0.34484843F), Set(2.02466578F)), mantissa),
                      Set(-1.67487759F));
  return hn::Add(exponent, q);
}

/// The shader's tone_map, exposure 0.62.
HWY_INLINE V3 ToneMap(V3 color) {
  color = Scale3(color, Set(0.62F));
  const F peak = hn::Max(color.x, hn::Max(color.y, color.z));
  const F start = Set(0.76F);
  const float room = 1.0F - 0.76F;
  const auto bright = hn::Gt(peak, start);
  if (hn::AllFalse(FloatTag(), bright)) return color;
  const F above = hn::Add(hn::Sub(peak, start), Set(room));
  const F new_peak = hn::Sub(Set(1.0F), hn::Div(Set(room * room), above));
  const F ratio = hn::Div(new_peak, hn::Max(peak, Set(1e-6F)));
  const F whiten = hn::Sub(
      Set(1.0F), hn::Div(Set(1.0F), hn::Add(Times(hn::Sub(peak, new_peak), 0.15F), Set(1.0F))));
  const auto mapped = [&](F c) HWY_ATTR {
    const F scaled = hn::Mul(c, ratio);
    return hn::IfThenElse(bright, Lerp(scaled, new_peak, whiten), c);
  };
  return {mapped(color.x), mapped(color.y), mapped(color.z)};
}

HWY_INLINE V3 Haze(const SceneFrame& scene, const V3& color, F distance_m) {
  const F clear = Exp2Negative(Times(distance_m, -scene.haze_per_m));
  const V3 horizon = Set3(scene.horizon_color);
  return {Lerp(horizon.x, color.x, clear), Lerp(horizon.y, color.y, clear),
          Lerp(horizon.z, color.z, clear)};
}

/// Octahedral snorm16 pair in one word to a vector (not unit length).
HWY_INLINE V3 Octahedral(I packed) {
  const FloatTag df;
  const F x =
      Times(hn::ConvertTo(df, hn::ShiftRight<16>(hn::ShiftLeft<16>(packed))), 1.0F / 32767.0F);
  const F y = Times(hn::ConvertTo(df, hn::ShiftRight<16>(packed)), 1.0F / 32767.0F);
  const F z = hn::Sub(hn::Sub(Set(1.0F), hn::Abs(x)), hn::Abs(y));
  const F fold = hn::Max(hn::Neg(z), hn::Zero(df));
  const auto shift = [&](F v) HWY_ATTR {
    return hn::IfThenElse(hn::Ge(v, hn::Zero(df)), hn::Sub(v, fold), hn::Add(v, fold));
  };
  return {shift(x), shift(y), z};
}

struct Rgba {
  F r, g, b, a;
};

/// Mean of two rows of two neighbouring texels; weights in 1/256. Components 0 to 1, not decoded.
HWY_INLINE Rgba Mix(U t00, U t10, U t01, U t11, U wx, U wy) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const U pairs = hn::Set(du, 0x00ff00ffU), low_half = hn::Set(du, 0xffff);
  const U left = hn::Sub(hn::Set(du, 256), wx);
  // two components at once along the row: each stays under 2^16
  const auto along = [&](U a, U b) HWY_ATTR {
    return hn::Add(hn::Mul(hn::And(a, pairs), left), hn::Mul(hn::And(b, pairs), wx));
  };
  const U even0 = along(t00, t10), even1 = along(t01, t11);
  const U odd0 = along(hn::ShiftRight<8>(t00), hn::ShiftRight<8>(t10));
  const U odd1 = along(hn::ShiftRight<8>(t01), hn::ShiftRight<8>(t11));
  const F below = Times(hn::ConvertTo(df, hn::BitCast(di, wy)), 1.0F / (65536.0F * 255.0F));
  const F above = hn::Sub(Set(1.0F / (256.0F * 255.0F)), below);
  const auto down = [&](U a, U b) HWY_ATTR {
    return hn::Add(hn::Mul(hn::ConvertTo(df, hn::BitCast(di, a)), above),
                   hn::Mul(hn::ConvertTo(df, hn::BitCast(di, b)), below));
  };
  return {down(hn::And(even0, low_half), hn::And(even1, low_half)),
          down(hn::And(odd0, low_half), hn::And(odd1, low_half)),
          down(hn::ShiftRight<16>(even0), hn::ShiftRight<16>(even1)),
          down(hn::ShiftRight<16>(odd0), hn::ShiftRight<16>(odd1))};
}

/// The cubic of element::linear_from_srgb.
HWY_INLINE F Linear(F srgb) {
  const F q = hn::Add(hn::Mul(srgb, hn::Add(Times(srgb, 0.305306011F), Set(0.682171111F))),
                      Set(0.012522878F));
  return hn::Mul(srgb, q);
}

HWY_INLINE V3 Unpack(U bits) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const U ten = hn::Set(du, 1023);
  const auto square = [&](U c) HWY_ATTR {
    const F root = Times(hn::ConvertTo(df, hn::BitCast(di, hn::And(c, ten))), 1.0F / 1023.0F);
    return hn::Mul(root, root);
  };
  return {square(bits), square(hn::ShiftRight<10>(bits)), square(hn::ShiftRight<20>(bits))};
}

/// The texture's colour with the regions of its mask dyed in an instance's tints.
HWY_INLINE V3 Dyed(const V3& albedo, const Rgba& mask, const V3 tints[4]) {
  const FloatTag df;
  const F rest = hn::Max(
      hn::Zero(df), hn::Sub(Set(1.0F), hn::Add(hn::Add(mask.r, mask.g), hn::Add(mask.b, mask.a))));
  V3 tint{rest, rest, rest};
  const F* weights[4] = {&mask.r, &mask.g, &mask.b, &mask.a};
  for (int region = 0; region < 4; ++region) {
    // element::pack_tint stores halves
    tint = Add3(tint, Scale3(tints[region], Times(*weights[region], 2.0F)));
  }
  return {hn::Mul(albedo.x, tint.x), hn::Mul(albedo.y, tint.y), hn::Mul(albedo.z, tint.z)};
}

HWY_INLINE V3 Tinted(const V3& albedo, const Rgba& mask, const std::uint32_t* shade_words,
                     I instance) {
  const UintTag du;
  V3 tints[4];
  for (int region = 0; region < 4; ++region) {
    tints[region] = Unpack(hn::GatherIndex(du, shade_words + 4 + region, instance));
  }
  return Dyed(albedo, mask, tints);
}

/// The channel's colour where there is one, else `albedo`.
HWY_INLINE V3 Colored(const V3& base, const V3& albedo, U channel) {
  const FloatTag df;
  const UintTag du;
  const F luma =
      hn::Add(hn::Add(Times(base.x, 0.2126F), Times(base.y, 0.7152F)), Times(base.z, 0.0722F));
  const V3 color = Scale3(Unpack(channel), hn::Add(Times(hn::Sqrt(luma), 0.45F), Set(0.55F)));
  const auto chosen = hn::RebindMask(df, hn::Ne(channel, hn::Set(du, kNoChannel)));
  return {hn::IfThenElse(chosen, color.x, albedo.x), hn::IfThenElse(chosen, color.y, albedo.y),
          hn::IfThenElse(chosen, color.z, albedo.z)};
}

/// A colour with its regions (a byte each, as shares) dyed, or in the channel's colour.
HWY_INLINE V3 Worn(const V3& color, U regions, const std::uint32_t* shade_words, I instance) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const U byte = hn::Set(du, 255);
  const auto region = [&](U bits) HWY_ATTR {
    return Times(hn::ConvertTo(df, hn::BitCast(di, hn::And(bits, byte))), 1.0F / 255.0F);
  };
  const Rgba mask{region(regions), region(hn::ShiftRight<8>(regions)),
                  region(hn::ShiftRight<16>(regions)), region(hn::ShiftRight<24>(regions))};
  const V3 albedo = Tinted(color, mask, shade_words, instance);
  const U channel = hn::GatherIndex(du, shade_words + 9, instance);
  const bool plain = hn::AllTrue(du, hn::Eq(channel, hn::Set(du, kNoChannel)));
  return plain ? albedo : Colored(color, albedo, channel);
}

/// What falls on a surface and what it throws back of itself.
struct Light {
  V3 on;
  F rim, gloss;  // of the sky's and the sun's colour
};

/// `n` and `sun` of unit length in one frame whose z is up, `above_m` over the feet.
HWY_INLINE Light LightOn(const SceneFrame& scene, const V3& sun, const V3& n, const V3& to_eye,
                         F above_m) {
  const F rise = Clamp01(Times(hn::Add(above_m, Set(0.05F)), 1.0F / 0.8F));
  const F smooth = hn::Mul(hn::Mul(rise, rise), hn::Sub(Set(3.0F), hn::Add(rise, rise)));
  const F ao = hn::Add(Set(0.55F), Times(smooth, 0.45F));
  F facing = Clamp01(Times(hn::Add(Dot3(n, sun), Set(0.22F)), 1.0F / 1.22F));
  facing = hn::Mul(facing, hn::Add(Times(facing, 0.4F), Set(0.6F)));
  const F up_share = hn::Add(Times(n.z, 0.5F), Set(0.5F));
  const F direct = hn::Mul(facing, hn::Add(Times(ao, 0.25F), Set(0.75F)));
  const F edge = hn::Sub(Set(1.0F), Clamp01(Dot3(n, to_eye)));
  const F rim = hn::Mul(hn::Mul(hn::Mul(edge, edge), edge),
                        Times(hn::Add(Times(hn::Mul(n.z, n.z), 0.65F), Set(0.35F)), 0.16F));
  F gloss = Clamp01(Dot3(n, Unit3(Add3(sun, to_eye))));
  for (int power = 0; power < 4; ++power) gloss = hn::Mul(gloss, gloss);
  const auto on = [&](float sun_c, float sky_c, float low_c) HWY_ATTR {
    const F sky_light = hn::Mul(hn::Add(Set(low_c), Times(up_share, sky_c - low_c)), ao);
    return hn::Add(Times(direct, sun_c), sky_light);
  };
  return {{on(scene.sun_color.x, scene.sky_color.x, scene.ground_light.x),
           on(scene.sun_color.y, scene.sky_color.y, scene.ground_light.y),
           on(scene.sun_color.z, scene.sky_color.z, scene.ground_light.z)},
          hn::Mul(rim, ao),
          Times(hn::Mul(gloss, facing), 0.035F)};
}

/// The surface's colour in this light, haze and tone map.
HWY_INLINE V3 Seen(const SceneFrame& scene, const V3& albedo, const Light& light, F distance_m) {
  const auto lit = [&](F a, F on, float sun_c, float sky_c) HWY_ATTR {
    return hn::Add(hn::Add(hn::Mul(a, on), Times(light.rim, sky_c)), Times(light.gloss, sun_c));
  };
  V3 color{lit(albedo.x, light.on.x, scene.sun_color.x, scene.sky_color.x),
           lit(albedo.y, light.on.y, scene.sun_color.y, scene.sky_color.y),
           lit(albedo.z, light.on.z, scene.sun_color.z, scene.sky_color.z)};
  if (!scene.orthographic) color = Haze(scene, color, distance_m);
  return ToneMap(color);
}

HWY_INLINE V3 Lit(const SceneFrame& scene, const V3& albedo, const V3& n, const V3& to_eye,
                  F above_m, F distance_m) {
  return Seen(scene, albedo, LightOn(scene, Set3(scene.sun_direction), n, to_eye, above_m),
              distance_m);
}

/// Fills the last vector with its last item.
HWY_INLINE void PadItems(ShadeItems& items, std::size_t lanes) {
  for (std::size_t i = items.count; i < items.count + lanes; ++i) {
    items.triangle[i] = items.triangle[items.count - 1];
    items.instance[i] = items.instance[items.count - 1];
  }
}

/// Pixels that are shaded in one go: what their vectors need is first brought together by plain
/// loads, whole rows at a time, which costs a fraction of gathering it value by value.
constexpr std::size_t kBatch = 64;

struct FigureBatch {
  HWY_ALIGN float x_px[kBatch], y_px[kBatch];
  HWY_ALIGN float corner[3][kBatch][4];  // position, and the octahedral normal's bits
  HWY_ALIGN std::int32_t uv[3][kBatch];  // unorm16 pairs
  // between the passes
  HWY_ALIGN std::int32_t texel[2][2][kBatch];  // base and mask, rows
  HWY_ALIGN std::int32_t wx[2][kBatch], wy[2][kBatch];
  HWY_ALIGN std::uint32_t pair[2][2][kBatch][2];
  HWY_ALIGN float light[6][kBatch];
  HWY_ALIGN float tone[7][kBatch];  // colour and regions
  // of mixed instances
  HWY_ALIGN std::int32_t instance[kBatch];
  HWY_ALIGN float frame[7][kBatch];
};

/// From the frame of an instance's vertices to the world's axes at the eye.
struct Frame {
  F cosine, sine, scale;  // the first two with the scale in them
  V3 place;
  F above;  // to be added to a height times the scale for the height over the feet
};

/// What an instance's pixels have in common, in the frame of its vertices; "x" and "y" are what a
/// pixel to the right and down adds.
struct Figure {
  V3 eye, eye_x, eye_y, ray, ray_x, ray_y, sun;
  F scale, above, area_px;
};

HWY_INLINE Figure FigureOf(const SceneFrame& scene, const Frame& frame) {
  const F inverse = hn::Div(Set(1.0F), frame.scale);
  const F squared = hn::Mul(inverse, inverse);
  const F cosine = hn::Mul(frame.cosine, squared), sine = hn::Mul(frame.sine, squared);
  const auto back = [&](const V3& v) HWY_ATTR {
    return V3{hn::Add(hn::Mul(v.x, cosine), hn::Mul(v.y, sine)),
              hn::Sub(hn::Mul(v.y, cosine), hn::Mul(v.x, sine)), hn::Mul(v.z, inverse)};
  };
  Figure figure;
  figure.eye = back(Sub3(Set3(scene.ray_origin), frame.place));
  figure.eye_x = back(Set3(scene.ray_origin_x));
  figure.eye_y = back(Set3(scene.ray_origin_y));
  figure.ray = back(Set3(scene.ray_direction));
  figure.ray_x = back(Set3(scene.ray_direction_x));
  figure.ray_y = back(Set3(scene.ray_direction_y));
  figure.sun = Scale3(back(Set3(scene.sun_direction)), frame.scale);
  figure.scale = frame.scale;
  figure.above = frame.above;
  // of a determinant in this frame, and texture coordinates are in 1/65535
  figure.area_px = Times(hn::Mul(hn::Mul(frame.scale, frame.scale), frame.scale),
                         scene.px_per_tangent * scene.px_per_tangent * 65535.0F * 65535.0F);
  return figure;
}

/// What of a batch's pixels has to be looked up.
struct Wants {
  bool texture, mask, tones;
};

/// An instance's character's textures, tints and channel.
struct Surface {
  I toned;   // negative: corners have tones
  I levels;  // of TextureStore::levels, in values
  I width[2], height[2], last_level[2], log2_width[2];
  F has_mask;
  V3 tints[4];
  U channel;
};

constexpr int kLevelsWords = sizeof(TextureLevels) / 4;

/// `read(words)` gives a value of each pixel's character, given the first character's;
/// `read_shade(word)` one of its instance's InstanceShade.
template <class Read, class ReadShade>
HWY_INLINE Surface SurfaceOf(const TextureStore& textures, I character, const Read& read,
                             const ReadShade& read_shade) {
  const FloatTag df;
  const UintTag du;
  Surface surface;
  const TextureLevels& first = textures.levels[0];
  surface.toned = read_shade(8);
  surface.levels = hn::Mul(character, hn::Set(IntTag(), kLevelsWords));
  for (int t = 0; t < 2; ++t) {
    surface.width[t] = read(&first.width[t]);
    surface.height[t] = read(&first.height[t]);
    surface.last_level[t] = read(&first.last_level[t]);
    surface.log2_width[t] = read(&first.log2_width[t]);
  }
  surface.has_mask = hn::ConvertTo(df, read(&first.has_mask));
  for (int region = 0; region < 4; ++region) {
    surface.tints[region] = Unpack(hn::BitCast(du, read_shade(4 + region)));
  }
  surface.channel = hn::BitCast(du, read_shade(9));
  return surface;
}

/// Brings the rows of a batch together; `count` of its pixels count, the last one is repeated up
/// to `padded`.
void LoadBatch(const FrameGeometry& geometry, const SharedMeshes& meshes,
               const InstanceShade* shades, const FigureItems& items, std::size_t from,
               std::size_t count, std::size_t padded, bool mixed, int tile_x_px, int tile_y_px,
               FigureBatch& batch) {
  const std::uint32_t* indices = geometry.indices.data();
  const BatchVertex* vertices = geometry.vertices.data();
  // two levels of memory that is anywhere: all of one before the next
  for (std::size_t k = 0; k < count; ++k) {
    if ((mixed ? items.group_at(from + k) : items.group_at(from)).is_shared != 0) continue;
    const std::uint32_t* corner = indices + items.at(from + k).triangle;
    for (int c = 0; c < 3; ++c) {
      const auto* vertex = reinterpret_cast<const char*>(vertices + corner[c]);
      __builtin_prefetch(vertex);
      __builtin_prefetch(vertex + sizeof(BatchVertex) - 1);
    }
  }
  for (std::size_t k = 0; k < padded; ++k) {
    const std::size_t place = from + std::min(k, count - 1);
    const FigureItems::Item& item = items.at(place);
    const FigureItems::Group& group = mixed ? items.group_at(place) : items.group_at(from);
    const SamplePlace& samples = kSamplePlaces[item.samples & 15U];
    batch.x_px[k] = static_cast<float>(tile_x_px + item.pixel % kTilePx) + samples.x;
    batch.y_px[k] = static_cast<float>(tile_y_px + item.pixel / kTilePx) + samples.y;
    if (group.is_shared != 0) {
      const SharedShade& shade = meshes.shades[group.instance];
      const std::uint32_t corners = meshes.corners[item.triangle];
      for (int c = 0; c < 3; ++c) {
        const std::uint32_t v = corner_of(corners, c);
        const float* x = meshes.posed + shade.posed + v;
        for (std::size_t column = 0; column < 4; ++column) {
          std::memcpy(&batch.corner[c][k][column], x + column * shade.stride, 4);
        }
        std::memcpy(&batch.uv[c][k], meshes.uv + shade.first_uv + v, 4);
      }
    } else {
      for (int c = 0; c < 3; ++c) {
        const BatchVertex& vertex = vertices[indices[item.triangle + static_cast<unsigned>(c)]];
        std::memcpy(batch.corner[c][k], &vertex, 16);
        std::memcpy(&batch.uv[c][k], &vertex.uv, 4);
      }
    }
    if ((shades[group.instance].character & kToned) != 0) {
      const std::uint32_t* tone =
          meshes.corner_tones +
          (meshes.tone_shift[group.instance] + (group.is_shared != 0 ? 3 : 1) * item.triangle);
      for (int c = 0; c < 3; ++c) std::memcpy(&batch.uv[c][k], tone + c, 4);
    }
    if (!mixed) continue;
    batch.instance[k] = static_cast<std::int32_t>(group.instance);
    const InstanceShade& shade = shades[group.instance];
    float frame[7] = {1.0F, 0.0F, 1.0F, 0.0F, 0.0F, 0.0F, -shade.feet_relative.z};
    if (group.is_shared != 0) {  // there may be no shared meshes at all
      const SharedShade& shared = meshes.shades[group.instance];
      const glm::vec3& feet = shade.feet_relative;
      const float posed[7] = {
          shared.cosine_scale, shared.sine_scale, shared.scale, feet.x, feet.y, feet.z, 0.0F};
      std::memcpy(frame, posed, sizeof frame);
    }
    for (int c = 0; c < 7; ++c) batch.frame[c][k] = frame[c];
  }
}

/// Which texels the pixel at k of a batch needs: it is at (b1, b2) of its triangle, which covers
/// twice `area_px` pixels.
HWY_INLINE void PlaceTexels(const TextureStore& textures, const Surface& surface, bool wants_mask,
                            F b1, F b2, F area_px, std::size_t k, FigureBatch& batch) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  // texture coordinates, 0 to 65535
  const I uv0 = hn::Load(di, batch.uv[0] + k), uv1 = hn::Load(di, batch.uv[1] + k),
          uv2 = hn::Load(di, batch.uv[2] + k);
  const auto u_of = [&](I uv)
                        HWY_ATTR { return hn::ConvertTo(df, hn::And(uv, hn::Set(di, 0xffff))); };
  const auto v_of = [&](I uv) HWY_ATTR {
    return hn::ConvertTo(df, hn::BitCast(di, hn::ShiftRight<16>(hn::BitCast(du, uv))));
  };
  const F u0 = u_of(uv0), u1 = hn::Sub(u_of(uv1), u0), u2 = hn::Sub(u_of(uv2), u0);
  const F v0 = v_of(uv0), v1 = hn::Sub(v_of(uv1), v0), v2 = hn::Sub(v_of(uv2), v0);
  const F u = hn::Add(u0, hn::Add(hn::Mul(u1, b1), hn::Mul(u2, b2)));
  const F v = hn::Add(v0, hn::Add(hn::Mul(v1, b1), hn::Mul(v2, b2)));
  // mip level from areas: texture covered over pixels covered
  const F area_uv = hn::Abs(hn::Sub(hn::Mul(u1, v2), hn::Mul(u2, v1)));
  const F level = Times(Log2Rough(hn::Div(area_uv, hn::Max(area_px, Set(1e-20F)))), 0.5F);
  const auto* first = textures.levels[0].first[0];
  const I zero = hn::Zero(di), one = hn::Set(di, 1);
  for (int t_number = 0; t_number < (wants_mask ? 2 : 1); ++t_number) {
    // level 0 has `width` texels to the whole: the level rises by log2 of that
    const F rough =
        hn::Add(hn::Add(level, hn::ConvertTo(df, surface.log2_width[t_number])), Set(0.5F));
    I number = hn::ConvertTo(di, hn::Floor(hn::Min(hn::Max(rough, Set(-1.0F)), Set(32.0F))));
    number = hn::Min(hn::Max(number, zero), surface.last_level[t_number]);
    const auto half = [&](I size) HWY_ATTR {
      const U shifted = hn::Shr(hn::BitCast(du, size), hn::BitCast(du, number));
      return hn::Max(hn::BitCast(di, shifted), one);
    };
    const I width = half(surface.width[t_number]), height = half(surface.height[t_number]);
    const I start = hn::GatherIndex(di, first + t_number * TextureLevels::kMost,
                                    hn::Add(surface.levels, number));
    const F x = hn::Sub(hn::Mul(u, Times(hn::ConvertTo(df, width), 1.0F / 65535.0F)), Set(0.5F));
    const F y = hn::Sub(hn::Mul(v, Times(hn::ConvertTo(df, height), 1.0F / 65535.0F)), Set(0.5F));
    const F x_floor = hn::Floor(x), y_floor = hn::Floor(y);
    // weights of 1/256, and integers from here on
    const I tx = hn::ConvertTo(di, Times(hn::Sub(x, x_floor), 256.0F));
    const I ty = hn::ConvertTo(di, Times(hn::Sub(y, y_floor), 256.0F));
    const I x_last = hn::Sub(width, one), y_last = hn::Sub(height, one);
    const I x_int = hn::ConvertTo(di, x_floor), y_int = hn::ConvertTo(di, y_floor);
    const auto between = hn::And(hn::Gt(x_int, hn::Set(di, -1)), hn::Lt(x_int, x_last));
    const I column = hn::Add(start, hn::Min(hn::Max(x_int, zero), x_last));
    const I y0 = hn::Min(hn::Max(y_int, zero), y_last);
    const I y1 = hn::Min(hn::Max(hn::Add(y_int, one), zero), y_last);
    hn::Store(hn::Add(column, hn::Mul(y0, width)), di, batch.texel[t_number][0] + k);
    hn::Store(hn::Add(column, hn::Mul(y1, width)), di, batch.texel[t_number][1] + k);
    hn::Store(hn::IfThenElseZero(between, tx), di, batch.wx[t_number] + k);
    hn::Store(ty, di, batch.wy[t_number] + k);
  }

  for (std::size_t lane = k; lane < k + hn::Lanes(df); ++lane) {
    for (int t_number = 0; t_number < (wants_mask ? 2 : 1); ++t_number) {
      __builtin_prefetch(textures.texels.data() + batch.texel[t_number][0][lane]);
      __builtin_prefetch(textures.texels.data() + batch.texel[t_number][1][lane]);
    }
  }
}

/// Colour and regions of element::unpack_tone, one after the other.
HWY_INLINE void UnpackTone(U word, F tone[7]) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const auto share = [&](U bits, std::uint32_t most) HWY_ATTR {
    const I code = hn::BitCast(di, hn::And(bits, hn::Set(du, most)));
    return Times(hn::ConvertTo(df, code), 1.0F / static_cast<float>(most));
  };
  tone[0] = share(word, 127U);
  tone[1] = share(hn::ShiftRight<7>(word), 127U);
  tone[2] = share(hn::ShiftRight<14>(word), 63U);
  for (int c = 0; c < 3; ++c) tone[c] = hn::Mul(tone[c], tone[c]);
  tone[3] = share(hn::ShiftRight<20>(word), 7U);
  tone[4] = share(hn::ShiftRight<23>(word), 7U);
  tone[5] = share(hn::ShiftRight<26>(word), 7U);
  tone[6] = share(hn::ShiftRight<29>(word), 7U);
}

/// What the corners' tones make of the pixel at k of a batch.
HWY_INLINE void MixTones(F b0, F b1, F b2, std::size_t k, FigureBatch& batch) {
  F tone[3][7];
  for (int c = 0; c < 3; ++c) {
    UnpackTone(hn::BitCast(UintTag(), hn::Load(IntTag(), batch.uv[c] + k)), tone[c]);
  }
  for (int i = 0; i < 7; ++i) {
    const F mixed =
        hn::Add(hn::Mul(tone[0][i], b0), hn::Add(hn::Mul(tone[1][i], b1), hn::Mul(tone[2][i], b2)));
    hn::Store(mixed, FloatTag(), batch.tone[i] + k);
  }
}

/// Where the pixel at k of a batch lies on its triangle: light and texels.
HWY_INLINE void ShadeGeometry(const SceneFrame& scene, const TextureStore& textures,
                              const Figure& figure, const Surface& surface, const Wants& wants,
                              std::size_t k, FigureBatch& batch) {
  const FloatTag df;
  const IntTag di;
  const F x_px = hn::Load(df, batch.x_px + k), y_px = hn::Load(df, batch.y_px + k);
  const V3 ray = Add3(Add3(figure.ray, Scale3(figure.ray_x, x_px)), Scale3(figure.ray_y, y_px));
  V3 eye = figure.eye;
  if (scene.orthographic) {
    eye = Add3(Add3(eye, Scale3(figure.eye_x, x_px)), Scale3(figure.eye_y, y_px));
  }
  V3 p[3];
  I normal[3];
  for (int c = 0; c < 3; ++c) {
    F bits;
    hn::LoadInterleaved4(df, batch.corner[c][k], p[c].x, p[c].y, p[c].z, bits);
    normal[c] = hn::BitCast(di, bits);
  }
  const V3 e1 = Sub3(p[1], p[0]), e2 = Sub3(p[2], p[0]);
  // where the ray meets the triangle's plane (Moeller & Trumbore 1997)
  const V3 cross = Cross3(ray, e2);
  const F determinant = Dot3(e1, cross);
  const F tiny = Set(1e-20F);
  const F safe = hn::IfThenElse(hn::Lt(hn::Abs(determinant), tiny), tiny, determinant);
  const F inverse = hn::Div(Set(1.0F), safe);
  const V3 t = Sub3(eye, p[0]);
  const V3 q = Cross3(t, e1);
  F b1 = Clamp01(hn::Mul(Dot3(t, cross), inverse));
  F b2 = Clamp01(hn::Mul(Dot3(ray, q), inverse));
  const F over = hn::Div(Set(1.0F), hn::Max(hn::Add(b1, b2), Set(1.0F)));
  b1 = hn::Mul(b1, over);
  b2 = hn::Mul(b2, over);
  const F b0 = hn::Sub(hn::Sub(Set(1.0F), b1), b2);
  const V3 place = Add3(p[0], Add3(Scale3(e1, b1), Scale3(e2, b2)));

  if (wants.texture) {
    // covered pixels: the triangle's shadow on the picture is |ray . (e1 x e2)| / distance^2,
    // `distance` being along the ray (its forward part is 1)
    F area_px = hn::Mul(hn::Abs(determinant), figure.area_px);
    if (!scene.orthographic) {
      const F distance = hn::Mul(Dot3(e2, q), inverse);
      area_px = hn::Div(area_px, hn::Max(hn::Mul(distance, distance), tiny));
    }
    PlaceTexels(textures, surface, wants.mask, b1, b2, area_px, k, batch);
  }
  if (wants.tones) MixTones(b0, b1, b2, k, batch);

  // light
  V3 n = Unit3(Add3(Scale3(Octahedral(normal[0]), b0),
                    Add3(Scale3(Octahedral(normal[1]), b1), Scale3(Octahedral(normal[2]), b2))));
  // a triangle seen from behind (double sided): its front is what was drawn counter-clockwise
  const auto behind = hn::Lt(determinant, hn::Zero(df));
  const F side = hn::IfThenElse(behind, Set(-1.0F), Set(1.0F));
  n = Scale3(n, side);
  const V3 back = Sub3(eye, place);
  const F length = hn::Sqrt(hn::Max(Dot3(back, back), Set(1e-30F)));
  V3 to_eye = Scale3(back, hn::Div(Set(1.0F), length));
  if (scene.orthographic) to_eye = Scale3(ray, hn::Neg(figure.scale));
  const Light light =
      LightOn(scene, figure.sun, n, to_eye, hn::Add(hn::Mul(place.z, figure.scale), figure.above));
  hn::Store(light.on.x, df, batch.light[0] + k);
  hn::Store(light.on.y, df, batch.light[1] + k);
  hn::Store(light.on.z, df, batch.light[2] + k);
  hn::Store(light.rim, df, batch.light[3] + k);
  hn::Store(light.gloss, df, batch.light[4] + k);
  hn::Store(hn::Mul(length, figure.scale), df, batch.light[5] + k);
}

/// The colours of the pixels from k on, into light[0] to light[2].
HWY_INLINE void ShadeTexels(const SceneFrame& scene, const Surface& surface, const Wants& wants,
                            std::size_t k, FigureBatch& batch) {
  const FloatTag df;
  const UintTag du;
  const F zero = hn::Zero(df);
  V3 color{zero, zero, zero};
  Rgba mask{zero, zero, zero, zero};
  if (wants.texture) {
    const auto sample = [&](int t) HWY_ATTR {
      U t00, t10, t01, t11;
      hn::LoadInterleaved2(du, batch.pair[t][0][k], t00, t10);
      hn::LoadInterleaved2(du, batch.pair[t][1][k], t01, t11);
      const auto weight = [&](const std::int32_t* w)
                              HWY_ATTR { return hn::BitCast(du, hn::Load(IntTag(), w + k)); };
      return Mix(t00, t10, t01, t11, weight(batch.wx[t]), weight(batch.wy[t]));
    };
    const Rgba base = sample(0);
    color = {Linear(base.r), Linear(base.g), Linear(base.b)};
    if (wants.mask) {
      mask = sample(1);
      mask.r = hn::Mul(mask.r, surface.has_mask);
      mask.g = hn::Mul(mask.g, surface.has_mask);
      mask.b = hn::Mul(mask.b, surface.has_mask);
      mask.a = hn::Mul(mask.a, surface.has_mask);
    }
  }
  if (wants.tones) {
    const auto toned = hn::RebindMask(df, hn::Lt(surface.toned, hn::Zero(IntTag())));
    F* const values[7] = {&color.x, &color.y, &color.z, &mask.r, &mask.g, &mask.b, &mask.a};
    for (int i = 0; i < 7; ++i) {
      *values[i] = hn::IfThenElse(toned, hn::Load(df, batch.tone[i] + k), *values[i]);
    }
  }
  V3 albedo = color;
  if (wants.mask || wants.tones) albedo = Dyed(color, mask, surface.tints);
  if (!hn::AllTrue(du, hn::Eq(surface.channel, hn::Set(du, kNoChannel)))) {
    albedo = Colored(color, albedo, surface.channel);
  }
  const auto column = [&](int c) HWY_ATTR { return hn::Load(df, batch.light[c] + k); };
  const V3 seen =
      Seen(scene, albedo, {{column(0), column(1), column(2)}, column(3), column(4)}, column(5));
  hn::Store(seen.x, df, batch.light[0] + k);
  hn::Store(seen.y, df, batch.light[1] + k);
  hn::Store(seen.z, df, batch.light[2] + k);
}

/// Texels of the batch's pixels, two neighbours at a time.
HWY_INLINE void LoadTexels(const std::uint32_t* texels, const Wants& wants, std::size_t padded,
                           FigureBatch& batch) {
  for (int t = 0; t < (wants.texture ? (wants.mask ? 2 : 1) : 0); ++t) {
    for (int row = 0; row < 2; ++row) {
      for (std::size_t k = 0; k < padded; ++k) {
        std::memcpy(batch.pair[t][row][k], texels + batch.texel[t][row][k], 8);
      }
    }
  }
}

void ShadeFigures(const SceneFrame& scene, const FrameGeometry& geometry,
                  const SharedMeshes& meshes, const InstanceShade* shades,
                  const TextureStore& textures, const FigureItems& items, int tile_x_px,
                  int tile_y_px, float* const rgb[3]) {
  const FloatTag df;
  const IntTag di;
  const std::size_t lanes = hn::Lanes(df);
  FigureBatch batch;
  static_assert(sizeof(InstanceShade) == 48);
  const auto add = [&](std::size_t from, std::size_t count) {
    for (std::size_t k = 0; k < count; ++k) {
      const FigureItems::Item& item = items.at(from + k);
      const float weight =
          kSamplePlaces[item.samples & 15U].weight * element::surface_kept(item.samples >> 4);
      for (int c = 0; c < 3; ++c) rgb[c][item.pixel] += weight * batch.light[c][k];
    }
  };
  for (const FigureItems::Group& group : items.groups()) {
    if (group.count < FigureItems::kLeastAlone) continue;
    const InstanceShade& shade = shades[group.instance];
    const auto* shade_words = reinterpret_cast<const std::int32_t*>(&shade);
    Frame frame{Set(1.0F), Set(0.0F), Set(1.0F), Set3(glm::vec3(0.0F)),
                Set(-shade.feet_relative.z)};
    if (group.is_shared != 0) {
      const SharedShade& shared = meshes.shades[group.instance];
      frame = {Set(shared.cosine_scale), Set(shared.sine_scale), Set(shared.scale),
               Set3(shade.feet_relative), Set(0.0F)};
    }
    const Figure figure = FigureOf(scene, frame);
    const std::uint32_t character = shade.character & ~kToned;
    const std::size_t offset = character * std::size_t{kLevelsWords};
    const Surface surface = SurfaceOf(
        textures, hn::Set(di, static_cast<std::int32_t>(character)),
        [&](const std::int32_t* words) HWY_ATTR { return hn::Set(di, words[offset]); },
        [&](int word) HWY_ATTR { return hn::Set(di, shade_words[word]); });
    const bool toned = (shade.character & kToned) != 0;
    const bool masked = textures.levels[character].has_mask != 0 && shade.channel == kNoChannel;
    const Wants wants{!toned, !toned && masked, toned};
    for (std::size_t done = 0; done < group.count; done += kBatch) {
      const std::size_t from = group.first + done;
      const std::size_t count = std::min(kBatch, group.count - done);
      const std::size_t padded = (count + lanes - 1) / lanes * lanes;
      LoadBatch(geometry, meshes, shades, items, from, count, padded, false, tile_x_px, tile_y_px,
                batch);
      for (std::size_t k = 0; k < padded; k += lanes) {
        ShadeGeometry(scene, textures, figure, surface, wants, k, batch);
      }
      LoadTexels(textures.texels.data(), wants, padded, batch);
      for (std::size_t k = 0; k < padded; k += lanes) {
        ShadeTexels(scene, surface, wants, k, batch);
      }
      add(from, count);
    }
  }
  for (std::size_t from = items.mixed(); from < items.count(); from += kBatch) {
    const std::size_t count = std::min(kBatch, items.count() - from);
    const std::size_t padded = (count + lanes - 1) / lanes * lanes;
    LoadBatch(geometry, meshes, shades, items, from, count, padded, true, tile_x_px, tile_y_px,
              batch);
    Wants wants{false, false, false};
    for (std::size_t k = 0; k < count; ++k) {
      const bool toned =
          (shades[static_cast<std::size_t>(batch.instance[k])].character & kToned) != 0;
      wants.texture |= !toned;
      wants.tones |= toned;
    }
    wants.mask = wants.texture;
    const auto surface_at = [&](std::size_t k) HWY_ATTR {
      const auto* words = reinterpret_cast<const std::int32_t*>(shades);
      const I at =
          hn::Mul(hn::Load(di, batch.instance + k), hn::Set(di, sizeof(InstanceShade) / 4));
      const I character = hn::And(hn::GatherIndex(di, words + 8, at),
                                  hn::Set(di, static_cast<std::int32_t>(~kToned)));
      const I levels = hn::Mul(character, hn::Set(di, kLevelsWords));
      return SurfaceOf(
          textures, character,
          [&](const std::int32_t* first) HWY_ATTR { return hn::GatherIndex(di, first, levels); },
          [&](int word) HWY_ATTR { return hn::GatherIndex(di, words + word, at); });
    };
    for (std::size_t k = 0; k < padded; k += lanes) {
      const auto column = [&](int c) HWY_ATTR { return hn::Load(df, batch.frame[c] + k); };
      const Frame frame{
          column(0), column(1), column(2), {column(3), column(4), column(5)}, column(6)};
      ShadeGeometry(scene, textures, FigureOf(scene, frame), surface_at(k), wants, k, batch);
    }
    LoadTexels(textures.texels.data(), wants, padded, batch);
    for (std::size_t k = 0; k < padded; k += lanes) {
      ShadeTexels(scene, surface_at(k), wants, k, batch);
    }
    add(from, count);
  }
}

void ShadeFlat(const SceneFrame& scene, const SharedMeshes& meshes, const InstanceShade* shades,
               ShadeItems& items) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const std::size_t lanes = hn::Lanes(df);
  if (items.count == 0) return;
  PadItems(items, lanes);
  const auto* shade_words = reinterpret_cast<const std::uint32_t*>(shades);
  const auto* shade_floats = reinterpret_cast<const float*>(shades);
  const auto* mesh_words = reinterpret_cast<const std::int32_t*>(meshes.shades);
  const auto* mesh_floats = reinterpret_cast<const float*>(meshes.shades);
  const auto* normals = reinterpret_cast<const std::int32_t*>(meshes.posed);
  const auto* tones = reinterpret_cast<const std::uint32_t*>(meshes.tones);
  static_assert(sizeof(InstanceShade) == 48 && sizeof(SharedShade) == 32);
  for (std::size_t i = 0; i < items.count; i += lanes) {
    const I triangle = hn::Load(di, items.triangle + i);
    const I number = hn::Load(di, items.instance + i);
    const I instance = hn::Mul(number, hn::Set(di, 12));
    const I at = hn::ShiftLeft<3>(number);
    const U word = hn::GatherIndex(du, meshes.corners, triangle);
    const I tone = hn::Add(triangle, triangle);
    const U base = hn::GatherIndex(du, tones, tone);
    const U regions = hn::GatherIndex(du, tones + 1, tone);
    const I posed = hn::GatherIndex(di, mesh_words, at);
    const I stride = hn::GatherIndex(di, mesh_words + 1, at);
    const F cosine = hn::GatherIndex(df, mesh_floats + 4, at);
    const F sine = hn::GatherIndex(df, mesh_floats + 5, at);
    const F scale = hn::GatherIndex(df, mesh_floats + 6, at);
    const V3 feet{hn::GatherIndex(df, shade_floats, instance),
                  hn::GatherIndex(df, shade_floats + 1, instance),
                  hn::GatherIndex(df, shade_floats + 2, instance)};
    // the corners' mean normal and height
    const U ten = hn::Set(du, 1023);
    const I z_column = hn::Add(posed, hn::Add(stride, stride));
    V3 n{hn::Zero(df), hn::Zero(df), hn::Zero(df)};
    F z = hn::Zero(df);
    const auto corner = [&](I c) HWY_ATTR {
      const I here = hn::Add(z_column, c);
      z = hn::Add(z, hn::GatherIndex(df, meshes.posed, here));
      n = Add3(n, Octahedral(hn::GatherIndex(di, normals, hn::Add(here, stride))));
    };
    corner(hn::BitCast(di, hn::And(word, ten)));
    corner(hn::BitCast(di, hn::And(hn::ShiftRight<10>(word), ten)));
    corner(hn::BitCast(di, hn::ShiftRight<20>(word)));
    n = Unit3({hn::Sub(hn::Mul(n.x, cosine), hn::Mul(n.y, sine)),
               hn::Add(hn::Mul(n.x, sine), hn::Mul(n.y, cosine)), hn::Mul(n.z, scale)});
    const F above_m = Times(hn::Mul(z, scale), 1.0F / 3.0F);
    V3 to_eye = Set3(-scene.ray_direction);
    if (!scene.orthographic) to_eye = Unit3(Scale3(feet, Set(-1.0F)));
    // what is double-sided shows the side it is seen from
    const auto flips = hn::And(hn::Lt(Dot3(n, to_eye), hn::Zero(df)),
                               hn::Gt(hn::GatherIndex(df, mesh_floats + 7, at), hn::Zero(df)));
    n = Scale3(n, hn::IfThenElse(flips, Set(-1.0F), Set(1.0F)));
    const V3 color = Unpack(base);
    const V3 albedo = Worn(color, regions, shade_words, instance);
    const V3 lit = Lit(scene, albedo, n, to_eye, above_m, hn::Sqrt(Dot3(feet, feet)));
    hn::Store(lit.x, df, items.rgb[0] + i);
    hn::Store(lit.y, df, items.rgb[1] + i);
    hn::Store(lit.z, df, items.rgb[2] + i);
  }
}

void ShadeSurface(const SceneFrame& scene, const InstanceShade* shades, SurfaceItems& items) {
  const FloatTag df;
  const IntTag di;
  const UintTag du;
  const std::size_t lanes = hn::Lanes(df);
  if (items.count == 0) return;
  for (std::size_t i = items.count; i < items.count + lanes; ++i) {  // fills the last vector
    const std::size_t last = items.count - 1;
    items.instance[i] = items.instance[last];
    items.base[i] = items.base[last];
    items.regions[i] = items.regions[last];
    for (int c = 0; c < 3; ++c) {
      items.normal[c][i] = items.normal[c][last];
      items.relative[c][i] = items.relative[c][last];
    }
  }
  const auto* shade_words = reinterpret_cast<const std::uint32_t*>(shades);
  const auto* shade_floats = reinterpret_cast<const float*>(shades);
  const V3 toward = Set3(-scene.ray_direction);
  for (std::size_t i = 0; i < items.count; i += lanes) {
    const I instance =
        hn::Mul(hn::Load(di, items.instance + i), hn::Set(di, sizeof(InstanceShade) / 4));
    const V3 place{hn::Load(df, items.relative[0] + i), hn::Load(df, items.relative[1] + i),
                   hn::Load(df, items.relative[2] + i)};
    const V3 n = Unit3({hn::Load(df, items.normal[0] + i), hn::Load(df, items.normal[1] + i),
                        hn::Load(df, items.normal[2] + i)});
    const V3 to_eye = scene.orthographic ? toward : Unit3(Scale3(place, Set(-1.0F)));
    const V3 color = Unpack(hn::Load(du, items.base + i));
    const U regions = hn::Load(du, items.regions + i);
    const V3 albedo = Worn(color, regions, shade_words, instance);
    const F above_m = hn::Sub(place.z, hn::GatherIndex(df, shade_floats + 2, instance));
    const V3 lit = Lit(scene, albedo, n, to_eye, above_m, hn::Sqrt(Dot3(place, place)));
    hn::Store(lit.x, df, items.rgb[0] + i);
    hn::Store(lit.y, df, items.rgb[1] + i);
    hn::Store(lit.z, df, items.rgb[2] + i);
  }
}

/// Share of [p - w/2, p + w/2] on lines of this half width, one each period (see gl/shaders.cpp).
HWY_INLINE F LineCover(F p, F w, float period, float half_width) {
  const F share = Set(2.0F * half_width / period);
  const F shift = Set(half_width / period);
  const F low = hn::Add(Times(hn::Sub(p, Times(w, 0.5F)), 1.0F / period), shift);
  const F high = hn::Add(Times(hn::Add(p, Times(w, 0.5F)), 1.0F / period), shift);
  const F low_floor = hn::Floor(low), high_floor = hn::Floor(high);
  const F sum_low = hn::Add(hn::Mul(low_floor, share), hn::Min(hn::Sub(low, low_floor), share));
  const F sum_high = hn::Add(hn::Mul(high_floor, share), hn::Min(hn::Sub(high, high_floor), share));
  return hn::Div(Times(hn::Sub(sum_high, sum_low), period), w);
}

HWY_INLINE F Iota(int x_px) {
  const FloatTag df;
  return hn::Add(hn::Iota(df, 0.0F), Set(static_cast<float>(x_px) + 0.5F));
}

void ShadeBackground(const SceneFrame& scene, int x_px, int y_px, int count, float* r, float* g,
                     float* b) {
  const FloatTag df;
  const int lanes = static_cast<int>(hn::Lanes(df));
  const float y = static_cast<float>(y_px) + 0.5F;
  for (int i = 0; i < count; i += lanes) {
    const F x = Iota(x_px + i);
    const auto along = [&](const glm::vec3& o, const glm::vec3& dx, const glm::vec3& dy) HWY_ATTR {
      const glm::vec3 row = o + dy * y;
      return V3{hn::Add(Set(row.x), Times(x, dx.x)), hn::Add(Set(row.y), Times(x, dx.y)),
                hn::Add(Set(row.z), Times(x, dx.z))};
    };
    const V3 origin = along(scene.ray_origin, scene.ray_origin_x, scene.ray_origin_y);
    const V3 ray = along(scene.ray_direction, scene.ray_direction_x, scene.ray_direction_y);
    const F length = hn::Sqrt(Dot3(ray, ray));
    const F up = hn::Div(ray.z, length);
    const F to_plane = hn::Sub(Set(scene.ground_relative_m), origin.z);
    auto hit = scene.orthographic ? hn::Gt(hn::Abs(ray.z), Set(1e-5F))
                                  : hn::Gt(hn::Mul(to_plane, ray.z), hn::Zero(df));
    if (!scene.ground) hit = hn::Lt(hn::Zero(df), hn::Zero(df));
    V3 color{hn::Zero(df), hn::Zero(df), hn::Zero(df)};
    if (!hn::AllTrue(df, hit)) {
      const bool below_ground = scene.ground && scene.ground_relative_m >= 0.0F;
      const F height = below_ground ? hn::Min(up, Set(-0.02F)) : up;
      const auto positive = hn::Ge(height, hn::Zero(df));
      const F above_t = hn::Sub(Set(1.0F), Exp2Negative(Times(Clamp01(height), -4.5F)));
      const F below_t =
          hn::Sub(Set(1.0F), Exp2Negative(Times(hn::Min(height, hn::Zero(df)), 6.0F)));
      const auto sky = [&](float horizon, float zenith, float low) HWY_ATTR {
        const F a = Lerp(Set(horizon), Set(zenith), above_t);
        const F d = Lerp(Set(horizon), Set(low), below_t);
        return Times(hn::IfThenElse(positive, a, d), 1.12F);
      };
      color = {sky(scene.horizon_color.x, scene.sky_color.x, scene.ground_light.x),
               sky(scene.horizon_color.y, scene.sky_color.y, scene.ground_light.y),
               sky(scene.horizon_color.z, scene.sky_color.z, scene.ground_light.z)};
    }
    if (!hn::AllFalse(df, hit)) {
      const F safe_z = hn::IfThenElse(hit, ray.z, Set(1.0F));
      const F inverse_z = hn::Div(Set(1.0F), safe_z);
      const F t = hn::Mul(to_plane, inverse_z);
      const F tx = hn::Neg(hn::Mul(
          hn::Add(Set(scene.ray_origin_x.z), Times(t, scene.ray_direction_x.z)), inverse_z));
      const F ty = hn::Neg(hn::Mul(
          hn::Add(Set(scene.ray_origin_y.z), Times(t, scene.ray_direction_y.z)), inverse_z));
      const auto width = [&](float ox, float dx, float oy, float dy, F ray_c) HWY_ATTR {
        const F step_x = hn::Add(hn::Add(Set(ox), Times(t, dx)), hn::Mul(ray_c, tx));
        const F step_y = hn::Add(hn::Add(Set(oy), Times(t, dy)), hn::Mul(ray_c, ty));
        return hn::Max(hn::Add(hn::Abs(step_x), hn::Abs(step_y)), Set(1e-5F));
      };
      const F wx = width(scene.ray_origin_x.x, scene.ray_direction_x.x, scene.ray_origin_y.x,
                         scene.ray_direction_y.x, ray.x);
      const F wy = width(scene.ray_origin_x.y, scene.ray_direction_x.y, scene.ray_origin_y.y,
                         scene.ray_direction_y.y, ray.y);
      const F px = hn::Add(hn::Add(origin.x, hn::Mul(ray.x, t)), Set(scene.grid_eye.x));
      const F py = hn::Add(hn::Add(origin.y, hn::Mul(ray.y, t)), Set(scene.grid_eye.y));
      const F fine_x = LineCover(px, wx, 1.0F, 0.010F), fine_y = LineCover(py, wy, 1.0F, 0.010F);
      const F strong_x = LineCover(px, wx, 10.0F, 0.028F),
              strong_y = LineCover(py, wy, 10.0F, 0.028F);
      const F metre = hn::Sub(hn::Add(fine_x, fine_y), hn::Mul(fine_x, fine_y));
      const F ten = hn::Sub(hn::Add(strong_x, strong_y), hn::Mul(strong_x, strong_y));
      // slabs of a metre, no two neighbours quite alike
      const UintTag du;
      const auto slab = [&](F c) HWY_ATTR {
        const F whole = hn::Floor(c);
        const F place = hn::Sub(whole, Times(hn::Floor(Times(whole, 0.05F)), 20.0F));
        return hn::BitCast(du, hn::ConvertTo(IntTag(), place));
      };
      U bits = hn::Add(
          hn::Add(hn::Mul(slab(px), hn::Set(du, 73U)), hn::Mul(slab(py), hn::Set(du, 179U))),
          hn::Set(du, 11U));
      bits = hn::Mul(bits, hn::Set(du, 0x9e3779b1U));
      bits = hn::Mul(hn::Xor(bits, hn::ShiftRight<15>(bits)), hn::Set(du, 0x85ebca6bU));
      const F shade =
          hn::Sub(Times(hn::ConvertTo(df, hn::BitCast(IntTag(), hn::ShiftRight<16>(bits))),
                        1.0F / 65536.0F),
                  Set(0.5F));
      const F apart = Clamp01(hn::Sub(Set(1.4F), Times(hn::Max(wx, wy), 1.2F)));
      const F tone = hn::Add(Set(1.0F), Times(hn::Mul(shade, apart), 0.08F));
      const F lines =
          hn::Mul(hn::Sub(Set(1.0F), Times(metre, 0.38F)), hn::Sub(Set(1.0F), Times(ten, 0.66F)));
      const F paint = hn::Mul(tone, lines);
      glm::vec3 light = scene.sun_color * std::max(scene.sun_direction.z, 0.0F) + scene.sky_color;
      if (scene.ground_relative_m >= 0.0F) light = scene.ground_light;
      light *= scene.ground_color;
      V3 lit{Times(paint, light.x), Times(paint, light.y), Times(paint, light.z)};
      if (!scene.orthographic) {
        lit = Haze(scene, lit, hn::Mul(hn::Abs(t), length));
        const F grazing = Exp2Negative(Times(hn::Abs(up), -55.0F));
        lit = {Lerp(lit.x, Set(scene.horizon_color.x * 1.12F), grazing),
               Lerp(lit.y, Set(scene.horizon_color.y * 1.12F), grazing),
               Lerp(lit.z, Set(scene.horizon_color.z * 1.12F), grazing)};
      }
      color = {hn::IfThenElse(hit, lit.x, color.x), hn::IfThenElse(hit, lit.y, color.y),
               hn::IfThenElse(hit, lit.z, color.z)};
    }
    color = ToneMap(color);
    hn::StoreU(color.x, df, r + i);
    hn::StoreU(color.y, df, g + i);
    hn::StoreU(color.z, df, b + i);
  }
}

void ShadeBlobRow(const SceneFrame& scene, const Blob& blob, int x_px, int y_px, int count,
                  float* missing) {
  const FloatTag df;
  const int lanes = static_cast<int>(hn::Lanes(df));
  const float y = static_cast<float>(y_px) + 0.5F;
  const float per_meter = 1.0F / blob.meter;
  for (int i = 0; i < count; i += lanes) {
    const F x = Iota(x_px + i);
    const auto along = [&](const glm::vec3& o, const glm::vec3& dx, const glm::vec3& dy) HWY_ATTR {
      const glm::vec3 row = o + dy * y;
      return V3{hn::Add(Set(row.x), Times(x, dx.x)), hn::Add(Set(row.y), Times(x, dx.y)),
                hn::Add(Set(row.z), Times(x, dx.z))};
    };
    const V3 origin = along(scene.ray_origin, scene.ray_origin_x, scene.ray_origin_y);
    const V3 ray = along(scene.ray_direction, scene.ray_direction_x, scene.ray_direction_y);
    const F to_plane = hn::Sub(Set(scene.ground_relative_m), origin.z);
    const auto down = hn::Lt(ray.z, Set(-1e-6F));
    const F t = hn::Div(to_plane, hn::IfThenElse(down, ray.z, Set(-1.0F)));
    const F gx =
        Times(hn::Sub(hn::Add(origin.x, hn::Mul(ray.x, t)), Set(blob.feet_relative.x)), per_meter);
    const F gy =
        Times(hn::Sub(hn::Add(origin.y, hn::Mul(ray.y, t)), Set(blob.feet_relative.y)), per_meter);
    const F far_along = hn::Add(Times(gx, blob.away.x), Times(gy, blob.away.y));
    const F across = hn::Sub(Times(gy, blob.away.x), Times(gx, blob.away.y));
    const F squared = hn::Add(hn::Mul(far_along, far_along), hn::Mul(across, across));
    F contact = Clamp01(hn::Sub(Set(1.0F), Times(squared, 1.0F / (0.48F * 0.48F))));
    contact = Times(hn::Mul(contact, contact), 0.62F * blob.contact);
    const F share = Clamp01(Times(far_along, 1.0F / std::max(blob.reach, 0.01F)));
    const F off = hn::Sub(far_along, hn::Min(hn::Max(far_along, hn::Zero(df)), Set(blob.reach)));
    const F off_squared = hn::Add(hn::Mul(off, off), hn::Mul(across, across));
    const F width = hn::Add(Set(0.20F), Times(share, 0.14F));
    F body = Clamp01(hn::Sub(Set(1.0F), hn::Div(off_squared, hn::Mul(width, width))));
    body = hn::Mul(hn::Mul(body, hn::Sub(Set(2.0F), body)),
                   Times(hn::Sub(Set(0.50F), Times(share, 0.20F)), blob.body));
    const F raised = hn::IfThenElseZero(down, hn::Max(contact, body));
    hn::StoreU(hn::Max(hn::LoadU(df, missing + i), raised), df, missing + i);
  }
}

void ShadeBlob(const SceneFrame& scene, const Blob& blob, int x_px, int y_px, int count, int rows,
               int stride, float* missing) {
  for (int row = 0; row < rows; ++row) {
    ShadeBlobRow(scene, blob, x_px, y_px + row, count, missing + row * stride);
  }
}

/// 255 times element::srgb_from_linear: above its straight part, a polynomial over the square root,
/// where it is nearly straight (within 0.04).
HWY_INLINE F Srgb255(F linear) {
  const F c = Clamp01(linear);
  const F r = hn::Sqrt(c);
  F p = Set(-241.65611F);
  for (const float k :
       {871.765392F, -1275.809F, 994.103768F, -484.367064F, 401.694182F, -10.7691539F}) {
    p = hn::Add(hn::Mul(p, r), Set(k));
  }
  return hn::IfThenElse(hn::Lt(c, Set(0.0031308F)), Times(c, 12.92F * 255.0F), p);
}

void EncodeRow(const float* r, const float* g, const float* b, int count, std::uint8_t* rgbx) {
  const FloatTag df;
  const IntTag di;
  const int lanes = static_cast<int>(hn::Lanes(df));
  HWY_ALIGN std::int32_t tail[16];
  for (int i = 0; i < count; i += lanes) {
    const auto code = [&](const float* c) HWY_ATTR {
      return hn::ConvertTo(di, hn::Add(Srgb255(hn::Load(df, c + i)), Set(0.5F)));
    };
    const I word = hn::Or(hn::Or(code(r), hn::ShiftLeft<8>(code(g))),
                          hn::Or(hn::ShiftLeft<16>(code(b)), hn::Set(di, -1 << 24)));
    if (i + lanes <= count) {
      hn::StoreU(word, di, reinterpret_cast<std::int32_t*>(rgbx + 4 * i));
    } else {
      hn::Store(word, di, tail);
      std::memcpy(rgbx + 4 * i, tail, 4 * static_cast<std::size_t>(count - i));
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace throng::render::visibility
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace throng::render::visibility {

namespace {

/// Mean over a triangle's part of an image, from the mip level where it has about 16 texels;
/// `decode` makes a vector of a texel.
template <typename Decode>
glm::vec4 mean_of(const std::uint32_t* texels, int width, int height, int levels,
                  const glm::vec2 uv[3], const Decode& decode) {
  const glm::vec2 a = uv[1] - uv[0], b = uv[2] - uv[0];
  float area = 0.5F * std::abs(a.x * b.y - a.y * b.x) * static_cast<float>(width) *
               static_cast<float>(height);
  for (int level = 1; level < levels && area > 16.0F; ++level, area *= 0.25F) {
    texels += width * height;
    width = std::max(1, width >> 1);
    height = std::max(1, height >> 1);
  }
  constexpr int kSteps = 5;
  glm::vec4 sum(0.0F);
  int count = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; i + j < kSteps; ++j, ++count) {
      const glm::vec2 p = uv[0] + a * ((static_cast<float>(i) + 1.0F / 3.0F) / kSteps) +
                          b * ((static_cast<float>(j) + 1.0F / 3.0F) / kSteps);
      const int x = std::clamp(static_cast<int>(p.x * static_cast<float>(width)), 0, width - 1);
      const int y = std::clamp(static_cast<int>(p.y * static_cast<float>(height)), 0, height - 1);
      sum += decode(texels[y * width + x]);
    }
  }
  return sum / static_cast<float>(count);
}

glm::vec4 components_of(std::uint32_t texel) {
  return glm::vec4(texel & 255U, texel >> 8 & 255U, texel >> 16 & 255U, texel >> 24) / 255.0F;
}

TriangleTone tone_of(const TextureInfo& info, const TextureStore& textures, const glm::vec2 uv[3]) {
  TriangleTone tone{};
  const glm::vec4 base =
      mean_of(textures.texels.data() + info.base_first, info.base_width, info.base_height,
              info.base_levels, uv, [](std::uint32_t texel) {
                const glm::vec4 c = components_of(texel);
                return glm::vec4(element::linear_from_srgb(c.r), element::linear_from_srgb(c.g),
                                 element::linear_from_srgb(c.b), 0.0F);
              });
  tone.base = element::pack_color(glm::vec3(base));
  if (info.mask_first < 0) return tone;
  const glm::vec4 mask = mean_of(textures.texels.data() + info.mask_first, info.mask_width,
                                 info.mask_height, info.mask_levels, uv, components_of);
  for (int k = 0; k < 4; ++k) {
    tone.regions |= static_cast<std::uint32_t>(mask[k] * 255.0F + 0.5F) << (8 * k);
  }
  return tone;
}

TriangleTone mean_tone(const std::uint32_t* corners) {
  glm::vec3 color(0.0F);
  glm::vec4 regions(0.0F);
  for (int k = 0; k < 3; ++k) {
    const element::Tone corner = element::unpack_tone(corners[k]);
    color += corner.color * (1.0F / 3.0F);
    regions += corner.regions * (1.0F / 3.0F);
  }
  TriangleTone mean{element::pack_color(color), 0};
  for (int k = 0; k < 4; ++k) {
    mean.regions |= static_cast<std::uint32_t>(regions[k] * 255.0F + 0.5F) << (8 * k);
  }
  return mean;
}

}  // namespace

HWY_EXPORT(ShadeFigures);
HWY_EXPORT(ShadeFlat);
HWY_EXPORT(ShadeSurface);
HWY_EXPORT(ShadeBackground);
HWY_EXPORT(ShadeBlob);
HWY_EXPORT(EncodeRow);

void FigureItems::clear() {
  for (std::size_t g = 0; g < group_count_; ++g) slots_[groups_[g].slot] = 0;
  count_ = group_count_ = mixed_ = 0;
}

std::uint32_t FigureItems::find(std::uint32_t instance, bool is_shared) {
  std::uint32_t slot = (instance * 0x9e3779b1U) >> 19;
  for (; slots_[slot] != 0; slot = (slot + 1) % kSlots) {
    if (groups_[slots_[slot] - 1U].instance == instance) return slots_[slot] - 1U;
  }
  const auto group = static_cast<std::uint32_t>(group_count_++);
  slots_[slot] = static_cast<std::uint16_t>(group + 1);
  groups_[group] = {instance, is_shared ? 1U : 0U, 0, 0, slot};
  return group;
}

void FigureItems::sort() {
  std::uint32_t next = 0;
  for (const bool alone : {true, false}) {
    if (!alone) mixed_ = next;
    for (std::size_t g = 0; g < group_count_; ++g) {
      if ((groups_[g].count >= kLeastAlone) != alone) continue;
      groups_[g].first = next;
      next += groups_[g].count;
    }
  }
  for (std::size_t i = 0; i < count_; ++i) {
    order_[groups_[group_[i]].first++] = static_cast<std::uint16_t>(i);
  }
  for (std::size_t g = 0; g < group_count_; ++g) groups_[g].first -= groups_[g].count;
}

void shade_figures(const SceneFrame& scene, const FrameGeometry& geometry,
                   const SharedMeshes& meshes, const InstanceShade* shades,
                   const TextureStore& textures, const FigureItems& items, int tile_x_px,
                   int tile_y_px, float* const rgb[3]) {
  HWY_DYNAMIC_DISPATCH(ShadeFigures)
  (scene, geometry, meshes, shades, textures, items, tile_x_px, tile_y_px, rgb);
}

void shade_flat_items(const SceneFrame& scene, const SharedMeshes& meshes,
                      const InstanceShade* shades, ShadeItems& items) {
  HWY_DYNAMIC_DISPATCH(ShadeFlat)(scene, meshes, shades, items);
}

void shade_surface_items(const SceneFrame& scene, const InstanceShade* shades,
                         SurfaceItems& items) {
  HWY_DYNAMIC_DISPATCH(ShadeSurface)(scene, shades, items);
}

std::vector<TriangleTone> make_tones(const Cast& cast, const LevelTable& levels,
                                     const TextureStore& textures) {
  std::vector<TriangleTone> tones(levels.corners.size());
  for (const Level& level : levels.levels) {
    const Character& character = cast.members[level.character].character;
    const TextureInfo& info = textures.infos[level.character];
    const CornerTones& corner_tones = character.corner_tones;
    if (level.vertex_count <= corner_tones.most_vertices()) {
      const std::uint32_t* tone =
          corner_tones.tone.data() +
          element::first_tone(corner_tones.band.data(),
                              static_cast<std::uint32_t>(corner_tones.band.size()),
                              level.vertex_count);
      for (std::uint32_t t = 0; t < level.triangle_count; ++t) {
        tones[level.first_triangle + t] = mean_tone(tone + std::size_t{3} * t);
      }
      continue;
    }
    for (std::uint32_t t = 0; t < level.triangle_count; ++t) {
      glm::vec2 uv[3];
      for (int k = 0; k < 3; ++k) {
        const std::uint32_t c = corner_of(levels.corners[level.first_triangle + t], k);
        uv[k] = glm::vec2(character.uv[c]) / 65535.0F;
      }
      tones[level.first_triangle + t] = tone_of(info, textures, uv);
    }
  }
  return tones;
}

void shade_background(const SceneFrame& scene, int x_px, int y_px, int count, float* r, float* g,
                      float* b) {
  HWY_DYNAMIC_DISPATCH(ShadeBackground)(scene, x_px, y_px, count, r, g, b);
}

void shade_blob(const SceneFrame& scene, const Blob& blob, int x_px, int y_px, int count, int rows,
                int stride, float* missing) {
  HWY_DYNAMIC_DISPATCH(ShadeBlob)(scene, blob, x_px, y_px, count, rows, stride, missing);
}

void encode_row(const float* r, const float* g, const float* b, int count, std::uint8_t* rgbx) {
  HWY_DYNAMIC_DISPATCH(EncodeRow)(r, g, b, count, rgbx);
}

}  // namespace throng::render::visibility
#endif  // HWY_ONCE
