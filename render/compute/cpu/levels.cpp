#include "render/compute/cpu/levels.hpp"

#include <algorithm>

namespace throng::render {

std::vector<std::uint32_t> level_counts(const Character& character) {
  std::vector<std::uint32_t> counts;
  std::uint32_t n = character.vertex_count();
  for (;;) {
    counts.push_back(n);
    if (n <= character.coarsest_count) return counts;
    const std::uint32_t next = character.legal_count[n - std::max(1U, n / 5)];
    n = std::max(next, character.coarsest_count);
  }
}

std::vector<std::uint32_t> level_corners(const Character& character, std::uint32_t n) {
  const std::uint32_t triangles = character.triangle_count_at[n];
  std::vector<std::uint32_t> corners(std::size_t{3} * triangles);
  for (std::uint32_t t = 0; t < triangles; ++t) {
    for (int i = 0; i < 3; ++i) {
      std::uint32_t corner = character.triangle[t][i];
      while (corner >= n) corner = character.collapse_target[corner];
      corners[3 * t + i] = corner;
    }
  }
  return corners;
}

LevelTable make_levels(const Cast& cast) {
  LevelTable table;
  for (std::size_t m = 0; m < cast.members.size(); ++m) {
    const Character& character = cast.members[m].character;
    std::vector<std::uint32_t> counts;
    const std::size_t steps = std::size_t{character.vertex_count()} + 1;
    if (cast.members[m].environment) {
      table.level_at.emplace_back();
      table.is_listed.push_back(false);
      continue;
    }
    // a rasterizer may be given characters without a collapse
    if (character.legal_count.size() == steps && character.triangle_count_at.size() == steps &&
        character.coarsest_count > 0) {
      counts = level_counts(character);
      std::reverse(counts.begin(), counts.end());
    }
    std::vector<std::uint32_t>& at = table.level_at.emplace_back(LevelTable::kMostVertices + 1, 0);
    const auto first = static_cast<std::uint32_t>(table.levels.size());
    for (const std::uint32_t n : counts) {
      if (n > LevelTable::kMostVertices) break;
      const auto number = static_cast<std::uint32_t>(table.levels.size());
      std::fill(at.begin() + n, at.end(), number);
      const std::vector<std::uint32_t> corners = level_corners(character, n);
      table.levels.push_back({static_cast<std::uint32_t>(m), n,
                              static_cast<std::uint32_t>(corners.size() / 3),
                              static_cast<std::uint32_t>(table.corners.size())});
      for (std::size_t k = 0; k < corners.size(); k += 3) {
        table.corners.push_back(corners[k] | corners[k + 1] << 10 | corners[k + 2] << 20);
      }
    }
    const bool has_holes =
        std::any_of(character.triangle_flags.begin(), character.triangle_flags.end(),
                    [](std::uint8_t flags) { return (flags & kTriangleAlphaCutout) != 0; });
    table.is_listed.push_back(table.levels.size() > first && !has_holes);
  }
  // so that whole vectors may be read
  table.corners.resize(table.corners.size() + LevelTable::kPadding, 0);
  return table;
}

bool same_columns(const Character& a, const Character& b) {
  return a.storage != nullptr && a.storage == b.storage && a.position.data() == b.position.data() &&
         a.triangle.data() == b.triangle.data() && a.palette.data() == b.palette.data() &&
         a.base_color.texels.data() == b.base_color.texels.data() && a.relief == b.relief;
}

/// Members before what stands around them.
static std::size_t character_count(const Cast& cast) {
  const auto first = std::find_if(cast.members.begin(), cast.members.end(),
                                  [](const CastMember& member) { return member.environment; });
  return static_cast<std::size_t>(first - cast.members.begin());
}

std::size_t kept_members(const Cast& cast, const Cast& before) {
  const std::size_t count = character_count(cast);
  if (count != character_count(before)) return 0;
  for (std::size_t m = 0; m < count; ++m) {
    if (!same_columns(cast.members[m].character, before.members[m].character)) return 0;
  }
  return count;
}

void set_surroundings(const Cast& cast, LevelTable& levels) {
  const std::size_t characters = character_count(cast);
  levels.level_at.resize(characters);
  levels.is_listed.resize(characters);
  levels.level_at.resize(cast.members.size());
  levels.is_listed.resize(cast.members.size(), false);
}

}  // namespace throng::render
