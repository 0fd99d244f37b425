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

/// What is the same for all specks of a tile: the light on a surface that faces right, left, the
/// eye, away, up or down (rows: rgb of what comes anyway, of what comes under open sky, and of what
/// is reflected then whatever the colour), and where shadows fall.
struct SpeckLight {
  alignas(64) float row[6][16];
  float tall[element::kSpeckElevations];  // height here of a picture made at an elevation
  glm::vec2 along, across;  // of a shadow, pixels down and right, for a figure of size 1
  float shadow;             // share of light it takes
};

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

/// How many slabs a figure gets: about two for each pixel of its height, so that where they lie on
/// the pixels blurs little.
inline std::uint32_t LevelOf(float rows_px) {
  return (rows_px > 0.7F ? 1U : 0U) + (rows_px > 1.4F ? 1U : 0U) + (rows_px > 2.8F ? 1U : 0U) +
         (rows_px > 5.6F ? 1U : 0U);
}

inline std::uint32_t ElevationOf(std::uint32_t image) {
  return image / element::kSpeckAzimuths % element::kSpeckElevations;
}

void PlaceSpecks(const Speck* specks, std::size_t count, const SpeckTable& table,
                 const SpeckScene& scene, PlacedSpeck* out) {
  const glm::mat4& m = scene.grid->clip_from_relative;
  const float half_width = 0.25F * static_cast<float>(scene.grid->width);
  const float half_height = 0.25F * static_cast<float>(scene.grid->height);
  const float px_per_tangent = scene.scene->px_per_tangent;
  const float haze = scene.scene->orthographic ? 0.0F : -scene.scene->haze_per_m;
  for (std::size_t i = 0; i < count; ++i) {
    const Speck& speck = specks[i];
    const glm::vec3& p = speck.position_relative;
    PlacedSpeck& placed = out[i];
    const float cx = ((m[0].x * p.x + m[1].x * p.y) + m[2].x * p.z) + m[3].x;
    const float cy = ((m[0].y * p.x + m[1].y * p.y) + m[2].y * p.z) + m[3].y;
    const float cz = ((m[0].z * p.x + m[1].z * p.y) + m[2].z * p.z) + m[3].z;
    const float cw = ((m[0].w * p.x + m[1].w * p.y) + m[2].w * p.z) + m[3].w;
    const bool seen = cw > 0.0F && cz > 0.0F && cz <= cw;
    const float inverse = 1.0F / (seen ? cw : 1.0F);
    const float nx = cx * inverse, ny = cy * inverse;
    placed.x = (1.0F + nx) * half_width;
    placed.y = (1.0F - ny) * half_height;
    placed.size = speck.height_m * px_per_tangent * inverse;
    // where a metre upwards goes
    const float up_x = (m[2].x - nx * m[2].w) * half_width;
    const float up_y = (m[2].y - ny * m[2].w) * half_height;
    placed.lean = up_y > std::fabs(up_x) ? up_x / up_y : 0.0F;
    placed.depth = seen ? std::min(cz * inverse, 1.0F) : 0.0F;
    const float distance_m = std::sqrt((p.x * p.x + p.y * p.y) + p.z * p.z);
    placed.clear = element::exp2_negative(distance_m * haze);
    placed.image = speck.image;
    placed.seed = speck.seed;
  }
}

/// What light does to a surface by its normal: shares of the sun and the sky, and what is reflected
/// of both whatever the colour. As element::lit has it.
struct Response {
  static constexpr int kParts = 4;
  float sun, up, rim, gloss;
};
inline Response ResponseOf(const glm::vec3& n, const glm::vec3& sun, const glm::vec3& to_eye) {
  Response response;
  const float facing = element::clamp01((element::dot3(n, sun) + 0.22F) * (1.0F / 1.22F));
  response.sun = facing * (facing * 0.4F + 0.6F);
  response.up = n.z * 0.5F + 0.5F;
  const float edge = 1.0F - element::clamp01(element::dot3(n, to_eye));
  response.rim = ((edge * edge) * edge) * (((n.z * n.z) * 0.65F + 0.35F) * 0.16F);
  float gloss = element::clamp01(element::dot3(n, element::unit3(sun + to_eye)));
  for (int power = 0; power < 4; ++power) gloss = gloss * gloss;
  response.gloss = (gloss * response.sun) * 0.035F;
  return response;
}

