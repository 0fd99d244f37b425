#include "simplify/bake/clips.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <span>

#include "simplify/collapse/collapse.hpp"
#include "support/source_shapes.hpp"

namespace throng::simplify {
namespace {

using render::ClipKind;
using ::testing::HasSubstr;

/// A tube that goes 0.1 m along +X in each frame, sways and nods.
SourceCharacter make_mover(std::uint32_t frames, bool repeats_first) {
  test::TubeOptions options;
  options.has_elbow = true;
  SourceCharacter source = test::make_tube(options);
  SourceClip& clip = source.clips[0];
  clip.name = "Walking";
  clip.frame_count = frames;
  clip.stride_m = 0.0F;
  clip.model_from_joint.clear();
  const float period = static_cast<float>(repeats_first ? frames - 1 : frames);
  for (std::uint32_t f = 0; f < frames; ++f) {
    const float wave = std::sin(6.2831853F * static_cast<float>(f) / period);
    const glm::mat4 root =
        glm::translate(glm::mat4(1.0F), {0.1F * static_cast<float>(f), 0.02F * wave, 0});
    clip.model_from_joint.push_back(root);
    clip.model_from_joint.push_back(
        glm::rotate(glm::translate(root, {0, 0, 0.9F}), 0.3F * wave, {1, 0, 0}));
  }
  return source;
}

/// Two flat feet that stand by turns: each goes back 0.8 m at even speed and then forward in the
/// air.
SourceCharacter make_walker() {
  SourceCharacter source = test::make_empty_source();
  source.joints.push_back({"left", 0, glm::mat4(1.0F)});
  source.joints.push_back({"right", 0, glm::mat4(1.0F)});
  source.normals.emplace_back(0, 0, 1);
  source.uvs.emplace_back(0.5F, 0.5F);
  const auto add_box = [&](const glm::vec3& low, const glm::vec3& high, std::uint16_t joint) {
    const auto first = static_cast<std::uint32_t>(source.points.size());
    for (int i = 0; i < 8; ++i) {
      const glm::vec3 share(i & 1, (i >> 1) & 1, i >> 2);
      source.points.push_back(
          {glm::mix(low, high, share), glm::u16vec4(joint, 0, 0, 0), {1, 0, 0, 0}});
    }
    for (const SourceTriangle& triangle : test::make_cube().triangles) {
      test::add_triangle(source,
                         {first + triangle.corner[0].point, first + triangle.corner[1].point,
                          first + triangle.corner[2].point},
                         {0, 0, 0}, {0, 0, 0});
    }
  };
  add_box({-0.2F, -0.2F, 0.8F}, {0.2F, 0.2F, 1.8F}, 0);
  add_box({-0.1F, 0.1F, 0}, {0.1F, 0.2F, 0.1F}, 1);
  add_box({-0.1F, -0.2F, 0}, {0.1F, -0.1F, 0.1F}, 2);
  SourceClip clip;
  clip.name = "Armature|Walk";
  clip.frame_count = 30;
  for (int f = 0; f < 30; ++f) {
    clip.model_from_joint.push_back(glm::mat4(1.0F));
    for (const int offset : {0, 15}) {
      // stands for 18 frames, swings for 12
      const int phase = (f + offset) % 30;
      const bool is_stance = phase < 18;
      const float x = is_stance ? 0.4F - 0.8F * static_cast<float>(phase) / 18
                                : -0.4F + 0.8F * static_cast<float>(phase - 18) / 12;
      const float z =
          is_stance ? 0.0F : 0.15F * std::sin(3.1415927F * static_cast<float>(phase - 18) / 12);
      clip.model_from_joint.push_back(glm::translate(glm::mat4(1.0F), {x, 0, z}));
    }
  }
  source.clips.push_back(clip);
  return source;
}

TEST(ClipsTest, PaletteIsModelFromJointTimesInverseBind) {
  test::TubeOptions options;
  options.has_elbow = true;
  SourceCharacter tube = test::make_tube(options);
  tube.clips[0].name = "bend";  // neither moved nor put on the ground
  tube.clips[0].kind = ClipKind::kSit;
  std::vector<std::string> notes;
  const auto baked = bake_clips(tube, notes);
  ASSERT_TRUE(baked.ok());
  ASSERT_EQ(baked->palette.size(), 24U);
  for (std::size_t i = 0; i < 24; ++i) {
    const glm::mat4 expected =
        tube.clips[0].model_from_joint[i] * tube.joints[i % 2].joint_from_model;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) {
        EXPECT_NEAR(baked->palette[i].row[row][column], expected[column][row], 1.0e-5F);
      }
    }
  }
}

TEST(ClipsTest, RootMotionBecomesTheStride) {
  std::vector<std::string> notes;
  const auto baked = bake_clips(make_mover(20, false), notes);
  ASSERT_TRUE(baked.ok());
  const render::Clip& clip = baked->clips[0];
  EXPECT_EQ(clip.kind, ClipKind::kWalk);
  EXPECT_EQ(clip.frame_count, 20U);
  EXPECT_NEAR(clip.stride_m, 2.0F, 0.02F);
  EXPECT_NEAR(clip.speed_mps, 3.0F, 0.03F);
  for (std::size_t f = 0; f < 20; ++f) {
    EXPECT_NEAR(baked->palette[2 * f].row[0].w, 0.0F, 0.01F) << f;  // stays where it is
  }
  EXPECT_NEAR(baked->palette[10].row[1].w, 0.02F, 0.02F);  // and still sways
}

