#include "render/raster/gl/cast_textures.hpp"

#include <gtest/gtest.h>

namespace throng::render::gl {
namespace {

std::vector<std::uint8_t> filled(std::size_t texels, std::uint8_t value) {
  return std::vector<std::uint8_t>(4 * texels, value);
}

TEST(TextureLayersTest, ImagesOfCommonSizeKeepTheirBakedLevels) {
  auto texels = filled(16, 10);
  const auto second = filled(4, 77), third = filled(1, 99);
  texels.insert(texels.end(), second.begin(), second.end());
  texels.insert(texels.end(), third.begin(), third.end());
  const MipImage image{4, 4, 3, texels};
  const auto layers = make_texture_layers({&image, &image}, true, 0, 4096);
  ASSERT_TRUE(layers.ok()) << layers.status();
  EXPECT_EQ(layers->width_px, 4u);
  EXPECT_EQ(layers->level_count, 3u);
  EXPECT_EQ(layers->levels[1], filled(2 * 4, 77));
  EXPECT_EQ(layers->levels[2], filled(2 * 1, 99));
}

TEST(TextureLayersTest, MissingLevelsAreMeansInLinearLight) {
  const std::vector<std::uint8_t> texels = {0,   0,   0,   255, 255, 255, 255, 255,
                                            255, 255, 255, 255, 0,   0,   0,   255};
  const MipImage image{2, 2, 1, texels};
  const auto srgb = make_texture_layers({&image}, true, 0, 4096);
  ASSERT_TRUE(srgb.ok());
  EXPECT_NEAR(srgb->levels[1][0], 188, 1);  // half the light, not half the number
  EXPECT_NEAR(make_texture_layers({&image}, false, 0, 4096)->levels[1][0], 128, 1);
}

TEST(TextureLayersTest, OtherSizesAreResampledToThePowerOfTwoThatHoldsTheLargest) {
  const auto large = filled(5 * 3, 50), small = filled(1, 200);
  const MipImage a{5, 3, 1, large}, b{1, 1, 1, small};
  const auto layers = make_texture_layers({&a, &b}, true, 0, 4096);
  ASSERT_TRUE(layers.ok());
  EXPECT_EQ(layers->width_px, 8u);
  EXPECT_EQ(layers->height_px, 4u);
  EXPECT_EQ(layers->levels[0][0], 50);
  EXPECT_EQ(layers->levels[0][4 * 8 * 4], 200);
  EXPECT_EQ(layers->levels.back().size(), 8u);
}

TEST(TextureLayersTest, MissingImageHasTheGivenColour) {
  const auto texels = filled(4, 9);
  const MipImage image{2, 2, 1, texels}, none{};
  const auto layers = make_texture_layers({&none, &image}, true, 0x11223344u, 4096);
  ASSERT_TRUE(layers.ok());
  EXPECT_EQ(layers->levels[0][0], 0x11);
  EXPECT_EQ(layers->levels[0][3], 0x44);
}

TEST(TextureLayersTest, LimitShrinksImages) {
  const auto texels = filled(64 * 64, 123);
  const MipImage image{64, 64, 1, texels};
  const auto layers = make_texture_layers({&image}, true, 0, 16);
  ASSERT_TRUE(layers.ok());
  EXPECT_EQ(layers->width_px, 16u);
  EXPECT_EQ(layers->levels[0][0], 123);
}

TEST(TextureLayersTest, ImageWithTooFewTexelsIsRejected) {
  const auto texels = filled(3, 1);
  const MipImage image{2, 2, 1, texels};
  EXPECT_EQ(make_texture_layers({&image}, true, 0, 4096).status().code(),
            absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace throng::render::gl
