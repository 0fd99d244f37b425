#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render/compute/element/motion.hpp"
#include "render/compute/element/pose.hpp"
#include "render/crowd/motion_graph.hpp"
#include "render/crowd/packed.hpp"
#include "support/tiny_character.hpp"
#include "throng/render/crowd.hpp"

namespace throng::render {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A character whose eight frames of idle are also its clips to sit, cheer and dance with.
std::shared_ptr<const Cast> acting_cast() {
  CharacterData data = test::make_tiny_character();
  Clip clip = data.clips[0];
  clip.name = "Sitting_01";
  clip.kind = ClipKind::kSit;
  data.clips.push_back(clip);
  clip.name = "cheer";
  clip.kind = ClipKind::kCheer;
  data.clips.push_back(clip);
  clip.name = "Dance";
  clip.kind = ClipKind::kOther;
  data.clips.push_back(clip);
  auto cast = std::make_shared<Cast>();
  cast->members.push_back({make_character(std::move(data)).value(), 1.0F});
  return cast;
}

class MotionTest : public testing::Test {
 protected:
  void push(std::int64_t time_us, std::vector<std::uint8_t> motion) {
    AgentFrame frame;
    frame.time_us = time_us;
    frame.membership = members_;
    frame.position_m.assign(members_->ids.size(), glm::vec3(0.0F));
    frame.motion = std::move(motion);
    frame.motion_names = {"sit", "cheer", "dance", "juggle", "walk"};
    const absl::Status status = crowd_.push(frame);
    ASSERT_TRUE(status.ok()) << status;
  }
  element::Motion motion(std::size_t slot = 0, float since_s = 0.0F) const {
    return element::unpack_motion(crowd_.newest()->motion[slot], since_s);
  }
  std::uint32_t code(const char* name) const { return graph_.code_of(name); }

