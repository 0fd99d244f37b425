#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <random>

#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"
#include "support/data_dir.hpp"

/// Thousands of damaged copies of good files. A file may still be good or be refused; the
/// sanitizers and `fault_of` say when one wasn't read with care.
namespace throng::simplify {
namespace {

void try_many(std::vector<std::uint8_t> good, int copies, std::uint32_t seed,
              std::size_t json_begin, std::size_t json_end, const std::string& path) {
  std::mt19937 random(seed);
  int accepted = 0;
  for (int i = 0; i < copies; ++i) {
    std::vector<std::uint8_t> bytes = good;
    test::mutate(bytes, json_begin, std::min(json_end, bytes.size() - 1), random);
    const absl::StatusOr<SourceCharacter> character = import_gltf_bytes(bytes, path);
    if (!character.ok()) {
      EXPECT_EQ(character.status().code(), absl::StatusCode::kInvalidArgument);
      continue;
    }
    ++accepted;
    ASSERT_EQ(test::fault_of(*character), "") << "copy " << i;
  }
  // a generator that only makes rubbish would test nothing
  EXPECT_GT(accepted, copies / 50);
  EXPECT_LT(accepted, copies);
}

TEST(ImportMutationTest, DamagedCopiesOfAMadeUpFileNeverCrash) {
  const std::vector<std::uint8_t> good = test::rich_file().glb();
  const std::string path = test::scratch_path("mutant.glb");
  const absl::StatusOr<SourceCharacter> character = import_gltf_bytes(good, path);
  ASSERT_TRUE(character.ok()) << character.status();
  ASSERT_EQ(test::fault_of(*character), "");
  try_many(good, 4000, 1, 20, test::json_end_of(good), path);
}

TEST(ImportMutationTest, DamagedCopiesOfRealFilesNeverCrash) {
  const std::string folder = throng::test::data_dir() + "/characters/";
  if (!std::filesystem::is_directory(folder)) GTEST_SKIP() << "no characters: set THRONG_DATA_DIR";
  const std::vector<std::uint8_t> skin = test::read_bytes(folder + "simple_skin.gltf");
  try_many(skin, 1500, 2, 0, skin.size(), test::scratch_path("mutant.gltf"));
  for (const auto& [file, copies] : {std::pair("quaternius_astronaut_bee_draco.glb", 40),
                                     std::pair("quaternius_suit_female_quantized.glb", 40),
                                     std::pair("robot_expressive.glb", 40)}) {
    const std::vector<std::uint8_t> good = test::read_bytes(folder + file);
    try_many(good, copies, 3, 20, test::json_end_of(good), test::scratch_path("mutant.glb"));
  }
}

}  // namespace
}  // namespace throng::simplify
