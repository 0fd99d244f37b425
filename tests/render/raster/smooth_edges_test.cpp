#include "render/raster/smooth_edges.hpp"

#include <gtest/gtest.h>

#include <random>

#include "render/compute/cpu/work_pool.hpp"

namespace throng::render {
namespace {

template <typename Value>
Picture picture_of(std::uint32_t width, std::uint32_t height, Value value) {
  Picture picture{width, height, {}};
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      const auto v = static_cast<std::uint8_t>(value(x, y));
      picture.rgbx.insert(picture.rgbx.end(), {v, v, v, 255});
    }
  }
  return picture;
}

TEST(SmoothEdgesTest, FlatPicturesAndStraightEdgesStay) {
  WorkPool pool(2);
  SmoothScratch scratch;
  for (Picture picture : {picture_of(40, 30, [](auto, auto) { return 90; }),
                          picture_of(40, 30, [](auto x, auto) { return x < 20 ? 0 : 255; }),
                          picture_of(40, 30, [](auto x, auto y) { return x + y; })}) {
    const auto before = picture.rgbx;
    smooth_edges(picture, scratch, pool);
    EXPECT_EQ(picture.rgbx, before);
  }
}

TEST(SmoothEdgesTest, StairsBecomeARamp) {
  WorkPool pool(2);
  SmoothScratch scratch;
  // an edge that climbs one pixel in eight
  Picture picture = picture_of(64, 32, [](auto x, auto y) { return y * 8 > x + 60 ? 255 : 0; });
  smooth_edges(picture, scratch, pool);
  int between = 0;
  for (std::size_t i = 0; i < picture.rgbx.size(); i += 4) {
    between += picture.rgbx[i] > 20 && picture.rgbx[i] < 235;
    ASSERT_EQ(picture.rgbx[i + 3], 255);
  }
  EXPECT_GT(between, 30);
  EXPECT_LT(between, 140);
}

TEST(SmoothEdgesTest, ThreadsDoNotChangeTheBytes) {
  std::mt19937 random(3);
  const Picture noise = picture_of(133, 71, [&](auto, auto) { return random() & 255u; });
  std::vector<std::uint8_t> expected;
  for (const unsigned threads : {1u, 2u, 7u}) {
    WorkPool pool(threads);
    SmoothScratch scratch;
    Picture picture = noise;
    smooth_edges(picture, scratch, pool);
    if (expected.empty()) expected = picture.rgbx;
    EXPECT_EQ(picture.rgbx, expected);
  }
}

TEST(SmoothEdgesTest, TinyPicturesAreLeftAlone) {
  WorkPool pool(1);
  SmoothScratch scratch;
  for (const auto& [width, height] : {std::pair{1u, 1u}, {2u, 9u}, {9u, 2u}, {3u, 3u}}) {
    Picture picture = picture_of(width, height, [](auto x, auto y) { return (x + y) % 2 * 255; });
    smooth_edges(picture, scratch, pool);
    EXPECT_EQ(picture.rgbx.size(), std::size_t{4} * width * height);
  }
}

}  // namespace
}  // namespace throng::render
