#pragma once

#include <glm/glm.hpp>

#include "render/compute/element/instance.hpp"
#include "render/compute/element/skinning.hpp"
#include "render/compute/element/stance.hpp"

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
  glm::vec2 shift_m;     // from there to where it is drawn (stance.hpp)
  float heading_rad;
  Placement placement;
  std::uint32_t character;
  std::uint32_t seed;
  float channel;
  Pose pose;
};

/// Where the figure's origin is drawn: all but decisions goes by it.
THRONG_HOST_DEVICE inline glm::vec3 drawn_at(const InstanceState& state) {
  return glm::vec3(state.position_m.x + state.shift_m.x, state.position_m.y + state.shift_m.y,
                   state.position_m.z);
}

/// A piece of the surroundings.
THRONG_HOST_DEVICE inline InstanceState standing_still(std::uint32_t character) {
  InstanceState state;
  state.position_m = glm::vec3(0.0F);
  state.shift_m = glm::vec2(0.0F);
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

/// The snapshots around a scene time. `shown` says who is there: the older one, or the newer one
/// when `between.at_newer`; the other one only says where they go.
struct Bracketed {
  SnapshotColumns shown, newer;
  Between between;
  bool same_roster = false;  // the slots of both belong to the same agents, so ids need no look
  std::int64_t scene_time_us = 0;
};

/// True where the agent of a present slot is in the newer snapshot, too.
THRONG_HOST_DEVICE inline bool goes_on(const Bracketed& moment, std::size_t slot) {
  return !moment.between.at_newer && slot < moment.newer.slots && moment.newer.present[slot] != 0 &&
         (moment.same_roster || moment.newer.id[slot] == moment.shown.id[slot]);
}

/// Where the agent of a present slot is: all that culling needs of `advance_slot`.
THRONG_HOST_DEVICE inline glm::vec3 position_at(const Bracketed& moment, std::size_t slot) {
  const glm::vec3& from_m = moment.shown.position_m[slot];
  if (goes_on(moment, slot)) {
    return interpolate_position(from_m, moment.newer.position_m[slot], moment.between);
  }
  if (!(moment.between.ahead_s > 0.0F)) return from_m;
  return extrapolate_position(from_m, moment.shown.velocity_mps[slot], moment.between);
}

THRONG_HOST_DEVICE inline Sample sample_at(const Bracketed& moment, const Gait& gait,
                                           std::size_t slot) {
  const SnapshotColumns& shown = moment.shown;
  const std::uint32_t seed = shown.seed[slot];
  if (goes_on(moment, slot)) {
    return interpolate(sample_of(shown, slot), sample_of(moment.newer, slot), moment.between, seed);
  }
  return extrapolate(sample_of(shown, slot), moment.between, gait, shown.scale[slot], seed);
}

THRONG_HOST_DEVICE inline float channel_at(const Bracketed& moment, std::size_t slot) {
  if (moment.shown.channel == nullptr) return __builtin_nanf("");
  const float value = moment.shown.channel[slot];
  if (moment.newer.channel == nullptr || !goes_on(moment, slot)) return value;
  const float next = moment.newer.channel[slot];
  return next == next ? fused(moment.between.t, next - value, value) : value;
}

THRONG_HOST_DEVICE inline Motion motion_at(const Bracketed& moment, std::size_t slot) {
  if (moment.shown.motion == nullptr) return {};
  return unpack_motion(moment.shown.motion[slot], moment.between.since_s);
}

/// The agent of a present slot.
THRONG_HOST_DEVICE inline InstanceState advance_slot(const Bracketed& moment, const Gait& gait,
                                                     std::size_t slot) {
  const SnapshotColumns& shown = moment.shown;
  const Sample sample = sample_at(moment, gait, slot);
  InstanceState state;
  state.position_m = sample.position_m;
  state.heading_rad = sample.heading_rad;
  state.placement = place(sample.heading_rad, shown.scale[slot]);
  state.character = shown.character[slot];
  state.seed = shown.seed[slot];
  state.channel = channel_at(moment, slot);
  const Motion motion = motion_at(moment, slot);
  state.pose = choose_pose(gait, state.seed, sample.speed_mps, sample.turn_radps,
                           sample.walked_cycles, moment.scene_time_us, motion);
  const StanceShift shift = stance_shift(gait, state.seed, sample, state.placement,
                                         moving_share(gait, mix_actions(gait, motion)));
  state.shift_m = shift.shift_m;
  state.heading_rad = sample.heading_rad + shift.turn_rad;
  state.placement = turned(state.placement, shift.turn_rad);
  return state;
}

}  // namespace throng::render::element