/// Responses of the six sides that are mixed by the squares of a normal's components. A side's own
/// response is right for what faces that way, and makes all between dark, since light grows faster
/// than it is mixed; what comes nearest for every normal that is seen (least squares, weighted by
/// how much of it is seen) makes what faces a side bright. Bodies are between: with a third of
/// the fit the built-in cast's figures of 7 pixels show what those of 28 do, in sun and in sky
/// light.
void FitResponses(const glm::vec3 (&sides)[6], const glm::vec3& sun, const glm::vec3& to_eye,
                  float (&fit)[6][Response::kParts]) {
  constexpr int kNormals = 96, kParts = Response::kParts;
  constexpr float kStay = 0.02F;  // what is hardly seen stays near its own
  double sum[6][6 + kParts] = {};
  for (int k = 0; k < 6; ++k) {
    const Response own = ResponseOf(sides[k], sun, to_eye);
    const float parts[kParts] = {own.sun, own.up, own.rim, own.gloss};
    sum[k][k] = kStay;
    for (int part = 0; part < kParts; ++part) {
      fit[k][part] = parts[part];
      sum[k][6 + part] = kStay * parts[part];
    }
  }
  for (int i = 0; i < kNormals; ++i) {
    // evenly over the sphere, by the golden angle
    const float z = 1.0F - (2.0F * static_cast<float>(i) + 1.0F) / kNormals;
    const float turn = static_cast<float>(i) * 2.39996323F;
    const element::SinCos at = element::sin_cos(element::wrap_angle(turn));
    const float ring = std::sqrt(1.0F - z * z);
    const glm::vec3 n(ring * at.cosine, ring * at.sine, z);
    const float seen = element::dot3(n, to_eye);
    if (!(seen > 0.0F)) continue;
    float share[6];
    for (int k = 0; k < 6; ++k) {
      const float along = std::max(element::dot3(n, sides[k]), 0.0F);
      share[k] = along * along;
    }
    const Response response = ResponseOf(n, sun, to_eye);
    const float parts[kParts] = {response.sun, response.up, response.rim, response.gloss};
    for (int k = 0; k < 6; ++k) {
      const float weight = seen * share[k];
      for (int j = 0; j < 6; ++j) sum[k][j] += weight * share[j];
      for (int part = 0; part < kParts; ++part) sum[k][6 + part] += weight * parts[part];
    }
  }
  // positive definite: no pivots
  for (int k = 0; k < 6; ++k) {
    for (int row = 0; row < 6; ++row) {
      if (row == k) continue;
      const double factor = sum[row][k] / sum[k][k];
      for (int j = k; j < 6 + kParts; ++j) sum[row][j] -= factor * sum[k][j];
    }
  }
  for (int k = 0; k < 6; ++k) {
    for (int part = 0; part < kParts; ++part) {
      const auto nearest = static_cast<float>(sum[k][6 + part] / sum[k][k]);
      fit[k][part] = std::max((2.0F * fit[k][part] + nearest) * (1.0F / 3.0F), 0.0F);
    }
  }
}

