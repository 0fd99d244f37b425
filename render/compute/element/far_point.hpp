#pragma once

#include <cstring>
#include <glm/glm.hpp>

#include "render/compute/element/gait.hpp"
#include "render/compute/element/octahedral.hpp"
#include "render/compute/element/pose.hpp"
#include "render/compute/element/skinning.hpp"
#include "render/raster/element/color.hpp"
#include "throng/render/far_points.hpp"
#include "throng/render/vertex.hpp"

// The points of a far crowd's agents (Larkin et al.; FarCrowd).
namespace throng::render::element {

inline constexpr std::uint32_t kFarPhases = 8;  // of a walk
inline constexpr std::uint32_t kFarPoses = 1 + kFarPhases;
inline constexpr std::uint32_t kFarPointsOfPose = 1788;  // sum of FarFigures::kCounts

/// Where the finest level of at most so many points begins among those of a pose
/// (FarFigures::kCounts: 1, 2, then two steps for each doubling).
THRONG_HOST_DEVICE inline std::uint32_t far_level_begin(std::uint32_t points) {
  std::uint32_t begin = 0, count = 1;
  for (;;) {
    const bool is_power = (count & (count - 1)) == 0;
    const std::uint32_t next = count == 1 ? 2 : (is_power ? count + count / 2 : count / 3 * 4);
    if (next > points || next > 512) return begin;
    begin += count;
    count = next;
  }
}

THRONG_HOST_DEVICE inline bool far_is_within(const ClipRange& clip, std::uint32_t frame) {
  return frame >= clip.first_frame && frame - clip.first_frame < clip.frame_count;
}

/// Which pose of FarFigures is nearest.
THRONG_HOST_DEVICE inline std::uint32_t far_pose(const Pose& pose, const Gait& gait) {
  const ClipRange& walk = gait.walk.frame_count != 0 ? gait.walk : gait.run;
  if (!far_is_within(walk, pose.a_frame0)) return 0;
  if (pose.b_weight > 0.5F && far_is_within(gait.idle, pose.b_frame0)) return 0;
  const float phase = (static_cast<float>(pose.a_frame0 - walk.first_frame) + pose.a_t) /
                      static_cast<float>(walk.frame_count);
  const auto nearest = static_cast<std::uint32_t>(phase * static_cast<float>(kFarPhases) + 0.5F);
  return 1 + nearest % kFarPhases;
}

/// Where in FarFigures::points those of an agent begin.
THRONG_HOST_DEVICE inline std::uint32_t far_first_point(std::uint32_t block, std::uint32_t pose,
                                                        std::uint32_t points) {
  return (block * kFarPoses + pose) * kFarPointsOfPose + far_level_begin(points);
}

/// An agent as each of its points needs it.
struct FarFigure {
  glm::vec3 feet_relative;
  float height_m;
  float cosine, sine;  // of the heading
  float radius;        // FarShare's
};

THRONG_HOST_DEVICE inline FarFigure far_figure(const glm::vec3& feet_relative, float heading_rad,
                                               float height_m, float radius) {
  const Placement turned = place(heading_rad, 1.0F);
  return {feet_relative, height_m, turned.cosine_scale, turned.sine_scale, radius};
}

THRONG_HOST_DEVICE inline glm::vec3 far_place(const FarFigure& figure, const glm::vec3& q) {
  return glm::vec3(
      figure.feet_relative.x + figure.height_m * (q.x * figure.cosine - q.y * figure.sine),
      figure.feet_relative.y + figure.height_m * (q.x * figure.sine + q.y * figure.cosine),
      figure.feet_relative.z + figure.height_m * q.z);
}

THRONG_HOST_DEVICE inline glm::i16vec2 far_normal(float x, float y, float z) {
  const std::uint32_t code = pack_octahedral(x, y, z);
  return glm::i16vec2(static_cast<std::int16_t>(code & 0xffffU),
                      static_cast<std::int16_t>(code >> 16));
}

/// A point of the cloud that all share. The mean of many shapes has no clear sides, so it always
/// faces the eye.
THRONG_HOST_DEVICE inline Splat far_cloud_splat(const FarFigure& figure, const glm::vec3& position,
                                                const glm::vec3& normal, std::uint32_t color) {
  return {far_place(figure, position),
          -figure.radius * figure.height_m,
          far_normal(normal.x * figure.cosine - normal.y * figure.sine,
                     normal.x * figure.sine + normal.y * figure.cosine, normal.z),
          color,
          0,
          kNobody};
}

/// From where an agent is seen, and what it wears.
struct FarLook {
  glm::vec3 to_eye;
  float level;        // squared cosine of the eye's elevation
  glm::vec3 tint[4];  // skin, hair, top, bottom
};

/// @param tints  [4] pack_tint
THRONG_HOST_DEVICE inline FarLook far_look(const FarFigure& figure, const std::uint32_t* tints) {
  FarLook look;
  const glm::vec3& feet = figure.feet_relative;
  float length = std::sqrt((feet.x * feet.x + feet.y * feet.y) + feet.z * feet.z);
  if (!(length > 1e-6F)) length = 1e-6F;  // at the eye
  look.to_eye = glm::vec3(-feet.x / length, -feet.y / length, -feet.z / length);
  look.level = 1.0F - look.to_eye.z * look.to_eye.z;
  for (int k = 0; k < 4; ++k) look.tint[k] = 2.0F * unpack_color(tints[k]);  // they are halves
  return look;
}

/// A point of the agent's own figure.
THRONG_HOST_DEVICE inline Splat far_figure_splat(const FarFigure& figure, const FarLook& look,
                                                 const FarFigurePoint& point) {
  Splat splat;
  splat.position_relative = far_place(figure, point.position);
  const float radius_m = point.radius * figure.radius * figure.height_m;
  splat.radius_m = radius_m;
  splat.regions = 0;
  splat.visible = kNobody;
  if (radius_m < 0.0F && point.squeeze < 1.0F) {
    // of an upright body: the steeper it is looked at, the rounder it is
    const float seen = std::sqrt(point.squeeze * point.squeeze * (1.0F - look.level) + look.level);
    splat.radius_m = radius_m * seen;
    splat.regions = static_cast<std::uint32_t>(255.0F * point.squeeze / seen + 0.5F);
  }
  // what goes round an upright figure shows the eye its sides, the less the steeper it looks
  const glm::vec3& n = point.normal;
  const float length = std::sqrt((n.x * n.x + n.y * n.y) + n.z * n.z);
  const float round = radius_m < 0.0F && length < 1.0F ? 1.0F - length : 0.0F;
  splat.normal = far_normal(n.x * figure.cosine - n.y * figure.sine + round * look.to_eye.x,
                            n.x * figure.sine + n.y * figure.cosine + round * look.to_eye.y,
                            n.z + round * point.squeeze * look.to_eye.z);
  float plain = 1.0F;
  glm::vec3 worn(0.0F);
  for (int r = 0; r < 4; ++r) {
    const float part = static_cast<float>(point.regions >> (8 * r) & 255U) / 255.0F;
    plain -= part;
    worn += part * look.tint[r];
  }
  if (!(plain > 0.0F)) plain = 0.0F;
  splat.base = pack_color(unpack_color(point.base) * (glm::vec3(plain) + worn));
  return splat;
}

}  // namespace throng::render::element
