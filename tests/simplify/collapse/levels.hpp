#pragma once

#include <gtest/gtest.h>

#include <map>
#include <set>
#include <tuple>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::test {

/// Triangles of a level, corners below n: the published rule, in the plainest way.
inline std::vector<glm::uvec3> triangles_at(const render::Character& character, std::uint32_t n) {
  std::vector<glm::uvec3> triangles;
  for (std::uint32_t k = 0; k < character.triangle_count_at[n]; ++k) {
    glm::uvec3 corner = character.triangle[k];
    for (int i = 0; i < 3; ++i) {
      while (corner[i] >= n) corner[i] = character.collapse_target[corner[i]];
    }
    triangles.push_back(corner);
  }
  return triangles;
}

inline std::vector<std::uint32_t> legal_counts(const render::Character& character) {
  std::vector<std::uint32_t> counts;
  for (std::uint32_t n = character.coarsest_count; n <= character.vertex_count(); ++n) {
    if (character.legal_count[n] == n) counts.push_back(n);
  }
  return counts;
}

/// Each triangle has three corners, each vertex a triangle.
inline void expect_whole(const render::Character& character, std::uint32_t n) {
  std::set<std::uint32_t> used;
  for (const glm::uvec3& corner : triangles_at(character, n)) {
    EXPECT_TRUE(corner.x != corner.y && corner.y != corner.z && corner.z != corner.x) << "at " << n;
    for (int i = 0; i < 3; ++i) used.insert(corner[i]);
  }
  EXPECT_EQ(used.size(), n);
}

/// Every edge between two places is walked once in each direction: no crack, no hole.
inline void expect_closed(const render::Character& character, std::uint32_t n) {
  using Place = std::tuple<float, float, float>;
  std::map<std::pair<Place, Place>, int> edges;
  for (const glm::uvec3& corner : triangles_at(character, n)) {
    for (int i = 0; i < 3; ++i) {
      const glm::vec3 &a = character.position[corner[i]],
                      &b = character.position[corner[(i + 1) % 3]];
      ++edges[{{a.x, a.y, a.z}, {b.x, b.y, b.z}}];
      --edges[{{b.x, b.y, b.z}, {a.x, a.y, a.z}}];
    }
  }
  int open = 0;
  for (const auto& [edge, balance] : edges) open += balance != 0 ? 1 : 0;
  EXPECT_EQ(open, 0) << "at " << n << " vertices";
}

}  // namespace throng::test
