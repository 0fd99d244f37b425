#include "simplify/report/hausdorff.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace throng::simplify {
namespace {

const std::vector<glm::uvec3> kSquare{{0, 1, 2}, {0, 2, 3}};

std::vector<glm::vec3> square_at(float z) { return {{0, 0, z}, {1, 0, z}, {1, 1, z}, {0, 1, z}}; }

TEST(HausdorffTest, DistanceIsToFacesEdgesAndCorners) {
  const auto position = square_at(0.0F);
  const TriangleTree tree(position, kSquare);
  EXPECT_FLOAT_EQ(tree.distance2({0.3F, 0.6F, 2.0F}), 4.0F);
  EXPECT_FLOAT_EQ(tree.distance2({0.5F, -3.0F, 0.0F}), 9.0F);
  EXPECT_FLOAT_EQ(tree.distance2({2.0F, 2.0F, 1.0F}), 3.0F);
  EXPECT_FLOAT_EQ(tree.distance2({0.25F, 0.25F, 0.0F}), 0.0F);
}

TEST(HausdorffTest, NothingIsInfinitelyFar) {
  const TriangleTree tree({}, {});
  EXPECT_TRUE(std::isinf(tree.distance2({0, 0, 0})));
}

TEST(HausdorffTest, TreeFindsWhatLookingAtAllFinds) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
  std::vector<glm::vec3> position(300);
  for (glm::vec3& p : position) p = {uniform(random), uniform(random), uniform(random)};
  std::vector<glm::uvec3> triangles;
  for (std::uint32_t i = 0; i + 2 < position.size(); i += 3) triangles.push_back({i, i + 1, i + 2});
  triangles.push_back({7, 7, 7});  // a point
  const TriangleTree tree(position, triangles);
  for (int i = 0; i < 200; ++i) {
    const glm::vec3 p(2.0F * uniform(random), 2.0F * uniform(random), 2.0F * uniform(random));
    float least2 = INFINITY;
    for (const glm::uvec3& triangle : triangles)
      least2 = std::min(least2, TriangleTree(position, {&triangle, 1}).distance2(p));
    EXPECT_FLOAT_EQ(tree.distance2(p), least2);
  }
}

TEST(HausdorffTest, FarthestSampleDecides) {
  const auto low = square_at(0.0F);
  auto bent = square_at(0.5F);
  bent[2].z = 2.0F;
  const TriangleTree tree(low, kSquare);
  const SurfaceSamples samples(bent, kSquare, 100);
  EXPECT_EQ(samples.size(), 104U);
  EXPECT_FLOAT_EQ(farthest2(samples, bent, tree, 0.0F), 4.0F);
  EXPECT_FLOAT_EQ(farthest2(samples, bent, tree, 9.0F), 9.0F);  // no more than was known
}

}  // namespace
}  // namespace throng::simplify
