#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <set>

#include "simplify/bake/bake.hpp"
#include "simplify/bake/jobs.hpp"
#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"

/// What artists export, made up in code, through import and bake; and what can't be baked.
namespace throng::simplify {
namespace {

using test::GltfBuilder;
using ::testing::HasSubstr;

render::Character baked(const GltfBuilder& file) {
  const auto source = import_gltf_bytes(file.glb(), "made_up.glb");
  EXPECT_TRUE(source.ok()) << source.status();
  if (!source.ok()) return {};
  auto result = bake(*source, {});
  EXPECT_TRUE(result.ok()) << result.status();
  if (!result.ok()) return {};
  auto character = render::make_character(std::move(result->character));
  EXPECT_TRUE(character.ok()) << character.status();
  if (!character.ok()) return {};
  EXPECT_TRUE(check_levels(*character).ok()) << check_levels(*character);
  return *std::move(character);
}

/// Colours of the base colour where vertices are.
std::set<std::tuple<int, int, int>> vertex_colors(const render::Character& character) {
  std::set<std::tuple<int, int, int>> colors;
  const render::MipImage& image = character.base_color;
  for (const glm::u16vec2& uv : character.uv) {
    const auto x = std::min(image.width_px - 1, uv.x * image.width_px / 65535U);
    const auto y = std::min(image.height_px - 1, uv.y * image.height_px / 65535U);
    const std::uint8_t* texel = &image.texels[4 * (std::size_t{y} * image.width_px + x)];
    colors.insert({texel[0] / 8, texel[1] / 8, texel[2] / 8});
  }
  return colors;
}

TEST(OddCharactersTest, MeshesPrimitivesMaterialsAndSkinsBecomeOneCharacterWithOneAtlas) {
  GltfBuilder b = test::bending_post();  // mesh 0, skin 0 over nodes 1 and 2
  const std::vector<float> uvs = {0, 0, 1, 0, 0, 1, 1, 1, 0, 0, 1, 0, 0, 1, 1, 1};
  const std::string uv = ",\"TEXCOORD_0\":" + std::to_string(b.accessor(uvs, "VEC2"));
  std::vector<std::uint8_t> joints;
  std::vector<float> weights;
  for (int i = 0; i < 8; ++i) {
    joints.insert(joints.end(), {0, 0, 0, 0});
    weights.insert(weights.end(), {1, 0, 0, 0});
  }
  const std::string skinned = ",\"JOINTS_0\":" + std::to_string(b.accessor(joints, "VEC4")) +
                              ",\"WEIGHTS_0\":" + std::to_string(b.accessor(weights, "VEC4"));
  b.materials = {
      R"({"name":"red","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})",
      R"({"name":"green","doubleSided":true,"pbrMetallicRoughness":{"baseColorTexture":{"index":1}}})",
      R"({"name":"blue","pbrMetallicRoughness":{"baseColorFactor":[0,0,1,1]}})"};
  b.textures = {R"({"source":0})", R"({"source":1})"};
  b.images = {
      "{\"bufferView\":" + std::to_string(b.view(test::png(8, 8, {255, 0, 0, 255}))) + "}",
      "{\"bufferView\":" + std::to_string(b.view(test::jpeg(8, 8, {0, 255, 0, 255}))) + "}"};
  b.meshes.push_back("{\"primitives\":[{" + b.box({1, 0, 0}, {1.5F, 0.5F, 0.5F}, uv + skinned) +
                     ",\"material\":0},{" + b.box({1, 1, 0}, {1.5F, 1.5F, 0.5F}, uv + skinned) +
                     ",\"material\":1}]}");
  b.meshes.push_back("{\"primitives\":[{" + b.box({-1.5F, 0, 0}, {-1, 0.5F, 0.5F}) +
                     ",\"material\":2}]}");
  b.skins.push_back(R"({"joints":[1]})");
  b.nodes[2] = R"({"name":"bend","translation":[0,1,0],"children":[4]})";
  b.nodes.push_back(R"({"mesh":1,"skin":1})");
  b.nodes.push_back(R"({"name":"held","mesh":2,"translation":[0,-1,0]})");
  const render::Character character = baked(b);
  ASSERT_GT(character.vertex_count(), 0U);
  EXPECT_EQ(character.triangle_count(), 32U + 36U);
  const auto colors = vertex_colors(character);
  EXPECT_EQ(colors.count({31, 0, 0}), 1U);
  EXPECT_EQ(colors.count({0, 0, 31}), 1U);
  EXPECT_EQ(colors.count({31, 31, 31}), 1U);  // the post has no material
  int double_sided = 0;
  for (const std::uint8_t flags : character.triangle_flags)
    double_sided += (flags & render::kTriangleDoubleSided) != 0 ? 1 : 0;
  EXPECT_EQ(double_sided, 0);  // a closed box has no back to show
}

TEST(OddCharactersTest, RigidFileWithoutSkinClipNormalsTextureIsBaked) {
  GltfBuilder b;
  const render::Character character =
      baked(test::one_mesh(b, b.box({-0.3F, 0, -0.3F}, {0.3F, 1.8F, 0.3F})));
  EXPECT_EQ(character.joint_count(), 1U);
  ASSERT_EQ(character.clips.size(), 1U);
  EXPECT_EQ(character.clips[0].frame_count, 1U);
  EXPECT_NEAR(character.height_m, 1.8F, 1.0e-4F);
  EXPECT_EQ(character.vertex_count(), 24U);  // hard edges
}

