#pragma once

#include "render/compute/element/gait.hpp"
#include "render/compute/element/motion.hpp"

namespace throng::render::element {

/// Up to three clips sampled between two palette frames each and mixed: b into a, then c into both.
/// Frames are into Character::palette.
struct Pose {
  std::uint32_t a_frame0 = 0, a_frame1 = 0;
  std::uint32_t b_frame0 = 0, b_frame1 = 0;
  float a_t = 0.0F, b_t = 0.0F;  // from frame0 to frame1
  float b_weight = 0.0F;         // 0: clip b is not looked at
  float c_weight = 0.0F;         // 0: clip c is not looked at
  std::uint32_t c_frame0 = 0, c_frame1 = 0;
  float c_t = 0.0F;
  std::uint32_t acts = 0;      // 1: clips beside idle, walk and run are in it
  std::uint32_t action = 0;    // code of the action that outweighs the rest; 0: none
  float action_cycles = 0.0F;  // its phase, in [0, 1)
};

/// True where the limbs may leave Character::gait_bounds.
THRONG_HOST_DEVICE inline bool is_acting(const Pose& pose) { return pose.acts != 0; }

/// True where an action or a turn is mixed with something else.
THRONG_HOST_DEVICE inline bool is_blending(const Pose& pose) {
  return pose.acts != 0 && (pose.b_weight > 0.0F || pose.c_weight > 0.0F);
}

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

/// A clip's phase by the clock. Agents begin anywhere in it.
THRONG_HOST_DEVICE inline double clock_cycles(const ClipRange& clip, float pace, std::uint32_t seed,
                                              std::int64_t scene_time_us) {
  if (clip.frame_count == 0) return 0.0;
  return static_cast<double>(scene_time_us) * 1e-6 * static_cast<double>(clip.rate_hz * pace) /
             static_cast<double>(clip.frame_count) +
         static_cast<double>(unit_from_seed(seed, kSeedIdleOffset));
}

/// Standing, walking and running, mixed by speed; who turns on the spot steps round.
THRONG_HOST_DEVICE inline Pose choose_gait_pose(const Gait& gait, std::uint32_t seed,
                                                float speed_mps, float turn_radps,
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
  const double idle_cycles = clock_cycles(gait.idle, 1.0F, seed, scene_time_us);
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
  const float turning = weights.idle * turn_weight(gait, turn_radps);
  if (turning > 0.0F) {
    // its share is taken from standing alone
    sample_clip(gait.turn, walked_cycles, pose.c_frame0, pose.c_frame1, pose.c_t);
    pose.c_weight = turning;
    pose.acts = 1;
    if (pose.b_weight > 0.0F) pose.b_weight = (weights.idle - turning) / (1.0F - turning);
  }
  return pose;
}

/// The clips of a pose, gathered one by one.
struct PoseParts {
  Pose pose;
  float weight[3] = {0.0F, 0.0F, 0.0F};
  std::uint32_t count = 0;

  THRONG_HOST_DEVICE void add(const ClipRange& clip, double cycles, float part) {
    if (!(part > 0.0F) || count == 3) return;
    if (count == 0) {
      sample_clip(clip, cycles, pose.a_frame0, pose.a_frame1, pose.a_t);
    } else if (count == 1) {
      sample_clip(clip, cycles, pose.b_frame0, pose.b_frame1, pose.b_t);
    } else {
      sample_clip(clip, cycles, pose.c_frame0, pose.c_frame1, pose.c_t);
    }
    weight[count] = part;
    ++count;
  }
  THRONG_HOST_DEVICE void add_action(const Gait& gait, std::uint32_t code, std::uint32_t seed,
                                     std::int64_t scene_time_us, float part) {
    const float pace = fused(0.2F, unit_from_seed(seed, kSeedPace), 0.9F);
    const ClipRange& clip = gait.action[code - 1].clip;
    const double cycles = clock_cycles(clip, pace, seed, scene_time_us);
    add(clip, cycles, part);
    pose.acts |= part > 0.0F ? 1U : 0U;
    if (!(part > 0.0F) || part < most) return;
    most = part;
    pose.action = code;
    pose.action_cycles = static_cast<float>(cycles - std::floor(cycles));
  }
  THRONG_HOST_DEVICE const Pose& mixed() {
    pose.b_weight = count < 3 ? weight[1] : weight[1] / (weight[0] + weight[1]);
    pose.c_weight = weight[2];
    return pose;
  }

