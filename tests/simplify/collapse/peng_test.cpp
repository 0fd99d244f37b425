#include <gtest/gtest.h>

#include "simplify/bake/bake.hpp"
#include "simplify/collapse/levels.hpp"
#include "support/source_shapes.hpp"

namespace throng::simplify {
namespace {

render::Character baked(const SourceCharacter& source) {
  BakeOptions options;
  options.criterion = Criterion::kPeng2011;
  auto result = bake(source, options);
  EXPECT_TRUE(result.ok()) << result.status();
  auto character = render::make_character(std::move(result->character));
  EXPECT_TRUE(character.ok()) << character.status();
  return *std::move(character);
}

TEST(Peng2011Test, FixedVerticesDoNotMove) {
  // every point of the unfolded cube that has more than two wedges is fixed
  const render::Character character = baked(test::make_cube());
  std::map<std::tuple<float, float, float>, int> wedges;
  for (const glm::vec3& p : character.position) ++wedges[{p.x, p.y, p.z}];
  int fixed = 0;
  for (std::uint32_t i = 0; i < character.vertex_count(); ++i) {
    const glm::vec3& p = character.position[i];
    if (wedges[{p.x, p.y, p.z}] <= 2) continue;
    ++fixed;
    // one that has no triangle left becomes another wedge of its own point
    if (i >= character.coarsest_count) {
      EXPECT_EQ(character.position[character.collapse_target[i]], p);
    }
  }
  EXPECT_GT(fixed, 0);
  EXPECT_LT(character.coarsest_count, character.vertex_count());
}

TEST(Peng2011Test, BordersStay) {
  const render::Character character = baked(test::make_cut_sheet(8));
  int border = 0;
  for (std::uint32_t i = 0; i < character.coarsest_count; ++i) {
    const glm::vec3& p = character.position[i];
    if (p.y == -0.5F || p.y == 0.5F || p.z == 0.0F || p.z == 1.0F) ++border;
  }
  EXPECT_EQ(border, 34);  // 32 points, the ends of the cut twice
}

TEST(Peng2011Test, CompanionsGoTogether) {
  const render::Character character = baked(test::make_cut_sheet(8));
  for (const std::uint32_t n : test::legal_counts(character)) {
    std::map<float, int> copies;
    for (std::uint32_t i = 0; i < n; ++i) {
      if (character.position[i].y == 0.0F) ++copies[character.position[i].z];
    }
    for (const auto& [z, count] : copies) EXPECT_EQ(count, 2) << "z " << z << " at " << n;
  }
  // all inner points of the cut are companioned and can go
  int inner = 0;
  for (std::uint32_t i = 0; i < character.coarsest_count; ++i) {
    const glm::vec3& p = character.position[i];
    inner += p.y == 0.0F && p.z > 0.0F && p.z < 1.0F ? 1 : 0;
  }
  EXPECT_EQ(inner, 0);
}

TEST(Peng2011Test, EveryLegalLevelIsWholeAndClosed) {
  test::TubeOptions tube;
  tube.has_elbow = true;
  const render::Character character = baked(test::make_tube(tube));
  EXPECT_LT(character.coarsest_count, character.vertex_count() / 2);
  for (const std::uint32_t n : test::legal_counts(character)) {
    test::expect_whole(character, n);
    test::expect_closed(character, n);
  }
}

}  // namespace
}  // namespace throng::simplify
