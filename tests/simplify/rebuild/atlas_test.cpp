#include <gtest/gtest.h>

#include "simplify/rebuild/image.hpp"
#include "simplify/rebuild/surface.hpp"
#include "support/source_shapes.hpp"

namespace throng::simplify {
namespace {

/// Nearest texel of the finest level.
glm::u8vec4 texel_at(const MipChain& image, const glm::vec2& uv) {
  const auto x = std::min(image.width_px - 1,
                          static_cast<std::uint32_t>(uv.x * static_cast<float>(image.width_px)));
  const auto y = std::min(image.height_px - 1,
                          static_cast<std::uint32_t>(uv.y * static_cast<float>(image.height_px)));
  const std::uint8_t* texel = &image.texels[4 * (std::size_t{y} * image.width_px + x)];
  return {texel[0], texel[1], texel[2], texel[3]};
}

/// A texture whose red is the column and green the row.
SourceImage make_gradient(std::uint32_t size_px) {
  SourceImage image{size_px, size_px, {}};
  for (std::uint32_t y = 0; y < size_px; ++y) {
    for (std::uint32_t x = 0; x < size_px; ++x) {
      for (const std::uint32_t value : {x, y, 0U, 255U})
        image.rgba.push_back(static_cast<std::uint8_t>(value));
    }
  }
  return image;
}

glm::vec2 centre_uv(const Surface& surface, std::size_t t) {
  const glm::uvec3& triangle = surface.triangles[t];
  return (surface.wedge_uv[triangle.x] + surface.wedge_uv[triangle.y] +
          surface.wedge_uv[triangle.z]) /
         3.0F;
}

glm::vec2 source_centre_uv(const SourceCharacter& source, std::size_t t) {
  glm::vec2 sum(0.0F);
  for (const SourceCorner& corner : source.triangles[t].corner) sum += source.uvs[corner.uv];
  return sum / 3.0F;
}

TEST(AtlasTest, OnlyTextureIsKeptTexelForTexel) {
  SourceCharacter cube = test::make_cube();
  cube.materials[0].base_color = make_gradient(64);
  const auto surface = rebuild(cube);
  ASSERT_TRUE(surface.ok());
  ASSERT_EQ(surface->base_color.width_px, 64U);
  for (std::size_t t = 0; t < 12; ++t) {
    const glm::vec2 uv = source_centre_uv(cube, t);
    const glm::u8vec4 texel = texel_at(surface->base_color, centre_uv(*surface, t));
    EXPECT_EQ(texel.r, static_cast<int>(uv.x * 64));
    EXPECT_EQ(texel.g, static_cast<int>(uv.y * 64));
  }
}

TEST(AtlasTest, TexturesAndColoursShareOneImage) {
  SourceCharacter cube = test::make_cube();
  cube.materials[0].base_color = make_gradient(64);
  SourceMaterial red;
  red.name = "red";
  red.factor = {1, 0, 0, 1};
  SourceMaterial half = cube.materials[0];
  half.name = "half";
  half.base_color = make_gradient(32);
  half.factor = {1, 1, 1, 1};
  cube.materials.push_back(red);
  cube.materials.push_back(half);
  for (std::size_t t = 4; t < 8; ++t) cube.triangles[t].material = 1;
  for (std::size_t t = 8; t < 12; ++t) cube.triangles[t].material = 2;
  const auto surface = rebuild(cube);
  ASSERT_TRUE(surface.ok());
  for (std::size_t t = 0; t < 12; ++t) {
    const glm::u8vec4 texel = texel_at(surface->base_color, centre_uv(*surface, t));
    if (t >= 4 && t < 8) {
      EXPECT_EQ(texel, glm::u8vec4(255, 0, 0, 255));
      continue;
    }
    const glm::vec2 uv = source_centre_uv(cube, t) * (t < 4 ? 64.0F : 32.0F);
    EXPECT_NEAR(texel.r, uv.x, 1.01F) << t;
    EXPECT_NEAR(texel.g, uv.y, 1.01F) << t;
  }
}

TEST(AtlasTest, RepeatedTextureIsLaidOut) {
  SourceCharacter cube = test::make_cube();
  cube.materials[0].base_color = make_gradient(32);
  for (glm::vec2& uv : cube.uvs) uv = uv * 2.0F - 5.0F;  // two by two copies, far off
  const auto surface = rebuild(cube);
  ASSERT_TRUE(surface.ok());
  for (std::size_t t = 0; t < 12; ++t) {
    const glm::vec2 uv = glm::fract(source_centre_uv(cube, t)) * 32.0F;
    const glm::u8vec4 texel = texel_at(surface->base_color, centre_uv(*surface, t));
    EXPECT_NEAR(texel.r, uv.x, 1.01F) << t;
    EXPECT_NEAR(texel.g, uv.y, 1.01F) << t;
  }
  for (const glm::vec2& uv : surface->wedge_uv) {
    EXPECT_TRUE(uv.x >= 0 && uv.x <= 1 && uv.y >= 0 && uv.y <= 1);
  }
}

TEST(AtlasTest, ShiftByWholeNumbersNeedsNoAtlas) {
  SourceCharacter cube = test::make_cube();
  cube.materials[0].base_color = make_gradient(32);
  for (glm::vec2& uv : cube.uvs) uv += glm::vec2(3.0F, -2.0F);
  EXPECT_EQ(rebuild(cube)->base_color.width_px, 32U);
}

TEST(AtlasTest, FactorMultipliesInLinearLight) {
  SourceCharacter cube = test::make_cube();
  cube.materials[0].factor = {0.5F, 1, 1, 1};
  const auto surface = rebuild(cube);
  ASSERT_TRUE(surface.ok());
  EXPECT_EQ(texel_at(surface->base_color, {0.4F, 0.4F}), glm::u8vec4(188, 255, 255, 255));
}

TEST(AtlasTest, CutoffMovesToOneHalf) {
  SourceCharacter cube = test::make_cube();
  SourceMaterial& material = cube.materials[0];
  material.alpha_cutout = true;
  material.alpha_cutoff = 0.25F;
  for (std::size_t i = 0; i < material.base_color.rgba.size(); i += 4)
    material.base_color.rgba[i + 3] = 70;
  EXPECT_GE(texel_at(rebuild(cube)->base_color, {0.4F, 0.4F}).a, 128);
  for (std::size_t i = 0; i < material.base_color.rgba.size(); i += 4)
    material.base_color.rgba[i + 3] = 60;
  EXPECT_LT(texel_at(rebuild(cube)->base_color, {0.4F, 0.4F}).a, 128);
}

TEST(AtlasTest, TintMaskGoesAlong) {
  SourceCharacter cube = test::make_cube();
  SourceMaterial plain;
  plain.name = "plain";
  cube.materials.push_back(plain);
  cube.materials[0].tint_mask = {
      2, 1, {255, 0, 0, 0, 0, 255, 0, 0}};  // skin on the left, hair on the right
  for (std::size_t t = 8; t < 12; ++t) cube.triangles[t].material = 1;
  const auto surface = rebuild(cube);
  ASSERT_TRUE(surface.ok());
  ASSERT_GT(surface->tint_mask.level_count, 0U);
  for (std::size_t t = 0; t < 12; ++t) {
    const glm::u8vec4 weights = texel_at(surface->tint_mask, centre_uv(*surface, t));
    const bool is_left = source_centre_uv(cube, t).x < 0.5F;
    if (t >= 8) {
      EXPECT_EQ(weights.r + weights.g, 0) << t;
    } else {
      EXPECT_EQ(weights.r > 128, is_left) << t;
      EXPECT_EQ(weights.g > 128, !is_left) << t;
    }
  }
}

TEST(AtlasTest, LargeTexturesAreScaledDownWithANote) {
  SourceCharacter cube = test::make_cube();
  cube.materials[0].base_color = make_gradient(256);
  RebuildOptions options;
  options.max_texture_px = 64;
  const auto surface = rebuild(cube, options);
  ASSERT_TRUE(surface.ok());
  EXPECT_EQ(surface->base_color.width_px, 64U);
  ASSERT_FALSE(surface->notes.empty());
}

TEST(AtlasTest, ManyMaterialsFit) {
  SourceCharacter cube = test::make_cube();
  cube.materials[0].base_color = make_gradient(200);
  for (int i = 0; i < 11; ++i) {
    cube.materials.push_back(cube.materials[0]);
    cube.materials.back().factor = {0.05F * static_cast<float>(i), 1, 1, 1};
    cube.triangles[i].material = static_cast<std::uint32_t>(i + 1);
  }
  RebuildOptions options;
  options.max_texture_px = 128;
  const auto surface = rebuild(cube, options);
  ASSERT_TRUE(surface.ok());
  EXPECT_LE(surface->base_color.width_px, 128U);
  for (const glm::vec2& uv : surface->wedge_uv)
    EXPECT_TRUE(uv.x >= 0 && uv.x <= 1 && uv.y >= 0 && uv.y <= 1);
}

}  // namespace
}  // namespace throng::simplify
