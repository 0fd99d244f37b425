#pragma once

#include <cstdint>

#include "render/compute/element/gait.hpp"
#include "render/compute/element/pose.hpp"

namespace throng::render::element {

/// Who is a few pixels high is drawn from a picture of a few slabs (SpeckTable). A character has
/// one for each of these poses, elevations and azimuths.
inline constexpr std::uint32_t kSpeckPhases = 8;
inline constexpr std::uint32_t kSpeckPoses = 1 + kSpeckPhases;  // standing, then a walk's phases
inline constexpr std::uint32_t kSpeckElevations = 4;            // 0, 25, 50, 75 degrees
inline constexpr std::uint32_t kSpeckAzimuths = 16;
inline constexpr std::uint32_t kSpeckImages = kSpeckPoses * kSpeckElevations * kSpeckAzimuths;

/// Which of kSpeckAzimuths sectors a direction points to: sector 0 is around +X, then towards +Y.
THRONG_HOST_DEVICE inline std::uint32_t speck_azimuth(float x, float y) {
  const float ax = x < 0.0F ? -x : x, ay = y < 0.0F ? -y : y;
  const bool is_steep = ay > ax;
  const float small = is_steep ? ax : ay, large = is_steep ? ay : ax;
  // sectors' edges lie at 11.25 and 33.75 degrees
  std::uint32_t k = small < 0.19891237F * large ? 0U : (small < 0.66817864F * large ? 1U : 2U);
  if (is_steep) k = 4U - k;
  if (x < 0.0F) k = 8U - k;
  if (y < 0.0F) k = 16U - k;
  return k & 15U;
}

/// Of the eye over the agent; edges half way between the elevations. @param sine  of the angle.
THRONG_HOST_DEVICE inline std::uint32_t speck_elevation(float sine) {
  return (sine > 0.2164396F ? 1U : 0U) + (sine > 0.6087614F ? 1U : 0U) +
         (sine > 0.8870108F ? 1U : 0U);
}
inline constexpr float kSpeckElevationRad[kSpeckElevations] = {0.0F, 0.43633231F, 0.87266463F,
                                                               1.30899694F};

THRONG_HOST_DEVICE inline std::uint32_t speck_phase(double cycles) {
  const auto fraction = static_cast<float>(cycles - std::floor(cycles));
  return 1U + (static_cast<std::uint32_t>(fused(fraction, static_cast<float>(kSpeckPhases), 0.5F)) &
               (kSpeckPhases - 1U));
}

/// The pose of who is told nothing. Below a quarter of the walk's speed a stride is less than half
/// as long: that is nearly standing.
THRONG_HOST_DEVICE inline std::uint32_t gait_speck_pose(const Gait& gait, float speed_mps,
                                                        double walked_cycles) {
  const bool has_walk = gait.walk.frame_count != 0 || gait.run.frame_count != 0;
  if (!has_walk || speed_mps < 0.25F * gait.walk_speed_mps) return 0;
  return speck_phase(walked_cycles);
}

THRONG_HOST_DEVICE inline std::uint32_t speck_pose(const Pose& pose, const Gait& gait) {
  if (pose.action != 0) return 0;  // stands, or sits a pixel lower
  const ClipRange& walk = gait.walk.frame_count != 0 ? gait.walk : gait.run;
  const std::uint32_t frame = pose.a_frame0 - walk.first_frame;
  if (pose.a_frame0 < walk.first_frame || frame >= walk.frame_count) return 0;
  const std::uint32_t b = pose.b_frame0 - gait.idle.first_frame;
  if (pose.b_weight > 0.5F && pose.b_frame0 >= gait.idle.first_frame && b < gait.idle.frame_count) {
    return 0;  // nearly standing
  }
  return speck_phase(static_cast<double>(static_cast<float>(frame) + pose.a_t) /
                     static_cast<double>(walk.frame_count));
}

}  // namespace throng::render::element