  float most = 0.0F;  // share that an action must have to stand for the whole pose
};

/// `code` if the character has a clip for it, else 0.
THRONG_HOST_DEVICE inline std::uint32_t known_action(const Gait& gait, std::uint32_t code) {
  return code <= kMostActions && code != 0 && gait.action[code - 1].clip.frame_count != 0 ? code
                                                                                          : 0;
}

/// The actions that are in a moment, and how much of the older one is left.
struct ActionMix {
  std::uint32_t now = 0, before = 0;
  float old = 0.0F;
};

THRONG_HOST_DEVICE inline ActionMix mix_actions(const Gait& gait, const Motion& motion) {
  ActionMix mix;
  mix.now = known_action(gait, motion.now);
  mix.before = known_action(gait, motion.before);
  if (mix.now != mix.before) {
    const float now_s = mix.now != 0 ? gait.action[mix.now - 1].blend_s : 0.0F;
    const float before_s = mix.before != 0 ? gait.action[mix.before - 1].blend_s : 0.0F;
    mix.old = 1.0F - smoothstep(0.0F, now_s > before_s ? now_s : before_s, motion.age_s);
  }
  return mix;
}

/// How much of a moment goes by the agent's speed: all of it but for whole actions.
THRONG_HOST_DEVICE inline float moving_share(const Gait& gait, const ActionMix& mix) {
  const bool is_now_whole = mix.now != 0 && gait.action[mix.now - 1].is_whole != 0;
  const bool is_before_whole = mix.before != 0 && gait.action[mix.before - 1].is_whole != 0;
  return (is_now_whole ? 0.0F : 1.0F - mix.old) + (is_before_whole ? 0.0F : mix.old);
}

/// The pose of an agent: a pure function of its speed, walked cycles, seed, what it was told and
/// the scene time.
///
/// An action stands in for standing, or (Action::is_whole) for walking and running too. Where it
/// has changed, the old one fades into the new one over the longer of their two times. Who acts
/// takes no steps to turn.
THRONG_HOST_DEVICE inline Pose choose_pose(const Gait& gait, std::uint32_t seed, float speed_mps,
                                           float turn_radps, double walked_cycles,
                                           std::int64_t scene_time_us, const Motion& motion = {}) {
  const ActionMix mix = mix_actions(gait, motion);
  const std::uint32_t now = mix.now, before = mix.before;
  const float old = mix.old;
  if (now == 0 && !(old > 0.0F)) {
    return choose_gait_pose(gait, seed, speed_mps, turn_radps, walked_cycles, scene_time_us);
  }

  GaitWeights weights = gait_weights(gait, seed, speed_mps);
  const ClipRange& walk = gait.walk.frame_count != 0 ? gait.walk : gait.run;
  if (walk.frame_count == 0) weights = {1.0F, 0.0F, 0.0F};
  const bool is_now_whole = now != 0 && gait.action[now - 1].is_whole != 0;
  const bool is_before_whole = before != 0 && gait.action[before - 1].is_whole != 0;
  const float moving = moving_share(gait, mix);
  const float now_share = (1.0F - old) * (is_now_whole ? 1.0F : weights.idle);
  const float before_share = old * (is_before_whole ? 1.0F : weights.idle);
  float standing = (now == 0 ? now_share : 0.0F) + (before == 0 ? before_share : 0.0F);
  float walking = moving * weights.walk;
  const float running = moving * weights.run;
  if (gait.idle.frame_count == 0) {
    walking += standing;
    standing = 0.0F;
  }

  PoseParts parts;
  parts.most = walking + running + standing;
  if (running > 0.0F && !(walking > 0.0F)) walking = 1e-6F;  // a runner's first clip is its walk
  parts.add(walk, walked_cycles, walking);
  parts.add(gait.run, walked_cycles, running);
  parts.add(gait.idle, clock_cycles(gait.idle, 1.0F, seed, scene_time_us), standing);
  if (before != 0) parts.add_action(gait, before, seed, scene_time_us, before_share);
  if (now != 0) parts.add_action(gait, now, seed, scene_time_us, now_share);
  return parts.mixed();
}

}  // namespace throng::render::element
