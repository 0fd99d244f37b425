#include <algorithm>
#include <limits>

#include "render/compute/cpu/stages.hpp"
#include "render/compute/element/instance.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kChunk = 1024;

element::Sample sample_of(const Snapshot& snapshot, std::size_t slot) {
  return {snapshot.position_m[slot], snapshot.velocity_mps[slot], snapshot.heading_rad[slot],
          snapshot.speed_mps[slot], snapshot.walked_cycles[slot]};
}

bool is_present(const Snapshot& snapshot, std::size_t slot) {
  return slot < snapshot.present.size() && snapshot.present[slot] != 0;
}

float channel_of(const Snapshot& snapshot, std::size_t channel, std::size_t slot) {
  return channel < snapshot.channels.size() ? snapshot.channels[channel][slot]
                                            : std::numeric_limits<float>::quiet_NaN();
}

}  // namespace

void advance(const Snapshot& older, const Snapshot& newer, std::int64_t scene_time_us,
             const CrowdSettings& settings, int channel, WorkPool& pool, CpuInstances& instances) {
  const element::Between between =
      element::between(older.time_us, newer.time_us, scene_time_us, settings.extrapolate_limit_us);
  // the agents shown are those of one snapshot; the other one only says where they go
  const Snapshot& shown = between.at_newer ? newer : older;
  const bool is_same_roster = older.roster == newer.roster;
  const std::size_t slots = shown.present.size();
  const CastTable& cast = *instances.cast;
  instances.scene_time_us = scene_time_us;
  instances.count = static_cast<std::uint32_t>(slots);
  instances.present = shown.present_count;
  instances.origin_world = settings.origin_world;
  instances.sphere_m.resize(slots);
  instances.state.resize(slots);

  pool.for_chunks(slots, kChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t slot = begin; slot < end; ++slot) {
      if (shown.present[slot] == 0) {
        instances.sphere_m[slot] = glm::vec4(0.0F, 0.0F, 0.0F, -1.0F);
        continue;
      }
      const Roster& roster = *shown.roster;
      const std::uint32_t seed = roster.seed[slot];
      const float scale = roster.scale[slot];
      const std::uint32_t character = roster.character[slot];
      const CharacterTable& table = cast.characters[character];

      float value = channel >= 0 ? channel_of(shown, static_cast<std::size_t>(channel), slot)
                                 : std::numeric_limits<float>::quiet_NaN();
      element::Sample sample;
      if (!between.at_newer && is_present(newer, slot) &&
          (is_same_roster || newer.roster->id[slot] == roster.id[slot])) {
        sample =
            element::interpolate(sample_of(older, slot), sample_of(newer, slot), between, seed);
        if (channel >= 0) {
          const float next = channel_of(newer, static_cast<std::size_t>(channel), slot);
          if (next == next) value = element::fused(between.t, next - value, value);
        }
      } else {
        sample = element::extrapolate(sample_of(shown, slot), between, table.gait, scale, seed);
      }

      InstanceState& state = instances.state[slot];
      state.position_m = sample.position_m;
      state.heading_rad = sample.heading_rad;
      state.placement = element::place(sample.heading_rad, scale);
      state.character = character;
      state.seed = seed;
      state.channel = value;
      state.pose = element::choose_pose(table.gait, seed, sample.speed_mps, sample.walked_cycles,
                                        scene_time_us);
      instances.sphere_m[slot] =
          element::place_sphere(state.placement, sample.position_m, table.character->bounds);
    }
  });
}

}  // namespace throng::render
