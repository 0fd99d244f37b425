#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"

namespace throng::simplify {
namespace {

using test::GltfBuilder;
using testing::AllOf;
using testing::HasSubstr;

std::string number(int value) { return std::to_string(value); }

std::string message_of(const absl::StatusOr<SourceCharacter>& character) {
  EXPECT_FALSE(character.ok());
  EXPECT_EQ(character.status().code(), absl::StatusCode::kInvalidArgument);
  return std::string(character.status().message());
}

std::string refusal_of(const GltfBuilder& builder) {
  const std::string path = test::scratch_path("bad.glb");
  test::write_file(path, builder.glb());
  const std::string message = message_of(import_gltf(path));
  EXPECT_THAT(message, testing::StartsWith(path + ": "));
  return message;
}

std::string refusal_of(const std::string& text, const std::string& name = "bad.gltf") {
  const std::string path = test::scratch_path(name);
  test::write_file(path, {text.begin(), text.end()});
  const std::string message = message_of(import_gltf(path));
  EXPECT_THAT(message, testing::StartsWith(path + ": "));
  return message;
}

GltfBuilder box_file() {
  GltfBuilder b;
  const std::string box = b.box({0, 0, 0}, {1, 1, 1});
  return test::one_mesh(b, box);
}

TEST(ImportBadInputTest, FilesThatAreMissingOrNotGltf) {
  EXPECT_THAT(message_of(import_gltf("/nowhere/at all.glb")),
              HasSubstr("/nowhere/at all.glb: no such file"));
  EXPECT_THAT(message_of(import_gltf(test::scratch_path(""))), HasSubstr("not a plain file"));
  EXPECT_THAT(refusal_of(std::string()), HasSubstr("is empty"));
  EXPECT_THAT(refusal_of("{]"), HasSubstr("JSON is malformed at byte 2"));
  EXPECT_THAT(refusal_of("[]"), HasSubstr("JSON is not an object"));
  EXPECT_THAT(refusal_of("{}"), HasSubstr("asset version is ''"));
  EXPECT_THAT(refusal_of(R"({"asset":{"version":"1.0"}})"), HasSubstr("'1.0', must be 2.x"));
  EXPECT_THAT(refusal_of("glTX", "bad.glb"), HasSubstr("'glTF'"));
  EXPECT_THAT(refusal_of("glTF", "bad.glb"), HasSubstr("ends after 4 bytes"));
  EXPECT_THAT(refusal_of(R"({"asset":{"version":"2.0"}})"), HasSubstr("no triangles"));
}

TEST(ImportBadInputTest, NestingThatWouldOverflowAParser) {
  const std::string deep = R"({"asset":{"version":"2.0"},"extras":)" + std::string(100000, '[') +
                           std::string(100000, ']') + "}";
  EXPECT_THAT(refusal_of(deep), HasSubstr("nested deeper than 64"));
}

TEST(ImportBadInputTest, ChunkLongerThanTheFile) {
  std::vector<std::uint8_t> bytes = box_file().glb();
  bytes[12] = bytes[13] = 0xFF;
  const std::string path = test::scratch_path("bad.glb");
  test::write_file(path, bytes);
  EXPECT_THAT(message_of(import_gltf(path)), HasSubstr("chunk 0 has"));
}

TEST(ImportBadInputTest, EveryTruncationIsRefused) {
  const std::vector<std::uint8_t> whole = test::bending_post().glb();
  const std::string path = test::scratch_path("short.glb");
  for (std::size_t size = 0; size < whole.size(); size += 7) {
    EXPECT_FALSE(import_gltf_bytes(std::span(whole).first(size), path).ok()) << size;
  }
}

TEST(ImportBadInputTest, AccessorBeyondItsViewIsNamedWithItsMesh) {
  GltfBuilder b;
  const int good = b.accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  const int bad =
      b.raw_accessor(R"({"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"})");
  b.meshes = {"{\"primitives\":[{\"attributes\":{\"POSITION\":" + number(good) +
              "}},{\"attributes\":{\"POSITION\":" + number(bad) + "}}]}"};
  b.nodes = {R"({"mesh":0})"};
  EXPECT_THAT(refusal_of(b),
              HasSubstr("mesh 0 primitive 1 accessor 1 has 4 rows of 12 bytes from byte 0, "
                        "bufferView 0 has 36 bytes"));
}

TEST(ImportBadInputTest, HugeOffsetsAndCountsDontWrapAround) {
  for (
      const char* accessor :
      {R"({"bufferView":0,"byteOffset":18446744073709551610,"componentType":5126,"count":3,"type":"VEC3"})",
       R"({"bufferView":0,"componentType":5126,"count":18446744073709551615,"type":"VEC3"})",
       R"({"bufferView":0,"componentType":5126,"count":-1,"type":"VEC3"})",
       R"({"bufferView":0,"componentType":5126,"count":1e30,"type":"VEC3"})",
       R"({"componentType":5126,"count":4000000,"type":"MAT4"})",
       R"({"componentType":5126,"count":100000000,"type":"VEC3"})"}) {
    GltfBuilder b;
    b.view(std::vector<std::uint8_t>(36));
    const int position = b.raw_accessor(accessor);
    EXPECT_THAT(
        refusal_of(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + number(position) + "}")),
        HasSubstr("accessor 0"));
  }
}

TEST(ImportBadInputTest, ViewsOutsideTheirBuffer) {
  GltfBuilder b = box_file();
  b.raw_view(R"({"buffer":0,"byteOffset":100,"byteLength":18446744073709551610})");
  EXPECT_THAT(refusal_of(b),
              HasSubstr("bufferView 2 ends at byte 100 + 18446744073709551610 of buffer 0"));
  GltfBuilder other = box_file();
  other.raw_view(R"({"buffer":7,"byteLength":1})");
  EXPECT_THAT(refusal_of(other), HasSubstr("bufferView 2 buffer is 7, the file has 1 buffers"));
}

TEST(ImportBadInputTest, IndexOfAVertexThatIsNotThere) {
  GltfBuilder b;
  const int position = b.accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  const int index = b.accessor(std::vector<std::uint8_t>{0, 1, 3}, "SCALAR");
  EXPECT_THAT(
      refusal_of(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + number(position) +
                                       "},\"indices\":" + number(index))),
      HasSubstr("mesh 0 primitive 0 accessor 1 (indices) names vertex 3 at 2, there are 3"));
}