  std::shared_ptr<const Cast> cast_ = acting_cast();
  MotionGraph graph_ = motion_graph_of(*cast_);
  Crowd crowd_{cast_, CrowdSettings{}};
  std::shared_ptr<const Membership> members_ = [] {
    auto made = std::make_shared<Membership>();
    made->epoch = 1;
    made->ids = {7, 8};
    return made;
  }();
};

TEST_F(MotionTest, GraphKnowsRolesByKindAndOtherClipsByName) {
  EXPECT_EQ(graph_.code_of("SIT"), graph_.code_of("sit"));
  EXPECT_NE(graph_.code_of("dance"), MotionGraph::kUnknown);
  EXPECT_EQ(graph_.code_of("wave"), MotionGraph::kUnknown);
  EXPECT_EQ(graph_.code_of("walk"), 0);
  EXPECT_EQ(graph_.code_of(""), 0);
  const element::Gait gait = gait_of(cast_->members[0].character, graph_);
  EXPECT_GT(gait.action[code("sit") - 1].clip.frame_count, 0U);
  EXPECT_EQ(gait.action[code("sit") - 1].is_whole, 1U);
  EXPECT_EQ(gait.action[code("cheer") - 1].is_whole, 0U);
}

TEST_F(MotionTest, AddedMembersChangeNoCode) {
  Cast more = *cast_;
  CharacterData data = test::make_tiny_character();
  data.clips[0].kind = ClipKind::kWave;
  data.clips[0].name = "hello";
  more.members.push_back({make_character(std::move(data)).value(), 1.0F});
  const MotionGraph larger = motion_graph_of(more);
  for (const char* name : {"sit", "cheer", "dance"}) EXPECT_EQ(larger.code_of(name), code(name));
  EXPECT_NE(larger.code_of("wave"), MotionGraph::kUnknown);
}

TEST_F(MotionTest, NothingIsKeptWhileNobodyIsToldAnything) {
  push(0, {});
  push(100'000, {});
  EXPECT_THAT(crowd_.newest()->motion, IsEmpty());
}

TEST_F(MotionTest, FirstHintIsThereAtOnceAndAChangeBlends) {
  push(0, {1, 0});
  EXPECT_EQ(motion(0).now, code("sit"));
  EXPECT_EQ(motion(0).before, code("sit"));
  push(100'000, {1, 2});
  EXPECT_EQ(motion(1).now, code("cheer"));
  EXPECT_EQ(motion(1).before, 0U);
  EXPECT_FLOAT_EQ(motion(1, 0.25F).age_s, 0.25F);
  push(300'000, {1, 2});
  EXPECT_FLOAT_EQ(motion(1).age_s, 0.2F);
  push(30'000'000, {1, 2});
  EXPECT_EQ(motion(1).before, code("cheer"));
}

TEST_F(MotionTest, WhoTurnsBackGoesOnFromTheSameMixture) {
  push(0, {0, 0});
  push(100'000, {2, 0});
  push(200'000, {0, 0});  // 0.1 s of 0.35 s
  EXPECT_EQ(motion().now, 0U);
  EXPECT_EQ(motion().before, code("cheer"));
  EXPECT_NEAR(motion().age_s, 0.25F, 1e-3F);
}

TEST_F(MotionTest, AnotherChangeWaitsUntilTheBlendIsOver) {
  push(0, {0, 0});
  push(100'000, {2, 0});
  push(200'000, {3, 0});
  EXPECT_EQ(motion().now, code("cheer"));
  EXPECT_FLOAT_EQ(motion().age_s, 0.1F);
  push(500'000, {3, 0});
  EXPECT_EQ(motion().now, code("dance"));
  EXPECT_EQ(motion().before, code("cheer"));
  EXPECT_EQ(motion().age_s, 0.0F);
}

TEST_F(MotionTest, HintsThatEndBlendBackToTheGait) {
  push(0, {1, 1});
  push(100'000, {});
  EXPECT_EQ(motion().now, 0U);
  EXPECT_EQ(motion().before, code("sit"));
}

TEST_F(MotionTest, UnknownNamesGoBySpeedAndAreToldOnce) {
  push(0, {4, 5});
  EXPECT_EQ(motion(0).now, 0U);
  EXPECT_EQ(motion(1).now, 0U);
  EXPECT_THAT(crowd_.take_unknown_motions(), ElementsAre("juggle"));
  push(100'000, {4, 5});
  EXPECT_THAT(crowd_.take_unknown_motions(), IsEmpty());
}

TEST_F(MotionTest, RefusesWhatDoesNotFit) {
  AgentFrame frame;
  frame.membership = members_;
  frame.position_m.resize(2);
  frame.motion = {1};
  EXPECT_THAT(crowd_.push(frame).message(), HasSubstr("motion has 1 rows, must have 2"));
  frame.motion = {0, 1};
  EXPECT_THAT(crowd_.push(frame).message(), HasSubstr("motion[1] (id 8) is 1, must be at most 0"));
  frame.motion_names.assign(65, "sit");
  EXPECT_THAT(crowd_.push(frame).message(), HasSubstr("65 motion_names, at most 64"));
  frame.motion_names = {std::string(65, 'x')};
  EXPECT_THAT(crowd_.push(frame).message(), HasSubstr("65 bytes, at most 64"));
}

TEST_F(MotionTest, PackedSnapshotsKeepMotions) {
  std::vector<std::shared_ptr<const Snapshot>> snapshots;
  for (int i = 0; i < 6; ++i) {
    push(100'000 * i, i == 0 ? std::vector<std::uint8_t>{}
                             : std::vector<std::uint8_t>{static_cast<std::uint8_t>(i < 3), 2});
    snapshots.push_back(crowd_.newest());
  }
  const auto back = unpack(pack(snapshots));
  ASSERT_EQ(back.size(), snapshots.size());
  for (std::size_t i = 0; i < back.size(); ++i) EXPECT_EQ(back[i]->motion, snapshots[i]->motion);
}

TEST_F(MotionTest, PoseChangesSteadilyThroughABlend) {
  // frames of the tiny character's clips hold matrices of their own; weights are what is looked at
  element::Gait gait = gait_of(cast_->members[0].character, graph_);
  for (element::Action& action : gait.action) {
    if (action.clip.frame_count != 0) action.clip.first_frame += 100;  // told apart from idle
  }
  for (const char* name : {"sit", "cheer"}) {
    for (const float speed_mps : {0.0F, 0.6F, 1.3F, 3.5F}) {
      float before = -1.0F;
      for (int ms = 0; ms <= 1000; ms += 10) {
        const element::Motion motion{code(name), 0, 1e-3F * static_cast<float>(ms)};
        const element::Pose pose =
            element::choose_pose(gait, 3, speed_mps, 0.0F, 0.3, 5'000'000, motion);
        float share[3] = {1.0F - pose.b_weight, pose.b_weight, 0.0F};
        for (float& each : share) each *= 1.0F - pose.c_weight;
        share[2] = pose.c_weight;
        const std::uint32_t frame[3] = {pose.a_frame0, pose.b_frame0, pose.c_frame0};
        float acting = 0.0F;
        for (int k = 0; k < 3; ++k) acting += frame[k] >= 100 ? share[k] : 0.0F;
        if (before >= 0.0F) {
          EXPECT_GE(acting, before - 1e-5F);
          EXPECT_LT(acting - before, 0.06F) << name << " at " << speed_mps << " m/s, " << ms;
        }
        before = acting;
      }
      if (std::string(name) == "sit") {
        EXPECT_EQ(before, 1.0F);
      } else if (speed_mps > 1.35F) {
        EXPECT_EQ(before, 0.0F);  // who walks does not cheer with its legs
      } else if (speed_mps == 0.0F) {
        EXPECT_EQ(before, 1.0F);
      }
    }
  }
}

}  // namespace
}  // namespace throng::render
