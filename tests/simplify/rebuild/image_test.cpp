#include "simplify/rebuild/image.hpp"

#include <gtest/gtest.h>

namespace throng::simplify {
namespace {

const std::vector<glm::vec2> kWholeImage = {{0, 0}, {1, 0}, {1, 1}, {0, 0}, {1, 1}, {0, 1}};

SourceImage make_image(std::uint32_t width_px, std::uint32_t height_px,
                       glm::u8vec4 (*color)(std::uint32_t, std::uint32_t)) {
  SourceImage image{width_px, height_px, {}};
  for (std::uint32_t y = 0; y < height_px; ++y) {
    for (std::uint32_t x = 0; x < width_px; ++x) {
      const glm::u8vec4 texel = color(x, y);
      for (int i = 0; i < 4; ++i) image.rgba.push_back(texel[i]);
    }
  }
  return image;
}

TEST(ImageTest, SrgbRoundTripIsExact) {
  for (int i = 0; i < 256; ++i) {
    EXPECT_EQ(srgb_from_linear(linear_from_srgb(static_cast<std::uint8_t>(i))), i);
  }
}

TEST(ImageTest, MipsAreAveragedInLinearLight) {
  const SourceImage image = make_image(2, 2, [](std::uint32_t x, std::uint32_t y) {
    return (x + y) % 2 == 0 ? glm::u8vec4(255) : glm::u8vec4(0, 0, 0, 255);
  });
  const MipChain mips = make_mips(image, kWholeImage, true);
  ASSERT_EQ(mips.level_count, 2U);
  EXPECT_EQ(mips.texels[16], 188);  // half the light, not half the number
  EXPECT_EQ(make_mips(image, kWholeImage, false).texels[16], 128);
}

TEST(ImageTest, LevelsOfOddSizesEndAtOneTexel) {
  const SourceImage image =
      make_image(13, 5, [](std::uint32_t, std::uint32_t) { return glm::u8vec4(9, 9, 9, 255); });
  const MipChain mips = make_mips(image, kWholeImage, true);
  EXPECT_EQ(mips.level_count, 4U);  // 13x5, 6x2, 3x1, 1x1
  EXPECT_EQ(mips.texels.size(), 4U * (65 + 12 + 3 + 1));
  for (std::size_t i = 0; i < mips.texels.size(); i += 4) EXPECT_EQ(mips.texels[i], 9);
}

TEST(ImageTest, BackgroundDoesNotBleedIntoMips) {
  // red in the upper left quarter, which alone is used, and garish green elsewhere
  const SourceImage image = make_image(64, 64, [](std::uint32_t x, std::uint32_t y) {
    return x < 36 && y < 36 ? glm::u8vec4(200, 0, 0, 255) : glm::u8vec4(0, 255, 0, 255);
  });
  const MipChain mips =
      make_mips(image, std::vector<glm::vec2>{{0, 0}, {0.5F, 0}, {0, 0.5F}}, true);
  for (std::size_t i = 0; i < mips.texels.size(); i += 4) {
    EXPECT_EQ(mips.texels[i + 1], 0) << "texel " << i / 4;
  }
}

TEST(ImageTest, WrapModes) {
  const SourceImage image = make_image(4, 1, [](std::uint32_t x, std::uint32_t) {
    return glm::u8vec4(static_cast<std::uint8_t>(x), 0, 0, 255);
  });
  EXPECT_EQ(wrapped_texel(image, Wrap::kRepeat, Wrap::kRepeat, -1, 7).r, 3);
  EXPECT_EQ(wrapped_texel(image, Wrap::kRepeat, Wrap::kRepeat, 9, 0).r, 1);
  EXPECT_EQ(wrapped_texel(image, Wrap::kClamp, Wrap::kClamp, -5, -5).r, 0);
  EXPECT_EQ(wrapped_texel(image, Wrap::kClamp, Wrap::kClamp, 99, 0).r, 3);
  EXPECT_EQ(wrapped_texel(image, Wrap::kMirror, Wrap::kMirror, -1, 0).r, 0);
  EXPECT_EQ(wrapped_texel(image, Wrap::kMirror, Wrap::kMirror, 4, 0).r, 3);
  EXPECT_EQ(wrapped_texel(image, Wrap::kMirror, Wrap::kMirror, 7, 0).r, 0);
}

TEST(ImageTest, ResizeKeepsAPlainColour) {
  const SourceImage image = make_image(
      40, 30, [](std::uint32_t, std::uint32_t) { return glm::u8vec4(10, 100, 250, 77); });
  const SourceImage small = resize(image, 7, 3, true);
  ASSERT_EQ(small.rgba.size(), 84U);
  EXPECT_EQ(small.rgba[80], 10);
  EXPECT_EQ(small.rgba[81], 100);
  EXPECT_EQ(small.rgba[82], 250);
  EXPECT_EQ(small.rgba[83], 77);
}

}  // namespace
}  // namespace throng::simplify
