#include "throng/render/quality.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace throng::render {
namespace {

constexpr std::uint32_t kWidth = 23, kHeight = 17;

Picture grey(std::uint8_t value) {
  return {kWidth, kHeight, std::vector<std::uint8_t>(std::size_t{kWidth} * kHeight * 4, value)};
}

Picture noise(unsigned seed) {
  std::mt19937 random(seed);
  Picture picture = grey(0);
  for (auto& byte : picture.rgbx) byte = static_cast<std::uint8_t>(random());
  return picture;
}

double luma(const Picture& picture, int x, int y) {
  const std::uint8_t* p = &picture.rgbx[4 * (static_cast<std::size_t>(y) * kWidth + x)];
  return 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2];
}

/// The definition, written as one double sum over the window.
double ssim_at(const Picture& a, const Picture& b, int x, int y) {
  double w = 0, ma = 0, mb = 0, maa = 0, mbb = 0, mab = 0;
  for (int dy = -5; dy <= 5; ++dy)
    for (int dx = -5; dx <= 5; ++dx) {
      if (x + dx < 0 || x + dx >= int{kWidth} || y + dy < 0 || y + dy >= int{kHeight}) continue;
      const double g = std::exp(-(dx * dx + dy * dy) / (2 * 1.5 * 1.5));
      const double la = luma(a, x + dx, y + dy), lb = luma(b, x + dx, y + dy);
      w += g, ma += g * la, mb += g * lb, maa += g * la * la, mbb += g * lb * lb,
          mab += g * la * lb;
    }
  ma /= w, mb /= w;
  const double va = maa / w - ma * ma, vb = mbb / w - mb * mb, vab = mab / w - ma * mb;
  const double c1 = 2.55 * 2.55, c2 = 7.65 * 7.65;
  return (2 * ma * mb + c1) * (2 * vab + c2) / ((ma * ma + mb * mb + c1) * (va + vb + c2));
}

TEST(ComparePicturesTest, EqualPicturesHaveNoError) {
  const Picture a = noise(1);
  const auto error = compare_pictures(a, a);
  ASSERT_TRUE(error.ok()) << error.status();
  EXPECT_TRUE(std::isinf(error->psnr_db));
  EXPECT_NEAR(error->ssim, 1, 1e-6);
  EXPECT_EQ(error->pixels, kWidth * kHeight);
}

TEST(ComparePicturesTest, FlatPicturesDifferByTheirMeansAlone) {
  const auto error = compare_pictures(grey(100), grey(110));
  ASSERT_TRUE(error.ok());
  const double c1 = 2.55 * 2.55;
  EXPECT_NEAR(error->psnr_db, 10 * std::log10(255.0 * 255.0 / 100), 1e-9);
  EXPECT_NEAR(error->ssim, (2 * 100 * 110 + c1) / (100 * 100 + 110 * 110 + c1), 1e-5);
}

TEST(ComparePicturesTest, EveryPixelEqualsTheDefinition) {
  const Picture a = noise(2), b = noise(3);
  for (const auto& [x, y] : {std::pair{0, 0}, {11, 8}, {22, 16}, {3, 12}}) {
    std::vector<std::uint8_t> mask(kWidth * kHeight);
    mask[y * kWidth + x] = 1;
    const auto error = compare_pictures(a, b, mask);
    ASSERT_TRUE(error.ok());
    EXPECT_EQ(error->pixels, 1u);
    EXPECT_NEAR(error->ssim, ssim_at(a, b, x, y), 1e-3) << x << ' ' << y;
  }
}

TEST(ComparePicturesTest, PictureOutsideTheMaskDoNotCount) {
  Picture a = grey(50);
  const Picture b = grey(50);
  a.rgbx[4 * 5] = 255;
  std::vector<std::uint8_t> mask(kWidth * kHeight);
  mask[kWidth * 16 + 22] = 1;
  const auto error = compare_pictures(a, b, mask);
  ASSERT_TRUE(error.ok());
  EXPECT_TRUE(std::isinf(error->psnr_db));
}

TEST(ComparePicturesTest, RejectsWrongSizesByName) {
  const Picture a = grey(1);
  Picture small = a;
  small.height_px -= 1;
  EXPECT_THAT(std::string(compare_pictures(a, small).status().message()),
              testing::HasSubstr("23x17 and 23x16"));
  EXPECT_FALSE(compare_pictures(small, small).ok());
  EXPECT_FALSE(compare_pictures(a, a, std::vector<std::uint8_t>(3)).ok());
}

TEST(FlickerTest, IsTheChangeOverTheReferencesChange) {
  const auto rate = flicker(grey(10), grey(30), grey(10), grey(20));
  ASSERT_TRUE(rate.ok());
  EXPECT_DOUBLE_EQ(*rate, 2);
  EXPECT_EQ(*flicker(grey(1), grey(1), grey(2), grey(2)), 1);
  EXPECT_TRUE(std::isinf(*flicker(grey(1), grey(2), grey(2), grey(2))));
}

TEST(PictureNearTest, IsADiscAroundEveryCoveredPixel) {
  std::vector<std::uint8_t> one(kWidth * kHeight), two(kWidth * kHeight);
  one[8 * kWidth + 4] = 1;
  two[0] = 7;
  for (const std::uint32_t radius : {0u, 1u, 4u, 100u}) {
    const auto near = pixels_near(one, two, kWidth, kHeight, radius);
    ASSERT_TRUE(near.ok());
    for (int y = 0; y < int{kHeight}; ++y)
      for (int x = 0; x < int{kWidth}; ++x) {
        const int to_one = (x - 4) * (x - 4) + (y - 8) * (y - 8), to_two = x * x + y * y;
        EXPECT_EQ((*near)[y * kWidth + x], std::min(to_one, to_two) <= int(radius * radius))
            << x << ' ' << y << " radius " << radius;
      }
  }
}

TEST(SilhouetteOverlapTest, IsIntersectionOverUnion) {
  EXPECT_DOUBLE_EQ(*silhouette_overlap(std::vector<std::uint8_t>{1, 1, 0, 0},
                                       std::vector<std::uint8_t>{0, 9, 1, 0}),
                   1.0 / 3);
  EXPECT_EQ(*silhouette_overlap({}, {}), 1);
  EXPECT_FALSE(silhouette_overlap(std::vector<std::uint8_t>{1}, {}).ok());
}

}  // namespace
}  // namespace throng::render
