#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <random>

#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"
#include "support/data_dir.hpp"

/// Thousands of damaged copies of good files. A file may still be good or be refused; the
/// sanitizers and `fault_of` say when one wasn't read with care.
namespace throng::simplify {
namespace {

using test::GltfBuilder;

/// A file with something of everything: skin, clip, picture, sparse rows, colours, a transform.
GltfBuilder rich_file() {
  GltfBuilder b = test::bending_post();
  const std::vector<float> uvs(40, 0.25F);
  std::vector<std::uint8_t> colors(80, 200);
  colors[5] = 3;
  const auto number = [](int value) { return std::to_string(value); };
  const int uv = b.accessor(uvs, "VEC2");
  const int color = b.accessor(colors, "VEC4", true);
  const int index_view = b.view({0, 3});
  const int value_view = b.view(std::vector<std::uint8_t>(24, 62));
  const int sparse = b.raw_accessor(
      R"({"bufferView":0,"componentType":5126,"count":20,"type":"VEC3","sparse":{"count":2,"indices":{"bufferView":)" +
      number(index_view) + R"(,"componentType":5121},"values":{"bufferView":)" +
      number(value_view) + "}}}");
  std::string& mesh = b.meshes[0];
  mesh.replace(mesh.find("\"POSITION\":0"), 12,
               "\"POSITION\":" + number(sparse) + ",\"TEXCOORD_0\":" + number(uv) +
                   ",\"COLOR_0\":" + number(color));
  mesh.replace(mesh.find("\"indices\""), 9, "\"material\":0,\"indices\"");
  b.materials = {
      R"({"alphaMode":"BLEND","pbrMetallicRoughness":{"baseColorFactor":[1,0.5,1,1],"baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"offset":[0.1,0.2],"rotation":0.3,"scale":[2,2]}}}}})"};
  b.textures = {R"({"source":0,"sampler":0})"};
  b.samplers = {R"({"wrapS":33071})"};
  b.images = {"{\"bufferView\":" + number(b.view(test::png(6, 5, {9, 8, 7, 255}, true))) + "}"};
  b.meshes.push_back("{\"primitives\":[{\"mode\":5," + b.box({0, 0, 0}, {1, 1, 1}) + "}]}");
  b.nodes[2] = R"({"name":"bend","translation":[0,1,0],"children":[3]})";
  b.nodes.push_back(R"({"mesh":1,"matrix":[1,0,0,0,0,1,0,0,0,0,1,0,1,2,3,1]})");
  b.extra = R"(,"scene":0,"scenes":[{"nodes":[0,1]}])";
  return b;
}

void mutate(std::vector<std::uint8_t>& bytes, std::size_t json_begin, std::size_t json_end,
            std::mt19937& random) {
  const auto pick = [&](std::size_t begin, std::size_t end) {
    return std::uniform_int_distribution<std::size_t>(begin, end - 1)(random);
  };
  const std::size_t changes = 1 + random() % 4;
  for (std::size_t i = 0; i < changes; ++i) {
    switch (random() % 5) {
      case 0:
        bytes[pick(0, bytes.size())] = static_cast<std::uint8_t>(random());
        break;
      case 1:
        bytes[pick(json_end, bytes.size())] ^= static_cast<std::uint8_t>(1U << random() % 8);
        break;
      default: {
        // digits become other digits, which gives files that are read further before they're
        // refused
        const std::size_t at = pick(json_begin, json_end);
        for (std::size_t k = at; k < json_end; ++k) {
          if (std::isdigit(bytes[k]) != 0) {
            bytes[k] = random() % 8 == 0 ? '-' : static_cast<std::uint8_t>('0' + random() % 10);
            break;
          }
        }
      }
    }
  }
}

void try_many(std::vector<std::uint8_t> good, int copies, std::uint32_t seed,
              std::size_t json_begin, std::size_t json_end, const std::string& path) {
  std::mt19937 random(seed);
  int accepted = 0;
  for (int i = 0; i < copies; ++i) {
    std::vector<std::uint8_t> bytes = good;
    mutate(bytes, json_begin, std::min(json_end, bytes.size() - 1), random);
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

std::size_t json_end_of(const std::vector<std::uint8_t>& glb) {
  return 20 + (std::size_t{glb[12]} | std::size_t{glb[13]} << 8 | std::size_t{glb[14]} << 16);
}

TEST(ImportMutationTest, DamagedCopiesOfAMadeUpFileNeverCrash) {
  const std::vector<std::uint8_t> good = rich_file().glb();
  const std::string path = test::scratch_path("mutant.glb");
  const absl::StatusOr<SourceCharacter> character = import_gltf_bytes(good, path);
  ASSERT_TRUE(character.ok()) << character.status();
  ASSERT_EQ(test::fault_of(*character), "");
  try_many(good, 4000, 1, 20, json_end_of(good), path);
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
    try_many(good, copies, 3, 20, json_end_of(good), test::scratch_path("mutant.glb"));
  }
}

}  // namespace
}  // namespace throng::simplify
