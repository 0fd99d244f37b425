#include "render/compute/cpu/kernels.hpp"
#include "render/compute/cpu/stages.hpp"

namespace throng::render {

void advance(const Snapshot& older, const Snapshot& newer, std::int64_t scene_time_us,
             const CrowdSettings& settings, int channel, Machine machine, CpuInstances& instances) {
  constexpr std::size_t kChunk = 1024;
  AdvanceJob job;
  job.older = &older;
  job.newer = &newer;
  job.cast = instances.cast.get();
  job.between =
      element::between(older.time_us, newer.time_us, scene_time_us, settings.extrapolate_limit_us);
  job.scene_time_us = scene_time_us;
  job.channel = channel;
  const Snapshot& shown = job.between.at_newer ? newer : older;
  const std::size_t slots = shown.present.size();
  instances.scene_time_us = scene_time_us;
  instances.count = static_cast<std::uint32_t>(slots);
  instances.present = shown.present_count;
  instances.origin_world = settings.origin_world;
  instances.sphere_m.resize(slots);
  instances.state.resize(slots);
  job.sphere_m = instances.sphere_m.data();
  job.state = instances.state.data();
  machine.pool.for_chunks(slots, kChunk, [&](std::size_t begin, std::size_t end) {
    machine.kernels.advance(job, begin, end);
  });
}

}  // namespace throng::render
