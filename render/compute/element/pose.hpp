#pragma once

#include "render/compute/element/gait.hpp"

namespace throng::render::element {

/// Two clips sampled between two palette frames each and mixed. Frames are into Character::palette.
struct Pose {
  std::uint32_t a_frame0 = 0, a_frame1 = 0;
  std::uint32_t b_frame0 = 0, b_frame1 = 0;
  float a_t = 0.0F, b_t = 0.0F;  // from frame0 to frame1
  float b_weight = 0.0F;         // 0: clip b is not looked at
};

/// A looping clip at a phase counted in cycles; only the fraction matters.
THRONG_HOST_DEVICE inline void sample_clip(const ClipRange& clip, double cycles,
                                           std::uint32_t& frame0, std::uint32_t& frame1, float& t) {
  const double fraction = cycles - std::floor(cycles);
  const float position = static_cast<float>(fraction * static_cast<double>(clip.frame_count));
  std::uint32_t index = static_cast<std::uint32_t>(position);
  if (index >= clip.frame_count) index = clip.frame_count - 1;
  t = position - static_cast<float>(index);
  if (t > 1.0F) t = 1.0F;
  frame0 = clip.first_frame + index;
  frame1 = clip.first_frame + (index + 1 == clip.frame_count ? 0 : index + 1);
}

/// The pose of an agent: a pure function of its speed, walked cycles, seed and the scene time.
THRONG_HOST_DEVICE inline Pose choose_pose(const Gait& gait, std::uint32_t seed, float speed_mps,
                                           double walked_cycles, std::int64_t scene_time_us) {
  GaitWeights weights = gait_weights(gait, seed, speed_mps);
  Pose pose;
  // a missing clip is stood in for by the next best; at least one clip of the three exists
  const bool has_walk = gait.walk.frame_count != 0;
  const ClipRange& walk = has_walk ? gait.walk : gait.run;
  if (gait.idle.frame_count == 0) {
    weights.walk += weights.idle;
    weights.idle = 0.0F;
  }
  if (walk.frame_count == 0) {
    weights = {1.0F, 0.0F, 0.0F};
  }
  const double idle_cycles = gait.idle.frame_count == 0
                                 ? 0.0
                                 : static_cast<double>(scene_time_us) * 1e-6 *
                                           static_cast<double>(gait.idle.rate_hz) /
                                           static_cast<double>(gait.idle.frame_count) +
                                       static_cast<double>(unit_from_seed(seed, kSeedIdleOffset));
  if (weights.run > 0.0F) {
    sample_clip(walk, walked_cycles, pose.a_frame0, pose.a_frame1, pose.a_t);
    sample_clip(gait.run, walked_cycles, pose.b_frame0, pose.b_frame1, pose.b_t);
    pose.b_weight = weights.run;
  } else if (weights.walk <= 0.0F) {
    sample_clip(gait.idle, idle_cycles, pose.a_frame0, pose.a_frame1, pose.a_t);
  } else {
    sample_clip(walk, walked_cycles, pose.a_frame0, pose.a_frame1, pose.a_t);
    if (weights.idle > 0.0F) {
      sample_clip(gait.idle, idle_cycles, pose.b_frame0, pose.b_frame1, pose.b_t);
      pose.b_weight = weights.idle;
    }
  }
  return pose;
}

}  // namespace throng::render::element
