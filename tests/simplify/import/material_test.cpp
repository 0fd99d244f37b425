#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"

namespace throng::simplify {
namespace {

using test::GltfBuilder;
using testing::Contains;
using testing::HasSubstr;

std::string number(int value) { return std::to_string(value); }

absl::StatusOr<SourceCharacter> import_built(const GltfBuilder& builder) {
  const std::string path = test::scratch_path("material.glb");
  test::write_file(path, builder.glb());
  absl::StatusOr<SourceCharacter> character = import_gltf(path);
  EXPECT_EQ(character.ok() ? test::fault_of(*character) : "", "");
  return character;
}

/// A square with texture coordinates and this material, whose texture 0 is image 0.
GltfBuilder textured_square(const std::string& material, const std::string& more_attributes = "") {
  GltfBuilder b;
  const int position = b.accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, "VEC3");
  const int uv = b.accessor(std::vector<float>{0, 1, 1, 1, 0, 0, 1, 0}, "VEC2");
  const int index = b.accessor(std::vector<std::uint8_t>{0, 1, 2, 1, 3, 2}, "SCALAR");
  b.materials = {material};
  b.meshes = {"{\"primitives\":[{\"material\":0,\"attributes\":{\"POSITION\":" + number(position) +
              ",\"TEXCOORD_0\":" + number(uv) + more_attributes + "},\"indices\":" + number(index) +
              "}]}"};
  b.nodes = {R"({"mesh":0})"};
  return b;
}

constexpr auto kTextured =
    R"({"name":"cloth","pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})";

void add_image(GltfBuilder& b, const std::vector<std::uint8_t>& encoded, const std::string& mime) {
  b.images = {"{\"bufferView\":" + number(b.view(encoded)) + ",\"mimeType\":\"" + mime + "\"}"};
  b.textures = {R"({"source":0})"};
}

TEST(ImportMaterialTest, PngAndJpegTexturesAreDecoded) {
  for (const bool is_png : {true, false}) {
    GltfBuilder b = textured_square(kTextured);
    if (is_png) {
      add_image(b, test::png(8, 4, {200, 100, 50, 255}), "image/png");
    } else {
      add_image(b, test::jpeg(8, 4, {200, 100, 50, 255}), "image/jpeg");
    }
    const auto character = import_built(b);
    ASSERT_TRUE(character.ok()) << character.status();
    ASSERT_EQ(character->materials.size(), 1U);
    const SourceImage& image = character->materials[0].base_color;
    EXPECT_EQ(image.width_px, 8U);
    EXPECT_EQ(image.height_px, 4U);
    EXPECT_NEAR(image.rgba[0], 200, 4);
    EXPECT_NEAR(image.rgba[1], 100, 4);
    EXPECT_EQ(image.rgba[3], 255);
    EXPECT_EQ(character->materials[0].name, "cloth");
    EXPECT_EQ(character->uvs.size(), 4U);
  }
}

TEST(ImportMaterialTest, ImageMayBeAFileBeside) {
  GltfBuilder b = textured_square(kTextured);
  test::write_file(test::scratch_path("picture one.png"), test::png(2, 2, {1, 2, 3, 255}));
  b.images = {R"({"uri":"picture%20one.png"})"};
  b.textures = {R"({"source":0})"};
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_EQ(character->materials[0].base_color.rgba[2], 3);
}

TEST(ImportMaterialTest, FactorsWrapModesAndSidesAreKept) {
  GltfBuilder b = textured_square(
      R"({"doubleSided":true,"pbrMetallicRoughness":{"baseColorFactor":[0.5,0.25,1,1],"baseColorTexture":{"index":0}}})");
  add_image(b, test::png(2, 2, {255, 255, 255, 255}), "image/png");
  b.textures = {R"({"source":0,"sampler":0})"};
  b.samplers = {R"({"wrapS":33071,"wrapT":33648})"};
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  const SourceMaterial& material = character->materials[0];
  EXPECT_TRUE(material.double_sided);
  EXPECT_EQ(material.factor, glm::vec4(0.5F, 0.25F, 1, 1));
  EXPECT_EQ(material.wrap_u, Wrap::kClamp);
  EXPECT_EQ(material.wrap_v, Wrap::kMirror);
}

