#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::render {

/// One level of detail of one character: its triangles as they are drawn with `vertex_count`
/// vertices, all corners below it.
struct Level {
  std::uint32_t character = 0;
  std::uint32_t vertex_count = 0;
  std::uint32_t triangle_count = 0;
  std::uint32_t first_triangle = 0;  // into LevelTable::corners
};

/// Levels of detail a fifth apart for every character, coarsest first: what far agents are drawn
/// with, so that nothing has to follow collapse targets. A pure function of the cast, so that the
/// stages and the rasterizer count levels alike.
struct LevelTable {
  static constexpr std::uint32_t kMostVertices = 1024;  // of a level; finer ones are not listed
  static constexpr std::uint32_t kPadding = 16;

  std::vector<Level> levels;
  std::vector<std::uint32_t> corners;  // three vertices in bits 0, 10 and 20; padded
  // [members][kMostVertices + 1] finest within n; [0] for surroundings
  std::vector<std::vector<std::uint32_t>> level_at;
  std::vector<bool> is_listed;  // [members] false where triangles have holes: never shared
};

inline constexpr std::uint32_t corner_of(std::uint32_t corners, int k) {
  return (corners >> (10 * k)) & 1023U;
}

LevelTable make_levels(const Cast& cast);

/// Whether two characters look into the same memory.
bool same_columns(const Character& a, const Character& b);

/// How many characters, all but the surroundings, `cast` has in common with `before`: all of them,
/// or 0. What was made of them then holds.
std::size_t kept_members(const Cast& cast, const Cast& before);

/// Levels of the same characters with the surroundings of `cast`.
void set_surroundings(const Cast& cast, LevelTable& levels);

/// Vertex counts of a character's levels, finest first.
std::vector<std::uint32_t> level_counts(const Character& character);

/// Corners of a character's triangles with n vertices (legal): three for each.
std::vector<std::uint32_t> level_corners(const Character& character, std::uint32_t n);

}  // namespace throng::render
