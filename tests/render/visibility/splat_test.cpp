#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "render/raster/visibility/visibility_rasterizer.hpp"
#include "support/image_compare.hpp"
#include "throng/render/raster.hpp"

namespace throng::render {
namespace {

constexpr Viewport kViewport{160, 120};

/// Looks along +Y from the origin, a metre is 20 px.
Camera along_y() {
  Camera camera;
  camera.eye_world = {0.0, 0.0, 0.0};
  camera.target_world = {0.0, 1.0, 0.0};
  camera.ortho_height_m = 6.0;
  camera.near_m = 1.0;
  camera.far_m = 100.0;
  return camera;
}

std::uint32_t packed(const glm::vec3& linear) {
  const glm::vec3 root = glm::sqrt(linear) * 1023.0F;
  return static_cast<std::uint32_t>(root.r) | static_cast<std::uint32_t>(root.g) << 10 |
         static_cast<std::uint32_t>(root.b) << 20;
}

Splat splat_at(const glm::vec3& position, float radius_m, const glm::vec3& normal,
               const glm::vec3& color) {
  return {position, radius_m, encode_octahedral(normal), packed(color), 0, kNobody};
}

Picture drawn(std::span<const Splat> splats, unsigned threads = 1,
              const Camera& camera = along_y()) {
  auto rasterizer = make_rasterizer(RasterKind::kVisibility, threads);
  EXPECT_TRUE(rasterizer.ok()) << rasterizer.status();
  Look look;
  look.ground = false;
  FrameGeometry geometry;
  geometry.splats = splats;
  Picture picture;
  const absl::Status status =
      (*rasterizer)->draw(geometry, camera, kViewport, glm::dvec3(0.0), look, picture);
  EXPECT_TRUE(status.ok()) << status;
  return picture;
}

const std::uint8_t* pixel(const Picture& picture, std::uint32_t x, std::uint32_t y) {
  return picture.rgbx.data() + std::size_t{4} * (std::size_t{y} * picture.width_px + x);
}

std::uint32_t changed_pixels(const Picture& picture) {
  const Picture empty = drawn({});
  std::uint32_t changed = 0;
  for (std::size_t i = 0; i < picture.rgbx.size(); i += 4) {
    changed += std::equal(picture.rgbx.begin() + static_cast<std::ptrdiff_t>(i),
                          picture.rgbx.begin() + static_cast<std::ptrdiff_t>(i + 4),
                          empty.rgbx.begin() + static_cast<std::ptrdiff_t>(i))
                   ? 0U
                   : 1U;
  }
  return changed;
}

TEST(SplatTest, DiscHasItsRadiusAndFacesItsNormal) {
  const glm::vec3 red(0.8F, 0.1F, 0.1F);
  const Splat facing[] = {splat_at({0, 10, 0}, 1.0F, {0, -1, 0}, red)};
  // 20 px of radius
  EXPECT_NEAR(changed_pixels(drawn(facing)), 3.1416 * 400, 70);
  const Splat turned[] = {splat_at({0, 10, 0}, 1.0F, {0.866F, -0.5F, 0}, red)};
  EXPECT_NEAR(changed_pixels(drawn(turned)), 3.1416 * 200, 60);
  const Splat away[] = {splat_at({0, 10, 0}, 1.0F, {0, 1, 0}, red)};
  EXPECT_EQ(changed_pixels(drawn(away)), 0U);
  const Splat without_side[] = {splat_at({0, 10, 0}, -1.0F, {0, 1, 0}, red)};
  EXPECT_NEAR(changed_pixels(drawn(without_side)), 3.1416 * 400, 70);
}

TEST(SplatTest, NearerSurfaceWinsWithinADisc) {
  // two discs that cross: left the one is in front, right the other
  const Splat splats[] = {
      splat_at({0, 10, 0}, 1.0F, glm::normalize(glm::vec3(0.6F, -1, 0)), {0.8F, 0.1F, 0.1F}),
      splat_at({0, 10, 0}, 1.0F, glm::normalize(glm::vec3(-0.6F, -1, 0)), {0.1F, 0.1F, 0.8F})};
  const Picture picture = drawn(splats);
  const std::uint8_t *left = pixel(picture, 74, 60), *right = pixel(picture, 86, 60);
  // the first rises towards -X seen from the eye, so it is nearer there
  EXPECT_NE(left[0] > left[2], right[0] > right[2]);
}

TEST(SplatTest, PictureDoesNotDependOnOrderOrThreads) {
  std::mt19937 random(5);
  const auto uniform = [&] { return static_cast<float>(random() >> 8) / 16777216.0F; };
  std::vector<Splat> splats;
  for (int i = 0; i < 3000; ++i) {
    splats.push_back(splat_at({8 * uniform() - 4, 5 + 20 * uniform(), 6 * uniform() - 3},
                              0.3F * uniform(), glm::normalize(glm::vec3(uniform() - 0.5F, -1, 0)),
                              {uniform(), uniform(), uniform()}));
  }
  const Picture one = drawn(splats, 1);
  EXPECT_EQ(one.rgbx, drawn(splats, 2).rgbx);
  EXPECT_EQ(one.rgbx, drawn(splats, 5).rgbx);
  // equal depths are decided by number, and these have none
  std::vector<Splat> backwards(splats.rbegin(), splats.rend());
  EXPECT_EQ(one.rgbx, drawn(backwards, 1).rgbx);
}

TEST(SplatTest, CoveredSurfaceHasNoHoles) {
  // a wall of points 0.1 m apart: discs of half a diagonal cover it
  std::vector<Splat> splats;
  for (int x = -20; x <= 20; ++x) {
    for (int z = -15; z <= 15; ++z) {
      splats.push_back(splat_at({0.1F * static_cast<float>(x), 10, 0.1F * static_cast<float>(z)},
                                0.0708F, {0, -1, 0}, {0.8F, 0.1F, 0.1F}));
    }
  }
  const Picture picture = drawn(splats);
  for (std::uint32_t y = 35; y < 85; ++y) {
    for (std::uint32_t x = 45; x < 115; ++x) {
      const std::uint8_t* p = pixel(picture, x, y);
      ASSERT_GT(p[0], p[2]) << x << ", " << y;
    }
  }
}

TEST(SplatTest, PlacesBeyondThePictureAndBehindTheEyeAreLeftOut) {
  const float huge = 3e38F, nan = std::nanf("");
  const glm::vec3 red(0.8F, 0.1F, 0.1F), front(0, -1, 0);
  std::vector<Splat> splats;
  for (const glm::vec3& p : {glm::vec3(0, -10, 0), glm::vec3(0, 0, 0), glm::vec3(huge, 10, 0),
                             glm::vec3(0, huge, 0), glm::vec3(nan, 10, 0), glm::vec3(0, nan, nan),
                             glm::vec3(-huge, huge, huge), glm::vec3(500, 10, 0)}) {
    splats.push_back(splat_at(p, 0.1F, front, red));
  }
  EXPECT_EQ(changed_pixels(drawn(splats)), 0U);
  Camera perspective = along_y();
  perspective.ortho_height_m = 0.0;
  const Picture picture = drawn(splats, 1, perspective);
  EXPECT_EQ(picture.rgbx, drawn({}, 1, perspective).rgbx);
  // a radius beyond everything covers everything, and one that is no number nothing
  const Splat all[] = {splat_at({0, 10, 0}, huge, front, red)};
  EXPECT_EQ(changed_pixels(drawn(all)), kViewport.width_px * kViewport.height_px);
  const Splat none[] = {splat_at({0, 10, 0}, nan, front, red)};
  EXPECT_EQ(changed_pixels(drawn(none)), 0U);
}

}  // namespace
}  // namespace throng::render