TEST(ImportBadInputTest, SparseIndexOutOfRange) {
  GltfBuilder b;
  b.view(std::vector<std::uint8_t>{9, 0, 0, 0});
  b.view(std::vector<std::uint8_t>(12));
  const int position = b.raw_accessor(
      R"({"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":1,"indices":{"bufferView":0,"componentType":5121},"values":{"bufferView":1}}})");
  EXPECT_THAT(
      refusal_of(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + number(position) + "}")),
      HasSubstr("accessor 0 sparse index 9 must be below 3"));
}

TEST(ImportBadInputTest, VerticesThatAreNotFinite) {
  for (const float bad : {std::nanf(""), std::numeric_limits<float>::infinity(), 1e30F}) {
    GltfBuilder b;
    const int position = b.accessor(std::vector<float>{0, 0, 0, 1, bad, 0, 0, 1, 0}, "VEC3");
    EXPECT_THAT(
        refusal_of(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + number(position) + "}")),
        HasSubstr("mesh 0 primitive 0 accessor 0 (POSITION) vertex 1 is (1, "));
  }
}

TEST(ImportBadInputTest, MeshWithoutArea) {
  GltfBuilder b;
  const int position = b.accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 2, 0, 0}, "VEC3");
  EXPECT_THAT(
      refusal_of(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + number(position) + "}")),
      HasSubstr("area of 0 m2"));
  GltfBuilder point;
  const int same = point.accessor(std::vector<float>(9, 1.0F), "VEC3");
  EXPECT_THAT(
      refusal_of(test::one_mesh(point, "\"attributes\":{\"POSITION\":" + number(same) + "}")),
      HasSubstr("no triangles"));
}

