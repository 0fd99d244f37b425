#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/angle.hpp"
#include "render/compute/element/gait.hpp"

namespace throng::render::element {

/// A jump faster than this is a teleport: nothing is drawn on the way and no steps are taken.
inline constexpr float kTeleportSpeedMps = 12.0F;
inline constexpr float kTeleportSlackM = 0.5F;  // so that a jittered time stamp makes no teleport

/// True where a step from one sample to the next can't have been walked.
THRONG_HOST_DEVICE inline bool is_teleport(const glm::vec3& step_m, float interval_s) {
  const float limit_m = fused(kTeleportSpeedMps, interval_s, kTeleportSlackM);
  return fused(step_m.x, step_m.x, fused(step_m.y, step_m.y, step_m.z * step_m.z)) >
         limit_m * limit_m;
}

/// One agent in one snapshot.
struct Sample {
  glm::vec3 position_m{0.0F};
  glm::vec3 velocity_mps{0.0F};
  float heading_rad = 0.0F;  // NaN: not known yet (the agent's first sample)
  float speed_mps = 0.0F;
  float turn_radps = 0.0F;  // to the left, smoothed
  double walked_cycles = 0.0;
};

/// How a scene time lies to the two snapshots around it; the same for all agents.
struct Between {
  float t = 0.0F;           // from older to newer
  float interval_s = 0.0F;  // newer - older; 0 when there is one snapshot
  float ahead_s = 0.0F;     // beyond the sample an agent is extrapolated from, limited
  float since_s = 0.0F;     // beyond the snapshot that is shown, never negative
  float pace = 1.0F;        // 1; falls to 0 once the limit is passed: who is held stands
  bool at_newer = false;    // no sample lies ahead: extrapolate newer (or show it before its time)
};

/// Where `scene_time_us` lies. Between the snapshots agents are those of `older`, who are
/// interpolated to `newer` or, when gone there, walk on; from `newer` on they are those of `newer`.
inline Between between(std::int64_t older_time_us, std::int64_t newer_time_us,
                       std::int64_t scene_time_us, std::int64_t extrapolate_limit_us) {
  constexpr double kStopS = 0.4;  // from the limit to standing
  Between result;
  const double interval_s = static_cast<double>(newer_time_us - older_time_us) * 1e-6;
  result.interval_s = static_cast<float>(interval_s);
  result.at_newer = interval_s <= 0.0 || scene_time_us >= newer_time_us;
  const double since_s =
      static_cast<double>(scene_time_us - (result.at_newer ? newer_time_us : older_time_us)) * 1e-6;
  const double limit_s = static_cast<double>(extrapolate_limit_us) * 1e-6;
  const double ahead_s = since_s < 0.0 ? 0.0 : (since_s > limit_s ? limit_s : since_s);
  const double held = (since_s - limit_s) / kStopS;
  result.ahead_s = static_cast<float>(ahead_s);
  result.since_s = static_cast<float>(since_s < 0.0 ? 0.0 : since_s);
  result.pace = static_cast<float>(held <= 0.0 ? 1.0 : (held >= 1.0 ? 0.0 : 1.0 - held));
  const double t = result.at_newer ? 0.0 : since_s / interval_s;
  result.t = static_cast<float>(t < 0.0 ? 0.0 : (t > 1.0 ? 1.0 : t));
  return result;
}

/// What a heading that nobody knows is shown as.
THRONG_HOST_DEVICE inline float known_heading(float heading_rad, std::uint32_t seed) {
  return heading_rad == heading_rad ? heading_rad
                                    : fused(kTwoPi, unit_from_seed(seed, kSeedHeading), -kPi);
}

THRONG_HOST_DEVICE inline glm::vec3 extrapolate_position(const glm::vec3& from_m,
                                                         const glm::vec3& velocity_mps,
                                                         const Between& between) {
  const float ahead_s = between.ahead_s;
  if (!(ahead_s > 0.0F)) return from_m;
  return glm::vec3(fused(velocity_mps.x, ahead_s, from_m.x),
                   fused(velocity_mps.y, ahead_s, from_m.y),
                   fused(velocity_mps.z, ahead_s, from_m.z));
}

THRONG_HOST_DEVICE inline glm::vec3 interpolate_position(const glm::vec3& older_m,
                                                         const glm::vec3& newer_m,
                                                         const Between& between) {
  const glm::vec3 step_m = newer_m - older_m;
  if (is_teleport(step_m, between.interval_s)) return older_m;
  const float t = between.t;
  return glm::vec3(fused(t, step_m.x, older_m.x), fused(t, step_m.y, older_m.y),
                   fused(t, step_m.z, older_m.z));
}

/// An agent that walks on from its sample as it did, for a limited time.
THRONG_HOST_DEVICE inline Sample extrapolate(const Sample& from, const Between& between,
                                             const Gait& gait, float scale, std::uint32_t seed) {
  Sample result = from;
  const float ahead_s = between.ahead_s;
  result.heading_rad = known_heading(from.heading_rad, seed);
  result.speed_mps = from.speed_mps * between.pace;
  // nobody is turned any further, so the feet come to rest soon
  const float turned = 1.0F - ahead_s * 4.0F;
  result.turn_radps = turned > 0.0F ? from.turn_radps * turned : 0.0F;
  if (ahead_s > 0.0F) {
    result.position_m = extrapolate_position(from.position_m, from.velocity_mps, between);
    const float stride = scale * stride_m(gait, gait_weights(gait, seed, from.speed_mps));
    result.walked_cycles += static_cast<double>(from.speed_mps * ahead_s / stride);
  }
  return result;
}

/// An agent that is in both snapshots. Position and walked cycles go linearly together, so the feet
/// stay where they are put; the heading turns along the shorter arc. A teleport waits, then jumps.
THRONG_HOST_DEVICE inline Sample interpolate(const Sample& older, const Sample& newer,
                                             const Between& between, std::uint32_t seed) {
  Sample result = older;
  const glm::vec3 step_m = newer.position_m - older.position_m;
  const float newer_heading_rad = known_heading(newer.heading_rad, seed);
  // the first sample has no motion to take a heading from: the next one's is right for it too
  const float older_heading_rad =
      older.heading_rad == older.heading_rad ? older.heading_rad : newer_heading_rad;
  result.heading_rad = older_heading_rad;
  if (is_teleport(step_m, between.interval_s)) return result;
  const float t = between.t;
  result.position_m = interpolate_position(older.position_m, newer.position_m, between);
  result.heading_rad = lerp_angle(older_heading_rad, newer_heading_rad, t);
  for (int k = 0; k < 2; ++k) {
    result.velocity_mps[k] =
        fused(t, newer.velocity_mps[k] - older.velocity_mps[k], older.velocity_mps[k]);
  }
  result.speed_mps = fused(t, newer.speed_mps - older.speed_mps, older.speed_mps);
  result.turn_radps = fused(t, newer.turn_radps - older.turn_radps, older.turn_radps);
  result.walked_cycles =
      older.walked_cycles + static_cast<double>(t) * (newer.walked_cycles - older.walked_cycles);
  return result;
}

}  // namespace throng::render::element