SpeckLight LightOf(const SpeckScene& speck_scene, float x_px, float y_px) {
  const SceneFrame& scene = *speck_scene.scene;
  SpeckLight light{};
  const glm::vec3 ray =
      (scene.ray_direction + scene.ray_direction_x * x_px) + scene.ray_direction_y * y_px;
  const glm::vec3 to_eye = element::unit3(ray * -1.0F);
  glm::vec3 ahead(to_eye.x, to_eye.y, 0.0F);
  if (ahead.x * ahead.x + ahead.y * ahead.y < 1e-4F) {
    ahead = -glm::vec3(speck_scene.camera_up.x, speck_scene.camera_up.y, 0.0F);
  }
  ahead = element::unit3(ahead);
  const glm::vec3 right(-ahead.y, ahead.x, 0.0F), up(0.0F, 0.0F, 1.0F);
  const glm::vec3 sides[6] = {right, -right, ahead, -ahead, up, -up};
  float fit[6][Response::kParts];
  FitResponses(sides, scene.sun_direction, to_eye, fit);
  for (int k = 0; k < 6; ++k) {
    float* row = light.row[k];
    for (int c = 0; c < 3; ++c) {
      const float sky = scene.sky_color[c], low = scene.ground_light[c];
      row[c] = 0.75F * fit[k][0] * scene.sun_color[c];
      row[4 + c] = 0.25F * fit[k][0] * scene.sun_color[c] + (low + fit[k][1] * (sky - low));
      row[8 + c] = fit[k][2] * sky + fit[k][3] * scene.sun_color[c];
    }
    for (int j = 0; j < 16; ++j) row[j] *= 1.0F / 255.0F;
  }
  const glm::mat4& m = speck_scene.grid->clip_from_relative;
  const float width = 0.5F * static_cast<float>(speck_scene.grid->width);
  const float height = 0.5F * static_cast<float>(speck_scene.grid->height);
  const float nx = 2.0F * x_px / width - 1.0F, ny = 1.0F - 2.0F * y_px / height;
  const float up_px = (m[2].y - ny * m[2].w) * 0.5F * height / scene.px_per_tangent;
  for (std::uint32_t e = 0; e < element::kSpeckElevations; ++e) {
    light.tall[e] =
        std::min(std::max(up_px / std::cos(element::kSpeckElevationRad[e]), 0.75F), 1.25F);
  }
  // shadows: a body of 0.43 m, as wide as that of a blob is on the average
  if (!scene.shadows) return light;
  const auto on_picture = [&](float x, float y) {
    const float dx = m[0].x * x + m[1].x * y, dy = m[0].y * x + m[1].y * y;
    const float dw = m[0].w * x + m[1].w * y;
    return glm::vec2((dx - nx * dw) * 0.5F * width, -(dy - ny * dw) * 0.5F * height) *
           (1.0F / (1.75F * scene.px_per_tangent));
  };
  InstanceShade figure{};
  figure.height_m = 1.75F;
  figure.feet_relative = glm::vec3(0.0F, 0.0F, scene.ground_relative_m);
  const element::Blob blob = element::make_blob(scene, figure);
  light.along = on_picture(blob.away.x, blob.away.y) * (blob.reach + 0.15F);
  light.across = on_picture(-blob.away.y * 0.43F, blob.away.x * 0.43F);
  const float slope = scene.orthographic ? 1.0F : element::clamp01(to_eye.z);
  light.shadow = 0.37F * (1.0F - element::exp2_negative(-55.0F * slope));
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
  const SpeckImage& image = table.image[placed.image];
  const float size_y = placed.size * light.tall[ElevationOf(placed.image)];
  const std::uint32_t level = LevelOf(size_y * (image.y_high - image.y_low));
  const std::uint32_t two = SpeckTable::columns(level) - 1;  // columns, as a shift
  const std::uint32_t rows = 1U << level, count = rows << two;
  const SpeckSlab* slabs = table.slab.data() + std::size_t{placed.image} * SpeckTable::kSlabs +
                           SpeckTable::first_slab(level);
  alignas(64) float tint[16];
  const element::Tints tints = element::tints_of(placed.seed);
  const glm::vec3 parts[5] = {glm::vec3(1.0F), tints.skin, tints.hair, tints.top, tints.bottom};
  for (int t = 0; t < 5; ++t) {
    for (int c = 0; c < 3; ++c) tint[3 * t + c] = parts[t][c] * (1.0F / (255.0F * 255.0F));
  }
  tint[15] = 0.0F;
  glm::vec3 shown(0.0F);
  if (scene.by_channel) {
    shown = element::channel_color(channel, {scene.channel_low, scene.channel_high, true});
    for (float& one : tint) one = 1.0F / (255.0F * 255.0F);
  }
  const float step = size_y * (image.y_high - image.y_low) / static_cast<float>(rows);
  const float bottom = placed.y - size_y * image.y_low;
  const float per_unit = placed.size * (1.0F / SpeckSlab::kPerHeight);
  const glm::vec3& horizon = scene.scene->horizon_color;
  figure.count = count;
  for (std::uint32_t k = 0; k < count; ++k) {
    const SpeckSlab& slab = slabs[k];
    figure.bottom[k] = bottom - step * static_cast<float>(k >> two);
    figure.top[k] = figure.bottom[k] - step;
    const float middle =
        placed.x + placed.lean * (placed.y - 0.5F * (figure.top[k] + figure.bottom[k]));
    figure.left[k] = middle + per_unit * static_cast<float>(slab.low);
    figure.right[k] = middle + per_unit * static_cast<float>(slab.high);
    float albedo[16];
    for (int j = 0; j < 16; ++j) {
      const float root = static_cast<float>(slab.tone[j]);
      albedo[j] = root * root * tint[j];
    }
    float row[16] = {};
    for (int f = 0; f < 6; ++f) {
      const float share = static_cast<float>(slab.facing[f]);
      for (int j = 0; j < 16; ++j) row[j] += share * light.row[f][j];
    }
    const float open = static_cast<float>(slab.open) * (1.0F / 255.0F);
    glm::vec3 base;
    for (int c = 0; c < 3; ++c) {
      base[c] = (albedo[c] + albedo[3 + c]) + (albedo[6 + c] + albedo[9 + c]) + albedo[12 + c];
    }
    if (scene.by_channel) {
      const float luma = (base.x * 0.2126F + base.y * 0.7152F) + base.z * 0.0722F;
      base = shown * (std::sqrt(luma) * 0.45F + 0.55F);
    }
    glm::vec3 color;
    for (int c = 0; c < 3; ++c) {
      color[c] = base[c] * (row[c] + open * row[4 + c]) + open * row[8 + c];
      color[c] = horizon[c] + placed.clear * (color[c] - horizon[c]);
    }
    color = element::tone_map(color);
    const float fill = static_cast<float>(slab.fill) * (1.0F / 255.0F);
    figure.color[k][0] = color.x * fill;
    figure.color[k][1] = color.y * fill;
    figure.color[k][2] = color.z * fill;
    figure.color[k][3] = fill;
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
    const float size_y = placed.size * light.tall[ElevationOf(placed.image)];
    const float up_low = placed.y - size_y * image.y_high - static_cast<float>(y_px);
    const float up_high = placed.y - size_y * image.y_low - static_cast<float>(y_px);
    const float lean_low = placed.lean * size_y * image.y_low;
    const float lean_high = placed.lean * size_y * image.y_high;
    const float left = placed.x + placed.size * image.x_low + std::min(lean_low, lean_high) -
                       static_cast<float>(x_px);
    const float right = placed.x + placed.size * image.x_high + std::max(lean_low, lean_high) -
                        static_cast<float>(x_px);
    const int x0 = std::max(static_cast<int>(std::floor(left)), 0);
    const int x1 = std::min(static_cast<int>(std::floor(right)), kTilePx - 1);
    const int y0 = std::max(static_cast<int>(std::floor(up_low)), 0);
    const int y1 = std::min(static_cast<int>(std::floor(up_high)), kTilePx - 1);
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
    constexpr float kLeast = 0.02F;
    bool is_seen = false;
    for (int y = y0; y <= y1 && !is_seen; ++y) {
      for (int x = x0; x <= x1; ++x) {
        if (Sum(seen_through(places(x, y))) > 4.0F * kLeast) {
          is_seen = true;
          break;
        }
      }
    }
    if (!is_seen) continue;
    const auto number = static_cast<std::uint32_t>(batch.entries[e]);
    ShadeFigure(scene, light, *batch.table, placed,
                scene.by_channel ? batch.specks[number].channel : 0.0F, figure);
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
        float* rgb = tile.rgb[y * kTilePx + x];
        Store(Load(rgb) + color * All(0.25F * Sum(through)), rgb);
        StoreSamples(LoadSamples(tile.through + at) - through * All(alpha), tile.through + at);
      }
    }
  }
}