TEST(ImportBadInputTest, NodesInACircleOrWithTwoParents) {
  GltfBuilder circle = box_file();
  circle.nodes = {R"({"mesh":0})", R"({"children":[2]})", R"({"children":[1]})"};
  EXPECT_THAT(refusal_of(circle), HasSubstr("is its own ancestor"));
  GltfBuilder self = box_file();
  self.nodes = {R"({"mesh":0,"children":[0]})"};
  EXPECT_THAT(refusal_of(self), HasSubstr("node 0 is its own ancestor"));
  GltfBuilder shared = box_file();
  shared.nodes = {R"({"children":[2]})", R"({"children":[2]})", R"({"mesh":0})"};
  EXPECT_THAT(refusal_of(shared), HasSubstr("node 2 is a child of node 0 and of node 1"));
}

TEST(ImportBadInputTest, ReferencesToNothing) {
  for (const auto& [change, expected] :
       {std::pair(R"(,"scene":3,"scenes":[{"nodes":[0]}])", "scene is 3, the file has 1 scenes"),
        std::pair(R"(,"scenes":[{"nodes":[5]}])", "scene 0 nodes is 5, the file has 1 nodes"),
        std::pair(R"(,"extensionsRequired":["KHR_made_up"])",
                  "requires the extension KHR_made_up")}) {
    GltfBuilder b = box_file();
    b.extra = change;
    EXPECT_THAT(refusal_of(b), HasSubstr(expected));
  }
  GltfBuilder mesh = box_file();
  mesh.nodes = {R"({"mesh":4})"};
  EXPECT_THAT(refusal_of(mesh), HasSubstr("node 0 mesh is 4, the file has 1 meshes"));
  GltfBuilder material = box_file();
  material.meshes[0].replace(material.meshes[0].find("\"indices\""), 9,
                             "\"material\":1,\"indices\"");
  EXPECT_THAT(refusal_of(material),
              HasSubstr("mesh 0 primitive 0 material is 1, the file has 0 materials"));
}

TEST(ImportBadInputTest, SkinsThatDontFit) {
  GltfBuilder no_weights = test::bending_post();
  std::string& mesh = no_weights.meshes[0];
  mesh.replace(mesh.find("\"WEIGHTS_0\""), 11, "\"_WEIGHTS\"");
  EXPECT_THAT(refusal_of(no_weights),
              HasSubstr("mesh 0 primitive 0 has JOINTS_0 and no WEIGHTS_0"));

  GltfBuilder too_few = test::bending_post();
  too_few.skins = {R"({"joints":[1]})"};
  EXPECT_THAT(refusal_of(too_few),
              AllOf(HasSubstr("(JOINTS_0) vertex"), HasSubstr("names joint 1, the skin has 1")));

  GltfBuilder short_bind = test::bending_post();
  short_bind.nodes.push_back("{}");
  short_bind.skins[0].replace(short_bind.skins[0].find("[1,2]"), 5, "[1,2,3]");
  EXPECT_THAT(refusal_of(short_bind),
              HasSubstr("skin 0 accessor 4 has 2 rows of 16 numbers, must have 3 of 16"));

  GltfBuilder empty = test::bending_post();
  empty.skins = {"{}"};
  EXPECT_THAT(refusal_of(empty), HasSubstr("skin 0 has 0 joints"));
}

