#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <string>
#include <vector>

#include "simplify/bake/bake.hpp"
#include "simplify/builtin/builtin.hpp"
#include "simplify/import/gltf.hpp"
#include "support/data_dir.hpp"

namespace throng::simplify {
namespace {

std::vector<std::string> characters() {
  std::vector<std::string> paths;
  const std::string data = test::data_dir();
  if (data.empty()) return paths;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(data + "/characters")) {
    const std::string path = entry.path().string(), extension = entry.path().extension().string();
    if ((extension == ".glb" || extension == ".gltf") &&
        path.find("malformed") == std::string::npos)
      paths.push_back(path);
  }
  std::sort(paths.begin(), paths.end());
  return paths;
}

TEST(RealCharactersTest, EveryLevelOfEveryCharacterIsWhole) {
  const std::vector<std::string> paths = characters();
  if (paths.empty()) GTEST_SKIP() << "no data folder; set THRONG_DATA_DIR";
  for (const std::string& path : paths) {
    SCOPED_TRACE(path);
    auto source = import_gltf(path);
    ASSERT_TRUE(source.ok()) << source.status();
    auto result = bake(*source);
    ASSERT_TRUE(result.ok()) << result.status();
    const auto character = render::make_character(std::move(result->character));
    ASSERT_TRUE(character.ok()) << character.status();
    EXPECT_TRUE(check_levels(*character).ok()) << check_levels(*character);
    EXPECT_LE(character->coarsest_count, 28U);
    EXPECT_GE(character->triangle_count_at[character->coarsest_count], 1U);
  }
}

TEST(RealCharactersTest, PublishedCriterionGivesWholeLevels) {
  const std::vector<std::string> paths = characters();
  if (paths.empty()) GTEST_SKIP() << "no data folder; set THRONG_DATA_DIR";
  for (const std::string& path : paths) {
    const bool is_small =
        std::filesystem::file_size(path) < 600000;  // every frame counts, so this is slow
    if (!is_small) continue;
    SCOPED_TRACE(path);
    auto source = import_gltf(path);
    ASSERT_TRUE(source.ok()) << source.status();
    BakeOptions options;
    options.criterion = Criterion::kPeng2011;
    auto result = bake(*source, options);
    ASSERT_TRUE(result.ok()) << result.status();
    const auto character = render::make_character(std::move(result->character));
    ASSERT_TRUE(character.ok()) << character.status();
    EXPECT_TRUE(check_levels(*character).ok()) << check_levels(*character);
  }
}

TEST(BuiltinCastTest, PublishedCriterionReaches324Triangles) {
  const std::vector<std::string> names = builtin::builtin_names();
  for (std::size_t i = 0; i < names.size(); i += 4) {  // each takes a second
    const std::string& name = names[i];
    SCOPED_TRACE(name);
    SourceCharacter source = builtin::make_builtin(name);
    for (SourceMaterial& material : source.materials) {
      material.base_color.width_px = material.base_color.height_px = 4;
      material.base_color.rgba.assign(64, 255);  // colours play no part in it
      material.tint_mask = {};
    }
    BakeOptions options;
    options.criterion = Criterion::kPeng2011;
    auto result = bake(source, options);
    ASSERT_TRUE(result.ok()) << result.status();
    const render::CharacterData& data = result->character;
    EXPECT_LE(data.triangle_count_at[data.coarsest_count], 324U);
    EXPECT_EQ(result->pose_count, data.palette.size() / data.joints.size() + 1);
  }
}

}  // namespace
}  // namespace throng::simplify
