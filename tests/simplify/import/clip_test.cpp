#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "simplify/import/clip_kind.hpp"
#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"

namespace throng::simplify {
namespace {

using render::ClipKind;
using test::GltfBuilder;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;

std::string number(int value) { return std::to_string(value); }

absl::StatusOr<SourceCharacter> import_built(const GltfBuilder& builder,
                                             const ImportOptions& options = {}) {
  const std::string path = test::scratch_path("clip.glb");
  test::write_file(path, builder.glb());
  absl::StatusOr<SourceCharacter> character = import_gltf(path, options);
  EXPECT_EQ(character.ok() ? test::fault_of(*character) : "", "");
  return character;
}

/// A box whose node's forward shift is the given keys.
GltfBuilder sliding_box(const std::vector<float>& times, const std::vector<float>& shifts,
                        const std::string& interpolation, const std::string& name = "slide") {
  GltfBuilder b;
  std::vector<float> rows;
  for (const float shift : shifts) rows.insert(rows.end(), {0, 0, shift});
  const int input = b.accessor(times, "SCALAR");
  const int output = b.accessor(rows, "VEC3");
  b.animations = {
      "{\"name\":\"" + name + "\",\"samplers\":[{\"input\":" + number(input) +
      ",\"output\":" + number(output) + ",\"interpolation\":\"" + interpolation +
      "\"}],\"channels\":[{\"sampler\":0,\"target\":{\"node\":0,\"path\":\"translation\"}}]}"};
  b.meshes = {"{\"primitives\":[{" + b.box({-0.5F, 0, -0.5F}, {0.5F, 1, 0.5F}) + "}]}"};
  b.nodes = {R"({"name":"box","mesh":0})"};
  return b;
}

float shift_at(const SourceCharacter& character, std::uint32_t frame) {
  const test::Extent extent = test::extent_of(test::posed(character, character.clips[0], frame));
  return 0.5F * (extent.low.x + extent.high.x);
}

TEST(ImportClipTest, StepHoldsAndLinearMixes) {
  const auto step = import_built(sliding_box({0, 1}, {0, 2}, "STEP"));
  const auto linear = import_built(sliding_box({0, 1}, {0, 2}, "LINEAR"));
  ASSERT_TRUE(step.ok() && linear.ok());
  EXPECT_NEAR(shift_at(*step, 15), 0.0F, 1e-5F);
  EXPECT_NEAR(shift_at(*linear, 15), 1.0F, 1e-5F);
}

TEST(ImportClipTest, CubicFollowsItsTangents) {
  // value 0 to 2 with zero tangents is a smooth step; with tangents of 2 a second it's a line
  const auto smooth = import_built(sliding_box({0, 1}, {0, 0, 0, 0, 2, 0}, "CUBICSPLINE"));
  const auto line = import_built(sliding_box({0, 1}, {2, 0, 2, 2, 2, 2}, "CUBICSPLINE"));
  ASSERT_TRUE(smooth.ok() && line.ok()) << smooth.status();
  const float t = 6.0F / 30.0F;
  EXPECT_NEAR(shift_at(*smooth, 6), 2.0F * (3.0F * t * t - 2.0F * t * t * t), 1e-4F);
  EXPECT_NEAR(shift_at(*line, 6), 2.0F * t, 1e-4F);
}

TEST(ImportClipTest, AnyRateIsSampledAtThirtyHertzAndMayBeginLate) {
  const auto uneven = import_built(sliding_box({1.0F, 1.1F, 1.7F, 2.0F}, {0, 1, 7, 10}, "LINEAR"));
  ASSERT_TRUE(uneven.ok());
  EXPECT_EQ(uneven->clips[0].frame_count, 30U);
  EXPECT_FLOAT_EQ(uneven->clips[0].rate_hz, 30.0F);
  for (const std::uint32_t frame : {0U, 3U, 12U, 29U}) {
    EXPECT_NEAR(shift_at(*uneven, frame), static_cast<float>(frame) / 3.0F, 1e-4F);
  }
  // a length that isn't a whole number of frames changes the rate a little, not the length
  const auto odd = import_built(sliding_box({0, 0.71F}, {0, 1}, "LINEAR"));
  ASSERT_TRUE(odd.ok());
  EXPECT_NEAR(static_cast<float>(odd->clips[0].frame_count) / odd->clips[0].rate_hz, 0.71F, 1e-5F);
}

TEST(ImportClipTest, PoseOfNoLengthIsOneFrame) {
  const auto character = import_built(sliding_box({0}, {0}, "LINEAR"));
  ASSERT_TRUE(character.ok());
  EXPECT_EQ(character->clips[0].frame_count, 1U);
}

TEST(ImportClipTest, ClipThatEndsElsewhereIsNotALoopUnlessItWalks) {
  for (const char* name : {"Die", "Walk"}) {
    GltfBuilder b = test::bending_post();
    const int times = b.accessor(std::vector<float>{0, 1}, "SCALAR");
    const float half = std::sqrt(0.5F);
    const int turns = b.accessor(std::vector<float>{0, 0, 0, 1, half, 0, 0, half}, "VEC4");
    b.animations = {
        "{\"name\":\"" + std::string(name) + "\",\"samplers\":[{\"input\":" + number(times) +
        ",\"output\":" + number(turns) +
        "}],\"channels\":[{\"sampler\":0,\"target\":{\"node\":2,\"path\":\"rotation\"}}]}"};
    const auto character = import_built(b);
    ASSERT_TRUE(character.ok());
    EXPECT_EQ(character->clips[0].loop, name == std::string("Walk"));
    EXPECT_EQ(character->clips[0].frame_count, 31U);  // the last key is a pose of its own
    EXPECT_NEAR(test::extent_of(test::posed(*character, character->clips[0], 30)).high.x, 1.0F,
                1e-4F);
  }
}

TEST(ImportClipTest, NamelessAnimationsOfDifferentNodesAreOneClip) {
  GltfBuilder b = test::bending_post();
  std::string first = b.animations[0];
  first.replace(first.find("\"name\":\"Walk\","), 14, "");
  std::string second = first;
  second.replace(second.find("\"node\":2"), 8, "\"node\":1");
  b.animations = {first, second};
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_EQ(character->clips.size(), 1U);
  EXPECT_THAT(character->notes, Contains(HasSubstr("are one clip")));
}

TEST(ImportClipTest, WordsOfANameAreFoundInAnySpelling) {
  using gltf::words_of;
  EXPECT_THAT(words_of("Rig|Walk_A2"), ElementsAre("rig", "walk", "a", "2"));
  EXPECT_THAT(words_of("mixamorig:LeftUpLeg"), ElementsAre("mixamorig", "left", "up", "leg"));
  EXPECT_THAT(words_of("HTMLIdle"), ElementsAre("html", "idle"));
  EXPECT_THAT(words_of(""), ElementsAre());
}

TEST(ImportClipTest, KindsComeFromThePlainestNames) {
  using gltf::kinds_of;
  EXPECT_THAT(kinds_of({"Idle", "Idle_Gun", "Walk", "Walk_Carry", "Run", "SitDown", "Jump_Idle"}),
              ElementsAre(ClipKind::kIdle, ClipKind::kOther, ClipKind::kWalk, ClipKind::kOther,
                          ClipKind::kRun, ClipKind::kOther, ClipKind::kOther));
  EXPECT_THAT(kinds_of({"HumanArmature|WALKING", "sprint", "Sit_Chair_Idle", "Cheer"}),
              ElementsAre(ClipKind::kWalk, ClipKind::kRun, ClipKind::kSit, ClipKind::kCheer));
  EXPECT_THAT(kinds_of({"fight_idle"}), ElementsAre(ClipKind::kIdle));  // better than none
  EXPECT_THAT(kinds_of({"walk to run", "grunt", "sidewalk"}),
              ElementsAre(ClipKind::kOther, ClipKind::kOther, ClipKind::kOther));
}

/// A stick figure of boxes on the joints of a human in a T pose, named `prefix` + part.
GltfBuilder stick_figure(bool named) {
  GltfBuilder b;
  struct Part {
    const char* name;
    int parent;
    glm::vec3 at;  // from the parent
    glm::vec3 low, high;
  };
  const std::vector<Part> parts = {
      {"Hips", -1, {0, 0.95F, 0}, {-0.15F, -0.05F, -0.1F}, {0.15F, 0.1F, 0.1F}},
      {"Spine", 0, {0, 0.1F, 0}, {-0.18F, 0, -0.1F}, {0.18F, 0.45F, 0.1F}},
      {"LeftArm", 1, {0.2F, 0.4F, 0}, {0, -0.04F, -0.04F}, {0.28F, 0.04F, 0.04F}},
      {"LeftForeArm", 2, {0.28F, 0, 0}, {0, -0.04F, -0.04F}, {0.28F, 0.04F, 0.04F}},
      {"RightArm", 1, {-0.2F, 0.4F, 0}, {-0.28F, -0.04F, -0.04F}, {0, 0.04F, 0.04F}},
      {"RightForeArm", 4, {-0.28F, 0, 0}, {-0.28F, -0.04F, -0.04F}, {0, 0.04F, 0.04F}},
      {"LeftUpLeg", 0, {0.1F, 0, 0}, {-0.06F, -0.43F, -0.06F}, {0.06F, 0, 0.06F}},
      {"LeftLeg", 6, {0, -0.43F, 0}, {-0.05F, -0.43F, -0.05F}, {0.05F, 0, 0.05F}},
      {"LeftFoot", 7, {0, -0.43F, 0}, {-0.04F, -0.09F, -0.06F}, {0.04F, 0, 0.2F}},
      {"RightUpLeg", 0, {-0.1F, 0, 0}, {-0.06F, -0.43F, -0.06F}, {0.06F, 0, 0.06F}},
      {"RightLeg", 9, {0, -0.43F, 0}, {-0.05F, -0.43F, -0.05F}, {0.05F, 0, 0.05F}},
      {"RightFoot", 10, {0, -0.43F, 0}, {-0.04F, -0.09F, -0.06F}, {0.04F, 0, 0.2F}},
      {"Head", 1, {0, 0.5F, 0}, {-0.1F, 0, -0.1F}, {0.1F, 0.25F, 0.1F}},
  };
  std::vector<std::string> children(parts.size());
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (parts[i].parent >= 0) {
      std::string& list = children[static_cast<std::size_t>(parts[i].parent)];
      list += (list.empty() ? "" : ",") + number(static_cast<int>(i));
    }
  }
  // meshes hang on nodes of their own so that joints stay joints
  for (std::size_t i = 0; i < parts.size(); ++i) {
    std::string& list = children[i];
    list += (list.empty() ? "" : ",") + number(static_cast<int>(parts.size() + i));
  }
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const Part& part = parts[i];
    b.meshes.push_back("{\"primitives\":[{" + b.box(part.low, part.high) + "}]}");
    b.nodes.push_back(
        "{\"name\":\"" +
        (named ? std::string("mixamorig:") + part.name : "bone" + number(static_cast<int>(i))) +
        "\",\"translation\":[" + std::to_string(part.at.x) + "," + std::to_string(part.at.y) + "," +
        std::to_string(part.at.z) + "],\"children\":[" + children[i] + "]}");
  }
  for (std::size_t i = 0; i < parts.size(); ++i)
    b.nodes.push_back("{\"mesh\":" + number(static_cast<int>(i)) + "}");
  return b;
}

