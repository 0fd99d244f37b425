#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/stages.hpp"
#include "render/compute/snapshot_columns.hpp"

namespace throng::render {
void advance(const Snapshot& older, const Snapshot& newer, std::int64_t scene_time_us,
             const CrowdSettings& settings, int channel, Surroundings surroundings, Machine machine,
             CpuInstances& instances) {
  constexpr std::size_t kChunk = 1024;
  AdvanceJob job;
  job.older = columns_of(older, channel);
  job.newer = columns_of(newer, channel);
  job.same_roster = older.roster == newer.roster;
  job.cast = instances.cast.get();
  job.between =
      element::between(older.time_us, newer.time_us, scene_time_us, settings.extrapolate_limit_us);
  job.scene_time_us = scene_time_us;
  const Snapshot& shown = job.between.at_newer ? newer : older;
  const std::size_t slots = shown.present.size();
  instances.scene_time_us = scene_time_us;
  instances.count = static_cast<std::uint32_t>(slots) + surroundings.member_count;
  instances.surrounding = surroundings.member_count;
  instances.present = shown.present_count;
  instances.origin_world = settings.origin_world;
  instances.sphere_m.resize(instances.count);
  instances.state.resize(instances.count);
  job.sphere_m = instances.sphere_m.data();
  job.state = instances.state.data();
  machine.pool.for_chunks(slots, kChunk, [&](std::size_t begin, std::size_t end) {
    machine.kernels.advance(job, begin, end);
  });
  for (std::uint32_t i = 0; i < surroundings.member_count; ++i) {
    const std::uint32_t member = surroundings.first_member + i;
    instances.state[slots + i] = element::standing_still(member);
    instances.sphere_m[slots + i] = job.cast->characters[member].character->bounds;
  }
}

}  // namespace throng::render
