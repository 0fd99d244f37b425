#pragma once

#include <absl/status/statusor.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "render/compute/cpu/posed_bank.hpp"
#include "render/compute/cpu/stages.hpp"
#include "render/compute/element/shared_pose.hpp"

namespace throng::render {

/// Numbers the shared pose of each visible instance that `shares(v)`, and makes room in the bank
/// for those that are not there. Returns what is to be filled in; ResourceExhausted beyond the
/// bank's limit.
template <typename Shares>
absl::StatusOr<std::vector<PosedBank::Want>> want_poses(CpuView& view, Machine machine,
                                                        PosedBank& bank,
                                                        std::vector<WorkerScratch>& scratch,
                                                        std::size_t count, const Shares& shares) {
  constexpr std::size_t kChunk = 1024;
  const CpuInstances& instances = *view.instances;
  const CastTable& cast = *instances.cast;
  bank.use(instances.cast);
  std::vector<PosedBank::Want> wanted;
  for (;;) {
    machine.pool.run((count + kChunk - 1) / kChunk, [&](std::size_t chunk, unsigned worker) {
      const std::size_t end = std::min(count, (chunk + 1) * kChunk);
      for (std::size_t v = chunk * kChunk; v < end; ++v) {
        if (!shares(v)) continue;
        const VisibleInstance& instance = view.visible[v];
        view.mesh[v] = PosedBank::number_of(
            instance.character,
            element::shared_pose_of(view.state[v].pose, cast.characters[instance.character].gait,
                                    view.tier[v]));
        const PosedBank::Want want{view.mesh[v], instance.vertex_count};
        if (!bank.has(want)) scratch[worker].wanted.push_back(want);
      }
    });
    wanted.clear();
    for (WorkerScratch& own : scratch) {
      wanted.insert(wanted.end(), own.wanted.begin(), own.wanted.end());
      own.wanted.clear();
    }
    absl::StatusOr<bool> has_room = bank.reserve(wanted);
    if (!has_room.ok()) return has_room.status();
    if (*has_room) return wanted;
  }
}

}  // namespace throng::render
