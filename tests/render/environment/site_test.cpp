#include <absl/strings/escaping.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <random>

#include "support/data_dir.hpp"
#include "support/temporary_folder.hpp"
#include "throng/render/encode.hpp"
#include "throng/render/environment.hpp"

namespace throng::render {
namespace {

using testing::HasSubstr;

/// Area of the walls' tops, by which sites are told apart.
double top_m2(const std::string& text) {
  const auto wkt = walkable_area_of(text);
  EXPECT_TRUE(wkt.ok()) << wkt.status();
  if (!wkt.ok()) return -1.0;
  const auto environment = make_environment(*wkt, {}, {.wall_thickness_m = 1.0});
  EXPECT_TRUE(environment.ok()) << environment.status();
  if (!environment.ok()) return -1.0;
  double area = 0.0;
  for (const Character& piece : (*environment)->pieces) {
    for (const glm::uvec3& t : piece.triangle) {
      const glm::vec3 cross = glm::cross(piece.position[t.y] - piece.position[t.x],
                                         piece.position[t.z] - piece.position[t.x]);
      if (cross.z > 1e-6F) area += 0.5 * static_cast<double>(cross.z);
    }
  }
  return area;
}

// 20 x 10 m with two overlapping obstacles of 4 m2 that share 2 m2.
constexpr double kRoomTop = 22.0 * 12.0 - 200.0 + 6.0;

constexpr char kGeoJson[] = R"({"type": "FeatureCollection", "features": [
  {"type": "Feature", "properties": {"name": "hall"}, "geometry": {"type": "Polygon",
   "coordinates": [[[0, 0], [20, 0], [20, 10], [0, 10], [0, 0]]]}},
  {"type": "Feature", "properties": {"type": "Obstacle"}, "geometry": {"type": "MultiPolygon",
   "coordinates": [[[[5, 5], [7, 5], [7, 7], [5, 7], [5, 5]]]]}},
  {"type": "Feature", "properties": {"obstacle": true}, "geometry": {"type": "GeometryCollection",
   "geometries": [{"type": "Polygon", "coordinates": [[[6, 5], [8, 5], [8, 7], [6, 7], [6, 5]]]},
                  {"type": "Point", "coordinates": [1, 1]}]}},
  {"type": "Feature", "properties": {"obstacle": false}, "geometry": null}]})";

constexpr char kScenario[] = R"({"name": "x", "scenario": {"topography": {
  "attributes": {"bounds": {"x": -0.5, "y": -0.5, "width": 21.0, "height": 11.0},
                 "boundingBoxWidth": 0.5, "bounded": true},
  "obstacles": [
    {"id": 1, "shape": {"type": "RECTANGLE", "x": 5, "y": 5, "width": 2, "height": 2}},
    {"id": 2, "shape": {"type": "POLYGON", "points": [{"x": 6, "y": 5}, {"x": 8, "y": 5},
                                                      {"x": 8, "y": 7}, {"x": 6, "y": 7}]}}]}}})";

TEST(SiteTest, WktIsLeftAlone) {
  EXPECT_EQ(*walkable_area_of("POLYGON ((0 0, 1 0, 1 1, 0 0))"), "POLYGON ((0 0, 1 0, 1 1, 0 0))");
  EXPECT_EQ(*walkable_area_of(""), "");
}

TEST(SiteTest, GeoJsonHasFloorsAndObstacles) { EXPECT_NEAR(top_m2(kGeoJson), kRoomTop, 1e-2); }

TEST(SiteTest, VadereScenarioHasBoundsFrameAndObstacles) {
  EXPECT_NEAR(top_m2(kScenario), kRoomTop, 1e-2);
}

TEST(SiteTest, ScenarioOfVadereItselfHasItsBottleneck) {
  const std::string folder = throng::test::data_dir();
  std::ifstream file(folder + "/trajectories/vadere_bottleneck.scenario", std::ios::binary);
  if (folder.empty() || !file) GTEST_SKIP() << "no vadere_bottleneck.scenario";
  const std::string text(std::istreambuf_iterator<char>(file), {});
  // 8 x 10 m with a frame of 0.5 m; two obstacles of 1.75 m2 at its sides leave 1 m between them.
  EXPECT_NEAR(top_m2(text), 9.0 * 11.0 - 7.0 * 9.0 + 3.5, 1e-2);
}

