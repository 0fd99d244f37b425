#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"
#include "support/data_dir.hpp"

namespace throng::simplify {
namespace {

using test::Extent;

/// The table in the characters' README: size of the skinned mesh in the file's axes at the first
/// key of the clip named ("" for the only one, "rest" for the bind pose).
struct Expected {
  const char* file;
  std::size_t triangles;
  std::size_t joints;  // of a skin; those that move nothing may be dropped
  glm::vec3 size;
  const char* clip;
};

constexpr auto kWalk = "Walk";

const Expected kExpected[] = {
    {"cesium_man.glb", 4672, 19, {0.51F, 1.46F, 0.90F}, ""},
    {"cge_knight/knight.gltf", 646, 50, {1.06F, 1.84F, 1.85F}, kWalk},
    {"fox.glb", 576, 24, {25.19F, 76.88F, 164.66F}, kWalk},
    {"kaykit_knight.glb", 6952, 41, {1.63F, 2.89F, 2.04F}, "Walking_A"},
    {"kaykit_mage.glb", 5683, 41, {2.09F, 2.70F, 2.04F}, "Walking_A"},
    {"kaykit_mannequin/manny_med_mod.gltf", 6756, 21, {1.98F, 2.21F, 1.01F}, "rest"},
    {"kenney_mini/character-female-a.glb", 876, 7, {0.88F, 0.83F, 0.50F}, "walk"},
    {"kenney_mini/character-female-b.glb", 742, 7, {0.66F, 0.72F, 0.42F}, "walk"},
    {"kenney_mini/character-female-c.glb", 732, 7, {0.66F, 0.78F, 0.50F}, "walk"},
    {"kenney_mini/character-female-d.glb", 797, 7, {0.66F, 0.78F, 0.50F}, "walk"},
    {"kenney_mini/character-male-a.glb", 723, 7, {0.66F, 0.67F, 0.34F}, "walk"},
    {"kenney_mini/character-male-b.glb", 690, 7, {0.66F, 0.66F, 0.39F}, "walk"},
    {"kenney_mini/character-male-c.glb", 793, 7, {0.66F, 0.79F, 0.46F}, "walk"},
    {"kenney_mini/character-male-d.glb", 711, 7, {0.66F, 0.72F, 0.34F}, "walk"},
    {"m2m_bird.glb", 2166, 55, {0.86F, 0.91F, 1.86F}, kWalk},
    {"m2m_fox.glb", 1654, 49, {0.51F, 1.67F, 3.43F}, kWalk},
    {"m2m_horse.glb", 3414, 56, {0.62F, 1.82F, 2.64F}, kWalk},
    {"m2m_human_male.glb", 13713, 66, {0.62F, 1.79F, 0.39F}, "New Custom"},
    {"m2m_kaiju.glb", 2318, 58, {1.25F, 2.10F, 3.94F}, kWalk},
    {"mannequiny.glb", 13932, 45, {0.49F, 1.75F, 0.94F}, "walk"},
    {"mannequiny_subdivided1.glb", 55728, 45, {0.49F, 1.75F, 0.94F}, "walk"},
    {"quaternius_casual_bald.glb", 2312, 23, {1.14F, 2.98F, 1.65F}, kWalk},
    {"quaternius_casual_female.glb", 6624, 23, {1.21F, 3.05F, 1.65F}, kWalk},
    {"quaternius_casual_male.gltf", 6492, 23, {1.21F, 3.18F, 1.65F}, kWalk},
    {"quaternius_doctor_female_young.glb", 8530, 23, {1.21F, 3.05F, 1.65F}, kWalk},
    {"quaternius_knight.glb", 956, 31, {2.58F, 5.48F, 2.72F}, "HumanArmature|Walking"},
    {"quaternius_modular_man_casual.glb", 6206, 49, {1.68F, 1.87F, 0.38F}, "rest"},
    {"quaternius_old_classy_male.glb", 5432, 23, {1.19F, 3.58F, 1.65F}, kWalk},
    {"quaternius_platformer_character.glb",
     2908,
     29,
     {2.46F, 3.63F, 2.05F},
     "CharacterArmature|Walk"},
    {"quaternius_suit_female.glb", 6810, 23, {1.29F, 3.05F, 1.65F}, kWalk},
    {"quaternius_suit_female_quantized.glb", 6810, 23, {1.29F, 3.05F, 1.65F}, kWalk},
    {"quaternius_worker_male.glb", 2524, 23, {1.23F, 3.17F, 1.65F}, kWalk},
    // its table row shows one of 19 clips that belong together; the rest pose is the same row's
    // size
    {"rigged_figure/RiggedFigure.gltf", 256, 19, {1.18F, 1.45F, 0.33F}, "rest"},
    {"robot_expressive.glb", 3237, 43, {3.06F, 4.42F, 2.88F}, "Walking"},
    {"simple_skin.gltf", 8, 2, {1.00F, 2.00F, 0.00F}, ""},
};

std::string folder() {
  const std::string data = throng::test::data_dir() + "/characters";
  return std::filesystem::is_directory(data) ? data : "";
}

class CharacterFileTest : public testing::TestWithParam<Expected> {};

TEST_P(CharacterFileTest, HasTheSizeOfTheTable) {
  if (folder().empty()) GTEST_SKIP() << "no characters: set THRONG_DATA_DIR";
  const Expected& expected = GetParam();
  const absl::StatusOr<SourceCharacter> character = import_gltf(folder() + "/" + expected.file);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_EQ(test::fault_of(*character), "");
  EXPECT_LE(character->joints.size(), expected.joints);
  // triangles with two corners in one place are left out
  EXPECT_LE(character->triangles.size(), expected.triangles);
  EXPECT_GE(character->triangles.size() + 5, expected.triangles);

  Extent extent = test::extent_of(*character);
  const std::string clip_name = expected.clip;
  if (clip_name != "rest") {
    const auto clip =
        std::find_if(character->clips.begin(), character->clips.end(),
                     [&](const SourceClip& c) { return clip_name.empty() || c.name == clip_name; });
    ASSERT_NE(clip, character->clips.end());
    extent = test::extent_of(test::posed(*character, *clip, 0));
  }
  // ours is x forward, y left, z up; theirs x left, y up, z forward
  const glm::vec3 size(extent.size().y, extent.size().z, extent.size().x);
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(size[axis], expected.size[axis], 0.006F + 0.01F * expected.size[axis])
        << "axis " << axis;
  }
}

INSTANTIATE_TEST_SUITE_P(All, CharacterFileTest, testing::ValuesIn(kExpected),
                         [](const auto& info) {
                           std::string name;
                           for (const char c : std::string(info.param.file))
                             name += std::isalnum(static_cast<unsigned char>(c)) != 0 ? c : '_';
                           return name;
                         });

TEST(CharacterFilesTest, EveryFileOfTheFolderIsImportedStandingOnItsFeet) {
  if (folder().empty()) GTEST_SKIP() << "no characters: set THRONG_DATA_DIR";
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder())) {
    const std::string path = entry.path().string();
    if ((!path.ends_with(".glb") && !path.ends_with(".gltf")) ||
        path.find("malformed") != std::string::npos)
      continue;
    ++count;
    ImportOptions options;
    options.height_m = 1.75F;
    const absl::StatusOr<SourceCharacter> character = import_gltf(path, options);
    ASSERT_TRUE(character.ok()) << character.status();
    EXPECT_EQ(test::fault_of(*character), "") << path;
    const SourceClip* first = &character->clips[0];
    for (const render::ClipKind kind : {render::ClipKind::kWalk, render::ClipKind::kIdle}) {
      const auto found = std::find_if(character->clips.begin(), character->clips.end(),
                                      [&](const SourceClip& clip) { return clip.kind == kind; });
      if (found != character->clips.end()) first = &*found;
    }
    const Extent extent = test::extent_of(test::posed(*character, *first, 0));
    EXPECT_NEAR(extent.high.z, 1.75F, 1e-4F) << path;
    // a gun or a sword may hang below the feet
    EXPECT_LE(extent.low.z, 1e-4F) << path;
    EXPECT_GE(extent.low.z, -0.35F) << path;
    // the middle of the feet is under the body
    EXPECT_LE(extent.low.x, 0.0F) << path;
    EXPECT_GE(extent.high.x, 0.0F) << path;
  }
  EXPECT_GE(count, std::size(kExpected));
}

