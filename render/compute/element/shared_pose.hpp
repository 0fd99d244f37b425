#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/frustum.hpp"
#include "render/compute/element/gait.hpp"
#include "render/compute/element/hash.hpp"
#include "render/compute/element/pose.hpp"
#include "render/compute/element/selection.hpp"
#include "throng/render/vertex.hpp"

namespace throng::render::element {

/// Poses that far agents share: each clip at fixed phases, walk mixed with idle and with run in
/// fixed shares, then the actions. A pose's number counts within its character.
inline constexpr std::uint32_t kPhases = 128;
inline constexpr std::uint32_t kShares = 16;
inline constexpr std::uint32_t kFirstActionRow = 1 + 2 * kShares;
inline constexpr std::uint32_t kSharedPoses = kPhases * (kFirstActionRow + kMostActions);

/// How coarsely an agent takes its pose: tier k uses every 2^k-th phase and share.
inline constexpr std::uint32_t kTiers = 4;

/// The nearest of the poses that a tier offers.
///
/// Off by half a step at most. A walk of the built-in cast moves the surface by 1.2 m in a cycle
/// (root mean square over the figure at the fastest moment; the toes by 4 m), and standing differs
/// from walking by 0.2 m.
THRONG_HOST_DEVICE inline std::uint32_t shared_pose_of(const Pose& pose, const Gait& gait,
                                                       std::uint32_t tier) {
  const auto is_within = [](const ClipRange& clip, std::uint32_t frame) {
    return frame >= clip.first_frame && frame - clip.first_frame < clip.frame_count;
  };
  const auto nearest_phase = [tier](float cycles) {
    const float steps = static_cast<float>(kPhases >> tier);
    const auto nearest = static_cast<std::uint32_t>(fused(cycles, steps, 0.5F));
    return (nearest << tier) & (kPhases - 1);
  };
  const auto phase_of = [&](const ClipRange& clip, std::uint32_t frame, float t) {
    return nearest_phase((static_cast<float>(frame - clip.first_frame) + t) /
                         static_cast<float>(clip.frame_count));
  };
  const auto share_of = [tier](float share) {
    const float steps = static_cast<float>(kShares >> tier);
    return static_cast<std::uint32_t>(fused(share, steps, 0.5F)) << tier;
  };
  if (pose.action != 0) {
    return kPhases * (kFirstActionRow + pose.action - 1) + nearest_phase(pose.action_cycles);
  }
  if (is_within(gait.idle, pose.a_frame0)) return phase_of(gait.idle, pose.a_frame0, pose.a_t);
  const ClipRange& walk = gait.walk.frame_count != 0 ? gait.walk : gait.run;
  const std::uint32_t phase = phase_of(walk, pose.a_frame0, pose.a_t);
  if (!(pose.b_weight > 0.0F)) return kPhases * kShares + phase;
  if (is_within(gait.run, pose.b_frame0) && gait.walk.frame_count != 0) {
    const std::uint32_t run = share_of(pose.b_weight);
    return kPhases * (run == 0 ? kShares : kShares + run) + phase;
  }
  const std::uint32_t moving = share_of(1.0F - pose.b_weight);
  if (moving == 0) return phase_of(gait.idle, pose.b_frame0, pose.b_t);
  return kPhases * moving + phase;
}

/// The pose of a number.
THRONG_HOST_DEVICE inline Pose shared_pose(const Gait& gait, std::uint32_t number) {
  const double cycles = static_cast<double>(number % kPhases) / static_cast<double>(kPhases);
  const std::uint32_t row = number / kPhases;
  Pose pose;
  if (row >= kFirstActionRow) {
    const ClipRange& clip = gait.action[row - kFirstActionRow].clip;
    if (clip.frame_count == 0) return pose;
    sample_clip(clip, cycles, pose.a_frame0, pose.a_frame1, pose.a_t);
    pose.acts = 1;
    pose.action = row - kFirstActionRow + 1;
    pose.action_cycles = static_cast<float>(cycles);
    return pose;
  }
  if (row == 0) {
    sample_clip(gait.idle, cycles, pose.a_frame0, pose.a_frame1, pose.a_t);
    return pose;
  }
  const ClipRange& walk = gait.walk.frame_count != 0 ? gait.walk : gait.run;
  sample_clip(walk, cycles, pose.a_frame0, pose.a_frame1, pose.a_t);
  if (row < kShares) {  // what stands in a walk is the idle clip's first moment
    pose.b_frame0 = pose.b_frame1 = gait.idle.first_frame;
    pose.b_weight = 1.0F - static_cast<float>(row) / static_cast<float>(kShares);
  } else if (row > kShares) {
    sample_clip(gait.run, cycles, pose.b_frame0, pose.b_frame1, pose.b_t);
    pose.b_weight = static_cast<float>(row - kShares) / static_cast<float>(kShares);
  }
  return pose;
}

/// What a tier's poses are off by as a share of the figure's height: root mean square over the
/// figure, at the worst moment of a walk mixed with standing (built-in cast, height 1.75 m).
THRONG_HOST_DEVICE inline constexpr float tier_error(std::uint32_t tier) {
  constexpr float kError[kTiers] = {0.0066F, 0.0097F, 0.018F, 0.036F};
  return kError[tier];
}
/// Who would be off by more pixels takes a finer tier, and at last a pose of its own.
inline constexpr float kSharedErrorPx = 0.25F;
/// Taller figures that go over from one clip to another have a pose of their own: the shared one is
/// that of the clip that outweighs the rest.
inline constexpr float kSharedBlendPx = 24.0F;
/// Of the bounding sphere; larger agents never share.
inline constexpr float kSharedRadiusPx = 48.0F;
/// The same as drawn at the edge of a wide angle; twice that is under the 128 pixels of 16 bits.
inline constexpr float kSharedDrawnOutPx = 60.0F;

inline constexpr std::uint8_t kOwnPose = 0xff;

/// How coarse an agent's shared pose may be: the coarsest tier that is off by less than
/// `error_px`, or kOwnPose. Each agent's limits lie up to a tenth apart, so that a row of them
/// does not change at once. Who goes over from one clip to another shares only where that is hard
/// to see. Only agents wholly between the near and the far plane share.
/// @param height_m  of the character, unscaled.
THRONG_HOST_DEVICE inline std::uint8_t shared_tier(const VisibleInstance& instance,
                                                   const Pose& pose, float distance_m,
                                                   float height_m, const Projection& projection,
                                                   const Frustum& frustum,
                                                   float error_px = kSharedErrorPx) {
  const glm::vec3& p = instance.position_relative;
  bool is_between = true;
  float inside_m = 0.0F;  // of the near plane, which comes last
  for (int k = 4; k < 6; ++k) {
    const glm::vec4& plane = frustum.planes[k];
    inside_m = plane.x * p.x + plane.y * p.y + plane.z * p.z + plane.w;
    // the feet are within the bounding sphere
    is_between = is_between && inside_m > 2.5F * instance.radius_m;
  }
  if (!is_between) return kOwnPose;
  const bool nearer = distance_m < instance.radius_m;
  const float d = projection.perspective != 0 ? (nearer ? instance.radius_m : distance_m) : 1.0F;
  const float px_per_m =
      projection.focal_px / d * (1.0F + 0.1F * unit_from_seed(instance.seed, kSeedTier));
  // The rasterizer keeps a figure's coordinates in 16 bits: wide creatures, and what a wide angle
  // draws out at its edges, away from the centre by the square of distance over depth.
  const float away = d / inside_m;
  const float drawn_out = projection.perspective != 0 && away > 1.0F ? away : 1.0F;
  const float radius_px = px_per_m * instance.radius_m;
  if (radius_px > kSharedRadiusPx || radius_px * drawn_out * drawn_out > kSharedDrawnOutPx) {
    return kOwnPose;
  }
  const float height_px = px_per_m * instance.scale * height_m;
  if (height_px > kSharedBlendPx && is_blending(pose)) return kOwnPose;
  for (std::uint32_t tier = kTiers; tier-- > 0;) {
    if (height_px * tier_error(tier) < error_px) return static_cast<std::uint8_t>(tier);
  }
  return kOwnPose;
}

}  // namespace throng::render::element
