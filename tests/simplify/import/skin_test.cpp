#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"

namespace throng::simplify {
namespace {

using test::GltfBuilder;
using testing::Contains;
using testing::HasSubstr;

absl::StatusOr<SourceCharacter> import_built(const GltfBuilder& builder,
                                             const ImportOptions& options = {}) {
  const std::string path = test::scratch_path("skin.glb");
  test::write_file(path, builder.glb());
  absl::StatusOr<SourceCharacter> character = import_gltf(path, options);
  EXPECT_EQ(character.ok() ? test::fault_of(*character) : "", "");
  return character;
}

std::string number(int value) { return std::to_string(value); }

/// A box with eight vertices whose joints and weights are the given accessors.
std::string skinned_box(GltfBuilder& b, const std::string& influences) {
  return b.box({-0.5F, 0, -0.5F}, {0.5F, 2, 0.5F}, influences);
}

TEST(ImportSkinTest, ClipMovesPointsAsTheHierarchySays) {
  const auto character = import_built(test::bending_post());
  ASSERT_TRUE(character.ok()) << character.status();
  ASSERT_EQ(character->clips.size(), 1U);
  const SourceClip& clip = character->clips[0];
  EXPECT_EQ(clip.kind, render::ClipKind::kWalk);
  EXPECT_EQ(clip.frame_count, 30U);  // the key at 1 s repeats the first
  EXPECT_FLOAT_EQ(clip.rate_hz, 30.0F);
  EXPECT_TRUE(clip.loop);
  ASSERT_EQ(character->joints.size(), 2U);
  EXPECT_EQ(character->joints[1].parent, 0);
  EXPECT_EQ(character->joints[1].name, "bend");
  // half way the upper half lies forward: the top at height 1 reaches one metre to the front
  const std::vector<glm::vec3> points = test::posed(*character, clip, 15);
  const test::Extent extent = test::extent_of(points);
  EXPECT_NEAR(extent.high.x, 1.0F, 1e-4F);
  EXPECT_NEAR(extent.high.z, 1.2F, 1e-4F);
  EXPECT_NEAR(extent.low.z, 0.0F, 1e-5F);
}

TEST(ImportSkinTest, HeightScalesMeshBindAndClipsAlike) {
  ImportOptions options;
  options.height_m = 1.0F;  // half
  const auto whole = import_built(test::bending_post());
  const auto half = import_built(test::bending_post(), options);
  ASSERT_TRUE(whole.ok() && half.ok());
  for (const std::uint32_t frame : {0U, 7U, 15U}) {
    const auto large = test::posed(*whole, whole->clips[0], frame);
    const auto small = test::posed(*half, half->clips[0], frame);
    for (std::size_t i = 0; i < large.size(); ++i)
      EXPECT_NEAR(glm::length(0.5F * large[i] - small[i]), 0.0F, 1e-5F);
  }
}

TEST(ImportSkinTest, SixInfluencesBecomeTheStrongestFour) {
  GltfBuilder b;
  std::vector<std::uint8_t> first;
  std::vector<std::uint8_t> second;
  std::vector<float> first_weights;
  std::vector<float> second_weights;
  for (int i = 0; i < 8; ++i) {
    first.insert(first.end(), {0, 1, 2, 3});
    second.insert(second.end(), {4, 5, 0, 0});
    first_weights.insert(first_weights.end(), {0.05F, 0.30F, 0.10F, 0.20F});
    second_weights.insert(second_weights.end(), {0.25F, 0.10F, 0.0F, 0.0F});
  }
  const std::string more = ",\"JOINTS_0\":" + number(b.accessor(first, "VEC4")) +
                           ",\"WEIGHTS_0\":" + number(b.accessor(first_weights, "VEC4")) +
                           ",\"JOINTS_1\":" + number(b.accessor(second, "VEC4")) +
                           ",\"WEIGHTS_1\":" + number(b.accessor(second_weights, "VEC4"));
  b.meshes = {"{\"primitives\":[{" + skinned_box(b, more) + "}]}"};
  b.nodes = {R"({"mesh":0,"skin":0})", R"({"children":[2,3,4,5,6]})", "{}", "{}", "{}", "{}", "{}"};
  b.skins = {R"({"joints":[1,2,3,4,5,6]})"};
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_THAT(character->notes, Contains(HasSubstr("8 vertices have more than four influences")));
  // 0.30, 0.25, 0.20, 0.10 of 0.85
  const glm::vec4 weight = character->points[0].weight;
  EXPECT_NEAR(weight.x, 0.30F / 0.85F, 1e-5F);
  EXPECT_NEAR(weight.y, 0.25F / 0.85F, 1e-5F);
  EXPECT_NEAR(weight.z, 0.20F / 0.85F, 1e-5F);
  EXPECT_NEAR(weight.w, 0.10F / 0.85F, 1e-5F);
  EXPECT_EQ(character->joints[character->points[0].joint.x].name, "joint_2");
  EXPECT_EQ(character->joints.size(), 5U);  // the root carries the others, the weakest leaf is gone
}

TEST(ImportSkinTest, IntegerWeightsAreNormalized) {
  for (const bool wide : {false, true}) {
    GltfBuilder b;
    std::vector<std::uint16_t> joints;
    std::vector<std::uint8_t> narrow_weights;
    std::vector<std::uint16_t> wide_weights;
    for (int i = 0; i < 8; ++i) {
      joints.insert(joints.end(), {1, 0, 0, 0});
      narrow_weights.insert(narrow_weights.end(), {204, 51, 0, 0});
      wide_weights.insert(wide_weights.end(), {52428, 13107, 0, 0});
    }
    const int weights =
        wide ? b.accessor(wide_weights, "VEC4", true) : b.accessor(narrow_weights, "VEC4", true);
    b.meshes = {"{\"primitives\":[{" +
                skinned_box(b, ",\"JOINTS_0\":" + number(b.accessor(joints, "VEC4")) +
                                   ",\"WEIGHTS_0\":" + number(weights)) +
                "}]}"};
    b.nodes = {R"({"mesh":0,"skin":0})", R"({"name":"a","children":[2]})", R"({"name":"b"})"};
    b.skins = {R"({"joints":[1,2]})"};
    const auto character = import_built(b);
    ASSERT_TRUE(character.ok()) << character.status();
    EXPECT_NEAR(character->points[0].weight.x, 0.8F, 1e-4F);
    EXPECT_EQ(character->joints[character->points[0].joint.x].name, "b");
  }
}

TEST(ImportSkinTest, VerticesWithoutWeightFollowTheirFirstJoint) {
  GltfBuilder b;
  const std::string more =
      ",\"JOINTS_0\":" + number(b.accessor(std::vector<std::uint8_t>(32, 0), "VEC4")) +
      ",\"WEIGHTS_0\":" + number(b.accessor(std::vector<float>(32, 0.0F), "VEC4"));
  b.meshes = {"{\"primitives\":[{" + skinned_box(b, more) + "}]}"};
  b.nodes = {R"({"mesh":0,"skin":0})", "{}"};
  b.skins = {R"({"joints":[1]})"};
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_THAT(character->notes, Contains(HasSubstr("no weight")));
}

/// Two boxes on one joint each of two skins over the same joint, the second with another bind
/// matrix.
GltfBuilder two_skins(const std::string& second_bind_scale) {
  GltfBuilder b;
  const std::string more = [&] {
    std::vector<float> weights;
    for (int i = 0; i < 8; ++i) weights.insert(weights.end(), {1, 0, 0, 0});
    return ",\"JOINTS_0\":" + number(b.accessor(std::vector<std::uint8_t>(32, 0), "VEC4")) +
           ",\"WEIGHTS_0\":" + number(b.accessor(weights, "VEC4"));
  }();
  const float s = std::stof(second_bind_scale);
  const int first =
      b.accessor(std::vector<float>{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}, "MAT4");
  const int second =
      b.accessor(std::vector<float>{s, 0, 0, 0, 0, s, 0, 0, 0, 0, s, 0, 0, 1, 0, 1}, "MAT4");
  b.meshes = {"{\"primitives\":[{" + b.box({0, 0, 0}, {1, 1, 1}, more) + "}]}",
              "{\"primitives\":[{" + b.box({0, 0, 0}, {1, 1, 1}, more) + "}]}"};
  b.nodes = {R"({"mesh":0,"skin":0})", R"({"mesh":1,"skin":1})", R"({"name":"joint"})"};
  b.skins = {"{\"joints\":[2],\"inverseBindMatrices\":" + number(first) + "}",
             "{\"joints\":[2],\"inverseBindMatrices\":" + number(second) + "}"};
  return b;
}

TEST(ImportSkinTest, SkinsOverOneJointAreMergedThroughTheirBindMatrices) {
  const auto character = import_built(two_skins("0.5"));
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_EQ(character->joints.size(), 1U);
  // the second box is half as large and stands on the first
  const test::Extent extent = test::extent_of(test::posed(*character, character->clips[0], 0));
  EXPECT_NEAR(extent.size().z, 1.5F, 1e-5F);
}

TEST(ImportSkinTest, BindMatricesThatContradictGetAJointEach) {
  // two joints bound by both skins, the second skin with one of them shifted: no common frame
  // exists
  GltfBuilder b;
  std::vector<std::uint8_t> joints;
  std::vector<float> weights;
  for (int i = 0; i < 8; ++i) {
    joints.insert(joints.end(), {0, 1, 0, 0});
    const float lower = i < 4 ? 1.0F : 0.0F;
    weights.insert(weights.end(), {lower, 1.0F - lower, 0, 0});
  }
  const std::string more = ",\"JOINTS_0\":" + number(b.accessor(joints, "VEC4")) +
                           ",\"WEIGHTS_0\":" + number(b.accessor(weights, "VEC4"));
  const std::vector<float> same = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1,
                                   1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  std::vector<float> shifted = same;
  shifted[16 + 14] = 2.0F;  // z of the second joint
  const int first = b.accessor(same, "MAT4");
  const int second = b.accessor(shifted, "MAT4");
  b.meshes = {"{\"primitives\":[{" + b.box({0, 0, 0}, {1, 1, 1}, more) + "}]}"};
  b.nodes = {R"({"mesh":0,"skin":0})", R"({"mesh":0,"skin":1})", R"({"name":"a","children":[3]})",
             R"({"name":"b"})"};
  b.skins = {"{\"joints\":[2,3],\"inverseBindMatrices\":" + number(first) + "}",
             "{\"joints\":[2,3],\"inverseBindMatrices\":" + number(second) + "}"};
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_EQ(character->joints.size(), 3U);
  // in the file: box one spans z 0 to 1, box two 0 to 1 below and 2 to 3 above
  const test::Extent extent = test::extent_of(test::posed(*character, character->clips[0], 0));
  EXPECT_NEAR(extent.size().x, 3.0F, 1e-5F);
}

TEST(ImportSkinTest, MeshUnderAJointIsRigidToIt) {
  GltfBuilder b = test::bending_post();
  b.meshes.push_back("{\"primitives\":[{" + b.box({-0.1F, 0, -0.1F}, {0.1F, 0.5F, 0.1F}) + "}]}");
  b.nodes[2] = R"({"name":"bend","translation":[0,1,0],"children":[3]})";
  b.nodes.push_back(R"({"name":"hat","mesh":1,"translation":[0,1,0]})");
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_EQ(character->joints.size(), 2U);  // the hat needs none of its own
  EXPECT_NEAR(test::extent_of(*character).high.z, 2.5F, 1e-5F);
  const test::Extent bent = test::extent_of(test::posed(*character, character->clips[0], 15));
  EXPECT_NEAR(bent.high.x, 1.5F, 1e-4F);
}

TEST(ImportSkinTest, RigidCharacterMovesWithItsNodes) {
  GltfBuilder b;
  const int times = b.accessor(std::vector<float>{0, 1}, "SCALAR");
  const int shifts = b.accessor(std::vector<float>{0, 1, 0, 0, 1, 3}, "VEC3");
  b.meshes = {"{\"primitives\":[{" + b.box({0, 0, 0}, {1, 1, 1}) + "}]}",
              "{\"primitives\":[{" + b.box({0, 0, 0}, {1, 1, 1}) + "}]}"};
  b.nodes = {R"({"name":"base","mesh":0,"children":[1]})",
             R"({"name":"part","mesh":1,"translation":[0,1,0]})"};
  b.animations = {
      "{\"samplers\":[{\"input\":" + number(times) + ",\"output\":" + number(shifts) +
      "}],\"channels\":[{\"sampler\":0,\"target\":{\"node\":1,\"path\":\"translation\"}}]}"};
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  ASSERT_EQ(character->joints.size(), 2U);
  EXPECT_EQ(character->joints[1].parent, 0);
  const SourceClip& clip = character->clips[0];
  EXPECT_NEAR(test::extent_of(test::posed(*character, clip, 0)).size().z, 2.0F, 1e-5F);
  EXPECT_NEAR(test::extent_of(test::posed(*character, clip, 15)).size().x, 2.5F, 1e-4F);
}

TEST(ImportSkinTest, PartScaledToNothingAtRestAppearsWhenItsClipScalesIt) {
  GltfBuilder b;
  const int times = b.accessor(std::vector<float>{0, 1}, "SCALAR");
  const int sizes = b.accessor(std::vector<float>{1, 1, 1, 2, 2, 2}, "VEC3");
  b.nodes = {R"({"name":"prop","mesh":0,"scale":[0,0,0]})"};
  b.animations = {"{\"name\":\"idle\",\"samplers\":[{\"input\":" + number(times) +
                  ",\"output\":" + number(sizes) +
                  "}],\"channels\":[{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"scale\"}}]}"};
  const auto character = import_built(test::one_mesh(b, b.box({0, 0, 0}, {1, 1, 1})));
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_NEAR(test::extent_of(test::posed(*character, character->clips[0], 0)).size().z, 1.0F,
              1e-5F);
}

TEST(ImportSkinTest, RestPoseThatIsNotTheBindPoseKeepsTheMeshUpright) {
  GltfBuilder b = test::bending_post();
  // saved while bent: the upper joint's rest is a quarter turn
  b.nodes[2] = R"({"name":"bend","translation":[0,1,0],"rotation":[0.70710678,0,0,0.70710678]})";
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_NEAR(test::extent_of(*character).size().z, 2.0F, 1e-5F);
  EXPECT_NEAR(test::extent_of(test::posed(*character, character->clips[0], 0)).size().z, 2.0F,
              1e-4F);
}

TEST(ImportSkinTest, TwoHundredFiftySixJointsAreTheLimit) {
  for (const int count : {256, 257}) {
    GltfBuilder b;
    std::vector<float> positions;
    std::vector<std::uint16_t> joints;
    std::vector<float> weights;
    std::string list;
    for (int j = 0; j < count; ++j) {
      const float x = static_cast<float>(j) * 0.01F;
      positions.insert(positions.end(), {x, 0, 0, x, 1, 0, x, 0, 1});
      for (int k = 0; k < 3; ++k) {
        joints.insert(joints.end(), {static_cast<std::uint16_t>(j), 0, 0, 0});
        weights.insert(weights.end(), {1, 0, 0, 0});
      }
      list += (j == 0 ? "" : ",") + number(j + 1);
    }
    b.nodes = {R"({"mesh":0,"skin":0})"};
    for (int j = 0; j < count; ++j) b.nodes.push_back("{}");
    b.skins = {"{\"joints\":[" + list + "]}"};
    b.meshes = {
        "{\"primitives\":[{\"attributes\":{\"POSITION\":" + number(b.accessor(positions, "VEC3")) +
        ",\"JOINTS_0\":" + number(b.accessor(joints, "VEC4")) +
        ",\"WEIGHTS_0\":" + number(b.accessor(weights, "VEC4")) + "}}]}"};
    const auto character = import_built(b);
    EXPECT_EQ(character.ok(), count == 256) << character.status();
    if (!character.ok()) {
      EXPECT_THAT(std::string(character.status().message()),
                  HasSubstr("257 joints that move vertices, the limit is 256"));
    }
  }
}

}  // namespace
}  // namespace throng::simplify
