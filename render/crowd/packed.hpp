#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "throng/render/crowd.hpp"

namespace throng::render {

/// Consecutive snapshots in little memory: columns in steps too small to see, as differences in
/// time, their bytes sorted by weight and compressed by zstd. Immutable.
///
/// What comes back differs from what went in by at most half a step: position 1 mm (more beyond
/// 2,000 km from the origin, where float32 has no millimetres), velocity 1 mm/s, heading 0.1 mrad,
/// walked cycles 1/4096, turning 5 mrad/s; speed is that of the velocity. Rosters, channels and
/// motions come back exactly.
struct PackedSnapshots {
  std::int64_t first_time_us = 0;
  std::int64_t last_time_us = 0;
  std::size_t count = 0;
  std::string bytes;

  std::size_t size_bytes() const { return sizeof(*this) + bytes.size(); }
};

/// @param snapshots  in order of time, at least one. Takes about 0.1 us an agent and snapshot.
PackedSnapshots pack(std::span<const std::shared_ptr<const Snapshot>> snapshots);

/// The snapshots of `pack`. Those that shared a roster share one again.
std::vector<std::shared_ptr<const Snapshot>> unpack(const PackedSnapshots& packed);

}  // namespace throng::render
