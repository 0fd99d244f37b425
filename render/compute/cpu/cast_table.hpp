#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "render/compute/cpu/error_table.hpp"
#include "render/compute/cpu/levels.hpp"
#include "render/compute/element/gait.hpp"
#include "render/compute/element/skinning.hpp"
#include "throng/render/asset.hpp"

namespace throng::render {

/// Triangles as they are drawn with `vertex_count` vertices: corners are below it.
struct LadderLevel {
  std::uint32_t vertex_count = 0;
  std::vector<std::uint32_t> corner;  // [3 * triangle_count_at[vertex_count]]
};

/// A vertex as the skinning loop reads it, in one go: element::SourceVertex with its weights as
/// numbers, and what is passed on.
struct TableVertex {
  glm::vec3 position_m;
  glm::vec3 normal;
  float weight[4];
  glm::u8vec4 joint_index;
  glm::u16vec2 uv;
};
static_assert(sizeof(TableVertex) == 48);

/// A character as the processor draws it.
struct CharacterTable {
  const Character* character = nullptr;  // of the cast
  element::Gait gait;
  float reach_m = 0.0F;                           // from the feet, whatever it does
  std::span<const TableVertex> vertex;            // [C]
  std::span<const element::JointMatrix> palette;  // [F][J]
  std::span<const std::uint32_t> joint_order;     // joints by the first vertex that needs them
  std::span<const std::uint32_t> joint_count_at;  // [C+1] how many of them n vertices need
  // Levels of detail a fifth apart, coarsest first: an instance starts at the next finer one, whose
  // corners are at most a few collapses away from its own.
  std::span<const LadderLevel> ladder;
  ErrorTable error;
  std::span<const TableVertex> point;  // [P] Character::points as they are skinned
  std::shared_ptr<const void>
      columns;  // what the spans look into; tables of the same cast share it
};

/// The cast on the processor.
struct CastTable {
  std::shared_ptr<const Cast> cast;
  std::vector<CharacterTable> characters;
  std::uint32_t most_joints = 0;
  std::uint32_t most_vertices = 0;
  LevelTable levels;
};

/// InvalidArgument names the member and what it lacks.
/// @param before  null, or a table whose characters and surroundings are taken over where the cast
///                has them too: only what is new is made
absl::StatusOr<std::shared_ptr<const CastTable>> make_cast_table(std::shared_ptr<const Cast> cast,
                                                                 const CastTable* before = nullptr);

}  // namespace throng::render