TEST(CharacterFilesTest, EveryMalformedFileIsRefusedByName) {
  if (folder().empty()) GTEST_SKIP() << "no characters: set THRONG_DATA_DIR";
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder() + "/malformed")) {
    const std::string path = entry.path().string();
    if (path.ends_with(".bin")) continue;
    ++count;
    const absl::StatusOr<SourceCharacter> character = import_gltf(path);
    ASSERT_FALSE(character.ok()) << path;
    EXPECT_EQ(character.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(character.status().message()), testing::StartsWith(path));
  }
  EXPECT_EQ(count, 11U);
}

TEST(CharacterFilesTest, DracoFileKeepsTrianglesAndWeights) {
  if (folder().empty()) GTEST_SKIP() << "no characters: set THRONG_DATA_DIR";
  const absl::StatusOr<SourceCharacter> character =
      import_gltf(folder() + "/quaternius_astronaut_bee_draco.glb");
  if (!character.ok()) {
    EXPECT_THAT(std::string(character.status().message()),
                testing::HasSubstr("KHR_draco_mesh_compression"));
    GTEST_SKIP() << "built without Draco";
  }
  EXPECT_EQ(character->triangles.size(), 8562U);
  EXPECT_EQ(test::fault_of(*character), "");
  EXPECT_EQ(character->materials[0].base_color.width_px, 512U);
}

TEST(CharacterFilesTest, ClipsOfAnotherFileMoveTheSameJoints) {
  const std::string clips = throng::test::data_dir() + "/motions/kaykit_med_movement_basic.glb";
  if (folder().empty() || !std::filesystem::exists(clips))
    GTEST_SKIP() << "no motions: set THRONG_DATA_DIR";
  ImportOptions options;
  options.clip_files = {clips};
  const absl::StatusOr<SourceCharacter> character =
      import_gltf(folder() + "/kaykit_mannequin/manny_med_mod.gltf", options);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_EQ(test::fault_of(*character), "");
  const auto walk =
      std::find_if(character->clips.begin(), character->clips.end(),
                   [](const SourceClip& c) { return c.kind == render::ClipKind::kWalk; });
  ASSERT_NE(walk, character->clips.end());
  // the arms have come down from the T of the rest pose
  EXPECT_LT(test::extent_of(test::posed(*character, *walk, 0)).size().y,
            0.8F * test::extent_of(*character).size().y);

  options.clip_files = {folder() + "/fox.glb"};
  const auto refused = import_gltf(folder() + "/kaykit_mannequin/manny_med_mod.gltf", options);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(std::string(refused.status().message()), testing::HasSubstr("fox.glb"));
}

}  // namespace
}  // namespace throng::simplify
