#include <gmock/gmock.h>
#include <gtest/gtest.h>

#ifdef THRONG_WITH_DRACO
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wall"
#pragma GCC diagnostic ignored "-Wextra"
#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#pragma GCC diagnostic pop
#endif

#include "simplify/import/gltf.hpp"
#include "simplify/import/made_up.hpp"

namespace throng::simplify {
namespace {

using ::testing::HasSubstr;

/// One triangle whose Draco data are `packed`, with the attribute of this number for positions.
test::GltfBuilder compressed_triangle(const std::vector<std::uint8_t>& packed, int attribute) {
  test::GltfBuilder b;
  const int view = b.view(packed);
  const int position = b.raw_accessor(
      R"({"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[0,1,2]})");
  const int index = b.raw_accessor(R"({"componentType":5123,"count":3,"type":"SCALAR"})");
  b.extra = R"(,"extensionsRequired":["KHR_draco_mesh_compression"])"
            R"(,"extensionsUsed":["KHR_draco_mesh_compression"])";
  return test::one_mesh(b, "\"attributes\":{\"POSITION\":" + std::to_string(position) +
                               "},\"indices\":" + std::to_string(index) +
                               ",\"extensions\":{\"KHR_draco_mesh_compression\":{\"bufferView\":" +
                               std::to_string(view) + ",\"attributes\":{\"POSITION\":" +
                               std::to_string(attribute) + "}}}");
}

#ifdef THRONG_WITH_DRACO

TEST(ImportDracoTest, TriangleIsDecoded) {
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(1);
  const int attribute =
      builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const float corner[3][3] = {{0, 0, 0}, {0, 1, 0}, {0, 0, 2}};
  builder.SetAttributeValuesForFace(attribute, draco::FaceIndex(0), corner[0], corner[1],
                                    corner[2]);
  const std::unique_ptr<draco::Mesh> mesh = builder.Finalize();
  draco::Encoder encoder;
  draco::EncoderBuffer buffer;
  ASSERT_TRUE(encoder.EncodeMeshToBuffer(*mesh, &buffer).ok());
  std::vector<std::uint8_t> packed(buffer.data(), buffer.data() + buffer.size());
  const int id = static_cast<int>(mesh->attribute(attribute)->unique_id());

  const auto character = import_gltf_bytes(compressed_triangle(packed, id).glb(), "draco.glb");
  ASSERT_TRUE(character.ok()) << character.status();
  EXPECT_EQ(test::extent_of(*character).size(), glm::vec3(2, 0, 1));  // z is forward in glTF

  const auto other = import_gltf_bytes(compressed_triangle(packed, 7).glb(), "draco.glb");
  ASSERT_FALSE(other.ok());
  EXPECT_THAT(other.status().message(), HasSubstr("attribute 7"));
  packed.resize(packed.size() / 2);
  const auto cut = import_gltf_bytes(compressed_triangle(packed, id).glb(), "draco.glb");
  ASSERT_FALSE(cut.ok());
  EXPECT_THAT(cut.status().message(), HasSubstr("draco.glb"));
}

#else

TEST(ImportDracoTest, MissingLibraryIsTold) {
  const auto character = import_gltf_bytes(compressed_triangle({1, 2, 3}, 0).glb(), "draco.glb");
  ASSERT_FALSE(character.ok());
  EXPECT_THAT(character.status().message(), HasSubstr("KHR_draco_mesh_compression"));
}

#endif

}  // namespace
}  // namespace throng::simplify
