#include "render/raster/element/tint.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "render/raster/element/tone.hpp"
#include "render/raster/visibility/element/shade.hpp"
#include "throng/render/asset.hpp"

namespace throng::render::element {
namespace {

TEST(TintTest, SameSeedGivesSameTints) {
  EXPECT_EQ(tints_of(42).top, tints_of(42).top);
  EXPECT_NE(tints_of(42).top, tints_of(43).top);
}

TEST(TintTest, TintsAreInRangeAndSkinStaysNatural) {
  for (std::uint32_t seed = 0; seed < 5000; ++seed) {
    const Tints tints = tints_of(seed);
    for (const glm::vec3& color : {tints.skin, tints.hair, tints.top, tints.bottom}) {
      for (int i = 0; i < 3; ++i) {
        ASSERT_GE(color[i], 0.0F);
        ASSERT_LE(color[i], 2.0F);
      }
    }
    // natural on any natural tone: never green, blue or far from the painted one
    ASSERT_GT(tints.skin.r, 0.95F * tints.skin.g);
    ASSERT_GT(tints.skin.g, 0.95F * tints.skin.b);
    ASSERT_GT(tints.skin.b, 0.4F);
    ASSERT_LT(tints.skin.r, 1.2F);
  }
}

TEST(TintTest, NeighbouringSeedsDressDifferently) {
  std::set<std::uint32_t> tops, bottoms;
  for (std::uint32_t seed = 0; seed < 256; ++seed) {
    tops.insert(pack_color(tints_of(seed).top));
    bottoms.insert(pack_color(tints_of(seed).bottom));
  }
  EXPECT_GT(tops.size(), 220u);
  EXPECT_GT(bottoms.size(), 210u);
}

TEST(ColorTest, PackedTintsAndColoursComeBack) {
  const auto unpack = [](std::uint32_t bits) {
    const glm::vec3 root =
        glm::vec3(bits & 1023u, (bits >> 10) & 1023u, (bits >> 20) & 1023u) / 1023.0F;
    return root * root;
  };
  const glm::vec3 color(0.02F, 0.5F, 1.0F);
  EXPECT_LT(glm::length(unpack(pack_color(color)) - color), 0.003F);
  EXPECT_LT(glm::length(2.0F * unpack(pack_tint(2.0F * color)) - 2.0F * color), 0.006F);
}

TEST(ColorMapTest, EndsAreThoseOfTheMapAndValuesAreClamped) {
  constexpr std::uint32_t kEnds[][2] = {{0x440154, 0xfde725},
                                        {0x0d0887, 0xf0f921},
                                        {0x000004, 0xfcffa4},
                                        {0x000004, 0xfcfdbf},
                                        {0x00224e, 0xfee838}};
  for (std::size_t i = 0; i < kColorMapNames.size(); ++i) {
    const auto map = static_cast<ColorMap>(i);
    EXPECT_EQ(map_color(map, 0.0F), linear_from_hex(kEnds[i][0])) << name_of(map);
    EXPECT_EQ(map_color(map, 1.0F), linear_from_hex(kEnds[i][1])) << name_of(map);
    EXPECT_EQ(map_color(map, -3.0F), map_color(map, 0.0F)) << name_of(map);
    EXPECT_EQ(map_color(map, 7.0F), map_color(map, 1.0F)) << name_of(map);
  }
}

TEST(ColorTest, CubicIsCloseToTheStandardCurve) {
  for (int i = 0; i < 256; ++i) {
    const double srgb = i / 255.0;
    const double exact = srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
    EXPECT_NEAR(linear_from_srgb(static_cast<float>(srgb)), exact, 0.003);
  }
}

TEST(ToneTest, LevelsFindTheirBand) {
  const ToneBand bands[] = {{20, 0}, {14, 30}, {9, 50}};
  for (std::uint32_t n = 15; n <= 20; ++n) EXPECT_EQ(element::first_tone(bands, 3, n), 0U);
  for (std::uint32_t n = 10; n <= 14; ++n) EXPECT_EQ(element::first_tone(bands, 3, n), 90U);
  for (std::uint32_t n = 0; n <= 9; ++n) EXPECT_EQ(element::first_tone(bands, 3, n), 150U);
  EXPECT_EQ(element::first_tone(bands, 1, 4), 0U);
}

TEST(ToneTest, UnpacksWhatWasPacked) {
  const element::Tone tone =
      element::unpack_tone(pack_corner_tone({0.7F, 0.04F, 0.3F}, {1.0F, 0.0F, 0.4F, 2.0F}));
  EXPECT_NEAR(tone.color.r, 0.7F, 0.008F);  // half a step of 127 or 63 square roots
  EXPECT_NEAR(tone.color.g, 0.04F, 0.002F);
  EXPECT_NEAR(tone.color.b, 0.3F, 0.01F);
  EXPECT_EQ(tone.regions.x, 1.0F);
  EXPECT_EQ(tone.regions.y, 0.0F);
  EXPECT_NEAR(tone.regions.z, 0.4F, 0.072F);
  EXPECT_EQ(tone.regions.w, 1.0F);
}

}  // namespace
}  // namespace throng::render::element
