#include <absl/strings/str_cat.h>

#include <algorithm>
#include <utility>

#include "simplify/collapse/collapse.hpp"

namespace throng::simplify {

// One pass instead of one for each level: along the chain of targets of a corner, vertex v stands
// for it at the counts over v up to its predecessor. Together with the counts at which the triangle
// is drawn this gives the intervals in which v is used; they must cover every legal count over v.
absl::Status check_levels(const render::Character& character) {
  const std::uint32_t vertices = character.vertex_count();
  const auto& target = character.collapse_target;
  std::vector<std::uint32_t> first_drawn(character.triangle.size());
  std::uint32_t level = character.coarsest_count;
  for (std::uint32_t k = 0; k < character.triangle.size(); ++k) {
    while (level < vertices &&
           (character.triangle_count_at[level] <= k || character.legal_count[level] != level)) {
      ++level;
    }
    first_drawn[k] = level;
    glm::uvec3 corner = character.triangle[k];
    for (int i = 0; i < 3; ++i) {
      while (corner[i] >= level) corner[i] = target[corner[i]];
    }
    if (corner.x == corner.y || corner.y == corner.z || corner.z == corner.x) {
      return absl::InternalError(
          absl::StrCat("triangle ", k, " has lost a corner at ", level, " vertices"));
    }
  }

  using Interval = std::pair<std::uint32_t, std::uint32_t>;  // counts, both ends included
  std::vector<std::vector<Interval>> used(vertices);
  for (std::uint32_t k = 0; k < character.triangle.size(); ++k) {
    for (int i = 0; i < 3; ++i) {
      std::uint32_t vertex = character.triangle[k][i];
      std::uint32_t last = vertices;
      for (;;) {
        const std::uint32_t first = std::max(vertex + 1, first_drawn[k]);
        if (first <= last) used[vertex].emplace_back(first, last);
        if (vertex < first_drawn[k] || vertex == 0) break;
        last = vertex;
        vertex = target[vertex];
      }
    }
  }
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    std::sort(used[vertex].begin(), used[vertex].end());
    std::uint32_t covered =
        std::max(vertex, character.coarsest_count - 1);  // counts up to here are fine
    used[vertex].emplace_back(vertices + 1, vertices + 1);
    for (const auto& [first, last] : used[vertex]) {
      for (std::uint32_t n = covered + 1; n < first && n <= vertices; ++n) {
        if (character.legal_count[n] == n) {
          return absl::InternalError(
              absl::StrCat("vertex ", vertex, " has no triangle at ", n, " vertices"));
        }
      }
      covered = std::max(covered, last);
    }
  }
  return absl::OkStatus();
}

}  // namespace throng::simplify
