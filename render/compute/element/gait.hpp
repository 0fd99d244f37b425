#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/hash.hpp"
#include "render/compute/element/host_device.hpp"

namespace throng::render::element {

/// What of a character's clips decides how it walks. A clip is looped over its frames.
struct ClipRange {
  std::uint32_t first_frame = 0;
  std::uint32_t frame_count = 0;  // 0: the character has no such clip
  float rate_hz = 30.0F;
};

/// What an agent does because its producer says so, beside standing, walking and running.
struct Action {
  ClipRange clip;
  float blend_s = 0.4F;  // how long it takes to begin and to end
  /// 1: whatever the speed. 0: in place of standing, so it gives way to the walk as the agent goes.
  std::uint32_t is_whole = 0;
};

inline constexpr std::uint32_t kMostActions = 16;

/// Phases at which a clip's stance shift is known.
inline constexpr std::uint32_t kShiftPhases = 32;

struct Gait {
  ClipRange idle, walk, run;
  ClipRange turn;                // steps on the spot that turn to the left; to the right backwards
  float turn_rad = 1.57079633F;  // angle of one cycle
  Action action[kMostActions];   // by the cast's motion graph; code k is at k - 1
  float walk_stride_m = 1.4F;    // distance of one cycle at scale 1
  float run_stride_m = 2.6F;
  float walk_speed_mps = 1.35F;  // at which the clip was made
  float run_speed_mps = 3.2F;
  // Where the body is on a path of curvature 1/m, by phase, at scale 1: forward and left of it in
  // m^2, and turned to the left in m (stance.hpp). None: on the path and along it.
  glm::vec3 walk_shift[kShiftPhases] = {};
  glm::vec3 run_shift[kShiftPhases] = {};
};

/// How much of each clip a speed asks for; they sum to 1 and one of idle and run is 0.
struct GaitWeights {
  float idle, walk, run;
};

THRONG_HOST_DEVICE inline float smoothstep(float low, float high, float x) {
  float t = (x - low) / (high - low);
  t = t < 0.0F ? 0.0F : (t > 1.0F ? 1.0F : t);
  return t * t * fused(-2.0F, t, 3.0F);
}

/// Clip weights at a speed. Below the clip's own speed the walk is mixed with idle: strides get
/// shorter with the square root of the speed, as people do, while the thresholds between standing,
/// walking and running differ a little from agent to agent instead of needing memory.
THRONG_HOST_DEVICE inline GaitWeights gait_weights(const Gait& gait, std::uint32_t seed,
                                                   float speed_mps) {
  const float stand_mps = fused(0.08F, unit_from_seed(seed, kSeedWalkThreshold), 0.08F);
  const float gate = smoothstep(stand_mps, stand_mps + 0.15F, speed_mps);
  const float ratio = speed_mps / gait.walk_speed_mps;
  const float amplitude = ratio >= 1.0F ? 1.0F : std::sqrt(ratio < 0.0F ? 0.0F : ratio);
  float run = 0.0F;
  if (gait.run.frame_count != 0 && gait.run_speed_mps > gait.walk_speed_mps) {
    const float span = gait.run_speed_mps - gait.walk_speed_mps;
    const float shift = fused(0.1F, unit_from_seed(seed, kSeedRunThreshold), 0.2F);
    run = smoothstep(fused(span, shift, gait.walk_speed_mps),
                     fused(span, shift + 0.3F, gait.walk_speed_mps), speed_mps);
  }
  const float moving = gate * amplitude;
  return {1.0F - moving, moving - run < 0.0F ? 0.0F : moving - run, run};
}

/// How much of the turning clip stands in for standing at a turning rate. The feet turn under the
/// body by this share of the clip's angle.
THRONG_HOST_DEVICE inline float turn_weight(const Gait& gait, float turn_radps) {
  if (gait.turn.frame_count == 0) return 0.0F;
  const float rate_radps = turn_radps < 0.0F ? -turn_radps : turn_radps;
  constexpr float kFullRadps = 1.2F;
  const float amplitude = rate_radps >= kFullRadps ? 1.0F : std::sqrt(rate_radps / kFullRadps);
  return smoothstep(0.1F, 0.35F, rate_radps) * amplitude;
}

/// Cycles of the turning clip for an angle turned at a rate on the spot.
THRONG_HOST_DEVICE inline float turn_cycles(const Gait& gait, float angle_rad, float turn_radps) {
  const float weight = turn_weight(gait, turn_radps);
  return weight > 0.0F ? angle_rad / (gait.turn_rad * (weight < 0.25F ? 0.25F : weight)) : 0.0F;
}

/// Distance of one cycle at a speed, at scale 1. A walk mixed with idle in the share w moves the
/// feet by w times the clip's stride (poses are mixed linearly), so the stance foot stays put when
/// the cycle covers exactly that distance. Never under a quarter of the clip's stride.
THRONG_HOST_DEVICE inline float stride_m(const Gait& gait, const GaitWeights& weights) {
  const float stride = fused(weights.walk, gait.walk_stride_m, weights.run * gait.run_stride_m);
  const float least = 0.25F * gait.walk_stride_m;
  return stride < least ? least : stride;
}

}  // namespace throng::render::element
