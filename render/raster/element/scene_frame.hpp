#pragma once

#include <cstdint>
#include <glm/glm.hpp>

// GLM only: .cu files include it.
namespace throng::render {

/// The light, ground and rays of one frame, as every rasterizer's shading takes them. "Relative" is
/// relative to the eye, world axes; colours are linear.
struct SceneFrame {
  glm::vec3 sun_direction;  // unit, towards the sun
  glm::vec3 sun_color, sky_color, ground_light, horizon_color, ground_color;
  float ground_relative_m;  // height of the ground plane
  bool ground, shadows, orthographic;
  // the ray through pixel coordinates (x, y), y down, centres at halves:
  // origin + origin_x * x + origin_y * y, and likewise its direction (forward component 1 m)
  glm::vec3 ray_origin, ray_origin_x, ray_origin_y;
  glm::vec3 ray_direction, ray_direction_x, ray_direction_y;
  glm::vec2 grid_eye;    // the eye's place within 20 m, the period of the ground
  float haze_per_m;      // over 1 / haze_per_m metres half of a colour goes to the horizon's
  float px_per_tangent;  // pixels of a metre at a distance of 1 m (perspective) or anywhere
};

/// What shading needs of one visible instance.
struct InstanceShade {
  glm::vec3 feet_relative;
  float height_m;
  std::uint32_t tint[4];    // skin, hair, top, bottom: element::pack_tint
  std::uint32_t character;  // its textures; with kToned, it shows tones instead
  std::uint32_t channel;    // element::pack_color, or kNoChannel
  float cast_shadow;  // share of the shadow drawn as the figure's projection, the rest is a blob;
                      // kNoBlob: all of it, and nothing where it touches the ground
  float size_px;      // the figure's height on the picture
};
inline constexpr std::uint32_t kNoChannel = 0xffffffffU;
inline constexpr float kNoBlob = 2.0F;
inline constexpr std::uint32_t kToned = 0x80000000U;
static_assert(sizeof(InstanceShade) == 48);

}  // namespace throng::render