TEST(ClipsTest, RepeatedLastFrameIsDropped) {
  std::vector<std::string> notes;
  const auto baked = bake_clips(make_mover(21, true), notes);
  ASSERT_TRUE(baked.ok());
  EXPECT_EQ(baked->clips[0].frame_count, 20U);
  EXPECT_NEAR(baked->clips[0].stride_m, 2.0F, 0.001F);
}

TEST(ClipsTest, StrideComesFromTheStanceFoot) {
  std::vector<std::string> notes;
  const auto baked = bake_clips(make_walker(), notes);
  ASSERT_TRUE(baked.ok());
  const render::Clip& clip = baked->clips[0];
  EXPECT_EQ(clip.kind, ClipKind::kWalk);
  // 0.8 m in 18 of 30 frames
  EXPECT_NEAR(clip.stride_m, 0.8F * 30 / 18, 0.02F);
  EXPECT_NEAR(clip.speed_mps, 1.333F, 0.02F);
  EXPECT_TRUE(notes.empty()) << notes[0];
}

TEST(ClipsTest, GivenStrideIsKept) {
  SourceCharacter walker = make_walker();
  walker.clips[0].stride_m = 1.25F;
  std::vector<std::string> notes;
  EXPECT_EQ(bake_clips(walker, notes)->clips[0].stride_m, 1.25F);
}

TEST(ClipsTest, NamelessClipIsJudgedBySpeed) {
  SourceCharacter walker = make_walker();
  walker.clips[0].name = "Take 001";
  std::vector<std::string> notes;
  EXPECT_EQ(bake_clips(walker, notes)->clips[0].kind, ClipKind::kWalk);
  EXPECT_THAT(notes, ::testing::Contains(HasSubstr("taken for walk")));
  walker.clips[0].rate_hz = 90.0F;
  EXPECT_EQ(bake_clips(walker, notes)->clips[0].kind, ClipKind::kRun);
  for (glm::mat4& matrix : walker.clips[0].model_from_joint) matrix = glm::mat4(1.0F);
  EXPECT_EQ(bake_clips(walker, notes)->clips[0].kind, ClipKind::kIdle);
}

TEST(ClipsTest, FloatingWalkIsPutOnTheGround) {
  SourceCharacter walker = make_walker();
  for (glm::mat4& matrix : walker.clips[0].model_from_joint) matrix[3].z += 0.1F;
  std::vector<std::string> notes;
  const auto baked = bake_clips(walker, notes);
  ASSERT_TRUE(baked.ok());
  std::vector<glm::vec3> position(walker.points.size());
  for (std::size_t f = 0; f < 30; ++f) {
    skin(walker.points, std::span(baked->palette).subspan(f * 3, 3), position);
    float low_m = 1.0F;
    for (const glm::vec3& each : position) low_m = std::min(low_m, each.z);
    EXPECT_NEAR(low_m, 0.0F, 0.005F);
  }
}

TEST(ClipsTest, NoClipGivesARestPose) {
  std::vector<std::string> notes;
  const auto baked = bake_clips(test::make_tube(), notes);
  ASSERT_TRUE(baked.ok());
  ASSERT_EQ(baked->clips.size(), 1U);
  EXPECT_EQ(baked->clips[0].kind, ClipKind::kIdle);
  EXPECT_EQ(baked->clips[0].frame_count, 1U);
}

TEST(ClipsTest, BadClipsAreNamed) {
  std::vector<std::string> notes;
  const auto message = [&](void (*inject)(SourceClip&)) {
    SourceCharacter walker = make_walker();
    inject(walker.clips[0]);
    return std::string(bake_clips(walker, notes).status().message());
  };
  EXPECT_THAT(message([](SourceClip& c) { c.model_from_joint[7][3][1] = std::nanf(""); }),
              HasSubstr("frame 2 joint 1 (left)"));
  EXPECT_THAT(message([](SourceClip& c) { c.model_from_joint.pop_back(); }),
              HasSubstr("has 89 matrices"));
  EXPECT_THAT(message([](SourceClip& c) { c.rate_hz = 0; }), HasSubstr("has rate 0"));
  EXPECT_THAT(message([](SourceClip& c) { c.stride_m = -1; }), HasSubstr("stride -1"));
}

TEST(ClipKindTest, NamesOfCommonTools) {
  EXPECT_EQ(kind_from_name("HumanArmature|Man_Walk"), ClipKind::kWalk);
  EXPECT_EQ(kind_from_name("Walking_A"), ClipKind::kWalk);
  EXPECT_EQ(kind_from_name("Running_A"), ClipKind::kRun);
  EXPECT_EQ(kind_from_name("sprint"), ClipKind::kRun);
  EXPECT_EQ(kind_from_name("Jog_Fwd_Loop"), ClipKind::kRun);
  EXPECT_EQ(kind_from_name("Idle"), ClipKind::kIdle);
  EXPECT_EQ(kind_from_name("Sit_Floor"), ClipKind::kSit);
  EXPECT_EQ(kind_from_name("Cheer"), ClipKind::kCheer);
  EXPECT_EQ(kind_from_name("Walking_Backwards"), ClipKind::kOther);
  EXPECT_EQ(kind_from_name("Running_Strafe_Left"), ClipKind::kOther);
  EXPECT_EQ(kind_from_name("Death"), ClipKind::kOther);
}

TEST(ClipKindTest, GenericNames) {
  for (const char* name :
       {"", "Take 001", "mixamo.com", "Armature|mixamo.com|Layer0", "Animation_0", "clip_3"}) {
    EXPECT_TRUE(is_generic_name(name)) << name;
  }
  for (const char* name : {"Wave", "Death", "Armature|Punch"})
    EXPECT_FALSE(is_generic_name(name)) << name;
}

}  // namespace
}  // namespace throng::simplify
