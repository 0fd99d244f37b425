#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/gait.hpp"
#include "render/compute/element/instance.hpp"
#include "render/compute/element/skinning.hpp"

// Turning without sliding. Clips are made for straight ways: on a curve of rate w the body turns
// about itself, and so do the feet on the ground, w times their distance from the axis. People turn
// about the foot that stands, and hardly while both do. With p the path, R the heading, f the place
// on the ground of what stands (model frame), and the body turned by a and moved by d from there,
// it rests where to the first order, per way walked at curvature k,
//
//     a' = k (r - 1),   d' = (k r f.y, a - k r f.x)
//
// r is 1 in the mean and near 0 while two feet stand. Over a step the body is up to 2 cm beside a
// path of 3 m radius. a and d are periodic and proportional to k, so a table by phase and a product
// are all of it; see add_stance_shift.
namespace throng::render::element {

/// The largest shift from the path at scale 1.
inline constexpr float kMostShiftM = 0.08F;

/// Curvature of the way that a sample walks on, 1/m, positive to the left; of the other sign for
/// who goes backwards. Falls to 0 for who stands or goes sideways.
THRONG_HOST_DEVICE inline float path_curvature(const Sample& sample, const Placement& placement) {
  constexpr float kSlowMps2 = 0.01F;
  constexpr float kMost = 0.8F;
  const float forward_mps = fused(sample.velocity_mps.x, placement.cosine_scale,
                                  sample.velocity_mps.y * placement.sine_scale) /
                            placement.scale;
  const float curvature =
      sample.turn_radps * forward_mps / fused(forward_mps, forward_mps, kSlowMps2);
  return curvature < -kMost ? -kMost : (curvature > kMost ? kMost : curvature);
}

THRONG_HOST_DEVICE inline glm::vec3 shift_at(const glm::vec3* table, double cycles) {
  const float at = static_cast<float>((cycles - std::floor(cycles)) * kShiftPhases);
  std::uint32_t index = static_cast<std::uint32_t>(at);
  if (index >= kShiftPhases) index = kShiftPhases - 1;
  const float t = at - static_cast<float>(index);
  const glm::vec3& from = table[index];
  const glm::vec3& to = table[index + 1 == kShiftPhases ? 0 : index + 1];
  return glm::vec3(fused(t, to.x - from.x, from.x), fused(t, to.y - from.y, from.y),
                   fused(t, to.z - from.z, from.z));
}

/// How a figure stands beside its path.
struct StanceShift {
  glm::vec2 shift_m;  // world axes
  float turn_rad;     // to the left
};

/// @param moving  share of walking and running; the rest is told to do something else.
THRONG_HOST_DEVICE inline StanceShift stance_shift(const Gait& gait, std::uint32_t seed,
                                                   const Sample& sample, const Placement& placement,
                                                   float moving) {
  const float curvature = path_curvature(sample, placement);
  // most of a crowd goes straight on: what is left out is under 0.1 mm
  if (!(curvature > 1e-3F || curvature < -1e-3F) || !(moving > 0.0F)) {
    return {glm::vec2(0.0F, 0.0F), 0.0F};
  }
  const GaitWeights weights = gait_weights(gait, seed, sample.speed_mps);
  const float walk = moving * weights.walk, run = moving * weights.run;
  glm::vec3 shift(0.0F, 0.0F, 0.0F);
  if (walk > 0.0F) {
    const glm::vec3 of_walk = shift_at(gait.walk_shift, sample.walked_cycles);
    for (int k = 0; k < 3; ++k) shift[k] = walk * of_walk[k];
  }
  if (run > 0.0F) {
    const glm::vec3 of_run = shift_at(gait.run_shift, sample.walked_cycles);
    for (int k = 0; k < 3; ++k) shift[k] = fused(run, of_run[k], shift[k]);
  }
  // lengths grow with the scale, and so do steps: one factor is in the placement. Shorter strides
  // reach less far ahead.
  const float scaled = curvature * placement.scale;
  const float forward = scaled * shift.x;
  const float left = scaled * (walk + run) * shift.y;
  return {glm::vec2(fused(forward, placement.cosine_scale, left * -placement.sine_scale),
                    fused(forward, placement.sine_scale, left * placement.cosine_scale)),
          scaled * shift.z};
}

/// Turned by a small angle.
THRONG_HOST_DEVICE inline Placement turned(const Placement& placement, float angle_rad) {
  const float cosine = fused(-0.5F * angle_rad, angle_rad, 1.0F);
  return {fused(placement.cosine_scale, cosine, placement.sine_scale * -angle_rad),
          fused(placement.sine_scale, cosine, placement.cosine_scale * angle_rad), placement.scale};
}

}  // namespace throng::render::element