TEST(ImportMaterialTest, MaskIsCutOutAndBlendIsDecidedByItsHoles) {
  const auto with_mode = [](const std::string& mode, bool holes) {
    GltfBuilder b = textured_square(
        "{\"alphaMode\":\"" + mode +
        R"(","alphaCutoff":0.3,"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})");
    add_image(b, test::png(4, 4, {9, 9, 9, 255}, holes), "image/png");
    return import_built(b);
  };
  const auto mask = with_mode("MASK", true);
  ASSERT_TRUE(mask.ok()) << mask.status();
  EXPECT_TRUE(mask->materials[0].alpha_cutout);
  EXPECT_FLOAT_EQ(mask->materials[0].alpha_cutoff, 0.3F);
  const auto holes = with_mode("BLEND", true);
  const auto solid = with_mode("BLEND", false);
  const auto opaque = with_mode("OPAQUE", true);
  ASSERT_TRUE(holes.ok() && solid.ok() && opaque.ok());
  EXPECT_TRUE(holes->materials[0].alpha_cutout);
  EXPECT_FALSE(solid->materials[0].alpha_cutout);
  EXPECT_FALSE(opaque->materials[0].alpha_cutout);
  EXPECT_EQ(opaque->materials[0].base_color.rgba[3], 255);
  EXPECT_THAT(solid->notes, Contains(HasSubstr("blended")));
}

TEST(ImportMaterialTest, TextureTransformMovesCoordinates) {
  GltfBuilder b = textured_square(
      R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"offset":[0.5,0.25],"scale":[0.5,0.25]}}}}})");
  add_image(b, test::png(2, 2, {0, 0, 0, 255}), "image/png");
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  glm::vec2 low(9);
  glm::vec2 high(-9);
  for (const glm::vec2& uv : character->uvs) {
    low = glm::min(low, uv);
    high = glm::max(high, uv);
  }
  EXPECT_EQ(low, glm::vec2(0.5F, 0.25F));
  EXPECT_EQ(high, glm::vec2(1.0F, 0.5F));
}

TEST(ImportMaterialTest, TextureTransformTurnsCounterClockwise) {
  GltfBuilder b = textured_square(
      R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0,"extensions":{"KHR_texture_transform":{"rotation":1.5707963267948966}}}}})");
  add_image(b, test::png(2, 2, {0, 0, 0, 255}), "image/png");
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  // (1, 0) goes up, which is towards -v
  EXPECT_THAT(character->uvs, Contains(testing::Truly([](const glm::vec2& uv) {
                return glm::length(uv - glm::vec2(0, -1)) < 1e-6F;
              })));
}

TEST(ImportMaterialTest, SecondCoordinateSetIsUsedWhereTheTextureSaysSo) {
  GltfBuilder b;
  const int second =
      b.accessor(std::vector<float>{0.1F, 0.1F, 0.1F, 0.1F, 0.1F, 0.1F, 0.1F, 0.1F}, "VEC2");
  GltfBuilder square =
      textured_square(R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0,"texCoord":1}}})");
  const int uv = square.accessor(std::vector<float>(8, 0.1F), "VEC2");
  std::string& mesh = square.meshes[0];
  mesh.replace(mesh.find("\"TEXCOORD_0\""), 12, "\"TEXCOORD_1\":" + number(uv) + ",\"TEXCOORD_0\"");
  add_image(square, test::png(2, 2, {0, 0, 0, 255}), "image/png");
  const auto character = import_built(square);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_EQ(character->uvs.size(), 1U);
  EXPECT_EQ(character->uvs[0], glm::vec2(0.1F));
  EXPECT_GE(second, 0);
}

TEST(ImportMaterialTest, TextureWithoutCoordinatesGivesThePlainColour) {
  GltfBuilder b;
  b.materials = {kTextured};
  const std::string box = b.box({0, 0, 0}, {1, 1, 1}) + ",\"material\":0";
  add_image(b, test::png(2, 2, {0, 0, 0, 255}), "image/png");
  const auto character = import_built(test::one_mesh(b, box));
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_TRUE(character->materials[0].base_color.rgba.empty());
  EXPECT_THAT(character->notes, Contains(HasSubstr("no TEXCOORD_0")));
}

