#include "render/raster/element/tint.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace throng::render::element {
namespace {

TEST(TintTest, SameSeedGivesSameTints) {
  EXPECT_EQ(tints_of(42).top, tints_of(42).top);
  EXPECT_NE(tints_of(42).top, tints_of(43).top);
}

TEST(TintTest, ColoursAreReflectancesAndSkinIsWarm) {
  for (std::uint32_t seed = 0; seed < 5000; ++seed) {
    const Tints tints = tints_of(seed);
    for (const glm::vec3& color : {tints.skin, tints.hair, tints.top, tints.bottom}) {
      for (int i = 0; i < 3; ++i) {
        ASSERT_GE(color[i], 0.0F);
        ASSERT_LE(color[i], 1.0F);
      }
    }
    ASSERT_GT(tints.skin.r, tints.skin.g);
    ASSERT_GT(tints.skin.g, tints.skin.b);
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

TEST(TintTest, DarkSkinNeverComesWithBlondHair) {
  const float blond = linear_from_hex(0xc09a5f).r * 0.9F;
  for (std::uint32_t seed = 0; seed < 5000; ++seed) {
    const Tints tints = tints_of(seed);
    const bool grey = tints.hair.r < 1.3F * tints.hair.b;
    if (tints.skin.r < 0.2F && !grey) {
      ASSERT_LT(tints.hair.r, blond);
    }
  }
}

TEST(ViridisTest, EndsAreThoseOfTheMapAndValuesAreClamped) {
  EXPECT_EQ(viridis(0.0F), linear_from_hex(0x440154));
  EXPECT_EQ(viridis(1.0F), linear_from_hex(0xfde725));
  EXPECT_EQ(viridis(-3.0F), viridis(0.0F));
  EXPECT_EQ(viridis(7.0F), viridis(1.0F));
}

TEST(ColorTest, CubicIsCloseToTheStandardCurve) {
  for (int i = 0; i < 256; ++i) {
    const double srgb = i / 255.0;
    const double exact = srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
    EXPECT_NEAR(linear_from_srgb(static_cast<float>(srgb)), exact, 0.003);
  }
}

}  // namespace
}  // namespace throng::render::element
