#include "simplify/bake/bake.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "simplify/bake/export_obj.hpp"
#include "simplify/bake/inspect.hpp"
#include "support/source_shapes.hpp"
#include "support/tiny_character.hpp"

namespace throng::simplify {
namespace {

using ::testing::HasSubstr;

SourceCharacter make_bending_tube() {
  test::TubeOptions options;
  options.has_elbow = true;
  return test::make_tube(options);
}

TEST(BakeTest, MakesAValidCharacter) {
  auto result = bake(make_bending_tube());
  ASSERT_TRUE(result.ok()) << result.status();
  const auto character = render::make_character(result->character);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_EQ(character->name, "shape");
  EXPECT_EQ(character->joint_count(), 2U);
  EXPECT_EQ(result->point_count, 16U * 21 + 2);
  EXPECT_FLOAT_EQ(character->height_m, 1.8F);
  EXPECT_TRUE(check_levels(*character).ok());
}

TEST(BakeTest, BoundsHoldEveryPoseWithRoundedWeights) {
  const auto result = bake(make_bending_tube());
  ASSERT_TRUE(result.ok());
  const render::CharacterData& data = result->character;
  float farthest_m = 0.0F;
  for (std::size_t f = 0; f < data.palette.size() / 2; ++f) {
    for (std::size_t i = 0; i < data.position.size(); ++i) {
      glm::vec3 sum(0.0F);
      for (int k = 0; k < 4; ++k) {
        const render::Affine& matrix = data.palette[f * 2 + data.joint_index[i][k]];
        const glm::vec4 bind(data.position[i], 1.0F);
        sum += static_cast<float>(data.joint_weight[i][k]) / 255.0F *
               glm::vec3(glm::dot(matrix.row[0], bind), glm::dot(matrix.row[1], bind),
                         glm::dot(matrix.row[2], bind));
      }
      farthest_m = std::max(farthest_m, glm::distance(sum, glm::vec3(data.bounds)));
    }
  }
  EXPECT_LE(farthest_m, data.bounds.w);
  EXPECT_GT(farthest_m, 0.95F * data.bounds.w);
}

TEST(BakeTest, HeightScalesAll) {
  BakeOptions options;
  options.height_m = 0.9F;
  const auto result = bake(make_bending_tube(), options);
  ASSERT_TRUE(result.ok());
  EXPECT_NEAR(result->character.height_m, 0.9F, 1.0e-5F);
  EXPECT_NEAR(result->character.clips[0].stride_m, 0.6F, 1.0e-5F);
}

TEST(BakeTest, ReportsProgressUpToTheEnd) {
  std::vector<float> shares;
  BakeOptions options;
  options.on_progress = [&](float share) { shares.push_back(share); };
  ASSERT_TRUE(bake(make_bending_tube(), options).ok());
  ASSERT_FALSE(shares.empty());
  EXPECT_EQ(shares.back(), 1.0F);
  EXPECT_TRUE(std::is_sorted(shares.begin(), shares.end()));
}

TEST(BakeTest, BadSourcesAreNamed) {
  SourceCharacter none = make_bending_tube();
  none.joints.clear();
  EXPECT_THAT(std::string(bake(none).status().message()), HasSubstr("no joint"));
  SourceCharacter cycle = make_bending_tube();
  cycle.joints[1].parent = 1;
  EXPECT_THAT(std::string(bake(cycle).status().message()), HasSubstr("joint 1 has parent 1"));
  SourceCharacter nan = make_bending_tube();
  nan.points[3].position.x = std::nanf("");
  EXPECT_THAT(std::string(bake(nan).status().message()), HasSubstr("point 3"));
}

TEST(ExportObjTest, WritesALevelThatOtherToolsRead) {
  const auto character = render::make_character(test::make_tiny_character());
  ASSERT_TRUE(character.ok());
  const std::string text = obj_of_level(*character, 13);  // not legal: 12 is
  const auto count = [&](const std::string& what) {
    std::size_t found = 0;
    for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1))
      ++found;
    return found;
  };
  const std::uint32_t n = character->legal_count[13];
  EXPECT_EQ(count("\nv "), n);
  EXPECT_EQ(count("\nvt "), n);
  EXPECT_EQ(count("\nvn "), n);
  EXPECT_EQ(count("\nf "), character->triangle_count_at[n]);
  EXPECT_EQ(obj_of_level(*character, 0), obj_of_level(*character, character->coarsest_count));
  EXPECT_EQ(obj_of_level(*character, 999), obj_of_level(*character, 38));
}

TEST(InspectTest, TellsCountsLevelsAndClips) {
  const auto character = render::make_character(test::make_tiny_character());
  ASSERT_TRUE(character.ok());
  const std::string text = inspect_text(*character, 1 << 20);
  EXPECT_THAT(text, HasSubstr("38 vertices (uv wedges of 34 points), 64 triangles, 2 joints"));
  EXPECT_THAT(text, HasSubstr("coarsest"));
  EXPECT_THAT(text, HasSubstr("walk"));
  const std::string json = inspect_json(*character, 1 << 20);
  EXPECT_THAT(json, HasSubstr("\"coarsest_vertices\": 12"));
  EXPECT_THAT(json, HasSubstr("\"kind\": \"walk\""));
}

}  // namespace
}  // namespace throng::simplify
