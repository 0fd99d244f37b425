#include "simplify/points/points.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/temporary_folder.hpp"
#include "support/tiny_character.hpp"

namespace throng::simplify {
namespace {

render::CharacterData sampled(std::uint32_t count) {
  render::CharacterData data = test::make_tiny_character();
  sample_points(data, {.count = count});
  return data;
}

/// Largest distance from places all over the surface to the nearest of the first n points.
float gap_m(const render::CharacterData& data, std::uint32_t n) {
  float worst = 0.0F;
  for (const glm::uvec3& c : data.triangle) {
    for (int i = 0; i <= 8; ++i) {
      for (int j = 0; i + j <= 8; ++j) {
        const float u = static_cast<float>(i) / 8.0F, v = static_cast<float>(j) / 8.0F;
        const glm::vec3 p =
            data.position[c.x] * (1.0F - u - v) + data.position[c.y] * u + data.position[c.z] * v;
        float nearest = std::numeric_limits<float>::max();
        for (std::uint32_t k = 0; k < n; ++k) {
          nearest = std::min(nearest, glm::distance(p, data.point[k].position));
        }
        worst = std::max(worst, nearest);
      }
    }
  }
  return worst;
}

TEST(SurfacePointsTest, EveryPrefixCoversTheSurfaceWithItsRadius) {
  const render::CharacterData data = sampled(256);
  ASSERT_EQ(data.point.size(), 256U);
  for (const std::uint32_t n : {1U, 2U, 7U, 40U, 128U, 256U}) {
    EXPECT_LE(gap_m(data, n), data.point_radius_m[n - 1]) << n;
  }
  // and not by luck: the bound is near what is needed
  EXPECT_LT(data.point_radius_m[255], 2.5F * gap_m(data, 256));
}

TEST(SurfacePointsTest, EveryPrefixIsSpreadEvenly) {
  const render::CharacterData data = sampled(256);
  float nearest = std::numeric_limits<float>::max();
  for (std::uint32_t i = 0; i < 64; ++i) {
    for (std::uint32_t k = 0; k < i; ++k) {
      nearest = std::min(nearest, glm::distance(data.point[i].position, data.point[k].position));
    }
  }
  // the farthest candidate is chosen each time, so no two of them are near
  EXPECT_GT(nearest, 0.5F * data.point_radius_m[63]);
}

TEST(SurfacePointsTest, SameMeshGivesSamePoints) {
  const render::CharacterData a = sampled(128), b = sampled(128);
  for (std::size_t i = 0; i < a.point.size(); ++i) {
    EXPECT_EQ(a.point[i].position, b.point[i].position);
    EXPECT_EQ(a.point_tone[i].base, b.point_tone[i].base);
  }
}

TEST(SurfacePointsTest, ToneOfOnePointIsTheMeanOfTheTexture) {
  const render::CharacterData data = sampled(64);
  ASSERT_EQ(data.point_tone.size(), render::point_tone_count(64));
  const std::uint32_t base = data.point_tone.back().base;
  // the tiny character is of one hue, sRGB 200 120 60, in lighter and darker parts
  const auto linear = [](std::uint32_t root) {
    const double c = static_cast<double>(root) / 1023.0;
    return c * c;
  };
  const double red = linear(base & 1023U);
  EXPECT_GT(red, 0.15);
  EXPECT_LT(red, 0.75);
  EXPECT_NEAR(linear(base >> 10 & 1023U) / red, 0.188 / 0.578, 0.05);
  EXPECT_NEAR(linear(base >> 20 & 1023U) / red, 0.045 / 0.578, 0.05);
}

TEST(SurfacePointsTest, SurfaceWithoutAreaGetsNone) {
  render::CharacterData data = test::make_tiny_character();
  for (glm::vec3& p : data.position) p = {0.0F, 0.0F, 1.0F};
  sample_points(data);
  EXPECT_TRUE(data.point.empty());
  EXPECT_TRUE(data.point_tone.empty());
}

TEST(SurfacePointsTest, FileKeepsThem) {
  const render::CharacterData data = sampled(100);
  const auto character = render::make_character(data);
  ASSERT_TRUE(character.ok()) << character.status();
  const test::TemporaryFolder folder;
  const std::string path = folder.file("tiny.throng");
  ASSERT_TRUE(render::write_character(*character, path).ok());
  const auto read = render::read_character(path);
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_EQ(read->points.count(), 100U);
  EXPECT_EQ(read->points.point[99].position, data.point[99].position);
  EXPECT_EQ(read->points.radius_m[50], data.point_radius_m[50]);
  EXPECT_EQ(read->points.tone.back().base, data.point_tone.back().base);
}

TEST(SurfacePointsTest, ReaderRefusesWhatMakesNoSense) {
  const auto refused = [](auto&& change) {
    render::CharacterData data = sampled(16);
    change(data);
    return std::string(render::make_character(std::move(data)).status().message());
  };
  EXPECT_EQ(refused([](auto& d) { d.point[3].joint_index[1] = 9; }),
            "point 3 has joint 9, must be below 2");
  EXPECT_EQ(refused([](auto& d) {
              d.point[2].joint_weight = {1, 1, 0, 0};
            }),
            "point 2 has weights that sum to 2, must be 255");
  EXPECT_EQ(refused([](auto& d) { d.point_tone.pop_back(); }),
            "point tone has 30 elements, must have 31");
  EXPECT_NE(refused([](auto& d) { d.point_radius_m[4] = 0.0F; }).find("point radius"),
            std::string::npos);
  EXPECT_NE(refused([](auto& d) { d.point_radius_m[4] = std::nanf(""); }).find("point radius"),
            std::string::npos);
  EXPECT_NE(refused([](auto& d) { d.point[0].position.x = std::nanf(""); }).find("not finite"),
            std::string::npos);
}

}  // namespace
}  // namespace throng::simplify
