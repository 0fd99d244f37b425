#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/instance.hpp"
#include "render/compute/element/skinning.hpp"

namespace throng::render::element {

/// The columns of one snapshot and its roster, by slot [I], wherever they are.
struct SnapshotColumns {
  std::uint32_t slots = 0;
  const std::uint8_t* present = nullptr;
  const glm::vec3* position_m = nullptr;
  const glm::vec3* velocity_mps = nullptr;
  const float* heading_rad = nullptr;
  const float* speed_mps = nullptr;
  const float* turn_radps = nullptr;
  const double* walked_cycles = nullptr;
  const float* channel = nullptr;         // null: none is shown
  const std::uint32_t* motion = nullptr;  // pack_motion; null: nobody is told anything
  const std::uint64_t* id = nullptr;
  const std::uint16_t* character = nullptr;
  const float* scale = nullptr;
  const std::uint32_t* seed = nullptr;
};

/// One agent at a scene time.
struct InstanceState {
  glm::vec3 position_m;  // offset from the crowd's origin
  float heading_rad;
  Placement placement;
  std::uint32_t character;
  std::uint32_t seed;
  float channel;
  Pose pose;
};

/// A piece of the surroundings.
THRONG_HOST_DEVICE inline InstanceState standing_still(std::uint32_t character) {
  InstanceState state;
  state.position_m = glm::vec3(0.0F);
  state.heading_rad = 0.0F;
  state.placement = Placement();
  state.character = character;
  state.seed = 0;
  state.channel = __builtin_nanf("");
  state.pose = Pose();
  return state;
}

THRONG_HOST_DEVICE inline Sample sample_of(const SnapshotColumns& columns, std::size_t slot) {
  return {columns.position_m[slot], columns.velocity_mps[slot], columns.heading_rad[slot],
          columns.speed_mps[slot],  columns.turn_radps[slot],   columns.walked_cycles[slot]};
}

/// The agent of a present slot of `shown`, the snapshot that says who is there: `older`, or `newer`
/// when `between.at_newer`. The other one only says where it goes.
/// @param same_roster  the slots of both belong to the same agents, so ids need no look.
THRONG_HOST_DEVICE inline InstanceState advance_slot(const SnapshotColumns& shown,
                                                     const SnapshotColumns& newer,
                                                     const Between& between, bool same_roster,
                                                     const Gait& gait, std::int64_t scene_time_us,
                                                     std::size_t slot) {
  const std::uint32_t seed = shown.seed[slot];
  const float scale = shown.scale[slot];
  float value = shown.channel != nullptr ? shown.channel[slot] : __builtin_nanf("");
  Sample sample;
  if (!between.at_newer && slot < newer.slots && newer.present[slot] != 0 &&
      (same_roster || newer.id[slot] == shown.id[slot])) {
    sample = interpolate(sample_of(shown, slot), sample_of(newer, slot), between, seed);
    const float next = newer.channel != nullptr ? newer.channel[slot] : __builtin_nanf("");
    if (next == next) value = fused(between.t, next - value, value);
  } else {
    sample = extrapolate(sample_of(shown, slot), between, gait, scale, seed);
  }
  InstanceState state;
  state.position_m = sample.position_m;
  state.heading_rad = sample.heading_rad;
  state.placement = place(sample.heading_rad, scale);
  state.character = shown.character[slot];
  state.seed = seed;
  state.channel = value;
  state.pose = choose_pose(
      gait, seed, sample.speed_mps, sample.turn_radps, sample.walked_cycles, scene_time_us,
      shown.motion != nullptr ? unpack_motion(shown.motion[slot], between.since_s) : Motion());
  return state;
}

}  // namespace throng::render::element