TEST(ImportClipTest, HumanoidWithoutClipsGetsAWalkThatKeepsToTheGround) {
  const auto character = import_built(stick_figure(true));
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_THAT(character->notes, Contains(HasSubstr("default walk")));
  ASSERT_EQ(character->clips.size(), 2U);
  EXPECT_EQ(character->clips[0].kind, ClipKind::kIdle);
  const SourceClip& walk = character->clips[1];
  EXPECT_EQ(walk.kind, ClipKind::kWalk);
  float longest = 0.0F;
  for (std::uint32_t frame = 0; frame < walk.frame_count; ++frame) {
    const test::Extent extent = test::extent_of(test::posed(*character, walk, frame));
    EXPECT_NEAR(extent.low.z, 0.0F, 0.03F) << "frame " << frame;
    EXPECT_LT(extent.size().y, 0.9F) << "arms are down";
    EXPECT_GT(extent.size().z, 1.6F);
    longest = std::max(longest, extent.size().x);
  }
  EXPECT_GT(longest, 0.7F);  // from heel to toe in a step
  // idle: upright, feet together
  EXPECT_NEAR(test::extent_of(test::posed(*character, character->clips[0], 0)).low.z, 0.0F, 1e-4F);
}

TEST(ImportClipTest, UnknownSkeletonWithoutClipsStandsInItsRestPose) {
  const auto character = import_built(stick_figure(false));
  ASSERT_TRUE(character.ok()) << character.status();
  ASSERT_EQ(character->clips.size(), 1U);
  EXPECT_EQ(character->clips[0].frame_count, 1U);
  EXPECT_THAT(character->notes, Contains(HasSubstr("rest pose")));
}

