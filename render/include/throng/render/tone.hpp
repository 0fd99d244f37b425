#pragma once

#include <cstdint>

// .cu files include it.
namespace throng::render {

/// Levels of detail that share the colours of their triangles: those with at most `vertex_count`
/// vertices, and more than the next band has.
struct ToneBand {
  std::uint32_t vertex_count;
  std::uint32_t first;  // triangle 0 of the band, in the tones of all triangles
};
static_assert(sizeof(ToneBand) == 8);

}  // namespace throng::render
