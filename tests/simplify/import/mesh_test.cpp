#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"

#ifdef THRONG_WITH_MESHOPT
#include <meshoptimizer.h>
#endif

namespace throng::simplify {
namespace {

using test::GltfBuilder;
using testing::Contains;
using testing::HasSubstr;

SourceCharacter import_ok(const GltfBuilder& builder, const ImportOptions& options = {}) {
  const std::string path = test::scratch_path("mesh.glb");
  test::write_file(path, builder.glb());
  absl::StatusOr<SourceCharacter> character = import_gltf(path, options);
  EXPECT_TRUE(character.ok()) << character.status();
  if (!character.ok()) return {};
  EXPECT_EQ(test::fault_of(*character), "");
  return *std::move(character);
}

glm::vec3 corner(const SourceCharacter& c, const SourceTriangle& t, int k) {
  return c.points[t.corner[k].point].position;
}

glm::vec3 face_normal(const SourceCharacter& c, const SourceTriangle& t) {
  return glm::normalize(
      glm::cross(corner(c, t, 1) - corner(c, t, 0), corner(c, t, 2) - corner(c, t, 0)));
}

/// True when every triangle turns away from `inside` and its normals with it.
bool is_outward(const SourceCharacter& c, const glm::vec3& inside) {
  return std::all_of(c.triangles.begin(), c.triangles.end(), [&](const SourceTriangle& t) {
    const glm::vec3 face = face_normal(c, t);
    const bool normals = std::all_of(t.corner.begin(), t.corner.end(), [&](const SourceCorner& k) {
      return glm::dot(c.normals[k.normal], face) > 0.1F;
    });
    return normals && glm::dot(face, corner(c, t, 0) - inside) > 0.0F;
  });
}

glm::vec3 middle(const SourceCharacter& c) {
  const test::Extent extent = test::extent_of(c);
  return 0.5F * (extent.low + extent.high);
}

TEST(ImportMeshTest, YUpFacingZBecomesZUpFacingXOnTheGround) {
  GltfBuilder builder;
  const std::string box = builder.box({2, 1, 0}, {3, 3, 4});
  const SourceCharacter character = import_ok(test::one_mesh(builder, box));
  const test::Extent extent = test::extent_of(character);
  EXPECT_EQ(extent.size(), glm::vec3(4, 1, 2));  // forward, left, up
  EXPECT_NEAR(glm::length(extent.low - glm::vec3(-2, -0.5, 0)), 0.0F, 1e-6F);
  EXPECT_TRUE(is_outward(character, middle(character)));
}

TEST(ImportMeshTest, LeftStaysLeft) {
  GltfBuilder builder;
  // a big box in the middle and a small one to the left (+x in the file), higher up
  builder.meshes = {"{\"primitives\":[{" + builder.box({-1, 0, -1}, {1, 1, 1}) + "}]}",
                    "{\"primitives\":[{" + builder.box({0.8F, 1, 0.5F}, {1, 2, 0.6F}) + "}]}"};
  builder.nodes = {R"({"mesh":0})", R"({"mesh":1})"};
  const SourceCharacter character = import_ok(builder);
  for (const SourcePoint& point : character.points) {
    if (point.position.z < 1.5F) continue;
    EXPECT_GT(point.position.y, 0.7F);
    EXPECT_NEAR(point.position.x, 0.55F, 0.06F);
  }
}

TEST(ImportMeshTest, TurnsByTheOptionSeenFromAbove) {
  GltfBuilder builder;
  const std::string box = builder.box({-0.5F, 0, -2}, {0.5F, 1, 2});
  ImportOptions options;
  options.turn_deg = 90.0F;
  const test::Extent extent = test::extent_of(import_ok(test::one_mesh(builder, box), options));
  EXPECT_NEAR(extent.size().x, 1.0F, 1e-5F);
  EXPECT_NEAR(extent.size().y, 4.0F, 1e-5F);
}

TEST(ImportMeshTest, IndicesOfEveryWidthAndNoneGiveTheSameMesh) {
  const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0};
  const std::vector<float> unrolled = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0};
  std::vector<SourceCharacter> all;
  for (int width = 0; width < 4; ++width) {
    GltfBuilder b;
    const int position = b.accessor(width == 3 ? unrolled : positions, "VEC3");
    int index = -1;
    if (width == 0) index = b.accessor(std::vector<std::uint8_t>{0, 1, 2, 1, 3, 2}, "SCALAR");
    if (width == 1) index = b.accessor(std::vector<std::uint16_t>{0, 1, 2, 1, 3, 2}, "SCALAR");
    if (width == 2) index = b.accessor(std::vector<std::uint32_t>{0, 1, 2, 1, 3, 2}, "SCALAR");
    all.push_back(import_ok(
        test::one_mesh(b, "\"attributes\":{\"POSITION\":" + std::to_string(position) + "}" +
                              (index < 0 ? "" : ",\"indices\":" + std::to_string(index)))));
  }
  for (const SourceCharacter& character : all) {
    ASSERT_EQ(character.triangles.size(), 2U);
    EXPECT_EQ(character.points.size(), 4U);  // equal vertices are one point
    for (int k = 0; k < 3; ++k) {
      EXPECT_EQ(corner(character, character.triangles[1], k),
                corner(all[0], all[0].triangles[1], k));
    }
  }
}