TEST(ImportClipTest, ClipFileMovesJointsOfTheSameName) {
  const std::string clip_path = test::scratch_path("lender.glb");
  test::write_file(clip_path, test::bending_post().glb());
  GltfBuilder still = test::bending_post();
  still.animations.clear();
  ImportOptions options;
  options.clip_files = {clip_path};
  const auto borrowed = import_built(still, options);
  ASSERT_TRUE(borrowed.ok()) << borrowed.status();
  ASSERT_EQ(borrowed->clips.size(), 1U);
  EXPECT_EQ(borrowed->clips[0].name, "Walk");
  EXPECT_NEAR(test::extent_of(test::posed(*borrowed, borrowed->clips[0], 15)).high.x, 1.0F, 1e-4F);
}

TEST(ImportClipTest, ClipFileWithAnotherRestPoseIsCarriedOverRelativeToIt) {
  const std::string clip_path = test::scratch_path("lender.glb");
  test::write_file(clip_path, test::bending_post().glb());
  // the same post with the axes of its joint turned about the vertical: only its local frame
  // differs
  GltfBuilder other = test::bending_post();
  other.animations.clear();
  const float half = std::sqrt(0.5F);
  other.nodes[2] = R"({"name":"BEND","translation":[0,1,0],"rotation":[0,)" + std::to_string(half) +
                   ",0," + std::to_string(half) + "]}";
  const int bind =
      other.accessor(std::vector<float>{1, 0, 0, 0, 0, 1, 0, 0, 0,  0, 1, 0, 0, 0,  0, 1,
                                        0, 0, 1, 0, 0, 1, 0, 0, -1, 0, 0, 0, 0, -1, 0, 1},
                     "MAT4");
  other.skins = {"{\"joints\":[1,2],\"inverseBindMatrices\":" + number(bind) + "}"};
  ImportOptions options;
  options.clip_files = {clip_path};
  const auto borrowed = import_built(other, options);
  ASSERT_TRUE(borrowed.ok()) << borrowed.status();
  EXPECT_THAT(borrowed->notes, Contains(HasSubstr("carried over")));
  EXPECT_NEAR(test::extent_of(*borrowed).size().z, 2.0F, 1e-5F);
  // it bends forward and not sideways
  EXPECT_NEAR(test::extent_of(test::posed(*borrowed, borrowed->clips[0], 15)).high.x, 1.0F, 1e-3F);
}

}  // namespace
}  // namespace throng::simplify
