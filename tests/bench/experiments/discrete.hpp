#pragma once

#include <cstdint>

#include "throng/render/asset.hpp"

namespace throng::bench {

/// Discrete levels of detail, the classic baseline: a few meshes made beforehand, chosen by height
/// on the picture. A level is used up to the height at which its quality is judged.
inline constexpr std::uint32_t kDiscreteLevels = 6;

/// Level of a figure so many pixels tall: 0 is full detail, 5 the coarsest mesh.
inline std::uint32_t discrete_level(double height_px) {
  constexpr double kOver[kDiscreteLevels - 1] = {200, 120, 60, 40, 20};
  std::uint32_t level = 0;
  while (level + 1 < kDiscreteLevels && height_px <= kOver[level]) ++level;
  return level;
}

/// Vertices of a level: 100, 50, 25, 10, 5 % and the coarsest, at legal counts.
inline std::uint32_t discrete_vertex_count(const render::Character& character,
                                           std::uint32_t level) {
  constexpr double kShare[kDiscreteLevels] = {1.0, 0.5, 0.25, 0.1, 0.05, 0.0};
  const auto wanted = static_cast<std::uint32_t>(kShare[level] * character.vertex_count());
  return wanted <= character.coarsest_count ? character.coarsest_count
                                            : character.legal_count[wanted];
}

}  // namespace throng::bench
