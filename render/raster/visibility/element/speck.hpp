#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>

#include "render/compute/element/angle.hpp"
#include "render/compute/element/speck.hpp"
#include "render/compute/element/speck_slab.hpp"
#include "render/raster/element/instance_shade.hpp"
#include "render/raster/element/scene_frame.hpp"
#include "render/raster/element/tint.hpp"
#include "render/raster/visibility/element/clip.hpp"
#include "render/raster/visibility/element/shade.hpp"
#include "render/raster/visibility/element/shadow.hpp"
#include "throng/render/vertex.hpp"

// Figures of a few pixels as boxes of an even colour, the same on every backend.
namespace throng::render::element {

/// A speck on the picture. 32 bytes.
struct PlacedSpeck {
  float x, y;   // of the feet, pixels from the picture's top left
  float size;   // pixels of the figure's height, seen from the side
  float lean;   // pixels to the right for each up
  float depth;  // reversed; 0: not seen
  float clear;  // share of its light that haze leaves
  std::uint32_t image;
  std::uint32_t seed;
};
static_assert(sizeof(PlacedSpeck) == 32);

/// Specks are listed, sorted and lit by tiles of so many pixels a side.
inline constexpr std::uint32_t kSpeckTilePx = 32;
/// Of a pixel of which specks have left less nothing more is shown.
inline constexpr float kSpeckLeastThrough = 0.02F;

/// Rows of slabs that a figure gets: one for each pixel of its height, and from 2 pixels on about
/// two, so that where they lie on the pixels blurs little. (Two below, too, would cost 1,000,000
/// agents from above 30 of 180 CPU ms.)
THRONG_HOST_DEVICE inline std::uint32_t speck_level(float rows_px) {
  return (rows_px > 1.0F ? 1U : 0U) + (rows_px > 2.0F ? 1U : 0U) + (rows_px > 2.8F ? 1U : 0U) +
         (rows_px > 5.6F ? 1U : 0U) + (rows_px > 11.2F ? 1U : 0U);
}

THRONG_HOST_DEVICE inline std::uint32_t elevation_of_image(std::uint32_t image) {
  return image / kSpeckAzimuths % kSpeckElevations;
}

THRONG_HOST_DEVICE inline PlacedSpeck place_speck(const Speck& speck, const SampleGrid& grid,
                                                  const SceneFrame& scene) {
  const glm::mat4& m = grid.clip_from_relative;
  const float half_width = 0.25F * static_cast<float>(grid.width);
  const float half_height = 0.25F * static_cast<float>(grid.height);
  const float haze = scene.orthographic ? 0.0F : -scene.haze_per_m;
  const glm::vec3& p = speck.position_relative;
  PlacedSpeck placed;
  const float cx = ((m[0].x * p.x + m[1].x * p.y) + m[2].x * p.z) + m[3].x;
  const float cy = ((m[0].y * p.x + m[1].y * p.y) + m[2].y * p.z) + m[3].y;
  const float cz = ((m[0].z * p.x + m[1].z * p.y) + m[2].z * p.z) + m[3].z;
  const float cw = ((m[0].w * p.x + m[1].w * p.y) + m[2].w * p.z) + m[3].w;
  const bool seen = cw > 0.0F && cz > 0.0F && cz <= cw;
  const float inverse = 1.0F / (seen ? cw : 1.0F);
  const float nx = cx * inverse, ny = cy * inverse;
  placed.x = (1.0F + nx) * half_width;
  placed.y = (1.0F - ny) * half_height;
  placed.size = speck.height_m * scene.px_per_tangent * inverse;
  // where a metre upwards goes
  const float up_x = (m[2].x - nx * m[2].w) * half_width;
  const float up_y = (m[2].y - ny * m[2].w) * half_height;
  placed.lean = up_y > std::fabs(up_x) ? up_x / up_y : 0.0F;
  const float depth = cz * inverse;
  placed.depth = seen ? (depth < 1.0F ? depth : 1.0F) : 0.0F;
  const float distance_m = std::sqrt((p.x * p.x + p.y * p.y) + p.z * p.z);
  placed.clear = exp2_negative(distance_m * haze);
  placed.image = speck.image;
  placed.seed = speck.seed;
  return placed;
}

/// The tiles that a speck and its shadow may reach; x_low > x_high: none.
struct SpeckTiles {
  std::uint32_t x_low, y_low, x_high, y_high;
};
/// @param width, height  of the picture in pixels.
THRONG_HOST_DEVICE inline SpeckTiles speck_tiles(const PlacedSpeck& placed, const SpeckImage& image,
                                                 bool shadows, float width, float height) {
  const float lean = std::fabs(placed.lean) * placed.size;
  const float aside = shadows ? placed.size : 0.0F;  // about as far as shadows reach
  const float x0 = placed.x + placed.size * image.x_low - lean - aside;
  const float x1 = placed.x + placed.size * image.x_high + lean + aside;
  const float y0 = placed.y - 1.25F * placed.size * image.y_high;
  const float y1 = placed.y - 1.25F * placed.size * image.y_low + 0.5F * aside;
  if (!(placed.depth > 0.0F) || !(x1 > 0.0F && y1 > 0.0F && x0 < width && y0 < height)) {
    return {1, 1, 0, 0};
  }
  const auto tile_of = [](float at, float size) {
    return static_cast<std::uint32_t>(least(most(at, 0.0F), size - 1.0F)) / kSpeckTilePx;
  };
  return {tile_of(x0, width), tile_of(y0, height), tile_of(x1, width), tile_of(y1, height)};
}

/// What light does to a surface by its normal: shares of the sun and the sky, and what is reflected
/// of both whatever the colour. As element::lit has it.
struct SpeckResponse {
  static constexpr int kParts = 4;
  float part[kParts];  // sun, up, rim, gloss
};
THRONG_HOST_DEVICE inline SpeckResponse speck_response(const glm::vec3& n, const glm::vec3& sun,
                                                       const glm::vec3& to_eye) {
  const float facing = clamp01((dot3(n, sun) + 0.22F) * (1.0F / 1.22F));
  const float lit = facing * (facing * 0.4F + 0.6F);
  const float edge = 1.0F - clamp01(dot3(n, to_eye));
  float gloss = clamp01(dot3(n, unit3(sun + to_eye)));
  for (int power = 0; power < 4; ++power) gloss = gloss * gloss;
  return {{lit, n.z * 0.5F + 0.5F, ((edge * edge) * edge) * (((n.z * n.z) * 0.65F + 0.35F) * 0.16F),
           (gloss * lit) * 0.035F}};
}

/// What specks of a tile see of the eye: the direction to it, and the six sides of a figure (right,
/// left, towards the eye, away, up, down).
struct SpeckView {
  glm::vec3 to_eye;
  glm::vec3 side[6];
};
/// @param x_px, y_px  the tile's middle.
THRONG_HOST_DEVICE inline SpeckView speck_view(const SceneFrame& scene, const glm::vec3& camera_up,
                                               float x_px, float y_px) {
  SpeckView view;
  const glm::vec3 ray =
      (scene.ray_direction + scene.ray_direction_x * x_px) + scene.ray_direction_y * y_px;
  view.to_eye = unit3(ray * -1.0F);
  glm::vec3 ahead(view.to_eye.x, view.to_eye.y, 0.0F);
  if (ahead.x * ahead.x + ahead.y * ahead.y < 1e-4F) {
    ahead = -glm::vec3(camera_up.x, camera_up.y, 0.0F);
  }
  ahead = unit3(ahead);
  const glm::vec3 right(-ahead.y, ahead.x, 0.0F), up(0.0F, 0.0F, 1.0F);
  const glm::vec3 sides[6] = {right, -right, ahead, -ahead, up, -up};
  for (int k = 0; k < 6; ++k) view.side[k] = sides[k];
  return view;
}

/// Responses of the six sides that are mixed by the squares of a normal's components. A side's own
/// response is right for what faces that way, and makes all between dark, since light grows faster
/// than it is mixed; what comes nearest for every normal that is seen (least squares, weighted by
/// how much of it is seen) makes what faces a side bright. Bodies are between: with a third of
/// the fit the built-in cast's figures of 7 pixels show what those of 28 do, in sun and in sky
/// light.
struct SpeckFit {
  static constexpr int kNormals = 96, kRow = 6 + SpeckResponse::kParts;
  double sum[6][kRow];
  float fit[6][SpeckResponse::kParts];
};
/// One of the normals; `seen` is positive where it counts.
struct SpeckNormal {
  float seen;
  float share[6];
  SpeckResponse response;
};
THRONG_HOST_DEVICE inline SpeckNormal speck_normal(int i, const SpeckView& view,
                                                   const glm::vec3& sun) {
  // evenly over the sphere, by the golden angle
  const float z = 1.0F - (2.0F * static_cast<float>(i) + 1.0F) / SpeckFit::kNormals;
  const float turn = static_cast<float>(i) * 2.39996323F;
  const SinCos at = sin_cos(wrap_angle(turn));
  const float ring = std::sqrt(1.0F - z * z);
  const glm::vec3 n(ring * at.cosine, ring * at.sine, z);
  SpeckNormal normal;
  normal.seen = dot3(n, view.to_eye);
  for (int k = 0; k < 6; ++k) {
    const float along = most(dot3(n, view.side[k]), 0.0F);
    normal.share[k] = along * along;
  }
  normal.response = speck_response(n, sun, view.to_eye);
  return normal;
}
/// What a normal adds to sum[k][j].
THRONG_HOST_DEVICE inline double speck_term(const SpeckNormal& normal, int k, int j) {
  const float weight = normal.seen * normal.share[k];
  return static_cast<double>(weight * (j < 6 ? normal.share[j] : normal.response.part[j - 6]));
}
/// Before any normal is added.
THRONG_HOST_DEVICE inline void begin_fit(SpeckFit& fit, int k, const SpeckView& view,
                                         const glm::vec3& sun) {
  constexpr float kStay = 0.02F;  // what is hardly seen stays near its own
  const SpeckResponse own = speck_response(view.side[k], sun, view.to_eye);
  for (int j = 0; j < 6; ++j) fit.sum[k][j] = 0.0;
  fit.sum[k][k] = static_cast<double>(kStay);
  for (int part = 0; part < SpeckResponse::kParts; ++part) {
    fit.fit[k][part] = own.part[part];
    fit.sum[k][6 + part] = static_cast<double>(kStay * own.part[part]);
  }
}
/// Once all are added.
THRONG_HOST_DEVICE inline void end_fit(SpeckFit& fit) {
  // positive definite: no pivots
  for (int k = 0; k < 6; ++k) {
    for (int row = 0; row < 6; ++row) {
      if (row == k) continue;
      const double factor = fit.sum[row][k] / fit.sum[k][k];
      for (int j = k; j < SpeckFit::kRow; ++j) fit.sum[row][j] -= factor * fit.sum[k][j];
    }
  }
  for (int k = 0; k < 6; ++k) {
    for (int part = 0; part < SpeckResponse::kParts; ++part) {
      const auto nearest = static_cast<float>(fit.sum[k][6 + part] / fit.sum[k][k]);
      fit.fit[k][part] = most((2.0F * fit.fit[k][part] + nearest) * (1.0F / 3.0F), 0.0F);
    }
  }
}

/// A blob (shade_blob) of a figure of 1.75 m, along its middle line: how much light slices across
/// it take, and how wide a box is that does so with the same spread. Metres.
struct SpeckProfile {
  static constexpr int kSlices = 16;
  float low, per_slice;       // of the line; slices a metre
  float before[kSlices + 1];  // square metres of darkness before each slice, then all
  float half[kSlices];        // of the box
};
THRONG_HOST_DEVICE inline SpeckProfile speck_profile(float reach) {
  constexpr float kContact = 0.48F, kEnd = 0.34F;
  constexpr int kAcross = 8;
  SpeckProfile profile;
  profile.low = -kContact;
  const float length = (reach + kEnd) + kContact;
  profile.per_slice = static_cast<float>(SpeckProfile::kSlices) / length;
  const float step = length / static_cast<float>(SpeckProfile::kSlices);
  constexpr float kStep = kContact / static_cast<float>(kAcross);
  profile.before[0] = 0.0F;
  for (int i = 0; i < SpeckProfile::kSlices; ++i) {
    const float along = profile.low + (static_cast<float>(i) + 0.5F) * step;
    const float share = clamp01(along * (1.0F / most(reach, 0.01F)));
    const float off = along - least(most(along, 0.0F), reach);
    const float width = 0.20F + share * 0.14F;
    float sum = 0.0F, squares = 0.0F;
    for (int j = 0; j < kAcross; ++j) {
      const float across = (static_cast<float>(j) + 0.5F) * kStep;
      float contact =
          clamp01(1.0F - (along * along + across * across) * (1.0F / (kContact * kContact)));
      contact = (contact * contact) * 0.62F;
      float body = clamp01(1.0F - (off * off + across * across) / (width * width));
      body = (body * (2.0F - body)) * (0.50F - share * 0.20F);
      const float dark = most(contact, body);
      sum += dark;
      squares += dark * (across * across);
    }
    profile.before[i + 1] = profile.before[i] + (2.0F * sum) * (kStep * step);
    profile.half[i] = std::sqrt(3.0F * (squares / most(sum, 1e-6F)));
  }
  return profile;
}

/// What is the same for all specks of a tile: the light on a surface that faces right, left, the
/// eye, away, up or down (rows: rgb of what comes anyway, of what comes under open sky, and of what
/// is reflected then whatever the colour), and where shadows fall.
struct SpeckLight {
  alignas(64) float row[6][16];
  float tall[kSpeckElevations];  // height here of a picture made at an elevation
  glm::vec2 along, across;       // of a shadow a metre long and wide, pixels for a figure of size 1
  float shadow;                  // how much of it is seen
  float detail;                  // rows of slabs, of those that leave nothing to be seen
  SpeckProfile profile;
};
THRONG_HOST_DEVICE inline void light_row(SpeckLight& light, int k, const SpeckFit& fit,
                                         const SceneFrame& scene) {
  float* row = light.row[k];
  const float* own = fit.fit[k];
  for (int j = 0; j < 16; ++j) row[j] = 0.0F;
  for (int c = 0; c < 3; ++c) {
    const float sky = scene.sky_color[c], low = scene.ground_light[c];
    row[c] = 0.75F * own[0] * scene.sun_color[c];
    row[4 + c] = 0.25F * own[0] * scene.sun_color[c] + (low + own[1] * (sky - low));
    row[8 + c] = own[2] * sky + own[3] * scene.sun_color[c];
  }
  for (int j = 0; j < 16; ++j) row[j] *= 1.0F / 255.0F;
}
/// All but the rows.
THRONG_HOST_DEVICE inline void light_places(SpeckLight& light, const SpeckView& view,
                                            const SceneFrame& scene, const SampleGrid& grid,
                                            float x_px, float y_px) {
  const glm::mat4& m = grid.clip_from_relative;
  const float width = 0.5F * static_cast<float>(grid.width);
  const float height = 0.5F * static_cast<float>(grid.height);
  const float nx = 2.0F * x_px / width - 1.0F, ny = 1.0F - 2.0F * y_px / height;
  const float up_px = (m[2].y - ny * m[2].w) * 0.5F * height / scene.px_per_tangent;
  for (std::uint32_t e = 0; e < kSpeckElevations; ++e) {
    light.tall[e] = least(most(up_px * speck_per_cosine(e), 0.75F), 1.25F);
  }
  light.along = light.across = glm::vec2(0.0F);
  light.shadow = 0.0F;
  light.detail = 1.0F;
  light.profile = {};
  if (!scene.shadows) return;
  const auto on_picture = [&](float x, float y) {
    const float dx = m[0].x * x + m[1].x * y, dy = m[0].y * x + m[1].y * y;
    const float dw = m[0].w * x + m[1].w * y;
    return glm::vec2((dx - nx * dw) * 0.5F * width, -(dy - ny * dw) * 0.5F * height) *
           (1.0F / (1.75F * scene.px_per_tangent));
  };
  InstanceShade figure{};
  figure.height_m = 1.75F;
  figure.feet_relative = glm::vec3(0.0F, 0.0F, scene.ground_relative_m);
  const Blob blob = make_blob(scene, figure);
  light.along = on_picture(blob.away.x, blob.away.y);
  light.across = on_picture(-blob.away.y, blob.away.x);
  light.profile = speck_profile(blob.reach);
  const float slope = scene.orthographic ? 1.0F : clamp01(view.to_eye.z);
  light.shadow = (1.0F - exp2_negative(-55.0F * slope));
}

/// A figure whose slabs are about to be drawn.
struct SpeckFigure {
  float tint[16];
  glm::vec3 shown;  // by channel
  float size_y;     // pixels of its height as it is drawn
  float step, bottom, per_unit;
  std::uint32_t count, shift;  // slabs; 2^shift in a row
  std::uint32_t first;         // slab of its picture's
};
THRONG_HOST_DEVICE inline SpeckFigure speck_figure(const PlacedSpeck& placed,
                                                   const SpeckImage& image, const SpeckLight& light,
                                                   const ChannelRange& range, float channel) {
  SpeckFigure figure;
  figure.size_y = placed.size * light.tall[elevation_of_image(placed.image)];
  const std::uint32_t level =
      speck_level(light.detail * figure.size_y * (image.y_high - image.y_low));
  figure.shift = SpeckLevels::column_shift(level);
  const std::uint32_t rows = 1U << level;
  figure.count = SpeckLevels::slabs(level);
  figure.first = SpeckLevels::first_slab(level);
  const Tints tints = tints_of(placed.seed);
  const glm::vec3 parts[5] = {glm::vec3(1.0F), tints.skin, tints.hair, tints.top, tints.bottom};
  for (int t = 0; t < 5; ++t) {
    for (int c = 0; c < 3; ++c) figure.tint[3 * t + c] = parts[t][c] * (1.0F / (255.0F * 255.0F));
  }
  figure.tint[15] = 0.0F;
  figure.shown = glm::vec3(0.0F);
  if (range.colors) {
    figure.shown = channel_color(channel, range);
    for (float& one : figure.tint) one = 1.0F / (255.0F * 255.0F);
  }
  figure.step = figure.size_y * (image.y_high - image.y_low) / static_cast<float>(rows);
  figure.bottom = placed.y - figure.size_y * image.y_low;
  figure.per_unit = placed.size * (1.0F / SpeckSlab::kPerHeight);
  return figure;
}

/// A slab as it is drawn; the colour is times its coverage, which is the fourth value.
struct SpeckPiece {
  float top, bottom, left, right;
  float color[4];
};
THRONG_HOST_DEVICE inline SpeckPiece speck_piece(const SpeckFigure& figure, std::uint32_t k,
                                                 const SpeckSlab& slab, const PlacedSpeck& placed,
                                                 const SpeckLight& light, const SceneFrame& scene,
                                                 bool by_channel) {
  SpeckPiece piece;
  piece.bottom = figure.bottom - figure.step * static_cast<float>(k >> figure.shift);
  piece.top = piece.bottom - figure.step;
  const float middle = placed.x + placed.lean * (placed.y - 0.5F * (piece.top + piece.bottom));
  piece.left = middle + figure.per_unit * static_cast<float>(slab.low);
  piece.right = middle + figure.per_unit * static_cast<float>(slab.high);
  float albedo[16];
  for (int j = 0; j < 16; ++j) {
    const auto root = static_cast<float>(slab.tone[j]);
    albedo[j] = root * root * figure.tint[j];
  }
  float row[16] = {};
  for (int f = 0; f < 6; ++f) {
    const auto share = static_cast<float>(slab.facing[f]);
    for (int j = 0; j < 16; ++j) row[j] += share * light.row[f][j];
  }
  const float open = static_cast<float>(slab.open) * (1.0F / 255.0F);
  glm::vec3 base;
  for (int c = 0; c < 3; ++c) {
    base[c] = (albedo[c] + albedo[3 + c]) + (albedo[6 + c] + albedo[9 + c]) + albedo[12 + c];
  }
  if (by_channel) {
    const float luma = (base.x * 0.2126F + base.y * 0.7152F) + base.z * 0.0722F;
    base = figure.shown * (std::sqrt(luma) * 0.45F + 0.55F);
  }
  glm::vec3 color;
  for (int c = 0; c < 3; ++c) {
    color[c] = base[c] * (row[c] + open * row[4 + c]) + open * row[8 + c];
    color[c] = scene.horizon_color[c] + placed.clear * (color[c] - scene.horizon_color[c]);
  }
  color = tone_map(color);
  const float fill = static_cast<float>(slab.fill) * (1.0F / 255.0F);
  for (int c = 0; c < 3; ++c) piece.color[c] = color[c] * fill;
  piece.color[3] = fill;
  return piece;
}

/// A shadow as it falls on the picture: rows of a pixel's height if it runs up or down, else
/// columns of a pixel's width. How dark each is is exact, how far it slants aside is that of its
/// middle.
struct SpeckShadow {
  bool is_tall, falls;
  float run, slant, across;  // pixels for a figure of size 1: of a metre along, aside, across
  float low, high;           // of the whole
  float per_px, px;          // slices in a pixel along it, and pixels of a slice, for size 1
  float dark[SpeckProfile::kSlices];  // of a box that takes a square metre of light
  SpeckProfile profile;
};
THRONG_HOST_DEVICE inline SpeckShadow speck_shadow(const SpeckLight& light) {
  SpeckShadow shadow;
  const glm::vec2 along = light.along;
  const float area = std::fabs(along.x * light.across.y - along.y * light.across.x);
  shadow.is_tall = std::fabs(along.y) > std::fabs(along.x);
  shadow.run = shadow.is_tall ? along.y : along.x;
  const float slide = shadow.is_tall ? along.x : along.y;
  shadow.falls = std::fabs(shadow.run) > 1e-4F && !(light.shadow < 0.01F);
  shadow.slant = shadow.falls ? slide / shadow.run : 0.0F;
  shadow.across = shadow.falls ? area / std::fabs(shadow.run) : 0.0F;
  shadow.profile = light.profile;
  const float one = shadow.run * light.profile.low;
  const float other = shadow.run * (light.profile.low + static_cast<float>(SpeckProfile::kSlices) /
                                                            light.profile.per_slice);
  shadow.per_px = shadow.falls ? light.profile.per_slice / shadow.run : 0.0F;
  shadow.px = shadow.falls ? shadow.run / light.profile.per_slice : 0.0F;
  for (int k = 0; k < SpeckProfile::kSlices; ++k) {
    shadow.dark[k] = (0.5F * std::fabs(shadow.run)) / most(light.profile.half[k], 1e-6F);
  }
  shadow.low = shadow.falls ? least(one, other) : 0.0F;
  shadow.high = shadow.falls ? most(one, other) : 0.0F;
  return shadow;
}

/// A row or column of a speck's shadow: darkness from `from` to `to`, pixels.
struct SpeckShade {
  float dark, from, to;
};
/// @param i  the row's or column's place. @param u, v  the feet's, along the shadow and aside.
THRONG_HOST_DEVICE inline SpeckShade speck_shade(const SpeckShadow& shadow, float strength,
                                                 float size, float u, float v, float i) {
  const SpeckProfile& profile = shadow.profile;
  const float per_px = shadow.per_px * (1.0F / size);
  const float offset = -profile.low * profile.per_slice;
  constexpr auto kEnd = static_cast<float>(SpeckProfile::kSlices);
  const float one = least(most((i - u) * per_px + offset, 0.0F), kEnd);
  const float other = least(most((i + 1.0F - u) * per_px + offset, 0.0F), kEnd);
  const auto before = [&](float at) {
    const int k = static_cast<int>(least(at, kEnd - 1.0F));
    return profile.before[k] +
           (at - static_cast<float>(k)) * (profile.before[k + 1] - profile.before[k]);
  };
  const float middle = 0.5F * (one + other);  // of what lies in the row
  const float mass = std::fabs(before(other) - before(one));
  const int k = static_cast<int>(least(middle, kEnd - 1.0F));
  const float half = profile.half[k] * (shadow.across * size);
  const float at = v + shadow.slant * ((middle - offset) * (shadow.px * size));
  SpeckShade shade;
  shade.from = at - half;
  shade.to = at + half;
  shade.dark = ((strength * mass) * size) * shadow.dark[k];
  return shade;
}
/// The light that is missing once `more` is: of two shadows that meet the darker one counts, so in
/// parts of a pixel as much as is not dark already.
THRONG_HOST_DEVICE inline float add_shade(float missing, float more) {
  constexpr float kDark = 0.5F;  // of what a shadow darkens
  return missing + most(1.0F - missing * (1.0F / kDark), 0.0F) * more;
}

/// What a speck's shadow adds at a pixel.
/// @param x, y  the pixel and the feet, both from the tile's corner.
THRONG_HOST_DEVICE inline float speck_shadow_at(const SpeckShadow& shadow, float strength,
                                                float size, float feet_x, float feet_y, int x,
                                                int y) {
  const float u = shadow.is_tall ? feet_y : feet_x, v = shadow.is_tall ? feet_x : feet_y;
  const auto i = static_cast<float>(shadow.is_tall ? y : x);
  const auto j = static_cast<float>(shadow.is_tall ? x : y);
  if (i < std::floor(u + size * shadow.low) || i > std::floor(u + size * shadow.high)) return 0.0F;
  const SpeckShade shade = speck_shade(shadow, strength, size, u, v, i);
  if (j < std::floor(shade.from) || j > std::floor(shade.to)) return 0.0F;
  return shade.dark * most(least(shade.to, j + 1.0F) - most(shade.from, j), 0.0F);
}

/// The pixels of a tile that a speck may cover, inclusive; x_low > x_high: none.
struct SpeckPixels {
  int x_low, y_low, x_high, y_high;
};
/// @param x_px, y_px  the tile's corner.
THRONG_HOST_DEVICE inline SpeckPixels speck_pixels(const PlacedSpeck& placed,
                                                   const SpeckImage& image, float size_y, int x_px,
                                                   int y_px) {
  constexpr int kLast = static_cast<int>(kSpeckTilePx) - 1;
  const float up_low = placed.y - size_y * image.y_high - static_cast<float>(y_px);
  const float up_high = placed.y - size_y * image.y_low - static_cast<float>(y_px);
  const float lean_low = placed.lean * size_y * image.y_low;
  const float lean_high = placed.lean * size_y * image.y_high;
  const float left =
      placed.x + placed.size * image.x_low + least(lean_low, lean_high) - static_cast<float>(x_px);
  const float right =
      placed.x + placed.size * image.x_high + most(lean_low, lean_high) - static_cast<float>(x_px);
  const auto at_least = [](int a, int b) { return a > b ? a : b; };
  const auto at_most = [](int a, int b) { return a < b ? a : b; };
  return {at_least(static_cast<int>(std::floor(left)), 0),
          at_least(static_cast<int>(std::floor(up_low)), 0),
          at_most(static_cast<int>(std::floor(right)), kLast),
          at_most(static_cast<int>(std::floor(up_high)), kLast)};
}

}  // namespace throng::render::element
