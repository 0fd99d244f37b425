#include "throng/render/environment.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace throng::render {
namespace {

/// Area of the triangles that look up, and of those that look sideways.
struct Areas {
  double top_m2 = 0, side_m2 = 0;
  glm::vec3 low{1e9F}, high{-1e9F};
};

Areas measure(const Environment& environment) {
  Areas areas;
  for (const Character& piece : environment.pieces) {
    for (const glm::uvec3& t : piece.triangle) {
      const glm::vec3 a = piece.position[t.x], b = piece.position[t.y], c = piece.position[t.z];
      const glm::vec3 cross = glm::cross(b - a, c - a);
      // it faces the way its normal says
      EXPECT_GT(glm::dot(cross, decode_octahedral(piece.normal[t.x])), 0.0F);
      (std::abs(cross.z) > 1e-6F ? areas.top_m2 : areas.side_m2) += 0.5 * glm::length(cross);
      for (const glm::vec3& p : {a, b, c}) {
        areas.low = glm::min(areas.low, p);
        areas.high = glm::max(areas.high, p);
      }
    }
  }
  return areas;
}

TEST(EnvironmentTest, WallsStandOutsideOfTheWalkableArea) {
  const auto environment = make_environment("POLYGON ((0 0, 10 0, 10 4, 0 4, 0 0))", {},
                                            {.wall_height_m = 2.0, .wall_thickness_m = 0.5});
  ASSERT_TRUE(environment.ok()) << environment.status();
  const Areas areas = measure(**environment);
  EXPECT_NEAR(areas.top_m2, 11.0 * 5.0 - 10.0 * 4.0, 1e-3);
  EXPECT_NEAR(areas.side_m2, 2.0 * (2 * (11.0 + 5.0) + 2 * (10.0 + 4.0)), 1e-3);
  EXPECT_NEAR(areas.low.x, -0.5, 1e-5);
  EXPECT_NEAR(areas.high.y, 4.5, 1e-5);
  EXPECT_NEAR(areas.high.z, 2.0, 1e-6);
}

TEST(EnvironmentTest, HolesAreSolidObstacles) {
  const std::string wkt =
      "POLYGON ((0 0, 20 0, 20 20, 0 20, 0 0), (5 5, 5 8, 9 8, 9 5, 5 5), (12 12, 13 12, 13 13, 12 "
      "13, 12 12))";
  const auto environment =
      make_environment(wkt, {}, {.wall_height_m = 1.0, .wall_thickness_m = 1.0});
  ASSERT_TRUE(environment.ok()) << environment.status();
  EXPECT_NEAR(measure(**environment).top_m2, (22.0 * 22.0 - 400.0) + 12.0 + 1.0, 1e-3);
}

TEST(EnvironmentTest, PiecesAreOffsetsFromTheOriginAndSmall) {
  const auto environment = make_environment(
      "POLYGON ((400000 5000000, 400200 5000000, 400200 5000100, 400000 5000100, 400000 5000000))",
      {400100, 5000050, 0});
  ASSERT_TRUE(environment.ok()) << environment.status();
  const Areas areas = measure(**environment);
  EXPECT_NEAR(areas.low.x, -100.2, 1e-3);
  EXPECT_NEAR(areas.high.y, 50.2, 1e-3);
  EXPECT_GT((*environment)->pieces.size(), 20U);
  for (const Character& piece : (*environment)->pieces) EXPECT_LT(piece.bounds.w, 30.0F);
}

TEST(EnvironmentTest, CollectionsAndOverlapsAreOneArea) {
  const auto one = make_environment("POLYGON ((0 0, 10 0, 10 4, 0 4, 0 0))", {});
  const auto two = make_environment(
      "GEOMETRYCOLLECTION (POLYGON ((0 0, 6 0, 6 4, 0 4, 0 0)), MULTIPOLYGON (((5 0, 10 0, 10 4, 5 "
      "4, "
      "5 0))))",
      {});
  ASSERT_TRUE(one.ok() && two.ok()) << two.status();
  EXPECT_NEAR(measure(**one).top_m2, measure(**two).top_m2, 1e-3);
}

TEST(EnvironmentTest, CrossedOutlineIsRepaired) {
  const auto bow = make_environment("POLYGON ((0 0, 4 4, 4 0, 0 4, 0 0))", {});
  ASSERT_TRUE(bow.ok()) << bow.status();
  EXPECT_GT(measure(**bow).top_m2, 0.0);
}

TEST(EnvironmentTest, BadInputIsRefusedByName) {
  const std::pair<const char*, const char*> cases[] = {
      {"", "WKT"},
      {"nonsense", "WKT"},
      {"POLYGON ((0 0, 1 0", "WKT"},
      {"POINT (1 2)", "no polygon"},
      {"POLYGON EMPTY", "no polygon"},
      {"POLYGON ((0 0, 1 0, 2 0, 0 0))", "no area"},
      {"POLYGON ((0 0, 1e300 0, 1 1, 0 0))", "1e+300"},
      {"POLYGON ((0 0, nan 0, 1 1, 0 0))", "nan"},
  };
  for (const auto& [wkt, words] : cases) {
    const auto environment = make_environment(wkt, {});
    ASSERT_FALSE(environment.ok()) << wkt;
    EXPECT_EQ(environment.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(environment.status().message()), testing::HasSubstr(words)) << wkt;
    // but for an area that must be looked at closely, the quick check says the same
    if (std::string(words) != "no area") {
      EXPECT_EQ(check_environment(wkt, {}), environment.status()) << wkt;
    }
  }
  EXPECT_FALSE(make_environment("POLYGON ((0 0, 1 0, 1 1, 0 0))", {}, {.wall_height_m = 0}).ok());
}

TEST(EnvironmentTest, CollectionsNestedTooDeepAreRefusedBeforeTheyAreRead) {
  const auto nested = [](int depth) {
    std::string wkt;
    for (int i = 0; i < depth; ++i) wkt += "GEOMETRYCOLLECTION (";
    wkt += "POLYGON ((0 0, 1 0, 1 1, 0 0))";
    return wkt + std::string(static_cast<std::size_t>(depth), ')');
  };
  EXPECT_TRUE(check_environment(nested(20), {}).ok());
  const absl::Status status = check_environment(nested(50'000), {});
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(status.message()), testing::HasSubstr("nested"));
}

/// A round room of `corners` whose wall goes in and out.
std::string star(int corners) {
  std::string wkt = "POLYGON ((";
  for (int i = 0; i <= corners; ++i) {
    const double angle = 2.0 * 3.14159265358979323846 * (i % corners) / corners;
    const double radius = i % corners % 2 == 0 ? 500.0 : 503.0;
    if (i > 0) wkt += ",";
    wkt +=
        std::to_string(radius * std::cos(angle)) + " " + std::to_string(radius * std::sin(angle));
  }
  return wkt + "))";
}

TEST(EnvironmentTest, LargeSitesAreCutInTwoWithoutAGapOrAWallInside) {
  // Cut or not, top and sides are the same: 150 corners are raised whole, 1,500 are not.
  for (const int corners : {150, 1'500}) {
    const auto environment =
        make_environment(star(corners), {}, {.wall_height_m = 2.0, .wall_thickness_m = 0.5});
    ASSERT_TRUE(environment.ok()) << environment.status();
    const Areas areas = measure(**environment);
    const double edge_m = std::hypot(3.0, 2.0 * 3.14159265358979323846 * 501.5 / corners);
    EXPECT_NEAR(areas.side_m2 / (2.0 * 2.0 * edge_m * corners), 1.0, 0.03) << corners;
    EXPECT_NEAR(areas.top_m2 / (0.5 * edge_m * corners), 1.0, 0.05) << corners;
  }
}

TEST(EnvironmentTest, ManyPointsAreRaised) {
  const auto environment = make_environment(star(3'000), {});
  ASSERT_TRUE(environment.ok()) << environment.status();
  EXPECT_GT((*environment)->triangles, 12'000U);
}

TEST(EnvironmentTest, CamerasSeeTheWholeRoom) {
  const glm::dvec3 origin(100.0, 0.0, 0.0);
  const auto room = make_environment("POLYGON ((90 0, 110 0, 110 8, 90 8, 90 0))", origin,
                                     {.wall_thickness_m = 0.5});
  ASSERT_TRUE(room.ok()) << room.status();
  glm::dvec3 low(103.0, 3.0, 0.0), high(104.0, 4.0, 0.0);
  include_environment(room->get(), origin, low, high);
  EXPECT_NEAR(low.x, 89.5, 1e-4);  // the wall's outside
  EXPECT_NEAR(high.x, 110.5, 1e-4);
  EXPECT_NEAR(low.y, -0.5, 1e-4);
  EXPECT_NEAR(high.y, 8.5, 1e-4);
  include_environment(nullptr, origin, low, high);
  EXPECT_NEAR(low.x, 89.5, 1e-4);
}

TEST(EnvironmentTest, CamerasSeeOfALargeSiteWhatIsNearTheAgents) {
  const auto site =
      make_environment("POLYGON ((0 0, 400 0, 400 9, 0 9, 0 0))", {}, {.wall_thickness_m = 0.5});
  ASSERT_TRUE(site.ok()) << site.status();
  glm::dvec3 low(98.0, 3.0, 0.0), high(118.0, 4.0, 0.0);
  include_environment(site->get(), {}, low, high);
  EXPECT_NEAR(low.x, 88.0, 1e-4);  // half of what the agents span
  EXPECT_NEAR(high.x, 128.0, 1e-4);
  EXPECT_NEAR(low.y, -0.5, 1e-4);
  low = {20.0, 3.0, 0.0}, high = {160.0, 4.0, 0.0};
  include_environment(site->get(), {}, low, high);
  EXPECT_NEAR(low.x, -0.5, 1e-4);  // it is three times as long as they span
  EXPECT_NEAR(high.x, 400.5, 1e-4);
}

TEST(EnvironmentTest, SurfacesLieOnTheGround) {
  const std::string streets =
      "\n;ROAD MULTIPOLYGON (((0 0, 100 0, 100 6, 0 6, 0 0)), ((50 0, 60 0, 60 6, 50 6, 50 0)))"
      "\n;WALK POLYGON ((0 6, 100 6, 100 8, 0 8, 0 6))";
  EXPECT_TRUE(check_environment(streets, {}).ok());
  const auto alone = make_environment(streets, {});
  ASSERT_TRUE(alone.ok()) << alone.status();
  EXPECT_LT((*alone)->high_m.z, 0.04);  // within what shows the ground's shadows
  EXPECT_GT((*alone)->low_m.z, 0.0);
  EXPECT_NEAR((*alone)->high_m.y, 8.0, 1e-4);
  EXPECT_TRUE((*alone)->rings.empty());
  const auto walled = make_environment("POLYGON ((0 0, 9 0, 9 9, 0 9, 0 0))" + streets, {});
  ASSERT_TRUE(walled.ok()) << walled.status();
  EXPECT_EQ((*walled)->rings.size(), 1U);
  EXPECT_NEAR((*walled)->high_m.z, 1.2, 1e-4);
  EXPECT_EQ(*walkable_area_of("POLYGON ((0 0, 9 0, 9 9, 0 0))" + streets),
            "POLYGON ((0 0, 9 0, 9 9, 0 0))" + streets);
  for (const char* wrong :
       {"\n;LAKE POLYGON ((0 0, 1 0, 1 1, 0 0))", "\n;ROAD", "\n;ROAD x", "\n;",
        "\n;ROAD POLYGON ((0 0, 1e9 0, 1 1, 0 0))", "POLYGON x\n;ROAD POINT (0 0)"}) {
    EXPECT_EQ(make_environment(wrong, {}).status().code(), absl::StatusCode::kInvalidArgument)
        << wrong;
    EXPECT_EQ(check_environment(wrong, {}).code(), absl::StatusCode::kInvalidArgument) << wrong;
  }
}

TEST(EnvironmentTest, ATownHasFewPieces) {
  std::string streets;
  for (int i = 0; i < 300; ++i) {
    streets +=
        absl::StrCat(i == 0 ? "\n;ROAD MULTIPOLYGON (((" : ", ((", i * 40, " 0, ", i * 40 + 6,
                     " 0, ", i * 40 + 6, " 12000, ", i * 40, " 12000, ", i * 40, " 0))");
  }
  const auto town = make_environment(streets + ")", {});
  ASSERT_TRUE(town.ok()) << town.status();
  EXPECT_LT((*town)->pieces.size(), 10'000U);
}

TEST(EnvironmentTest, WhatWouldNotFitIntoMemoryIsRefusedBeforeItIsCut) {
  // 3,000 slivers as long as the world, and a solid block of 300 km
  std::string slivers = "\n;ROAD MULTIPOLYGON (";
  for (int i = 0; i < 3'000; ++i) {
    const double y = 0.001 * i;
    absl::StrAppend(&slivers, i == 0 ? "((" : ", ((", "-9e6 ", y, ", 9e6 ", y, ", 9e6 ", y + 0.0005,
                    ", -9e6 ", y, "))");
  }
  const std::string wrong[] = {
      slivers + ")",
      "POLYGON ((0 0, 300010 0, 300010 300010, 0 300010, 0 0), (5 5, 5 300005, 300005 300005, "
      "300005 5, 5 5))"};
  for (const std::string& wkt : wrong) {
    const absl::Status status = make_environment(wkt, {}).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    EXPECT_NE(status.message().find("triangles, must be at most"), std::string::npos) << status;
  }
}

TEST(EnvironmentTest, WhoNoLongerWaitsIsNotServed) {
  const std::atomic<bool> cancelled{true};
  EXPECT_EQ(make_environment(star(1'500), {}, {.cancelled = &cancelled}).status().code(),
            absl::StatusCode::kCancelled);
}

}  // namespace
}  // namespace throng::render
