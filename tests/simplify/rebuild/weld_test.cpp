#include "simplify/rebuild/weld.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>

namespace throng::simplify {
namespace {

SourcePoint point_at(const glm::vec3& position) {
  return {position, glm::u16vec4(0), {1, 0, 0, 0}};
}

TEST(WeldTest, JoinsOnlyPointsWithinTheDistance) {
  const std::vector<SourcePoint> points = {point_at({0, 0, 0}), point_at({0.0000004F, 0, 0}),
                                           point_at({0.01F, 0, 0}), point_at({-0.0F, 0, 0}),
                                           point_at({-0.0000004F, -0.0000001F, 0})};
  EXPECT_EQ(weld_points(points, 1.0e-6F), (std::vector<std::uint32_t>{0, 0, 2, 0, 0}));
}

TEST(WeldTest, OrderOfJointsDoesNotMatter) {
  std::vector<SourcePoint> points = {point_at({1, 1, 1}), point_at({1, 1, 1}), point_at({1, 1, 1})};
  points[0].joint = {3, 5, 0, 0};
  points[0].weight = {0.5F, 0.5F, 0, 0};
  points[1].joint = {5, 3, 9, 9};
  points[1].weight = {0.5F, 0.5F, 0, 0};
  points[2].joint = {5, 3, 0, 0};
  points[2].weight = {0.9F, 0.1F, 0, 0};
  EXPECT_EQ(weld_points(points, 1.0e-6F), (std::vector<std::uint32_t>{0, 0, 2}));
}

/// Each edge has at most one triangle in each direction, each point one fan.
void expect_manifold(const std::vector<glm::uvec3>& triangles) {
  std::set<std::pair<std::uint32_t, std::uint32_t>> directed;
  std::map<std::uint32_t, std::vector<std::uint32_t>> of_point;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    for (int i = 0; i < 3; ++i) {
      EXPECT_TRUE(directed.emplace(triangles[t][i], triangles[t][(i + 1) % 3]).second);
      of_point[triangles[t][i]].push_back(t);
    }
  }
  for (const auto& [point, around] : of_point) {
    // grow one fan from the first triangle over shared edges
    std::set<std::uint32_t> fan = {around[0]};
    for (bool is_growing = true; is_growing;) {
      is_growing = false;
      for (const std::uint32_t t : around) {
        if (fan.count(t) > 0) continue;
        for (const std::uint32_t other : fan) {
          int shared = 0;
          for (int i = 0; i < 3; ++i) {
            for (int k = 0; k < 3; ++k)
              shared += triangles[t][i] == triangles[other][k] && triangles[t][i] != point;
          }
          if (shared == 0) continue;
          fan.insert(t);
          is_growing = true;
          break;
        }
      }
    }
    EXPECT_EQ(fan.size(), around.size()) << "point " << point;
  }
}

std::vector<glm::uvec3> split(const std::vector<glm::uvec3>& triangles, std::size_t points,
                              std::vector<std::uint32_t>& origin) {
  std::vector<glm::vec3> position;
  for (std::size_t i = 0; i < points; ++i) {
    position.emplace_back(static_cast<float>(i % 3), static_cast<float>(i / 3),
                          static_cast<float>(i * i % 5));
  }
  return make_manifold(triangles, triangles, position, origin);
}

TEST(ManifoldTest, ManifoldStaysAsItIs) {
  std::vector<std::uint32_t> origin;
  const std::vector<glm::uvec3> tetrahedron = {{0, 1, 2}, {0, 2, 3}, {0, 3, 1}, {1, 3, 2}};
  expect_manifold(split(tetrahedron, 4, origin));
  EXPECT_EQ(origin.size(), 4U);
}

TEST(ManifoldTest, BowTieIsCutAtItsPoint) {
  std::vector<std::uint32_t> origin;
  expect_manifold(split({{0, 1, 2}, {0, 3, 4}}, 5, origin));
  EXPECT_EQ(origin.size(), 6U);
}

TEST(ManifoldTest, ThreeSheetsAtAnEdgeKeepTwoTogether) {
  std::vector<std::uint32_t> origin;
  expect_manifold(split({{0, 1, 2}, {1, 0, 3}, {1, 0, 4}}, 5, origin));
  EXPECT_EQ(origin.size(), 7U);
}

TEST(ManifoldTest, NeighboursWithOppositeWindingAreCut) {
  std::vector<std::uint32_t> origin;
  expect_manifold(split({{0, 1, 2}, {0, 1, 3}}, 4, origin));
  EXPECT_EQ(origin.size(), 6U);
}

TEST(ManifoldTest, BothSidesOfASheetStayOnePillow) {
  std::vector<std::uint32_t> origin;
  expect_manifold(split({{0, 1, 2}, {0, 2, 1}}, 3, origin));
  EXPECT_EQ(origin.size(), 3U);
}

TEST(ManifoldTest, RandomTrianglesBecomeAManifold) {
  std::uint32_t state = 1;
  const auto next = [&state](std::uint32_t limit) {
    state = state * 1664525U + 1013904223U;
    return (state >> 8U) % limit;
  };
  for (int round = 0; round < 50; ++round) {
    std::vector<glm::uvec3> triangles;
    std::set<std::array<std::uint32_t, 3>> seen;
    while (triangles.size() < 40) {
      const std::uint32_t a = next(10), b = next(10), c = next(10);
      if (a == b || b == c || c == a) continue;
      std::array<std::uint32_t, 3> turned = {a, b, c};
      std::rotate(turned.begin(), std::min_element(turned.begin(), turned.end()), turned.end());
      if (seen.insert(turned).second) triangles.push_back({a, b, c});
    }
    std::vector<std::uint32_t> origin;
    expect_manifold(split(triangles, 10, origin));
  }
}

}  // namespace
}  // namespace throng::simplify
