#include "support/tiny_character.hpp"

#include <gtest/gtest.h>

#include <set>

namespace throng::render {
namespace {

TEST(TinyCharacterTest, KeepsEveryPromiseOfCharacter) {
  const auto character = make_character(test::make_tiny_character());
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_EQ(character->vertex_count(), 38U);
  EXPECT_EQ(character->triangle_count(), 64U);
  EXPECT_EQ(character->coarsest_count, 12U);
  EXPECT_EQ(character->clips.size(), 2U);
}

TEST(TinyCharacterTest, EveryLegalLevelIsWholeAndUsesItsVertices) {
  const CharacterData data = test::make_tiny_character();
  int legal_levels = 0;
  for (std::uint32_t n = data.coarsest_count; n <= data.position.size(); ++n) {
    if (data.legal_count[n] != n) continue;
    ++legal_levels;
    std::set<std::uint32_t> used;
    for (std::uint32_t k = 0; k < data.triangle_count_at[n]; ++k) {
      std::set<std::uint32_t> corners;
      for (int i = 0; i < 3; ++i) {
        std::uint32_t corner = data.triangle[k][i];
        while (corner >= n) corner = data.collapse_target[corner];
        corners.insert(corner);
      }
      EXPECT_EQ(corners.size(), 3U) << "triangle " << k << " at " << n;
      used.insert(corners.begin(), corners.end());
    }
    EXPECT_EQ(used.size(), n);
  }
  EXPECT_EQ(legal_levels, 25);  // 24 groups of collapses
}

TEST(TinyCharacterTest, CoarsestLevelIsAFourSidedPrism) {
  const CharacterData data = test::make_tiny_character();
  EXPECT_EQ(data.triangle_count_at[12], 16U);
  EXPECT_EQ(data.triangle_count_at[11], 0U);
}

}  // namespace
}  // namespace throng::render