void BlendSpecks(const SpeckBatch& batch, const SpeckScene& scene, int x_px, int y_px,
                 const TilePlanes* planes, SpeckTile& tile) {
  const SpeckLight light = LightOf(scene, static_cast<float>(x_px + kTilePx / 2),
                                   static_cast<float>(y_px + kTilePx / 2));
  if (planes != nullptr) {
    DrawSpecks<true>(batch, scene, light, x_px, y_px, planes, tile);
  } else {
    DrawSpecks<false>(batch, scene, light, x_px, y_px, planes, tile);
  }
}

/// A shadow is a slanted box on the picture: rows of one width if it runs up or down, else columns
/// of one height. Only its area is exact.
void ShadeSpecks(const SpeckBatch& batch, const SpeckScene& scene, int x_px, int y_px,
                 float* missing) {
  const SpeckLight light = LightOf(scene, static_cast<float>(x_px + kTilePx / 2),
                                   static_cast<float>(y_px + kTilePx / 2));
  const glm::vec2 along = light.along;
  const float area = std::fabs(along.x * light.across.y - along.y * light.across.x);
  const bool is_tall = std::fabs(along.y) > std::fabs(along.x);
  const float run = is_tall ? along.y : along.x, slide = is_tall ? along.x : along.y;
  if (!(std::fabs(run) > 1e-4F) || light.shadow < 0.01F) return;
  const float slant = slide / run, across = area / std::fabs(run);
  const int stride_run = is_tall ? kTilePx : 1, stride_across = is_tall ? 1 : kTilePx;
  for (std::size_t e = 0; e < batch.count; ++e) {
    const PlacedSpeck& placed = batch.placed[e];
    const float strength = light.shadow * placed.clear;
    if (strength < 0.01F) continue;
    const float x = placed.x - static_cast<float>(x_px), y = placed.y - static_cast<float>(y_px);
    const float u = is_tall ? y : x, v = is_tall ? x : y;
    // thinner than a pixel: as wide as one, and weaker
    const float length = run * placed.size;
    const float low = u + std::min(length, 0.0F), high = u + std::max(length, 0.0F);
    const float half = 0.5F * across * placed.size;
    const int u0 = std::max(static_cast<int>(std::floor(low)), 0);
    const int u1 = std::min(static_cast<int>(std::floor(high)), kTilePx - 1);
    for (int i = u0; i <= u1; ++i) {
      const float from_u = std::max(low, static_cast<float>(i));
      const float to_u = std::min(high, static_cast<float>(i + 1));
      const float deep = (to_u - from_u) * strength;
      const float middle = v + slant * (0.5F * (from_u + to_u) - u);
      const float from = middle - half, to = middle + half;
      const int v0 = std::max(static_cast<int>(std::floor(from)), 0);
      const int v1 = std::min(static_cast<int>(std::floor(to)), kTilePx - 1);
      for (int j = v0; j <= v1; ++j) {
        const float wide =
            std::min(to, static_cast<float>(j + 1)) - std::max(from, static_cast<float>(j));
        float& out = missing[i * stride_run + j * stride_across];
        out += (1.0F - out) * (deep * std::max(wide, 0.0F));
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
    const SpeckImage& image = table.image[placed.image];
    const float lean = std::fabs(placed.lean) * placed.size;
    const float aside = shadows ? placed.size : 0.0F;  // about as far as shadows reach
    const float x0 = placed.x + placed.size * image.x_low - lean - aside;
    const float x1 = placed.x + placed.size * image.x_high + lean + aside;
    const float y0 = placed.y - 1.25F * placed.size * image.y_high;
    const float y1 = placed.y - 1.25F * placed.size * image.y_low + 0.5F * aside;
    if (!(x1 > 0.0F && y1 > 0.0F && x0 < width && y0 < height)) return;
    const auto tile_of = [](float at, float size) {
      return static_cast<std::uint32_t>(std::clamp(at, 0.0F, size - 1.0F)) / kTilePx;
    };
    const std::uint32_t tx1 = tile_of(x1, width), ty1 = tile_of(y1, height);
    for (std::uint32_t ty = tile_of(y0, height); ty <= ty1; ++ty) {
      for (std::uint32_t tx = tile_of(x0, width); tx <= tx1; ++tx) visit(ty * tiles_x + tx);
    }
  };
  pool.run(runs.size(), [&](std::size_t r, unsigned) {
    HWY_DYNAMIC_DISPATCH(PlaceSpecks)
    (geometry.specks.data() + runs[r].first, runs[r].count, table, scene,
     placed_.data() + runs[r].first);
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
   scene, x_px, y_px, planes, result);
}

void SpeckStage::shade(std::size_t tile, int x_px, int y_px, const FrameGeometry& geometry,
                       const SpeckScene& scene, SpeckScratch& scratch, float* missing) const {
  const std::span<const std::uint64_t> list = bins_.of(tile);
  gather(list, scratch.placed);
  HWY_DYNAMIC_DISPATCH(ShadeSpecks)
  ({geometry.specks.data(), geometry.speck_table, scratch.placed.data(), list.data(), list.size()},
   scene, x_px, y_px, missing);
}

}  // namespace throng::render::visibility
#endif