TEST(SiteTest, VadereCircleIsRound) {
  std::string text = kScenario;
  const std::size_t at = text.find(R"("RECTANGLE", "x": 5, "y": 5, "width": 2, "height": 2)");
  text.replace(at, 52, R"("CIRCLE", "center": {"x": 12, "y": 5}, "radius": 2)");
  EXPECT_NEAR(top_m2(text), 22.0 * 12.0 - 200.0 + 4.0 + 12.57, 0.1);
}

TEST(SiteTest, BadFilesAreRefusedByName) {
  const std::pair<const char*, const char*> cases[] = {
      {"{", "is none"},
      {"{}", "neither"},
      {R"({"type": 3})", "no type"},
      {R"({"type": "FeatureCollection"})", "features"},
      {R"({"type": "Polygon"})", "coordinates"},
      {R"({"type": "Polygon", "coordinates": [[[0, 0], [1, 0]]]})", "3 points"},
      {R"({"type": "Polygon", "coordinates": [[[0, 0], [1, "a"], [1, 1]]]})", "two numbers"},
      {R"({"type": "Polygon", "coordinates": 7})", "no list"},
      {R"({"type": "Point", "coordinates": [1, 2]})", "walkable"},
      {R"({"type": "Feature", "properties": {"building": "yes"}, "geometry": {"type": "Polygon",
           "coordinates": [[[0, 0], [1, 0], [1, 1]]]}})",
       "walkable"},
      {R"({"type": "FeatureCollection", "features": [],
           "crs": {"type": "name", "properties": {"name": "urn:ogc:def:crs:OGC:1.3:CRS84"}}})",
       "degrees"},
      {R"({"topography": {}})", "bounds"},
      {R"({"topography": {"attributes": {"bounds": {"x": 0}}}})", "lack"},
      {R"({"topography": {"attributes": {"boundingBoxWidth": 3,
           "bounds": {"x": 0, "y": 0, "width": 5, "height": 50}}}})",
       "nothing"},
      {R"({"topography": {"attributes": {"bounds": {"x": 0, "y": 0, "width": 5, "height": 5}},
           "obstacles": [{"shape": {"type": "BLOB"}}]}})",
       "BLOB"},
  };
  for (const auto& [text, words] : cases) {
    const auto area = walkable_area_of(text);
    ASSERT_FALSE(area.ok()) << text;
    EXPECT_EQ(area.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(area.status().message()), HasSubstr(words)) << text;
  }
}

TEST(SiteTest, DeepNestingIsRefused) {
  std::string text = R"({"type": "Polygon", "coordinates": []})";
  for (int i = 0; i < 2000; ++i) {
    text = R"({"type": "GeometryCollection", "geometries": [)" + text + "]}";
  }
  EXPECT_THAT(std::string(walkable_area_of(text).status().message()), HasSubstr("nested"));
}

TEST(SiteTest, CutTextsAreSurvived) {
  for (const std::string& text : {std::string(kGeoJson), std::string(kScenario)}) {
    for (std::size_t size = 0; size < text.size(); ++size) {
      EXPECT_FALSE(size > 0 && walkable_area_of(text.substr(0, size)).ok());
    }
  }
}

