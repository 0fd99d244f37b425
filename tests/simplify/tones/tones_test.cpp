#include "simplify/tones/tones.hpp"

#include <gtest/gtest.h>

#include "support/tiny_character.hpp"

namespace throng::simplify {
namespace {

/// Texels of the largest level of the base colour by a function of u, all smaller levels left out.
template <typename ColorOf>
void paint(render::CharacterData& data, const ColorOf& color_of) {
  constexpr std::uint32_t kSide = 64;
  data.base_color_width_px = data.base_color_height_px = kSide;
  data.base_color_levels = 1;
  data.base_color.clear();
  for (std::uint32_t i = 0; i < kSide * kSide; ++i) {
    const glm::u8vec3 color = color_of((static_cast<float>(i % kSide) + 0.5F) / kSide);
    data.base_color.insert(data.base_color.end(), {color.r, color.g, color.b, 255});
  }
  data.tint_mask_width_px = data.tint_mask_height_px = data.tint_mask_levels = 0;
  data.tint_mask.clear();
}

struct Unpacked {
  float r, g, b;
};
/// Linear, 0 to 1.
Unpacked color_of(std::uint32_t tone) {
  const float r = static_cast<float>(tone & 127U) / 127.0F;
  const float g = static_cast<float>(tone >> 7 & 127U) / 127.0F;
  const float b = static_cast<float>(tone >> 14 & 63U) / 63.0F;
  return {r * r, g * g, b * b};
}

TEST(CornerTonesTest, OfOneColourAreThatColour) {
  render::CharacterData data = test::make_tiny_character();
  paint(data, [](float) { return glm::u8vec3(188, 0, 255); });  // linear 0.5, 0, 1
  make_corner_tones(data, {data.position});
  ASSERT_EQ(data.tone_band.size(), 1U);  // at most a quarter of all, or the coarsest
  EXPECT_EQ(data.tone_band[0].vertex_count, data.coarsest_count);
  ASSERT_EQ(data.corner_tone.size(), 3U * data.triangle_count_at[data.coarsest_count]);
  for (const std::uint32_t tone : data.corner_tone) {
    const Unpacked color = color_of(tone);
    EXPECT_NEAR(color.r, 0.5F, 0.02F);
    EXPECT_NEAR(color.g, 0.0F, 0.001F);
    EXPECT_NEAR(color.b, 1.0F, 0.03F);
    EXPECT_EQ(tone >> 20, 0U);  // no mask
  }
  EXPECT_TRUE(render::make_character(data).ok());
}

TEST(CornerTonesTest, ShowWhatIsSeenWhereCoordinatesAreTorn) {
  // red all over but for what the coarsest level's own corners have for coordinates
  render::CharacterData data = test::make_tiny_character();
  paint(data, [](float u) { return u < 0.02F ? glm::u8vec3(0, 0, 255) : glm::u8vec3(255, 0, 0); });
  for (std::uint32_t i = 0; i < data.position.size(); ++i) {
    data.uv[i] = {i < data.coarsest_count ? 0 : 40000, 30000};
  }
  EXPECT_TRUE(prefers_corner_tones(data, {data.position}, data.coarsest_count));
  make_corner_tones(data, {data.position});
  ASSERT_EQ(data.tone_band.size(), 1U);
  float red = 0.0F;
  for (const std::uint32_t tone : data.corner_tone) red += color_of(tone).r;
  EXPECT_GT(red / static_cast<float>(data.corner_tone.size()), 0.5F);  // the texture: blue only
}

TEST(CornerTonesTest, TextureStaysWhereItIsTheBetterPicture) {
  render::CharacterData data = test::make_tiny_character();
  paint(data, [](float u) {
    // borders in the middle of triangles
    return u > 0.375F && u < 0.875F ? glm::u8vec3(255) : glm::u8vec3(0);
  });
  make_corner_tones(data, {data.position});
  EXPECT_TRUE(data.tone_band.empty());
  EXPECT_TRUE(data.corner_tone.empty());
  EXPECT_TRUE(render::make_character(data).ok());
}

TEST(CornerTonesTest, WithoutPosesThereAreNone) {
  render::CharacterData data = test::make_tiny_character();
  make_corner_tones(data, {});
  EXPECT_TRUE(data.tone_band.empty());
  EXPECT_TRUE(data.corner_tone.empty());
}

}  // namespace
}  // namespace throng::simplify