TEST(ImportMeshTest, StripsAndFansKeepTheirWinding) {
  for (const int mode : {5, 6}) {
    GltfBuilder b;
    const std::vector<float> strip = {0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0, 1, 2, 0};
    const std::vector<float> fan = {0, 0, 0, 2, 0, 0, 2, 1, 0, 1, 2, 0, 0, 2, 0};
    const int position = b.accessor(mode == 5 ? strip : fan, "VEC3");
    const SourceCharacter character = import_ok(
        test::one_mesh(b, "\"mode\":" + std::to_string(mode) +
                              ",\"attributes\":{\"POSITION\":" + std::to_string(position) + "}"));
    ASSERT_EQ(character.triangles.size(), mode == 5 ? 4U : 3U);
    for (const SourceTriangle& triangle : character.triangles) {
      EXPECT_GT(face_normal(character, triangle).x, 0.9F);  // all face the viewer
    }
  }
}

TEST(ImportMeshTest, PointsAndLinesAreLeftOutWithANote) {
  GltfBuilder b;
  const std::string box = b.box({0, 0, 0}, {1, 1, 1});
  const int position = b.accessor(std::vector<float>{0, 0, 0, 5, 5, 5}, "VEC3");
  b.meshes = {"{\"primitives\":[{" + box +
              "},{\"mode\":1,\"attributes\":{\"POSITION\":" + std::to_string(position) + "}}]}"};
  b.nodes = {R"({"mesh":0})"};
  const SourceCharacter character = import_ok(b);
  EXPECT_EQ(character.triangles.size(), 12U);
  EXPECT_THAT(character.notes, Contains(HasSubstr("points or lines")));
}

TEST(ImportMeshTest, SparseAccessorReplacesRows) {
  GltfBuilder b;
  const std::string box = b.box({0, 0, 0}, {1, 1, 1});
  // accessor 0 holds the box; a sparse one on the same view lifts the four top corners
  const int index_view = b.view({2, 3, 6, 7});
  std::vector<std::uint8_t> values(48);
  const float lifted[12] = {0, 3, 0, 1, 3, 0, 0, 3, 1, 1, 3, 1};
  std::memcpy(values.data(), lifted, 48);
  const int value_view = b.view(values);
  const int sparse = b.raw_accessor(
      R"({"bufferView":0,"componentType":5126,"count":8,"type":"VEC3","sparse":{"count":4,"indices":{"bufferView":)" +
      std::to_string(index_view) + R"(,"componentType":5121},"values":{"bufferView":)" +
      std::to_string(value_view) + "}}}");
  std::string primitive = box;
  primitive.replace(primitive.find("\"POSITION\":0"), 12, "\"POSITION\":" + std::to_string(sparse));
  const SourceCharacter character = import_ok(test::one_mesh(b, primitive));
  EXPECT_FLOAT_EQ(test::extent_of(character).size().z, 3.0F);
}

TEST(ImportMeshTest, AccessorWithoutViewIsZerosUnderItsSparseRows) {
  GltfBuilder b;
  const int index_view = b.view({1, 2});
  std::vector<std::uint8_t> values(24);
  const float rows[6] = {1, 0, 0, 0, 2, 0};
  std::memcpy(values.data(), rows, 24);
  const int value_view = b.view(values);
  const int sparse = b.raw_accessor(
      R"({"componentType":5126,"count":3,"type":"VEC3","sparse":{"count":2,"indices":{"bufferView":)" +
      std::to_string(index_view) + R"(,"componentType":5121},"values":{"bufferView":)" +
      std::to_string(value_view) + "}}}");
  const SourceCharacter character =
      import_ok(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + std::to_string(sparse) + "}"));
  EXPECT_EQ(test::extent_of(character).size(), glm::vec3(0, 1, 2));
}

