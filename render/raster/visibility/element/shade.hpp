#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <glm/glm.hpp>

#include "render/raster/element/color.hpp"
#include "render/raster/element/scene_frame.hpp"

// Shading of one pixel, in the written order of the vectors in cpu/shade_simd.cpp: the same bits. A
// test holds the two together.
namespace throng::render::element {

/// Base colour and tint mask of one character within all characters' texels.
struct TextureInfo {
  std::int32_t base_first = 0, base_width = 1, base_height = 1, base_levels = 1;
  std::int32_t mask_first = -1, mask_width = 1, mask_height = 1, mask_levels = 0;  // -1: no mask
};

/// A soft shadow's place on the ground.
struct Blob {
  glm::vec2 feet_relative;
  glm::vec2 away;       // unit, from the sun
  float meter;          // one metre of a figure of 1.75 m
  float reach;          // length of the shadow, in those metres
  float contact, body;  // strengths
};

/// What a pixel sees of a triangle.
struct ShadeCorners {
  glm::vec3 p[3];       // relative to the eye
  std::uint32_t uv[3];  // unorm16 pairs; of toned figures pack_corner_tone
  glm::vec3 n[3];       // not unit length
};

THRONG_HOST_DEVICE inline float least(float a, float b) { return a < b ? a : b; }
THRONG_HOST_DEVICE inline float most(float a, float b) { return a > b ? a : b; }
THRONG_HOST_DEVICE inline float clamp01(float v) { return least(most(v, 0.0F), 1.0F); }
THRONG_HOST_DEVICE inline float lerp(float a, float b, float t) { return a + (b - a) * t; }
THRONG_HOST_DEVICE inline float dot3(const glm::vec3& a, const glm::vec3& b) {
  return (a.x * b.x + a.y * b.y) + a.z * b.z;
}
THRONG_HOST_DEVICE inline glm::vec3 cross3(const glm::vec3& a, const glm::vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
THRONG_HOST_DEVICE inline glm::vec3 unit3(const glm::vec3& a) {
  return a * (1.0F / std::sqrt(most(dot3(a, a), 1e-30F)));
}
THRONG_HOST_DEVICE inline std::uint32_t float_bits(float value) {
  std::uint32_t bits;
  std::memcpy(&bits, &value, sizeof bits);
  return bits;
}
THRONG_HOST_DEVICE inline float bits_float(std::uint32_t bits) {
  float value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

/// 2^x for x <= 0, to 1e-5: the whole part into the exponent, a cubic for the rest.
THRONG_HOST_DEVICE inline float exp2_negative(float x) {
  x = most(x, -60.0F);
  const float whole = std::floor(x);
  const float part = x - whole;
  float p = part * 0.0135557F + 0.0520323F;
  p = p * part + 0.2413793F;
  p = p * part + 0.6930321F;
  p = p * part + 1.0F;
  return p * bits_float(static_cast<std::uint32_t>(static_cast<std::int32_t>(whole) + 127) << 23);
}

/// log2 to 0.01, enough to choose a mip level.
THRONG_HOST_DEVICE inline float log2_rough(float x) {
  const std::uint32_t bits = float_bits(most(x, 1e-30F));
  const auto exponent = static_cast<float>(static_cast<std::int32_t>(bits >> 23) - 127);
  const float mantissa = bits_float((bits & 0x7fffffU) | 0x3f800000U);
  // quadratic through 1, sqrt(2) and 2
  return exponent + ((mantissa * -0.34484843F + 2.02466578F) * mantissa + -1.67487759F);
}

/// The shader's tone_map, exposure 0.62.
THRONG_HOST_DEVICE inline glm::vec3 tone_map(glm::vec3 color) {
  color = color * 0.62F;
  const float peak = most(color.x, most(color.y, color.z));
  constexpr float kStart = 0.76F, kRoom = 1.0F - 0.76F;
  if (!(peak > kStart)) return color;
  const float above = (peak - kStart) + kRoom;
  const float new_peak = 1.0F - (kRoom * kRoom) / above;
  const float ratio = new_peak / most(peak, 1e-6F);
  const float whiten = 1.0F - 1.0F / ((peak - new_peak) * 0.15F + 1.0F);
  return {lerp(color.x * ratio, new_peak, whiten), lerp(color.y * ratio, new_peak, whiten),
          lerp(color.z * ratio, new_peak, whiten)};
}

THRONG_HOST_DEVICE inline glm::vec3 haze(const SceneFrame& scene, const glm::vec3& color,
                                         float distance_m) {
  const float clear = exp2_negative(distance_m * -scene.haze_per_m);
  const glm::vec3& horizon = scene.horizon_color;
  return {lerp(horizon.x, color.x, clear), lerp(horizon.y, color.y, clear),
          lerp(horizon.z, color.z, clear)};
}

/// Octahedral snorm16 pair in one word to a vector (not unit length).
THRONG_HOST_DEVICE inline glm::vec3 rough_octahedral(std::uint32_t packed) {
  const float x =
      static_cast<float>(static_cast<std::int16_t>(packed & 0xffffU)) * (1.0F / 32767.0F);
  const float y = static_cast<float>(static_cast<std::int16_t>(packed >> 16)) * (1.0F / 32767.0F);
  const float z = (1.0F - std::fabs(x)) - std::fabs(y);
  const float fold = most(-z, 0.0F);
  return {x >= 0.0F ? x - fold : x + fold, y >= 0.0F ? y - fold : y + fold, z};
}

/// One mip level of an image with its levels one after the other.
struct MipLevel {
  std::int32_t first, width, height;
};
THRONG_HOST_DEVICE inline MipLevel mip_level(std::int32_t first, std::int32_t width,
                                             std::int32_t height, std::int32_t levels,
                                             float level_of_unit) {
  // level 0 has `width` texels to uv 1: the level rises by log2 of that
  int log2_width = 0;
  while ((width >> (log2_width + 1)) != 0) ++log2_width;
  auto level =
      static_cast<std::int32_t>(std::floor(level_of_unit + static_cast<float>(log2_width) + 0.5F));
  level = level < 0 ? 0 : (level < levels ? level : levels - 1);
  for (; level > 0; --level) {
    first += width * height;
    width = width > 1 ? width >> 1 : 1;
    height = height > 1 ? height >> 1 : 1;
  }
  return {first, width, height};
}

/// Bilinear sample of a mip level, r g b a; components 0..1, not decoded.
THRONG_HOST_DEVICE inline glm::vec4 bilinear(const std::uint32_t* texels, const MipLevel& level,
                                             float u, float v) {
  const float x = u * static_cast<float>(level.width) - 0.5F;
  const float y = v * static_cast<float>(level.height) - 0.5F;
  const float x_floor = std::floor(x), y_floor = std::floor(y);
  // weights of 1/256, and integers from here on
  const auto wx = static_cast<std::uint32_t>(static_cast<std::int32_t>((x - x_floor) * 256.0F));
  const auto wy = static_cast<std::uint32_t>(static_cast<std::int32_t>((y - y_floor) * 256.0F));
  const auto within = [](std::int32_t i, std::int32_t count) {
    return i < 0 ? 0 : (i < count ? i : count - 1);
  };
  const auto xi = static_cast<std::int32_t>(x_floor), yi = static_cast<std::int32_t>(y_floor);
  const std::int32_t x0 = within(xi, level.width), x1 = within(xi + 1, level.width);
  const std::int32_t row0 = level.first + within(yi, level.height) * level.width;
  const std::int32_t row1 = level.first + within(yi + 1, level.height) * level.width;
  const std::uint32_t t00 = texels[row0 + x0], t10 = texels[row0 + x1];
  const std::uint32_t t01 = texels[row1 + x0], t11 = texels[row1 + x1];
  const std::uint32_t w11 = wx * wy, w10 = (wx << 8) - w11, w01 = (wy << 8) - w11;
  const std::uint32_t w00 = ((65536U - w11) - w10) - w01;
  const auto mix = [&](int shift) {
    const std::uint32_t sum = (((t00 >> shift) & 255U) * w00 + ((t10 >> shift) & 255U) * w10) +
                              (((t01 >> shift) & 255U) * w01 + ((t11 >> shift) & 255U) * w11);
    return static_cast<float>(static_cast<std::int32_t>(sum)) * (1.0F / (65536.0F * 255.0F));
  };
  return {mix(0), mix(8), mix(16), mix(24)};
}

/// What pack_corner_tone packed.
struct Tone {
  glm::vec3 color;    // linear
  glm::vec4 regions;  // tint mask
};
THRONG_HOST_DEVICE inline Tone unpack_tone(std::uint32_t word) {
  const float r = static_cast<float>(word & 127U) * (1.0F / 127.0F);
  const float g = static_cast<float>((word >> 7) & 127U) * (1.0F / 127.0F);
  const float b = static_cast<float>((word >> 14) & 63U) * (1.0F / 63.0F);
  Tone tone;
  tone.color = glm::vec3(r * r, g * g, b * b);
  for (int k = 0; k < 4; ++k) {
    tone.regions[k] = static_cast<float>((word >> (20 + 3 * k)) & 7U) * (1.0F / 7.0F);
  }
  return tone;
}

/// The texture's colour with the regions of its mask dyed.
THRONG_HOST_DEVICE inline glm::vec3 tinted(const glm::vec3& albedo, const glm::vec4& mask,
                                           const InstanceShade& shade) {
  const float rest = most(0.0F, 1.0F - ((mask.x + mask.y) + (mask.z + mask.w)));
  glm::vec3 tint(rest, rest, rest);
  for (int region = 0; region < 4; ++region) {
    tint = tint + unpack_color(shade.tint[region]) * (mask[region] * 2.0F);  // stored as halves
  }
  return albedo * tint;
}

/// The channel's colour on what the texture shows.
THRONG_HOST_DEVICE inline glm::vec3 channel_tinted(const glm::vec3& base, std::uint32_t channel) {
  const float luma = (base.x * 0.2126F + base.y * 0.7152F) + base.z * 0.0722F;
  return unpack_color(channel) * (std::sqrt(luma) * 0.45F + 0.55F);
}

/// Light, haze and tone map. `n` of unit length, `above_m` over the feet.
THRONG_HOST_DEVICE inline glm::vec3 lit(const SceneFrame& scene, const glm::vec3& albedo,
                                        const glm::vec3& n, const glm::vec3& to_eye, float above_m,
                                        float distance_m) {
  const glm::vec3& sun = scene.sun_direction;
  const float rise = clamp01((above_m + 0.05F) * (1.0F / 0.8F));
  const float smooth = (rise * rise) * (3.0F - (rise + rise));
  const float ao = 0.55F + smooth * 0.45F;
  float facing = clamp01((dot3(n, sun) + 0.22F) * (1.0F / 1.22F));
  facing = facing * (facing * 0.4F + 0.6F);
  const float up_share = n.z * 0.5F + 0.5F;
  const float direct = facing * (ao * 0.25F + 0.75F);
  const float edge = 1.0F - clamp01(dot3(n, to_eye));
  const float rim = ((edge * edge) * edge) * (((n.z * n.z) * 0.65F + 0.35F) * 0.16F);
  float gloss = clamp01(dot3(n, unit3(sun + to_eye)));
  for (int power = 0; power < 4; ++power) gloss = gloss * gloss;
  gloss = (gloss * facing) * 0.035F;
  const float rim_ao = rim * ao;
  glm::vec3 color;
  for (int c = 0; c < 3; ++c) {
    const float sky = scene.sky_color[c], low = scene.ground_light[c];
    const float sky_light = (low + up_share * (sky - low)) * ao;
    const float light = direct * scene.sun_color[c] + sky_light;
    color[c] = (albedo[c] * light + rim_ao * sky) + gloss * scene.sun_color[c];
  }
  if (!scene.orthographic) color = haze(scene, color, distance_m);
  return tone_map(color);
}

/// What the texture shows at (b1, b2) of a triangle that covers twice `area_px` pixels.
THRONG_HOST_DEVICE inline glm::vec3 textured(const InstanceShade& shade, const TextureInfo& texture,
                                             const std::uint32_t* texels, const std::uint32_t uv[3],
                                             float b1, float b2, float area_px) {
  const auto u_of = [](std::uint32_t word) {
    return static_cast<float>(word & 0xffffU) * (1.0F / 65535.0F);
  };
  const auto v_of = [](std::uint32_t word) {
    return static_cast<float>(word >> 16) * (1.0F / 65535.0F);
  };
  const float u0 = u_of(uv[0]), u1 = u_of(uv[1]) - u0, u2 = u_of(uv[2]) - u0;
  const float w0 = v_of(uv[0]), w1 = v_of(uv[1]) - w0, w2 = v_of(uv[2]) - w0;
  const float u = u0 + (u1 * b1 + u2 * b2);
  const float v = w0 + (w1 * b1 + w2 * b2);
  const float area_uv = std::fabs(u1 * w2 - u2 * w1);
  const float level = log2_rough(area_uv / most(area_px, 1e-20F)) * 0.5F;
  const glm::vec4 base = bilinear(texels,
                                  mip_level(texture.base_first, texture.base_width,
                                            texture.base_height, texture.base_levels, level),
                                  u, v);
  const glm::vec3 linear(linear_from_srgb(base.x), linear_from_srgb(base.y),
                         linear_from_srgb(base.z));
  if (shade.channel != kNoChannel) return channel_tinted(linear, shade.channel);
  if (texture.mask_first < 0) return linear;
  return tinted(linear,
                bilinear(texels,
                         mip_level(texture.mask_first, texture.mask_width, texture.mask_height,
                                   texture.mask_levels, level),
                         u, v),
                shade);
}

/// Colour of a figure's triangle at pixel coordinates (x, y): tone-mapped, linear. A texture is
/// bilinear in one mip level; the sun and sky are the Look's.
THRONG_HOST_DEVICE inline glm::vec3 shade_triangle(
    const SceneFrame& scene, const InstanceShade& shade, const TextureInfo& texture,
    const std::uint32_t* texels, const ShadeCorners& corner, float x_px, float y_px) {
  const glm::vec3 ray =
      (scene.ray_direction + scene.ray_direction_x * x_px) + scene.ray_direction_y * y_px;
  glm::vec3 origin(0.0F, 0.0F, 0.0F);
  if (scene.orthographic) {
    origin = (scene.ray_origin + scene.ray_origin_x * x_px) + scene.ray_origin_y * y_px;
  }
  const glm::vec3 p0 = corner.p[0];
  const glm::vec3 e1 = corner.p[1] - p0, e2 = corner.p[2] - p0;
  // where the ray meets the triangle's plane (Moeller & Trumbore 1997)
  const glm::vec3 p = cross3(ray, e2);
  const float determinant = dot3(e1, p);
  constexpr float kTiny = 1e-20F;
  const float inverse = 1.0F / (std::fabs(determinant) < kTiny ? kTiny : determinant);
  const glm::vec3 t = origin - p0;
  const glm::vec3 q = cross3(t, e1);
  float b1 = clamp01(dot3(t, p) * inverse);
  float b2 = clamp01(dot3(ray, q) * inverse);
  const float over = most(b1 + b2, 1.0F);
  b1 = b1 / over;
  b2 = b2 / over;
  const float b0 = (1.0F - b1) - b2;
  const glm::vec3 place = p0 + (e1 * b1 + e2 * b2);

  glm::vec3 albedo;
  if ((shade.character & kToned) != 0) {
    const Tone t0 = unpack_tone(corner.uv[0]), t1 = unpack_tone(corner.uv[1]),
               t2 = unpack_tone(corner.uv[2]);
    const glm::vec3 linear = t0.color * b0 + (t1.color * b1 + t2.color * b2);
    albedo = shade.channel != kNoChannel
                 ? channel_tinted(linear, shade.channel)
                 : tinted(linear, t0.regions * b0 + (t1.regions * b1 + t2.regions * b2), shade);
  } else {
    // mip level from areas: texture covered over pixels covered. The triangle's shadow on the
    // picture is |ray . (e1 x e2)| / distance^2, `distance` being along the ray (its forward part
    // is 1).
    const float distance = dot3(e2, q) * inverse;
    float area_px = std::fabs(determinant) * (scene.px_per_tangent * scene.px_per_tangent);
    if (!scene.orthographic) area_px = area_px / most(distance * distance, kTiny);
    albedo = textured(shade, texture, texels, corner.uv, b1, b2, area_px);
  }

  glm::vec3 n = unit3(corner.n[0] * b0 + (corner.n[1] * b1 + corner.n[2] * b2));
  // a triangle seen from behind (double sided): its front is what was drawn counter-clockwise
  n = n * (determinant < 0.0F ? -1.0F : 1.0F);
  glm::vec3 to_eye = ray * -1.0F;
  if (!scene.orthographic) to_eye = unit3(to_eye);
  return lit(scene, albedo, n, to_eye, place.z - shade.feet_relative.z,
             std::sqrt(dot3(place, place)));
}

/// Share of [p - w/2, p + w/2] on lines of this half width, one each period.
THRONG_HOST_DEVICE inline float line_cover(float p, float w, float period, float half_width) {
  const float share = 2.0F * half_width / period;
  const float shift = half_width / period;
  const float low = (p - w * 0.5F) * (1.0F / period) + shift;
  const float high = (p + w * 0.5F) * (1.0F / period) + shift;
  const float low_floor = std::floor(low), high_floor = std::floor(high);
  const float sum_low = low_floor * share + least(low - low_floor, share);
  const float sum_high = high_floor * share + least(high - high_floor, share);
  return ((sum_high - sum_low) * period) / w;
}

/// The ray through the centre of a pixel.
struct PixelRay {
  glm::vec3 origin, direction;
};
THRONG_HOST_DEVICE inline PixelRay pixel_ray(const SceneFrame& scene, int x_px, int y_px) {
  const float x = static_cast<float>(x_px) + 0.5F, y = static_cast<float>(y_px) + 0.5F;
  return {(scene.ray_origin + scene.ray_origin_y * y) + scene.ray_origin_x * x,
          (scene.ray_direction + scene.ray_direction_y * y) + scene.ray_direction_x * x};
}

THRONG_HOST_DEVICE inline glm::vec3 shade_sky(const SceneFrame& scene, float up) {
  const bool below_ground = scene.ground && scene.ground_relative_m >= 0.0F;
  const float height = below_ground ? least(up, -0.02F) : up;
  glm::vec3 color;
  const bool positive = height >= 0.0F;
  const float t = positive ? 1.0F - exp2_negative(clamp01(height) * -4.5F)
                           : 1.0F - exp2_negative(least(height, 0.0F) * 6.0F);
  for (int c = 0; c < 3; ++c) {
    color[c] =
        lerp(scene.horizon_color[c], positive ? scene.sky_color[c] : scene.ground_light[c], t) *
        1.12F;
  }
  return color;
}

THRONG_HOST_DEVICE inline glm::vec3 shade_ground(const SceneFrame& scene, const PixelRay& pixel,
                                                 float to_plane, float length, float up) {
  const glm::vec3& origin = pixel.origin;
  const glm::vec3& ray = pixel.direction;
  const float inverse_z = 1.0F / ray.z;
  const float t = to_plane * inverse_z;
  const float tx = -((scene.ray_origin_x.z + t * scene.ray_direction_x.z) * inverse_z);
  const float ty = -((scene.ray_origin_y.z + t * scene.ray_direction_y.z) * inverse_z);
  const auto width = [&](float ox, float dx, float oy, float dy, float ray_c) {
    const float step_x = (ox + t * dx) + ray_c * tx;
    const float step_y = (oy + t * dy) + ray_c * ty;
    return most(std::fabs(step_x) + std::fabs(step_y), 1e-5F);
  };
  const float wx = width(scene.ray_origin_x.x, scene.ray_direction_x.x, scene.ray_origin_y.x,
                         scene.ray_direction_y.x, ray.x);
  const float wy = width(scene.ray_origin_x.y, scene.ray_direction_x.y, scene.ray_origin_y.y,
                         scene.ray_direction_y.y, ray.y);
  const float px = (origin.x + ray.x * t) + scene.grid_eye.x;
  const float py = (origin.y + ray.y * t) + scene.grid_eye.y;
  const float fine_x = line_cover(px, wx, 1.0F, 0.010F), fine_y = line_cover(py, wy, 1.0F, 0.010F);
  const float strong_x = line_cover(px, wx, 10.0F, 0.028F);
  const float strong_y = line_cover(py, wy, 10.0F, 0.028F);
  const float metre = (fine_x + fine_y) - fine_x * fine_y;
  const float ten = (strong_x + strong_y) - strong_x * strong_y;
  // slabs of a metre, no two neighbours quite alike
  const auto slab = [](float c) {
    const float whole = std::floor(c);
    const float place = whole - std::floor(whole * 0.05F) * 20.0F;
    // rounding may leave it beyond 0 to 20 far out; whatever it is then, it is an integer
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(least(most(place, -1e9F), 1e9F)));
  };
  std::uint32_t bits = (slab(px) * 73U + slab(py) * 179U) + 11U;
  bits = bits * 0x9e3779b1U;
  bits = (bits ^ (bits >> 15)) * 0x85ebca6bU;
  const float shade =
      static_cast<float>(static_cast<std::int32_t>(bits >> 16)) * (1.0F / 65536.0F) - 0.5F;
  const float apart = clamp01(1.4F - most(wx, wy) * 1.2F);
  const float tone = 1.0F + (shade * apart) * 0.08F;
  const float lines = (1.0F - metre * 0.38F) * (1.0F - ten * 0.66F);
  const float paint = tone * lines;
  glm::vec3 light = scene.sun_color * most(scene.sun_direction.z, 0.0F) + scene.sky_color;
  if (scene.ground_relative_m >= 0.0F) light = scene.ground_light;
  light = light * scene.ground_color;
  glm::vec3 color = light * paint;
  if (!scene.orthographic) {
    color = haze(scene, color, std::fabs(t) * length);
    const float grazing = exp2_negative(std::fabs(up) * -55.0F);
    for (int c = 0; c < 3; ++c) {
      color[c] = lerp(color[c], scene.horizon_color[c] * 1.12F, grazing);
    }
  }
  return color;
}

/// Ground, grid and sky of a pixel: tone-mapped, linear.
THRONG_HOST_DEVICE inline glm::vec3 shade_background(const SceneFrame& scene, int x_px, int y_px) {
  const PixelRay pixel = pixel_ray(scene, x_px, y_px);
  const glm::vec3& ray = pixel.direction;
  const float length = std::sqrt(dot3(ray, ray));
  const float up = ray.z / length;
  const float to_plane = scene.ground_relative_m - pixel.origin.z;
  const bool hit =
      scene.ground && (scene.orthographic ? std::fabs(ray.z) > 1e-5F : to_plane * ray.z > 0.0F);
  return tone_map(hit ? shade_ground(scene, pixel, to_plane, length, up) : shade_sky(scene, up));
}

THRONG_HOST_DEVICE inline Blob make_blob(const SceneFrame& scene, const InstanceShade& shade) {
  Blob blob;
  blob.feet_relative = glm::vec2(shade.feet_relative.x, shade.feet_relative.y);
  const glm::vec2 away(-scene.sun_direction.x, -scene.sun_direction.y);
  const float flat_length = std::sqrt(away.x * away.x + away.y * away.y);
  blob.away = flat_length > 1e-4F ? away / flat_length : glm::vec2(1.0F, 0.0F);
  blob.meter = shade.height_m / 1.75F;
  blob.reach = 1.75F * least(flat_length / most(scene.sun_direction.z, 0.05F), 3.0F);
  const float distance_m =
      scene.orthographic ? 1e-3F
                         : most(std::sqrt(dot3(shade.feet_relative, shade.feet_relative)), 1e-3F);
  const float slope = least(std::fabs(scene.ground_relative_m) / distance_m, 1.0F);
  const float seen =
      (1.0F - exp2_negative(-55.0F * slope)) * exp2_negative(-distance_m * scene.haze_per_m);
  blob.contact = seen * least(kNoBlob - shade.cast_shadow, 1.0F);
  blob.body = seen * most(1.0F - shade.cast_shadow, 0.0F);
  return blob;
}

/// Share of light that a blob takes from the ground seen through a pixel.
THRONG_HOST_DEVICE inline float shade_blob(const SceneFrame& scene, const Blob& blob, int x_px,
                                           int y_px) {
  const PixelRay pixel = pixel_ray(scene, x_px, y_px);
  const glm::vec3& ray = pixel.direction;
  if (!(ray.z < -1e-6F)) return 0.0F;
  const float per_meter = 1.0F / blob.meter;
  const float t = (scene.ground_relative_m - pixel.origin.z) / ray.z;
  const float gx = ((pixel.origin.x + ray.x * t) - blob.feet_relative.x) * per_meter;
  const float gy = ((pixel.origin.y + ray.y * t) - blob.feet_relative.y) * per_meter;
  const float far_along = gx * blob.away.x + gy * blob.away.y;
  const float across = gy * blob.away.x - gx * blob.away.y;
  const float squared = far_along * far_along + across * across;
  float contact = clamp01(1.0F - squared * (1.0F / (0.48F * 0.48F)));
  contact = (contact * contact) * (0.62F * blob.contact);
  const float share = clamp01(far_along * (1.0F / most(blob.reach, 0.01F)));
  const float off = far_along - least(most(far_along, 0.0F), blob.reach);
  const float off_squared = off * off + across * across;
  const float width = 0.20F + share * 0.14F;
  float body = clamp01(1.0F - off_squared / (width * width));
  body = (body * (2.0F - body)) * ((0.50F - share * 0.20F) * blob.body);
  return most(contact, body);
}

/// sRGB code of a linear component, 0 to 255: above its straight part, a polynomial over the square
/// root, where it is nearly straight (within 0.04).
THRONG_HOST_DEVICE inline std::uint32_t srgb_code(float linear) {
  const float c = clamp01(linear);
  const float r = std::sqrt(c);
  float p = -241.65611F;
  p = p * r + 871.765392F;
  p = p * r + -1275.809F;
  p = p * r + 994.103768F;
  p = p * r + -484.367064F;
  p = p * r + 401.694182F;
  p = p * r + -10.7691539F;
  const float code = c < 0.0031308F ? c * (12.92F * 255.0F) : p;
  return static_cast<std::uint32_t>(static_cast<std::int32_t>(code + 0.5F));
}

}  // namespace throng::render::element
