#include "simplify/bake/joints.hpp"

#include <gtest/gtest.h>

#include "support/source_shapes.hpp"

namespace throng::simplify {
namespace {

TEST(QuantizeWeightsTest, SumIsAlways255AndStrongestComesFirst) {
  std::uint32_t state = 7;
  for (int round = 0; round < 2000; ++round) {
    SourcePoint point;
    float sum = 0.0F;
    for (int k = 0; k < 4; ++k) {
      state = state * 1664525U + 1013904223U;
      point.joint[k] = static_cast<std::uint16_t>(k * 3);
      point.weight[k] = static_cast<float>(state >> 20U) * (round % 3 == 0 && k > 1 ? 0.0F : 1.0F);
      sum += point.weight[k];
    }
    if (sum > 0) point.weight /= sum;
    glm::u8vec4 joint, weight;
    quantize_weights(point, joint, weight);
    EXPECT_EQ(weight.x + weight.y + weight.z + weight.w, 255);
    EXPECT_TRUE(weight.x >= weight.y && weight.y >= weight.z && weight.z >= weight.w);
    for (int k = 0; k < 4; ++k) {
      if (weight[k] == 0) continue;
      EXPECT_NEAR(weight[k], point.weight[joint[k] / 3] * 255.0F, 1.0F);
    }
  }
}

TEST(QuantizeWeightsTest, EqualJointsAreJoined) {
  SourcePoint point;
  point.joint = {4, 7, 4, 0};
  point.weight = {0.3F, 0.4F, 0.3F, 0.0F};
  glm::u8vec4 joint, weight;
  quantize_weights(point, joint, weight);
  EXPECT_EQ(joint, glm::u8vec4(4, 7, 0, 0));
  EXPECT_EQ(weight, glm::u8vec4(153, 102, 0, 0));
}

TEST(QuantizeWeightsTest, NoWeightGoesToTheFirstJoint) {
  SourcePoint point;
  point.joint = {9, 0, 0, 0};
  point.weight = glm::vec4(0.0F);
  glm::u8vec4 joint, weight;
  quantize_weights(point, joint, weight);
  EXPECT_EQ(joint.x, 9);
  EXPECT_EQ(weight, glm::u8vec4(255, 0, 0, 0));
}

TEST(LimitJointsTest, UnusedJointsGoWhereThereAreTooMany) {
  SourceCharacter cube = test::make_cube();
  for (int j = 1; j < 300; ++j)
    cube.joints.push_back({"j" + std::to_string(j), j - 1, glm::mat4(1.0F)});
  for (SourcePoint& point : cube.points) point.joint = glm::u16vec4(299, 150, 0, 0);
  for (SourcePoint& point : cube.points) point.weight = {0.6F, 0.4F, 0, 0};
  SourceClip clip;
  clip.frame_count = 2;
  for (int i = 0; i < 600; ++i)
    clip.model_from_joint.push_back(glm::mat4(static_cast<float>(i % 300)));
  cube.clips.push_back(clip);
  std::vector<std::string> notes;
  ASSERT_TRUE(limit_joints(cube, notes).ok());
  ASSERT_EQ(cube.joints.size(), 2U);
  EXPECT_EQ(cube.joints[1].name, "j299");
  EXPECT_EQ(cube.joints[1].parent, 0);
  EXPECT_EQ(cube.points[0].joint.x, 1);
  ASSERT_EQ(cube.clips[0].model_from_joint.size(), 4U);
  EXPECT_EQ(cube.clips[0].model_from_joint[1][0][0], 299.0F);
  EXPECT_EQ(notes.size(), 1U);
}

TEST(LimitJointsTest, TooManyUsedJointsAreRefused) {
  SourceCharacter tube = test::make_tube();
  tube.joints.resize(300, {"j", -1, glm::mat4(1.0F)});
  for (std::size_t i = 0; i < tube.points.size(); ++i)
    tube.points[i].joint.x = static_cast<std::uint16_t>(i % 300);
  std::vector<std::string> notes;
  EXPECT_EQ(limit_joints(tube, notes).code(), absl::StatusCode::kInvalidArgument);
}

TEST(ScaleTest, ScalesPosesToo) {
  test::TubeOptions options;
  options.has_elbow = true;
  SourceCharacter tube = test::make_tube(options);
  const glm::vec4 point(tube.points[40].position, 1.0F);
  const glm::vec3 before(tube.clips[0].model_from_joint[7] * tube.joints[1].joint_from_model *
                         point);
  scale(tube, 0.5F);
  const glm::vec4 scaled(tube.points[40].position, 1.0F);
  const glm::vec3 after(tube.clips[0].model_from_joint[7] * tube.joints[1].joint_from_model *
                        scaled);
  EXPECT_LT(glm::length(after - 0.5F * before), 1.0e-5F);
  EXPECT_FLOAT_EQ(tube.clips[0].stride_m, 0.6F);
}

}  // namespace
}  // namespace throng::simplify
