#pragma once

#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>

#include "render/compute/element/host_device.hpp"
#include "render/raster/element/scene_frame.hpp"

// The shadows that figures throw on the surroundings. gl/shaders.cpp says the same in its language.
namespace throng::render::element {

/// Figures by where they stand: lists of a hash of square cells, in any order.
struct FigureCells {
  static constexpr std::uint32_t kCount = 1U << 14;
  static constexpr std::uint32_t kNobody = 0xffffffffU;
  std::uint32_t* first = nullptr;  // [kCount] of the visible list, or kNobody
  std::uint32_t* next = nullptr;   // [V]
  float top_relative_m = 1e9F;     // nobody is higher
};
inline constexpr float kFigureCellM = 2.0F;
/// Shadows end so far from who throws them, and so far beside the way to the sun.
inline constexpr float kFarthestGapM = 6.0F, kWidestFigureM = 0.6F;
/// Surfaces within this of the ground show the ground's own shadows, and throw none on it.
inline constexpr float kFloorM = 0.04F;

THRONG_HOST_DEVICE inline std::int32_t figure_cell(float at_m) {
  const float cell = std::floor(at_m * (1.0F / kFigureCellM));
  return static_cast<std::int32_t>(cell < -1e6F ? -1e6F : (cell < 1e6F ? cell : 1e6F));
}
THRONG_HOST_DEVICE inline std::uint32_t figure_list(std::int32_t x, std::int32_t y) {
  return (static_cast<std::uint32_t>(x) * 73856093U ^ static_cast<std::uint32_t>(y) * 19349663U) &
         (FigureCells::kCount - 1);
}

/// Adds a figure to the list of its cell. On a device kernels do it, with atomics.
inline void list_figure(FigureCells& figures, const InstanceShade& figure, std::uint32_t number) {
  const glm::vec3& feet = figure.feet_relative;
  std::uint32_t& first = figures.first[figure_list(figure_cell(feet.x), figure_cell(feet.y))];
  figures.next[number] = first;
  first = number;
  const float top = feet.z + figure.height_m * (2.2F / 1.75F);
  if (top > figures.top_relative_m) figures.top_relative_m = top;
}

/// The sun as surroundings see it: where it stands on the ground, unit, and how far a ray to it
/// rises on each metre. Overhead it throws nothing on walls.
struct Sunward {
  glm::vec2 toward;
  float rise;
  bool overhead;
};
THRONG_HOST_DEVICE inline Sunward sunward(const SceneFrame& scene) {
  const glm::vec2 flat(scene.sun_direction.x, scene.sun_direction.y);
  const float length = std::sqrt(flat.x * flat.x + flat.y * flat.y);
  if (!(length > 1e-3F)) return {glm::vec2(1.0F, 0.0F), 0.0F, true};
  const float up = scene.sun_direction.z;
  return {flat / length, (up < 0.05F ? 0.05F : up) / length, false};
}

/// Share of the sun's light that a figure keeps from a point: its outline, two legs, a trunk and a
/// head, faces the sun; the edge softens with the way to it.
THRONG_HOST_DEVICE inline float figure_shadow(const Sunward& sun, const InstanceShade& figure,
                                              const glm::vec3& p) {
  const auto within = [](float v, float low, float high) {
    return v < low ? low : (v < high ? v : high);
  };
  const float dx = figure.feet_relative.x - p.x, dy = figure.feet_relative.y - p.y;
  const float gap_m = dx * sun.toward.x + dy * sun.toward.y;
  const float aside_m = std::fabs(dy * sun.toward.x - dx * sun.toward.y);
  const float per_meter = 1.75F / figure.height_m;
  if (!(aside_m < kWidestFigureM) || !(gap_m < kFarthestGapM) || !(gap_m * per_meter > -0.25F)) {
    return 0.0F;
  }
  const float gap = gap_m < 0.0F ? 0.0F : gap_m;
  const float x = aside_m * per_meter;
  const float z = ((p.z - figure.feet_relative.z) + gap * sun.rise) * per_meter;
  if (!(z < 2.2F) || !(z > -0.3F)) return 0.0F;
  const auto away = [&](float side, float low, float high, float radius) {
    const float off = z - within(z, low, high), beside = x - side;
    return std::sqrt(beside * beside + off * off) - radius;
  };
  const float legs = away(0.09F, 0.05F, 0.80F, 0.085F);
  const float trunk = away(0.0F, 0.86F, 1.24F, 0.19F);
  const float head = away(0.0F, 1.61F, 1.64F, 0.105F);
  float off = legs < trunk ? legs : trunk;
  off = head < off ? head : off;
  const float soft = 0.05F + 0.08F * gap;
  const float covered = within(0.5F - off / soft, 0.0F, 1.0F);
  const float before = within(1.0F + gap_m * per_meter * 4.0F, 0.0F, 1.0F);
  const float near = within(kFarthestGapM - gap, 0.0F, 1.0F);
  return covered * (before * near) * (0.56F - 0.14F * within(z * (1.0F / 1.75F), 0.0F, 1.0F));
}

/// The strongest shadow of a figure on a point of the surroundings.
THRONG_HOST_DEVICE inline float strongest_figure_shadow(const Sunward& sun,
                                                        const FigureCells& figures,
                                                        const InstanceShade* shades,
                                                        const glm::vec3& p) {
  if (sun.overhead) return 0.0F;
  float reach = (figures.top_relative_m - p.z) / sun.rise;
  if (!(reach > 0.0F)) return 0.0F;
  reach = reach < kFarthestGapM ? reach : kFarthestGapM;
  const float to_x = p.x + sun.toward.x * reach, to_y = p.y + sun.toward.y * reach;
  constexpr float kMargin = kWidestFigureM;
  const std::int32_t x0 = figure_cell((p.x < to_x ? p.x : to_x) - kMargin);
  const std::int32_t x1 = figure_cell((p.x < to_x ? to_x : p.x) + kMargin);
  const std::int32_t y0 = figure_cell((p.y < to_y ? p.y : to_y) - kMargin);
  const std::int32_t y1 = figure_cell((p.y < to_y ? to_y : p.y) + kMargin);
  float strongest = 0.0F;
  for (std::int32_t y = y0; y <= y1; ++y) {
    for (std::int32_t x = x0; x <= x1; ++x) {
      for (std::uint32_t i = figures.first[figure_list(x, y)]; i != FigureCells::kNobody;
           i = figures.next[i]) {
        const float shadow = figure_shadow(sun, shades[i], p);
        strongest = strongest < shadow ? shadow : strongest;
      }
    }
  }
  return strongest;
}

/// Share of what a point of the surroundings shows that shadows take, in steps of
/// 1 / kSurfaceShadowSteps.
/// @param corner  of its triangle, relative to the eye.
/// @param x_px, y_px  pixel coordinates of the point.
/// @param ground_missing  what shadows take from the ground there.
inline constexpr std::uint32_t kSurfaceShadowSteps = 4095;
THRONG_HOST_DEVICE inline std::uint32_t surface_shadow(const SceneFrame& scene, const Sunward& sun,
                                                       const FigureCells& figures,
                                                       const InstanceShade* shades,
                                                       const glm::vec3 corner[3], float x_px,
                                                       float y_px, float ground_missing) {
  const glm::vec3 ray =
      (scene.ray_direction + scene.ray_direction_x * x_px) + scene.ray_direction_y * y_px;
  glm::vec3 origin(0.0F, 0.0F, 0.0F);
  if (scene.orthographic) {
    origin = (scene.ray_origin + scene.ray_origin_x * x_px) + scene.ray_origin_y * y_px;
  }
  const auto dot = [](const glm::vec3& a, const glm::vec3& b) {
    return (a.x * b.x + a.y * b.y) + a.z * b.z;
  };
  const glm::vec3 a = corner[1] - corner[0], b = corner[2] - corner[0];
  const glm::vec3 n(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
  const float slope = dot(n, ray), length = std::sqrt(dot(n, n));
  if (!(std::fabs(slope) > 1e-20F) || !(length > 1e-20F)) return 0;
  const glm::vec3 p = origin + ray * (dot(n, corner[0] - origin) / slope);
  const float side = (slope > 0.0F ? -1.0F : 1.0F) / length;  // the side that is seen
  float missing = 0.0F;
  if (std::fabs(p.z - scene.ground_relative_m) < kFloorM && n.z * side > 0.7F) {
    missing = ground_missing;
  } else {
    float facing = dot(n, scene.sun_direction) * side * 2.5F;
    if (!(facing > 0.0F)) return 0;
    facing = facing < 1.0F ? facing : 1.0F;
    missing = strongest_figure_shadow(sun, figures, shades, p) * facing;
    if (!scene.orthographic) {
      // through haze less is seen of it
      missing = missing / (1.0F + std::sqrt(dot(p, p)) * scene.haze_per_m);
    }
  }
  missing = missing < 1.0F ? missing : 1.0F;
  return static_cast<std::uint32_t>(missing * static_cast<float>(kSurfaceShadowSteps) + 0.5F);
}

/// What is left of a surface's light.
THRONG_HOST_DEVICE inline float surface_kept(std::uint32_t shadow_steps) {
  return 1.0F - static_cast<float>(shadow_steps) * (1.0F / kSurfaceShadowSteps);
}

/// Whether a wall's triangle throws a shadow on the ground: a floor doesn't.
THRONG_HOST_DEVICE inline bool throws_shadow(const SceneFrame& scene, float z0_relative_m,
                                             float z1_relative_m, float z2_relative_m) {
  const float floor_m = scene.ground_relative_m + kFloorM;
  return z0_relative_m > floor_m || z1_relative_m > floor_m || z2_relative_m > floor_m;
}

}  // namespace throng::render::element
