#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <set>

#include "simplify/rebuild/surface.hpp"
#include "support/source_shapes.hpp"

namespace throng::simplify {
namespace {

using ::testing::HasSubstr;

bool has_note(const Surface& surface, const std::string& text) {
  for (const std::string& note : surface.notes) {
    if (note.find(text) != std::string::npos) return true;
  }
  return false;
}

/// Algorithm 1 of Dong & Peng 2019, as it is printed.
struct Rebuilt {
  std::vector<glm::vec3> vertices, normals;
  std::vector<glm::uvec3> triangles;
};
Rebuilt algorithm_1(const SourceCharacter& source) {
  Rebuilt rebuilt;
  rebuilt.vertices.resize(source.uvs.size());
  rebuilt.normals.resize(source.uvs.size());
  std::vector<bool> checked(source.uvs.size(), false);
  for (const SourceTriangle& triangle : source.triangles) {
    glm::uvec3 corners;
    for (int j = 0; j < 3; ++j) {
      const std::uint32_t uv = triangle.corner[j].uv;
      if (!checked[uv]) {
        checked[uv] = true;
        rebuilt.vertices[uv] = source.points[triangle.corner[j].point].position;
        rebuilt.normals[uv] = source.normals[triangle.corner[j].normal];
      }
      corners[j] = uv;
    }
    rebuilt.triangles.push_back(corners);
  }
  return rebuilt;
}

TEST(RebuildTest, EqualsAlgorithm1ForAOneToOneUvMap) {
  const SourceCharacter cube = test::make_cube();
  ASSERT_EQ(cube.uvs.size(), 14U);
  const auto surface = rebuild(cube);
  ASSERT_TRUE(surface.ok()) << surface.status();
  const Rebuilt expected = algorithm_1(cube);
  EXPECT_EQ(surface->point_count(), 8U);
  ASSERT_EQ(surface->wedge_count(), 14U);
  ASSERT_EQ(surface->triangles.size(), expected.triangles.size());
  // the same triangles in the same order, up to the numbering of vertices
  std::map<std::uint32_t, std::uint32_t> wedge_of_uv;
  for (std::size_t t = 0; t < expected.triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t wedge = surface->triangles[t][i], uv = expected.triangles[t][i];
      EXPECT_EQ(wedge_of_uv.emplace(uv, wedge).first->second, wedge);
      EXPECT_EQ(surface->points[surface->wedge_point[wedge]].position, expected.vertices[uv]);
      EXPECT_LT(glm::length(surface->wedge_normal[wedge] - expected.normals[uv]), 1.0e-5F);
      EXPECT_LT(glm::length(surface->wedge_uv[wedge] - cube.uvs[uv]), 1.0e-6F);
    }
  }
  EXPECT_EQ(wedge_of_uv.size(), 14U);
}

TEST(RebuildTest, MirroredUvsDoNotMergePlaces) {
  // both halves use the same texels: algorithm 1 would make one vertex of two
  SourceCharacter sheet = test::make_cut_sheet(4);
  for (glm::vec2& uv : sheet.uvs) uv = glm::vec2(std::fabs(uv.x - 0.2F), uv.y);
  for (SourceTriangle& triangle : sheet.triangles) {
    for (SourceCorner& corner : triangle.corner) corner.uv = corner.uv / 2 * 2;
  }
  const auto surface = rebuild(sheet);
  ASSERT_TRUE(surface.ok());
  EXPECT_EQ(surface->point_count(), 25U);
  EXPECT_EQ(surface->wedge_count(), 25U);
}

TEST(RebuildTest, HardCreaseMakesOneWedgeForEachSide) {
  SourceCharacter cube = test::make_cube();
  cube.uvs.assign(1, glm::vec2(0.5F));
  for (SourceTriangle& triangle : cube.triangles) {
    const glm::vec3 a = cube.points[triangle.corner[0].point].position,
                    b = cube.points[triangle.corner[1].point].position,
                    c = cube.points[triangle.corner[2].point].position;
    for (SourceCorner& corner : triangle.corner) {
      corner.uv = 0;
      corner.normal = static_cast<std::uint32_t>(cube.normals.size());
    }
    cube.normals.push_back(glm::normalize(glm::cross(b - a, c - a)));
  }
  const auto hard = rebuild(cube);
  ASSERT_TRUE(hard.ok());
  EXPECT_EQ(hard->point_count(), 8U);
  EXPECT_EQ(hard->wedge_count(), 24U);
  RebuildOptions soft;
  soft.crease_angle_rad = 3.2F;
  EXPECT_EQ(rebuild(cube, soft)->wedge_count(), 8U);
}

TEST(RebuildTest, PointsOfASeamAreWelded) {
  SourceCharacter tube = test::make_tube();
  // as exporters write it: a point of its own for each corner
  SourceCharacter split = tube;
  split.points.clear();
  for (SourceTriangle& triangle : split.triangles) {
    for (SourceCorner& corner : triangle.corner) {
      split.points.push_back(tube.points[corner.point]);
      corner.point = static_cast<std::uint32_t>(split.points.size() - 1);
    }
  }
  const auto whole = rebuild(tube), welded = rebuild(split);
  ASSERT_TRUE(whole.ok() && welded.ok());
  EXPECT_EQ(welded->point_count(), tube.points.size());
  EXPECT_EQ(welded->wedge_count(), whole->wedge_count());
}

TEST(RebuildTest, PointsThatMoveApartAreNotWelded) {
  SourceCharacter cube = test::make_cube();
  cube.joints.push_back({"other", 0, glm::mat4(1.0F)});
  SourceCharacter second = test::make_cube();
  const auto offset = static_cast<std::uint32_t>(cube.points.size());
  for (SourcePoint point : second.points) {
    point.position.x += 1.0F;  // the cubes touch with a side
    point.joint = glm::u16vec4(1, 0, 0, 0);
    cube.points.push_back(point);
  }
  for (SourceTriangle triangle : second.triangles) {
    for (SourceCorner& corner : triangle.corner) corner.point += offset;
    cube.triangles.push_back(triangle);
  }
  EXPECT_EQ(rebuild(cube)->point_count(), 16U);
}

TEST(RebuildTest, DegenerateAndRepeatedTrianglesAreLeftOutWithANote) {
  SourceCharacter cube = test::make_cube();
  cube.triangles.push_back(cube.triangles[0]);
  cube.triangles.push_back(cube.triangles[1]);
  cube.triangles.back().corner[1] = cube.triangles.back().corner[0];
  const auto surface = rebuild(cube);
  ASSERT_TRUE(surface.ok());
  EXPECT_EQ(surface->triangles.size(), 12U);
  EXPECT_TRUE(has_note(*surface, "1 triangles without an area"));
  EXPECT_TRUE(has_note(*surface, "1 triangles that appear twice"));
}

TEST(RebuildTest, EveryPointAndWedgeIsUsed) {
  SourceCharacter cube = test::make_cube();
  cube.points.push_back({{9, 9, 9}, glm::u16vec4(0), {1, 0, 0, 0}});
  const auto surface = rebuild(cube);
  ASSERT_TRUE(surface.ok());
  std::set<std::uint32_t> wedges, points;
  for (const glm::uvec3& triangle : surface->triangles) {
    for (int i = 0; i < 3; ++i) wedges.insert(triangle[i]);
  }
  for (const std::uint32_t wedge : wedges) points.insert(surface->wedge_point[wedge]);
  EXPECT_EQ(wedges.size(), surface->wedge_count());
  EXPECT_EQ(points.size(), surface->point_count());
}

TEST(RebuildTest, FlagsFollowTheMaterial) {
  SourceCharacter cube = test::make_cube();
  cube.materials.push_back(cube.materials[0]);
  cube.materials[1].double_sided = true;
  cube.materials[1].alpha_cutout = true;
  cube.triangles[3].material = 1;
  const auto surface = rebuild(cube);
  ASSERT_TRUE(surface.ok());
  EXPECT_EQ(surface->triangle_flags[2], 0);
  EXPECT_EQ(surface->triangle_flags[3],
            render::kTriangleDoubleSided | render::kTriangleAlphaCutout);
}

TEST(RebuildTest, OnlyWhatIsClosedAndWithoutHolesHidesItsBack) {
  const auto flags_of = [](SourceCharacter source, bool alpha_cutout) {
    source.materials[0].double_sided = true;
    source.materials[0].alpha_cutout = alpha_cutout;
    const auto surface = rebuild(source);
    EXPECT_TRUE(surface.ok());
    return std::set<int>(surface->triangle_flags.begin(), surface->triangle_flags.end());
  };
  using Flags = std::set<int>;
  constexpr int kBoth = render::kTriangleDoubleSided | render::kTriangleAlphaCutout;
  EXPECT_EQ(flags_of(test::make_cube(), false), Flags{0});
  EXPECT_EQ(flags_of(test::make_cube(), true), Flags{kBoth});
  EXPECT_EQ(flags_of(test::make_cut_sheet(), false), Flags{render::kTriangleDoubleSided});
  SourceCharacter open = test::make_cube();
  open.triangles.pop_back();
  EXPECT_EQ(flags_of(open, false), Flags{render::kTriangleDoubleSided});
  SourceCharacter turned = test::make_cube();
  for (SourceTriangle& triangle : turned.triangles)
    std::swap(triangle.corner[1], triangle.corner[2]);
  EXPECT_EQ(flags_of(turned, false), Flags{render::kTriangleDoubleSided});
}

struct Fault {
  const char* name;
  void (*inject)(SourceCharacter&);
  const char* message;
};
class RebuildFaultTest : public ::testing::TestWithParam<Fault> {};

TEST_P(RebuildFaultTest, IsNamed) {
  SourceCharacter cube = test::make_cube();
  GetParam().inject(cube);
  const auto surface = rebuild(cube);
  ASSERT_FALSE(surface.ok());
  EXPECT_EQ(surface.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(surface.status().message()), HasSubstr(GetParam().message));
}

INSTANTIATE_TEST_SUITE_P(
    Faults, RebuildFaultTest,
    ::testing::Values(
        Fault{"NoTriangle", [](SourceCharacter& c) { c.triangles.clear(); },
              "no triangle with an area"},
        Fault{"NoArea",
              [](SourceCharacter& c) {
                for (auto& p : c.points) p.position = {p.position.x, 0, 0};
              },
              "no triangle with an area"},
        Fault{"Point", [](SourceCharacter& c) { c.triangles[3].corner[1].point = 8; },
              "triangle 3 has point 8, must be below 8"},
        Fault{"Uv", [](SourceCharacter& c) { c.triangles[3].corner[1].uv = 14; },
              "triangle 3 has uv 14"},
        Fault{"Normal", [](SourceCharacter& c) { c.triangles[0].corner[0].normal = 99; },
              "triangle 0 has normal 99"},
        Fault{"Material", [](SourceCharacter& c) { c.triangles[5].material = 1; },
              "triangle 5 has material 1"},
        Fault{"NanPosition", [](SourceCharacter& c) { c.points[2].position.z = std::nanf(""); },
              "point 2 is"},
        Fault{"NanUv", [](SourceCharacter& c) { c.uvs[4].x = std::nanf(""); }, "uv 4 is"},
        Fault{"NanNormal", [](SourceCharacter& c) { c.normals[1].x = std::nanf(""); },
              "normal 1 is not finite"},
        Fault{"Joint", [](SourceCharacter& c) { c.points[0].joint.y = 1; },
              "point 0 has joint 1, must be below 1"},
        Fault{"Weight", [](SourceCharacter& c) { c.points[0].weight.x = -1; },
              "point 0 has weight -1"},
        Fault{"Texture", [](SourceCharacter& c) { c.materials[0].base_color.rgba.pop_back(); },
              "texture of material skin"},
        Fault{"Factor", [](SourceCharacter& c) { c.materials[0].factor.y = std::nanf(""); },
              "colour factor of material skin"}),
    [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace throng::simplify