TEST(ImportMaterialTest, UnsupportedPictureFormatIsTold) {
  GltfBuilder b = textured_square(kTextured);
  b.images = {R"({"uri":"a.webp"})"};
  b.textures = {R"({"extensions":{"EXT_texture_webp":{"source":0}}})"};
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_THAT(character->notes, Contains(HasSubstr("EXT_texture_webp")));
}

TEST(ImportMaterialTest, OneVertexColourGoesIntoTheFactor) {
  GltfBuilder b;
  std::vector<std::uint8_t> colors;
  for (int i = 0; i < 8; ++i) colors.insert(colors.end(), {255, 0, 51, 255});
  const int color = b.accessor(colors, "VEC4", true);
  const auto character =
      import_built(test::one_mesh(b, b.box({0, 0, 0}, {1, 1, 1}, ",\"COLOR_0\":" + number(color))));
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_NEAR(character->materials[0].factor.r, 1.0F, 1e-5F);
  EXPECT_NEAR(character->materials[0].factor.g, 0.0F, 1e-5F);
  EXPECT_NEAR(character->materials[0].factor.b, 0.2F, 1e-5F);
}

TEST(ImportMaterialTest, SeveralVertexColoursBecomeAPalette) {
  GltfBuilder b;
  // two triangles, one red and one blue
  const int position =
      b.accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0}, "VEC3");
  const int color =
      b.accessor(std::vector<float>{1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  const auto character =
      import_built(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + number(position) +
                                         ",\"COLOR_0\":" + number(color) + "}"));
  ASSERT_TRUE(character.ok()) << character.status();
  ASSERT_EQ(character->materials.size(), 1U);
  const SourceImage& image = character->materials[0].base_color;
  const auto texel = [&](const SourceTriangle& triangle) {
    const glm::vec2 uv = character->uvs[triangle.corner[0].uv];
    const std::size_t x = static_cast<std::size_t>(uv.x * static_cast<float>(image.width_px));
    const std::size_t y = static_cast<std::size_t>(uv.y * static_cast<float>(image.height_px));
    const std::uint8_t* at = &image.rgba[4 * (y * image.width_px + x)];
    return glm::u8vec3(at[0], at[1], at[2]);
  };
  EXPECT_EQ(texel(character->triangles[0]), glm::u8vec3(255, 0, 0));
  EXPECT_EQ(texel(character->triangles[1]), glm::u8vec3(0, 0, 255));
  EXPECT_THAT(character->notes, Contains(HasSubstr("palette of 2")));
}

TEST(ImportMaterialTest, MaterialsOfSeveralPrimitivesStayApart) {
  GltfBuilder b;
  b.materials = {R"({"name":"a","pbrMetallicRoughness":{"baseColorFactor":[1,0,0,1]}})",
                 R"({"name":"unused"})",
                 R"({"name":"b","pbrMetallicRoughness":{"baseColorFactor":[0,1,0,1]}})"};
  b.meshes = {"{\"primitives\":[{" + b.box({0, 0, 0}, {1, 1, 1}) + ",\"material\":0},{" +
              b.box({0, 1, 0}, {1, 2, 1}) + ",\"material\":2},{" + b.box({0, 2, 0}, {1, 3, 1}) +
              "}]}"};
  b.nodes = {R"({"mesh":0})"};
  const auto character = import_built(b);
  ASSERT_TRUE(character.ok()) << character.status();
  ASSERT_EQ(character->materials.size(), 3U);
  EXPECT_EQ(character->materials[0].name, "a");
  EXPECT_EQ(character->materials[1].name, "b");
  EXPECT_EQ(character->materials[2].factor, glm::vec4(1));
}

TEST(ImportMaterialTest, OldSpecularGlossinessColourIsRead) {
  GltfBuilder b;
  b.materials = {
      R"({"extensions":{"KHR_materials_pbrSpecularGlossiness":{"diffuseFactor":[0.2,0.4,0.6,1]}}})"};
  const auto character =
      import_built(test::one_mesh(b, b.box({0, 0, 0}, {1, 1, 1}) + ",\"material\":0"));
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_NEAR(character->materials[0].factor.g, 0.4F, 1e-6F);
}

}  // namespace
}  // namespace throng::simplify