TEST(ImportMeshTest, InterleavedVerticesAreReadByStride) {
  GltfBuilder b;
  const float rows[3][6] = {{0, 0, 0, 0, 0, 1}, {1, 0, 0, 0, 0, 1}, {0, 1, 0, 0, 0, 1}};
  std::vector<std::uint8_t> bytes(sizeof rows);
  std::memcpy(bytes.data(), rows, sizeof rows);
  const int view = b.view(bytes, ",\"byteStride\":24");
  const std::string at = "{\"bufferView\":" + std::to_string(view) +
                         ",\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"";
  const int position = b.raw_accessor(at + "}");
  const int normal = b.raw_accessor(at + ",\"byteOffset\":12}");
  const SourceCharacter character =
      import_ok(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + std::to_string(position) +
                                      ",\"NORMAL\":" + std::to_string(normal) + "}"));
  EXPECT_EQ(character.normals.size(), 1U);
  EXPECT_EQ(character.normals[0], glm::vec3(1, 0, 0));
}

TEST(ImportMeshTest, MissingNormalsAreHardAtABoxEdgeAndSmoothOverAGentleFold) {
  GltfBuilder b;
  const SourceCharacter box = import_ok(test::one_mesh(b, b.box({0, 0, 0}, {1, 1, 1})));
  for (const SourceTriangle& triangle : box.triangles) {
    for (const SourceCorner& k : triangle.corner) {
      EXPECT_GT(glm::dot(box.normals[k.normal], face_normal(box, triangle)), 0.999F);
    }
  }
  EXPECT_THAT(box.notes, Contains(HasSubstr("lack normals")));

  GltfBuilder fold;  // two squares that meet at 30 degrees along z = 0
  const float s = 0.5F;
  const float c = std::sqrt(0.75F);
  const int position = fold.accessor(
      std::vector<float>{0, 0, 0, 0, 1, 0, 1, 0, 0, 1, 1, 0, -c, 0, s, -c, 1, s}, "VEC3");
  const int index =
      fold.accessor(std::vector<std::uint8_t>{0, 2, 1, 2, 3, 1, 4, 0, 1, 4, 1, 5}, "SCALAR");
  const SourceCharacter smooth =
      import_ok(test::one_mesh(fold, "\"attributes\":{\"POSITION\":" + std::to_string(position) +
                                         "},\"indices\":" + std::to_string(index)));
  // the four corners on the fold share a normal between the two faces
  std::set<std::uint32_t> shared;
  for (const SourceTriangle& triangle : smooth.triangles) {
    for (int k = 0; k < 3; ++k) {
      const glm::vec3 normal = smooth.normals[triangle.corner[k].normal];
      if (glm::dot(normal, face_normal(smooth, triangle)) < 0.99F)
        shared.insert(triangle.corner[k].normal);
    }
  }
  EXPECT_FALSE(shared.empty());
}

TEST(ImportMeshTest, BrokenNormalsAreComputed) {
  GltfBuilder b;
  std::vector<float> normals(24, 0.0F);
  normals[4] = std::nanf("");
  const int normal = b.accessor(normals, "VEC3");
  const SourceCharacter character = import_ok(
      test::one_mesh(b, b.box({0, 0, 0}, {1, 1, 1}, ",\"NORMAL\":" + std::to_string(normal))));
  EXPECT_TRUE(is_outward(character, middle(character)));
}

TEST(ImportMeshTest, NonUniformScaleKeepsNormalsPerpendicular) {
  GltfBuilder b;
  // a slanted square: its normal isn't scaled like its points
  const float n = std::sqrt(0.5F);
  const int position = b.accessor(std::vector<float>{0, 0, 0, 1, 0, 0, 1, 1, -1, 0, 1, -1}, "VEC3");
  const int normal = b.accessor(std::vector<float>{0, n, n, 0, n, n, 0, n, n, 0, n, n}, "VEC3");
  const int index = b.accessor(std::vector<std::uint8_t>{0, 1, 2, 0, 2, 3}, "SCALAR");
  b.nodes = {R"({"mesh":0,"scale":[1,3,0.5]})"};
  const SourceCharacter character = import_ok(test::one_mesh(
      b, "\"attributes\":{\"POSITION\":" + std::to_string(position) +
             ",\"NORMAL\":" + std::to_string(normal) + "},\"indices\":" + std::to_string(index)));
  for (const SourceTriangle& triangle : character.triangles) {
    for (const SourceCorner& k : triangle.corner) {
      EXPECT_GT(glm::dot(character.normals[k.normal], face_normal(character, triangle)), 0.9999F);
    }
  }
}

