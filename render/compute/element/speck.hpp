#pragma once

#include <cstdint>

#include "render/compute/element/gait.hpp"
#include "render/compute/element/pose.hpp"
#include "render/compute/element/selection.hpp"
#include "render/compute/element/visible.hpp"
#include "throng/render/representation.hpp"

namespace throng::render::element {

/// Who is a few pixels high is drawn from a picture of a few slabs (SpeckTable). A character has
/// one for each of these poses, elevations and azimuths.
inline constexpr std::uint32_t kSpeckPhases = 8;
// Actions of the cast's motion graph that have a picture, by their codes: to sit, to cheer, to
// wave. Who talks or phones stands.
inline constexpr std::uint32_t kSpeckFirstAction = 2, kSpeckActions = 3;
// standing, then a walk's phases, then what the character may do beside: one moment of each
inline constexpr std::uint32_t kSpeckPoses = 1 + kSpeckPhases + kSpeckActions;
inline constexpr std::uint32_t kSpeckElevations = 4;  // 0, 25, 50, 75 degrees
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
// 1 / cos of those
THRONG_HOST_DEVICE inline float speck_per_cosine(std::uint32_t elevation) {
  constexpr float kPerCosine[kSpeckElevations] = {1.0F, 1.1033779F, 1.5557238F, 3.8637033F};
  return kPerCosine[elevation];
}

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
  if (pose.action != 0) {
    const std::uint32_t picture = pose.action - kSpeckFirstAction;
    return picture < kSpeckActions ? 1 + kSpeckPhases + picture : 0;
  }
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

/// Who of the mixed frame is a speck.
struct SpeckRule {
  Projection projection;
  glm::vec3 forward{0.0F, 1.0F, 0.0F};
  MixedForms mixed{};
};

/// How an agent's figure lies to the eye.
struct SpeckPlace {
  glm::vec3 feet;  // relative to the eye
  float height_m;  // as it is scaled
  float d;         // what a metre's pixels are divided by
  float px_per_m, height_px;
};
/// @param scale  of the agent. @param height_m  of its character.
THRONG_HOST_DEVICE inline SpeckPlace speck_place(const SpeckRule& rule, const glm::vec3& position_m,
                                                 float scale, float height_m,
                                                 const glm::dvec3& eye_offset_m) {
  SpeckPlace place;
  place.height_m = scale * height_m;
  place.feet = relative(position_m.x, position_m.y, position_m.z, eye_offset_m);
  const float distance_m = distance_of(
      glm::vec4(place.feet.x, place.feet.y, fused(0.5F, place.height_m, place.feet.z), 0.0F));
  const bool nearer = distance_m < place.height_m;
  place.d = rule.projection.perspective != 0 ? (nearer ? place.height_m : distance_m) : 1.0F;
  place.px_per_m = rule.projection.focal_px / place.d;
  place.height_px = place.px_per_m * place.height_m;
  return place;
}

/// False for who is too large whatever else is said of him.
THRONG_HOST_DEVICE inline bool may_be_speck(const SpeckRule& rule, const SpeckPlace& place) {
  return place.height_px < 1.1F * (rule.mixed.error_px / rule.mixed.speck_error);
}

enum class SpeckFate : std::uint8_t { kListed, kSpeck, kLeftOut };

/// @param acts  beside its gait. @param vertices  of a mesh that is off by as much.
/// @param larger  how much larger it is drawn: of those that are too small some stand for all, as
///                much larger as they are fewer.
THRONG_HOST_DEVICE inline SpeckFate speck_fate(const SpeckRule& rule, const SpeckPlace& place,
                                               std::uint32_t seed, bool acts,
                                               std::uint32_t vertices, float& larger) {
  const MixedForms& mixed = rule.mixed;
  larger = 1.0F;
  // each agent's limits lie up to a fifth apart, so that a row of them does not change at once
  const float own = unit_from_seed(seed, kSeedForm);
  const float speck_us =
      fused(mixed.speck_px2_us, place.height_px * place.height_px, mixed.speck_us);
  const float mesh_us = fused(mixed.mesh_vertex_us, static_cast<float>(vertices), mixed.mesh_us);
  // who waves or cheers is shown in one moment of it: that shows sooner
  const bool is_small = place.height_px * (0.9F + 0.2F * own) * (acts ? 1.5F : 1.0F) <
                        mixed.error_px / mixed.speck_error;
  if (!is_small || !(speck_us < mesh_us)) return SpeckFate::kListed;
  const float kept = place.height_px / mixed.least_px;
  larger = kept < 1.0F ? 1.0F / kept : 1.0F;
  return own * larger * larger >= 1.0F ? SpeckFate::kLeftOut : SpeckFate::kSpeck;
}

/// @param pose  gait_speck_pose or speck_pose.
THRONG_HOST_DEVICE inline Speck make_speck(const SpeckRule& rule, const SpeckPlace& place,
                                           float larger, std::uint32_t character,
                                           std::uint32_t pose, float heading_rad,
                                           std::uint32_t seed, float channel) {
  const bool perspective = rule.projection.perspective != 0;
  const glm::vec3 to_eye = perspective ? -place.feet : -rule.forward;
  const SinCos turned = sin_cos(heading_rad);
  const std::uint32_t azimuth = speck_azimuth(to_eye.x * turned.cosine + to_eye.y * turned.sine,
                                              to_eye.y * turned.cosine - to_eye.x * turned.sine);
  const float sine = perspective ? to_eye.z / place.d : to_eye.z;
  Speck speck;
  speck.position_relative = place.feet;
  speck.height_m = larger * place.height_m;
  speck.image = character * kSpeckImages +
                (pose * kSpeckElevations + speck_elevation(sine)) * kSpeckAzimuths + azimuth;
  speck.seed = seed;
  speck.channel = channel;
  speck.reserved = 0;
  return speck;
}

}  // namespace throng::render::element
