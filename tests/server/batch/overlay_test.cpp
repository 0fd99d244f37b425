#include "server/batch/overlay.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <vector>

#include "server/batch/font.hpp"

namespace throng::server {
namespace {

render::Picture grey(std::uint32_t width_px, std::uint32_t height_px) {
  return {width_px, height_px,
          std::vector<std::uint8_t>(std::size_t{4} * width_px * height_px, 128)};
}

/// Pixels of the box [x0, x1) x [y0, y1) that are not as they were.
std::size_t changed(const render::Picture& picture, std::uint32_t x0, std::uint32_t y0,
                    std::uint32_t x1, std::uint32_t y1) {
  std::size_t count = 0;
  for (std::uint32_t y = y0; y < y1; ++y) {
    for (std::uint32_t x = x0; x < x1; ++x) {
      count += picture.rgbx[4 * (std::size_t{y} * picture.width_px + x)] != 128;
    }
  }
  return count;
}

TEST(OverlayTest, ItemsAreNamedAndMistakesToo) {
  EXPECT_FALSE(parse_overlay("")->any());
  const auto two = parse_overlay("time,scale");
  ASSERT_TRUE(two.ok());
  EXPECT_TRUE(two->time && two->scale && !two->legend && !two->agents);
  EXPECT_TRUE(parse_overlay("all")->legend);
  EXPECT_THAT(std::string(parse_overlay("time,clock").status().message()),
              testing::HasSubstr("'clock'"));
}

TEST(OverlayTest, EveryItemHasItsCorner) {
  const OverlayFacts facts{.scene_time_us = 61'500'000, .agents = 30'000, .channel = "speed"};
  const auto corners = [&](const OverlayItems& items) {
    render::Picture picture = grey(640, 360);
    draw_overlay(items, facts, picture);
    return std::array<bool, 4>{
        changed(picture, 0, 0, 320, 180) > 50, changed(picture, 320, 0, 640, 180) > 50,
        changed(picture, 0, 180, 320, 360) > 50, changed(picture, 320, 180, 640, 360) > 50};
  };
  using testing::ElementsAre;
  EXPECT_THAT(corners({.title = "Exit B"}), ElementsAre(true, false, false, false));
  EXPECT_THAT(corners({.legend = true}), ElementsAre(false, true, false, false));
  EXPECT_THAT(corners({.time = true}), ElementsAre(false, false, true, false));
  EXPECT_THAT(corners({.agents = true}), ElementsAre(false, false, true, false));
  EXPECT_THAT(corners({.scale = true}), ElementsAre(false, false, false, true));
}

TEST(OverlayTest, ScaleBarIsAsLongAsItSays) {
  OverlayFacts facts;
  facts.camera.ortho_height_m = 36.0;  // 10 px a metre
  render::Picture picture = grey(640, 360);
  draw_overlay({.scale = true}, facts, picture);
  // 18 % of the width are 11.5 m: a bar of 10 m, the longest run of its colour
  int longest = 0;
  for (std::uint32_t y = 180; y < 360; ++y) {
    int run = 0;
    for (std::uint32_t x = 0; x < 640; ++x) {
      run = picture.rgbx[4 * (std::size_t{y} * 640 + x)] == 245 ? run + 1 : 0;
      longest = std::max(longest, run);
    }
  }
  EXPECT_EQ(longest, 100);
}

TEST(OverlayTest, LegendNeedsAChannel) {
  render::Picture picture = grey(640, 360);
  draw_overlay({.legend = true}, {}, picture);
  EXPECT_EQ(changed(picture, 0, 0, 640, 360), 0U);
}

TEST(OverlayTest, SmallPicturesAndOddTextAreSurvived) {
  for (const std::uint32_t side : {1U, 16U, 64U}) {
    render::Picture picture = grey(side, side);
    OverlayFacts facts{.scene_time_us = side == 16U ? INT64_MAX : INT64_MIN,
                       .agents = 4'000'000'000U};
    facts.channel = "\xff\xfe\xc3";
    facts.camera.target_world = facts.camera.eye_world;
    draw_overlay({.time = true, .agents = true, .scale = true, .legend = true, .title = "\xc3"},
                 facts, picture);
  }
}

TEST(FontTest, WidthGrowsWithTextAndSize) {
  const Font small(12.0), large(24.0);
  EXPECT_EQ(small.width(""), 0);
  EXPECT_GT(small.width("ab"), small.width("a"));
  EXPECT_NEAR(large.width("Halle 4"), 2 * small.width("Halle 4"), 3);
}

}  // namespace
}  // namespace throng::server
