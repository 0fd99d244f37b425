#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "render/compute/cpu/work_pool.hpp"

namespace throng::render::visibility {

/// Lists by tile: those of tile i are entries [first[i], first[i + 1]), in the order of the values.
template <typename Entry>
struct Bins {
  static constexpr std::size_t kChunks = 16;  // of the values, so that threads can share the work
  std::vector<std::uint32_t> first;           // [tiles + 1]
  std::vector<std::uint32_t> next;            // [kChunks][tiles] where a chunk's entries go
  std::vector<Entry> entries;

  /// `visit(begin, end, place)` calls place(tile, entry) for each entry of values [begin, end),
  /// twice in the same order.
  template <typename Visit>
  void fill(std::size_t tiles, std::size_t values, WorkPool& pool, const Visit& visit) {
    first.resize(tiles + 1);
    next.assign(kChunks * tiles, 0);
    pool.run(kChunks, [&](std::size_t chunk, unsigned) {
      std::uint32_t* own = next.data() + chunk * tiles;
      visit(values * chunk / kChunks, values * (chunk + 1) / kChunks,
            [own](std::size_t tile, const Entry&) { ++own[tile]; });
    });
    std::uint32_t sum = 0;
    for (std::size_t tile = 0; tile < tiles; ++tile) {
      first[tile] = sum;
      for (std::size_t chunk = 0; chunk < kChunks; ++chunk) {
        const std::uint32_t own = next[chunk * tiles + tile];
        next[chunk * tiles + tile] = sum;
        sum += own;
      }
    }
    first[tiles] = sum;
    if (entries.size() < sum) entries.resize(sum + sum / 2);
    pool.run(kChunks, [&](std::size_t chunk, unsigned) {
      std::uint32_t* own = next.data() + chunk * tiles;
      visit(values * chunk / kChunks, values * (chunk + 1) / kChunks,
            [this, own](std::size_t tile, const Entry& entry) { entries[own[tile]++] = entry; });
    });
  }
  void clear() { first.clear(); }
  bool any(std::size_t tile) const { return !first.empty() && first[tile + 1] > first[tile]; }
  std::span<const Entry> of(std::size_t tile) const {
    return {entries.data() + first[tile], entries.data() + first[tile + 1]};
  }
  std::uint64_t size_bytes() const {
    return sizeof(Entry) * entries.capacity() +
           sizeof(std::uint32_t) * (first.capacity() + next.capacity());
  }
};

}  // namespace throng::render::visibility