TEST(ImportMeshTest, MirroringNodeTurnsTrianglesAround) {
  GltfBuilder b;
  b.nodes = {R"({"mesh":0,"scale":[-1,1,1]})"};
  const SourceCharacter character = import_ok(test::one_mesh(b, b.box({0, 0, 0}, {1, 2, 1})));
  EXPECT_TRUE(is_outward(character, middle(character)));
}

TEST(ImportMeshTest, SharedEdgesOfManyTrianglesPassThrough) {
  GltfBuilder b;
  const int position =
      b.accessor(std::vector<float>{0, 0, 0, 0, 1, 0, 1, 0, 0, -1, 0, 0, 0, 0, 1}, "VEC3");
  const int index =
      b.accessor(std::vector<std::uint8_t>{0, 1, 2, 0, 1, 3, 0, 1, 4, 0, 1, 1}, "SCALAR");
  const SourceCharacter character =
      import_ok(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + std::to_string(position) +
                                      "},\"indices\":" + std::to_string(index)));
  EXPECT_EQ(character.triangles.size(), 3U);
  EXPECT_THAT(character.notes, Contains(HasSubstr("repeated corner")));
}

TEST(ImportMeshTest, MorphTargetsAreIgnoredWithANote) {
  GltfBuilder b;
  const std::string box = b.box({0, 0, 0}, {1, 1, 1});
  const SourceCharacter character =
      import_ok(test::one_mesh(b, box + ",\"targets\":[{\"POSITION\":0}]"));
  EXPECT_THAT(character.notes, Contains(HasSubstr("morph targets")));
  EXPECT_FLOAT_EQ(test::extent_of(character).size().z, 1.0F);
}

TEST(ImportMeshTest, QuantizedPositionsAreDequantizedByTheNode) {
  GltfBuilder b;
  const int position =
      b.accessor(std::vector<std::int16_t>{0, 0, 0, 1000, 0, 0, 0, 2000, 0}, "VEC3");
  const int normal =
      b.accessor(std::vector<std::int8_t>{0, 0, 127, 0, 0, 127, 0, 0, 127}, "VEC3", true);
  b.nodes = {R"({"mesh":0,"scale":[0.001,0.001,0.001]})"};
  b.extra = R"(,"extensionsRequired":["KHR_mesh_quantization"])";
  const SourceCharacter character =
      import_ok(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + std::to_string(position) +
                                      ",\"NORMAL\":" + std::to_string(normal) + "}"));
  EXPECT_NEAR(test::extent_of(character).size().z, 2.0F, 1e-5F);
  EXPECT_NEAR(test::extent_of(character).size().y, 1.0F, 1e-5F);
}

TEST(ImportMeshTest, HeightOptionScalesAndOddHeightsAreTold) {
  GltfBuilder b;
  const std::string box = b.box({0, 0, 0}, {100, 180, 50});
  const GltfBuilder whole = test::one_mesh(b, box);
  const SourceCharacter plain = import_ok(whole);
  EXPECT_THAT(plain.notes, Contains(HasSubstr("180 m tall; for a person pass --height 1.75")));
  ImportOptions options;
  options.height_m = 1.75F;
  const SourceCharacter scaled = import_ok(whole, options);
  EXPECT_NEAR(test::extent_of(scaled).size().z, 1.75F, 1e-5F);
  EXPECT_THAT(scaled.notes, testing::Not(Contains(HasSubstr("--height"))));
}

TEST(ImportMeshTest, OnlyTheShownSceneIsUsed) {
  GltfBuilder b;
  b.meshes = {"{\"primitives\":[{" + b.box({0, 0, 0}, {1, 1, 1}) + "}]}",
              "{\"primitives\":[{" + b.box({0, 0, 0}, {1, 9, 1}) + "}]}"};
  b.nodes = {R"({"mesh":0})", R"({"mesh":1})"};
  b.extra = R"(,"scene":0,"scenes":[{"nodes":[0]},{"nodes":[1]}])";
  EXPECT_FLOAT_EQ(test::extent_of(import_ok(b)).size().z, 1.0F);
}