/// A red square of 20 x 20 m, a metre above the ground.
std::string gltf(const std::string& positions = "0", const std::string& more = "") {
  // corners (0 0 0) (40 0 0) (40 0 -40) (0 0 -40), indices 0 1 2 0 2 3 as bytes
  const float corners[] = {0, 0, 0, 40, 0, 0, 40, 0, -40, 0, 0, -40};
  const unsigned char indices[] = {0, 1, 2, 0, 2, 3};
  std::string bytes(reinterpret_cast<const char*>(corners), sizeof corners);
  bytes.append(reinterpret_cast<const char*>(indices), sizeof indices);
  std::string base64;
  absl::Base64Escape(bytes, &base64);
  return R"({"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}],
    "nodes": [{"children": [1], "translation": [0, 1, 0]}, {"mesh": 0, "scale": [0.5, 1, 0.5]}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": )" +
         positions + R"(}, "indices": 1, "material": 0}]}],
    "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                  {"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"}],
    "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 6}],
    "buffers": [{"byteLength": 54, "uri": "data:application/octet-stream;base64,)" +
         base64 + "\"}]" + more + "}";
}

absl::StatusOr<std::shared_ptr<const Environment>> read(const std::string& name,
                                                        const std::string& text) {
  const test::TemporaryFolder folder;
  std::ofstream(folder.file(name), std::ios::binary) << text;
  return read_environment(folder.file(name), {100.0, 0.0, 0.0});
}

TEST(SiteTest, StaticGltfStandsWhereItsNodesSay) {
  const auto site = read("hall.gltf", gltf());
  ASSERT_TRUE(site.ok()) << site.status();
  double area_m2 = 0.0;
  for (const Character& piece : (*site)->pieces) {
    EXPECT_LT(piece.bounds.w, 20.0F);
    EXPECT_EQ(piece.base_color.texels[0], 255) << "red";
    EXPECT_EQ(piece.base_color.texels[1], 0);
    for (const glm::uvec3& t : piece.triangle) {
      const glm::vec3 &a = piece.position[t.x], &b = piece.position[t.y], &c = piece.position[t.z];
      EXPECT_NEAR(a.z, 1.01F, 1e-5F);
      EXPECT_GE(a.x, -100.0F);
      EXPECT_LE(a.x, -80.0F);
      EXPECT_GE(a.y, 0.0F);
      EXPECT_LE(a.y, 20.0F);
      area_m2 += 0.5 * static_cast<double>(glm::cross(b - a, c - a).z);
    }
  }
  EXPECT_NEAR(area_m2, 400.0, 1e-3);
}

/// A square of 4 x 4 m with a texture, red on the left and green on the right, and a skin: its far
/// corners hang on a joint that stands 2 m above where it was bound.
std::string textured_gltf(const std::string& image) {
  const float corners[] = {0, 0, 0, 4, 0, 0, 4, 0, -4, 0, 0, -4};
  const float uvs[] = {0, 1, 1, 1, 1, 0, 0, 0};
  const unsigned char joints[] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  const unsigned char weights[] = {255, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0};
  const unsigned char indices[] = {0, 1, 2, 0, 2, 3};
  std::string bytes;
  const auto add = [&](const auto& part) {
    bytes.append(reinterpret_cast<const char*>(&part), sizeof part);
  };
  add(corners), add(uvs), add(joints), add(weights), add(indices);
  std::string base64, image64;
  absl::Base64Escape(bytes, &base64);
  absl::Base64Escape(image, &image64);
  return R"({"asset": {"version": "2.0"}, "scenes": [{"nodes": [0, 1, 2]}],
    "nodes": [{"mesh": 0, "skin": 0, "translation": [70, 70, 70]}, {}, {"translation": [0, 2, 0]}],
    "skins": [{"joints": [1, 2]}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "JOINTS_0": 2,
                                               "WEIGHTS_0": 3}, "indices": 4, "material": 0}]}],
    "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
    "textures": [{"source": 0}], "images": [{"uri": "data:image/png;base64,)" +
         image64 + R"("}],
    "accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
                  {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
                  {"bufferView": 2, "componentType": 5121, "count": 4, "type": "VEC4"},
                  {"bufferView": 3, "componentType": 5121, "count": 4, "type": "VEC4",
                   "normalized": true},
                  {"bufferView": 4, "componentType": 5121, "count": 6, "type": "SCALAR"}],
    "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48},
                    {"buffer": 0, "byteOffset": 80}, {"buffer": 0, "byteOffset": 96},
                    {"buffer": 0, "byteOffset": 112}],
    "buffers": [{"byteLength": 118, "uri": "data:application/octet-stream;base64,)" +
         base64 + "\"}]}";
}

TEST(SiteTest, GltfShowsItsTexturesAndStandsAtRestInItsSkin) {
  const std::uint8_t pixels[] = {255, 0, 0, 0, 0, 255, 0, 0};
  const auto png = encode_png(pixels, 2, 1);
  ASSERT_TRUE(png.ok());
  const auto site = read("hall.gltf", textured_gltf({png->begin(), png->end()}));
  ASSERT_TRUE(site.ok()) << site.status();
  double red_m2 = 0.0, green_m2 = 0.0;
  for (const Character& piece : (*site)->pieces) {
    const std::size_t width = piece.base_color.width_px;
    for (const glm::uvec3& t : piece.triangle) {
      const glm::vec3 &a = piece.position[t.x], &b = piece.position[t.y], &c = piece.position[t.z];
      for (const glm::vec3& p : {a, b, c}) {
        EXPECT_NEAR(p.z, 0.01F + 0.5F * p.y, 1e-4F) << "a ramp of 2 m";
        EXPECT_LE(p.y, 4.001F);
      }
      const std::size_t texel = 4 * (std::size_t{piece.uv[t.x].x} * width / 65536);
      const double area_m2 = 0.5 * static_cast<double>(glm::cross(b - a, c - a).z);
      if (piece.base_color.texels[texel] > 200) red_m2 += area_m2;
      if (piece.base_color.texels[texel + 1] > 200) green_m2 += area_m2;
      EXPECT_EQ(piece.base_color.texels[texel + 2], 0);
    }
  }
  EXPECT_NEAR(red_m2, 8.0, 1.5);
  EXPECT_NEAR(green_m2, 8.0, 1.5);

  // A texture that can't be read leaves the material's own colour.
  const auto plain = read("hall.gltf", textured_gltf("no picture"));
  ASSERT_TRUE(plain.ok()) << plain.status();
  EXPECT_EQ((*plain)->pieces[0].base_color.texels[0], 255);
  EXPECT_EQ((*plain)->pieces[0].base_color.texels[2], 255);

  std::string joint = textured_gltf("");
  joint.replace(joint.find("[1, 2]"), 6, "[1]");
  EXPECT_THAT(std::string(read("bad.gltf", joint).status().message()), HasSubstr("joint 1 of 1"));
}

TEST(SiteTest, BinaryGltfIsReadToo) {
  std::string text = gltf();
  while (text.size() % 4 != 0) text += ' ';
  std::string bytes = "glTF";
  for (const std::uint32_t word : {2U, static_cast<std::uint32_t>(20 + text.size()),
                                   static_cast<std::uint32_t>(text.size()), 0x4E4F534AU}) {
    bytes.append(reinterpret_cast<const char*>(&word), 4);
  }
  const auto site = read("hall.glb", bytes + text);
  ASSERT_TRUE(site.ok()) << site.status();
  EXPECT_GT((*site)->triangles, 1U);
}

TEST(SiteTest, BadGltfIsRefusedByName) {
  std::string far = gltf();
  far.replace(far.find("[0, 1, 0]"), 9, "[0, 1e9, 0]");
  std::string outside = gltf();
  outside.replace(outside.find("\"count\": 4"), 10, "\"count\": 5");
  std::string huge = gltf();
  huge.replace(huge.find("\"count\": 4"), 10, "\"count\": 18446744073709551615");
  std::string loop = gltf();
  loop.replace(loop.find("[1]"), 3, "[0]");
  const std::pair<std::string, const char*> cases[] = {
      {"{", "JSON"},
      {"{}", "no scene"},
      {gltf("9"), "accessor"},
      {gltf("1"), "POSITION"},
      {gltf("0", R"(, "extensionsRequired": ["KHR_draco_mesh_compression"])"), "draco"},
      {far, "1e7"},
      {outside, "does not fit"},
      {huge, "does not fit"},
      {loop, "nested"},
  };
  for (const auto& [text, words] : cases) {
    const auto site = read("bad.gltf", text);
    ASSERT_FALSE(site.ok()) << text;
    EXPECT_THAT(std::string(site.status().message()), HasSubstr("bad.gltf")) << text;
    EXPECT_THAT(std::string(site.status().message()), HasSubstr(words)) << text;
  }
  EXPECT_EQ(read_environment("/no/such/file.glb", {}).status().code(), absl::StatusCode::kNotFound);
}

TEST(SiteTest, DamagedGltfIsSurvived) {
  const std::string good = gltf();
  std::mt19937 random(5);
  for (int i = 0; i < 120; ++i) {
    std::string text = good;
    for (int k = 0; k < 3; ++k) text[random() % text.size()] = "0123456789[]{},\"-e"[random() % 18];
    (void)read("damaged.gltf", text);
  }
}

}  // namespace
}  // namespace throng::render