TEST(OddCharactersTest, AFanOfSheetsAtOneEdgeIsBakedWhole) {
  GltfBuilder b;
  // five sheets around the edge from (0, 0, 0) to (0, 1, 0)
  std::vector<float> positions = {0, 0, 0, 0, 1, 0};
  std::vector<std::uint8_t> indices;
  for (int i = 0; i < 5; ++i) {
    const float angle = 1.2F * static_cast<float>(i);
    positions.insert(positions.end(), {std::cos(angle), 0.5F, std::sin(angle)});
    indices.insert(indices.end(), {0, 1, static_cast<std::uint8_t>(i + 2)});
  }
  const int position = b.accessor(positions, "VEC3");
  const int index = b.accessor(indices, "SCALAR");
  const render::Character character =
      baked(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + std::to_string(position) +
                                  "},\"indices\":" + std::to_string(index)));
  EXPECT_EQ(character.triangle_count(), 5U);
}

TEST(OddCharactersTest, RichFileIsBaked) { EXPECT_GT(baked(test::rich_file()).vertex_count(), 0U); }

class BadInputTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("throng_bad_" + std::to_string(::getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void add(const std::string& name, const std::vector<std::uint8_t>& bytes) {
    test::write_file((folder_ / name).string(), bytes);
    options_.inputs.push_back((folder_ / name).string());
  }
  static GltfBuilder triangle(const std::vector<float>& positions) {
    GltfBuilder b;
    const int position = b.accessor(positions, "VEC3");
    return test::one_mesh(b, "\"attributes\":{\"POSITION\":" + std::to_string(position) + "}");
  }

  std::filesystem::path folder_;
  JobOptions options_;
};

TEST_F(BadInputTest, EachIsNamedOnceWithItsElementAndTheOthersAreBaked) {
  add("truncated.glb", {'g', 'l', 'T', 'F', 2, 0, 0, 0, 200, 0, 0, 0});
  add("good.glb", test::bending_post().glb());
  GltfBuilder range;
  range.accessor(std::vector<float>(9, 0.0F), "VEC3");
  const int beyond =
      range.raw_accessor(R"({"bufferView":0,"componentType":5126,"count":400,"type":"VEC3"})");
  add("range.glb",
      test::one_mesh(range, "\"attributes\":{\"POSITION\":" + std::to_string(beyond) + "}").glb());
  GltfBuilder circle = test::bending_post();
  circle.nodes[2] = R"({"name":"bend","children":[1]})";
  add("circle.glb", circle.glb());
  add("nan.glb", triangle({0, 0, 0, 1, std::nanf(""), 0, 0, 1, 0}).glb());
  add("flat.glb", triangle({0, 0, 0, 1, 0, 0, 2, 0, 0}).glb());
  add("fine.glb", test::rich_file().glb());
  options_.folder = (folder_ / "cast").string();
  options_.jobs = 2;
  std::vector<std::string> errors;
  options_.say = [&](const std::string& line) {
    if (line.rfind("error: ", 0) == 0) errors.push_back(line);
  };
  JobSummary summary;
  ASSERT_TRUE(run_jobs(options_, summary).ok());
  EXPECT_EQ(summary.failed, 5);
  EXPECT_EQ(summary.baked, 2);
  EXPECT_FALSE(summary.is_internal);
  using ::testing::AllOf;
  EXPECT_THAT(errors, ::testing::UnorderedElementsAre(
                          HasSubstr("truncated.glb"),
                          AllOf(HasSubstr("range.glb"), HasSubstr("accessor 1")),
                          AllOf(HasSubstr("circle.glb"), HasSubstr("node 1")),
                          AllOf(HasSubstr("nan.glb"), HasSubstr("vertex 1")),
                          AllOf(HasSubstr("flat.glb"), HasSubstr("area"))));
  EXPECT_EQ(render::read_cast(options_.folder)->members.size(), 2U);
}

TEST_F(BadInputTest, OddHeightIsToldUnlessOneIsGiven) {
  GltfBuilder b;
  add("tower.glb", test::one_mesh(b, b.box({-0.3F, 0, -0.3F}, {0.3F, 180, 0.3F})).glb());
  options_.folder = (folder_ / "cast").string();
  for (const float height_m : {0.0F, 1.75F}) {
    options_.bake.height_m = height_m;
    std::string said;
    options_.say = [&](const std::string& line) { said += line; };
    JobSummary summary;
    ASSERT_TRUE(run_jobs(options_, summary).ok());
    EXPECT_EQ(summary.baked, 1);
    EXPECT_EQ(said.find("180 m tall; for a person pass --height") != std::string::npos,
              height_m == 0.0F);
    EXPECT_FLOAT_EQ(render::read_cast(options_.folder)->members[0].character.height_m,
                    height_m == 0.0F ? 180.0F : height_m);
  }
}

TEST_F(BadInputTest, UnchangedMadeUpInputIsNotBakedAgain) {
  add("post.glb", test::bending_post().glb());
  options_.folder = (folder_ / "cast").string();
  JobSummary first, second, third;
  ASSERT_TRUE(run_jobs(options_, first).ok());
  ASSERT_TRUE(run_jobs(options_, second).ok());
  EXPECT_EQ(first.baked, 1);
  EXPECT_EQ(second.baked, 0);
  EXPECT_EQ(second.unchanged, 1);
  test::write_file(options_.inputs[0], test::rich_file().glb());
  ASSERT_TRUE(run_jobs(options_, third).ok());
  EXPECT_EQ(third.baked, 1);
}

}  // namespace
}  // namespace throng::simplify