TEST(ImportMeshTest, BuffersMayBeAFileBesideOrBase64) {
  GltfBuilder b;
  const std::string box = b.box({0, 0, 0}, {1, 2, 1});
  const GltfBuilder whole = test::one_mesh(b, box);
  test::write_file(test::scratch_path("my buffer.bin"), whole.bytes());
  const auto import_json = [](const std::string& json) {
    const std::string path = test::scratch_path("beside.gltf");
    test::write_file(path, {json.begin(), json.end()});
    return import_gltf(path);
  };
  const auto beside = import_json(whole.json("my%20buffer.bin"));
  ASSERT_TRUE(beside.ok()) << beside.status();
  EXPECT_FLOAT_EQ(test::extent_of(*beside).size().z, 2.0F);

  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text = "data:application/octet-stream;base64,";
  std::vector<std::uint8_t> bytes = whole.bytes();
  while (bytes.size() % 3 != 0) bytes.push_back(0);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::uint32_t three =
        std::uint32_t{bytes[i]} << 16 | std::uint32_t{bytes[i + 1]} << 8 | bytes[i + 2];
    for (int k = 3; k >= 0; --k) text += kDigits[three >> (6 * k) & 63];
  }
  const auto inside = import_json(whole.json(text));
  ASSERT_TRUE(inside.ok()) << inside.status();
  EXPECT_FLOAT_EQ(test::extent_of(*inside).size().z, 2.0F);
}

#ifdef THRONG_WITH_MESHOPT
TEST(ImportMeshTest, MeshoptViewsAreDecoded) {
  const std::vector<float> positions = {0, 0, 0, 0, 1, 0, 0, 0, 0, 2, 0, 0};  // padded to 16 bytes
  std::vector<std::uint8_t> packed(meshopt_encodeVertexBufferBound(3, 16));
  packed.resize(meshopt_encodeVertexBuffer(packed.data(), packed.size(), positions.data(), 3, 16));
  const std::vector<unsigned int> indices = {0, 1, 2};
  std::vector<std::uint8_t> packed_indices(meshopt_encodeIndexBufferBound(3, 3));
  packed_indices.resize(
      meshopt_encodeIndexBuffer(packed_indices.data(), packed_indices.size(), indices.data(), 3));

  GltfBuilder b;
  b.view(packed);  // view 0 and 1 only carry the bytes
  b.view(packed_indices);
  const std::size_t second = (packed.size() + 3) / 4 * 4;
  const auto describe = [&](std::size_t offset, std::size_t length, int count, int stride,
                            const char* mode) {
    return "{\"buffer\":0,\"byteLength\":" + std::to_string(count * stride) +
           ",\"byteStride\":" + std::to_string(stride) +
           ",\"extensions\":{\"EXT_meshopt_compression\":{\"buffer\":0,\"byteOffset\":" +
           std::to_string(offset) + ",\"byteLength\":" + std::to_string(length) +
           ",\"byteStride\":" + std::to_string(stride) + ",\"count\":" + std::to_string(count) +
           ",\"mode\":\"" + mode + "\"}}}";
  };
  const int vertex_view = b.raw_view(describe(0, packed.size(), 3, 16, "ATTRIBUTES"));
  const int index_view = b.raw_view(describe(second, packed_indices.size(), 3, 2, "TRIANGLES"));
  const int position = b.raw_accessor("{\"bufferView\":" + std::to_string(vertex_view) +
                                      ",\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}");
  const int index = b.raw_accessor("{\"bufferView\":" + std::to_string(index_view) +
                                   ",\"componentType\":5123,\"count\":3,\"type\":\"SCALAR\"}");
  b.extra = R"(,"extensionsRequired":["EXT_meshopt_compression"])";
  const SourceCharacter character =
      import_ok(test::one_mesh(b, "\"attributes\":{\"POSITION\":" + std::to_string(position) +
                                      "},\"indices\":" + std::to_string(index)));
  EXPECT_EQ(test::extent_of(character).size(), glm::vec3(0, 1, 2));
}
#endif

}  // namespace
}  // namespace throng::simplify
