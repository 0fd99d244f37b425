#pragma once

#include <cmath>
#include <glm/glm.hpp>

#include "render/raster/element/color.hpp"
#include "render/raster/element/scene_frame.hpp"
#include "render/raster/element/tint.hpp"
#include "throng/render/vertex.hpp"

namespace throng::render::element {

/// The channel's part of a Look.
struct ChannelRange {
  float low, high;
  bool colors;  // agents by their channel
  ColorMap map;
};

THRONG_HOST_DEVICE inline glm::vec3 channel_color(float value, const ChannelRange& range) {
  if (!(std::fabs(value) <= 3.4028235e38F)) return {0.32F, 0.32F, 0.33F};  // not finite
  const float extent = range.high - range.low;
  return map_color(range.map, extent != 0.0F ? (value - range.low) / extent : 0.5F);
}

/// What shading needs of a visible instance; who casts a projected shadow is chosen later.
/// @param height_m  of the character, unscaled.
/// @param toned_count  CornerTones::most_vertices() of the character.
/// @param first_surrounding  first member of the cast that is no character: all have its texture.
THRONG_HOST_DEVICE inline InstanceShade instance_shade(const VisibleInstance& instance,
                                                       float height_m, std::uint32_t toned_count,
                                                       const SceneFrame& scene,
                                                       const ChannelRange& range,
                                                       std::uint32_t first_surrounding) {
  InstanceShade shade;
  shade.feet_relative = instance.position_relative;
  shade.height_m = (height_m < 0.05F ? 0.05F : height_m) * instance.scale;
  const Tints tints = tints_of(instance.seed);
  shade.tint[0] = pack_tint(tints.skin);
  shade.tint[1] = pack_tint(tints.hair);
  shade.tint[2] = pack_tint(tints.top);
  shade.tint[3] = pack_tint(tints.bottom);
  shade.character = instance.character;
  if (toned_count > 0 && instance.vertex_count <= toned_count) shade.character |= kToned;
  shade.channel = range.colors ? pack_color(channel_color(instance.channel, range)) : kNoChannel;
  shade.cast_shadow = 0.0F;
  const glm::vec3& p = instance.position_relative;
  const float away_m = std::sqrt((p.x * p.x + p.y * p.y) + p.z * p.z);
  const float distance_m = scene.orthographic ? 1.0F : (away_m < 0.1F ? 0.1F : away_m);
  shade.size_px = shade.height_m * scene.px_per_tangent / distance_m;
  if (instance.character >= first_surrounding) {
    shade.character = first_surrounding;
    shade.channel = kNoChannel;
    shade.cast_shadow = kNoBlob;
  }
  return shade;
}

/// Figures cast a projected shadow from this height on, fading in up to the second.
inline constexpr float kCastShadowFromPx = 40.0F, kCastShadowFullPx = 64.0F;

THRONG_HOST_DEVICE inline float cast_shadow_of(float size_px) {
  return glm::smoothstep(kCastShadowFromPx, kCastShadowFullPx, size_px);
}

/// Triangles that cast shadows may have in all: an eighth of the figures' own.
THRONG_HOST_DEVICE inline std::uint64_t shadow_room(std::uint64_t triangles_drawn) {
  constexpr std::uint64_t kLeast = 120'000;
  const std::uint64_t share = triangles_drawn / 8;
  return share < kLeast ? kLeast : share;
}

/// Vertices a caster's shadow is drawn with: it shows less than the figure, a quarter of its
/// vertices, and the smaller it is the less.
THRONG_HOST_DEVICE inline std::uint32_t shadow_vertices(std::uint32_t vertex_count,
                                                        std::uint32_t most_of_a_level,
                                                        float size_px) {
  constexpr std::uint32_t kLeast = 96;
  const float shown = 2.0F * (size_px < 4096.0F ? size_px : 4096.0F);
  const auto seen = static_cast<std::uint32_t>(shown);
  const std::uint32_t quarter = vertex_count / 4 < seen ? vertex_count / 4 : seen;
  return quarter < kLeast ? kLeast : (quarter < most_of_a_level ? quarter : most_of_a_level);
}

/// Of the room, what the shadow of a figure of so many triangles takes (two for each vertex).
THRONG_HOST_DEVICE inline std::uint32_t shadow_charge(std::uint32_t triangles, float size_px) {
  const std::uint32_t drawn = 2 * shadow_vertices(triangles / 2, 0xffffffffU, size_px);
  return drawn < triangles ? drawn : triangles;
}

}  // namespace throng::render::element
