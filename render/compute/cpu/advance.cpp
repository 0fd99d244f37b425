#include <utility>

#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/stages.hpp"
#include "render/compute/snapshot_columns.hpp"

namespace throng::render {
void advance(std::shared_ptr<const Snapshot> older, std::shared_ptr<const Snapshot> newer,
             std::int64_t scene_time_us, const CrowdSettings& settings, int channel,
             Surroundings surroundings, Machine machine, CpuInstances& instances) {
  constexpr std::size_t kChunk = 4096;
  element::Bracketed& moment = instances.moment;
  moment.between = element::between(older->time_us, newer->time_us, scene_time_us,
                                    settings.extrapolate_limit_us);
  moment.scene_time_us = scene_time_us;
  moment.same_roster = older->roster == newer->roster;
  const Snapshot& shown = moment.between.at_newer ? *newer : *older;
  moment.shown = columns_of(shown, channel);
  moment.newer = columns_of(*newer, channel);
  const std::size_t slots = shown.present.size();
  instances.scene_time_us = scene_time_us;
  instances.count = static_cast<std::uint32_t>(slots) + surroundings.member_count;
  instances.surrounding = surroundings.member_count;
  instances.first_surrounding = surroundings.first_member;
  instances.present = shown.present_count;
  instances.origin_world = settings.origin_world;
  instances.older = std::move(older);
  instances.newer = std::move(newer);
  instances.place_m.resize(slots);
  machine.pool.for_chunks(slots, kChunk, [&](std::size_t begin, std::size_t end) {
    machine.kernels.advance(moment, instances.place_m.data(), begin, end);
  });
}

}  // namespace throng::render
