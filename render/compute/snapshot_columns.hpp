#pragma once

#include "render/compute/element/advance.hpp"
#include "throng/render/crowd.hpp"

namespace throng::render {

/// The columns of a snapshot in the processor's memory; `channel` as Snapshot::channel.
inline element::SnapshotColumns columns_of(const Snapshot& snapshot, int channel) {
  element::SnapshotColumns columns;
  columns.slots = static_cast<std::uint32_t>(snapshot.present.size());
  columns.present = snapshot.present.data();
  columns.position_m = snapshot.position_m.data();
  columns.velocity_mps = snapshot.velocity_mps.data();
  columns.heading_rad = snapshot.heading_rad.data();
  columns.speed_mps = snapshot.speed_mps.data();
  columns.turn_radps = snapshot.turn_radps.data();
  columns.walked_cycles = snapshot.walked_cycles.data();
  if (!snapshot.motion.empty()) columns.motion = snapshot.motion.data();
  if (const std::vector<float>* values = snapshot.channel(channel)) {
    columns.channel = values->data();
  }
  if (snapshot.roster != nullptr) {  // none: nobody ever came
    columns.id = snapshot.roster->id.data();
    columns.character = snapshot.roster->character.data();
    columns.scale = snapshot.roster->scale.data();
    columns.seed = snapshot.roster->seed.data();
  }
  return columns;
}

}  // namespace throng::render