TEST(ImportBadInputTest, AnimationsThatDontFit) {
  GltfBuilder backwards = test::bending_post();
  const int times = backwards.accessor(std::vector<float>{0, 1, 0.5F}, "SCALAR");
  backwards.animations[0].replace(backwards.animations[0].find("\"input\":5"), 9,
                                  "\"input\":" + number(times));
  EXPECT_THAT(refusal_of(backwards),
              HasSubstr("animation 0 channel 0 sampler 0 accessor 7 time 2 is 0.5 s"));

  GltfBuilder endless = test::bending_post();
  const int late = endless.accessor(std::vector<float>{0, 1, 1e9F}, "SCALAR");
  endless.animations[0].replace(endless.animations[0].find("\"input\":5"), 9,
                                "\"input\":" + number(late));
  EXPECT_THAT(refusal_of(endless), HasSubstr("the limit is 600"));

  GltfBuilder shape = test::bending_post();
  shape.animations[0].replace(shape.animations[0].find("\"rotation\""), 10, "\"scale\"");
  EXPECT_THAT(refusal_of(shape), HasSubstr("accessor 6 has 3 rows of 4 numbers, must have 3 of 3"));

  GltfBuilder missing = test::bending_post();
  missing.animations[0].replace(missing.animations[0].find("\"sampler\":0"), 11, "\"sampler\":2");
  EXPECT_THAT(refusal_of(missing), HasSubstr("animation 0 channel 0 sampler is 2"));
}

TEST(ImportBadInputTest, ImagesThatAreMissingOrDamaged) {
  const auto with_image = [](const std::string& image, const std::vector<std::uint8_t>& bytes) {
    GltfBuilder b;
    const int uv = b.accessor(std::vector<float>(16, 0.0F), "VEC2");
    const std::string box =
        b.box({0, 0, 0}, {1, 1, 1}, ",\"TEXCOORD_0\":" + number(uv)) + ",\"material\":0";
    b.materials = {R"({"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}})"};
    b.textures = {R"({"source":0})"};
    b.images = {image.empty() ? "{\"bufferView\":" + number(b.view(bytes)) + "}" : image};
    return refusal_of(test::one_mesh(b, box));
  };
  EXPECT_THAT(with_image(R"({"uri":"not there.png"})", {}),
              AllOf(HasSubstr("mesh 0 primitive 0 material 0 image 0"),
                    HasSubstr("not there.png: no such file")));
  EXPECT_THAT(with_image(R"({"uri":"http://example.com/a.png"})", {}),
              HasSubstr("is not a file beside this one"));
  EXPECT_THAT(with_image("{}", {}), HasSubstr("neither a uri nor a bufferView"));
  EXPECT_THAT(with_image("", {1, 2, 3, 4}), HasSubstr("neither PNG nor JPEG"));
  std::vector<std::uint8_t> png = test::png(16, 16, {1, 2, 3, 255});
  png.resize(png.size() / 2);
  EXPECT_THAT(with_image("", png), HasSubstr("image 0 is damaged"));
  std::vector<std::uint8_t> huge = test::png(16, 16, {1, 2, 3, 255});
  huge[18] = huge[22] = 0xFF;  // width and height of some 65,000
  EXPECT_THAT(with_image("", huge), HasSubstr("the limit is 16384 a side"));
}

TEST(ImportBadInputTest, OptionsOutOfRange) {
  ImportOptions options;
  options.sample_rate_hz = 0.0F;
  EXPECT_THAT(message_of(import_gltf_bytes({}, "x.glb", options)),
              HasSubstr("sample_rate_hz is 0, must be in (0, 240]"));
  options = {};
  options.height_m = -1.0F;
  EXPECT_THAT(message_of(import_gltf_bytes({}, "x.glb", options)),
              HasSubstr("height_m is -1, must be in (0, 1000]"));
  options = {};
  options.turn_deg = std::nanf("");
  EXPECT_THAT(message_of(import_gltf_bytes({}, "x.glb", options)), HasSubstr("turn_deg"));
}

}  // namespace
}  // namespace throng::simplify
