#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::simplify {

/// A level at which characters are judged: share of the vertices, and how tall the figure is shown.
struct LevelSpec {
  const char* name;
  float share;  // 0: the coarsest
  std::uint32_t native_px;
};
inline constexpr std::array<LevelSpec, 6> kLevelSpecs{{{"full", 1.0F, 400},
                                                       {"50 %", 0.5F, 200},
                                                       {"25 %", 0.25F, 120},
                                                       {"10 %", 0.1F, 60},
                                                       {"5 %", 0.05F, 40},
                                                       {"coarsest", 0.0F, 20}}};

/// The legal vertex count for a share of the vertices, at least the coarsest.
std::uint32_t level_vertices(const render::Character& character, float share);

/// What is drawn of a character: corners index its vertices [C], of which some need not be used.
struct LevelMesh {
  std::vector<glm::uvec3> triangles;         // [t]
  std::vector<std::uint8_t> triangle_flags;  // [t]
  std::uint32_t vertices = 0;                // different ones in use
  std::uint32_t count = 0;  // vertex count of the character's level; 0: a mesh of another kind
};

/// The level with `count` vertices, a legal count: triangles [0, triangle_count_at[count]) with
/// every corner replaced by following the collapse target until it is below `count`.
LevelMesh level_mesh(const render::Character& character, std::uint32_t count);

/// The largest legal level with at most so many triangles, else the coarsest.
LevelMesh level_mesh_of(const render::Character& character, std::uint32_t triangles);

}  // namespace throng::simplify
