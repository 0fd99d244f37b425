#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <thread>

#include "render/compute/crowd_fixture.hpp"
#include "render/raster/gl/egl_context.hpp"
#include "render/raster/rasterizer_fixture.hpp"
#include "support/image_compare.hpp"
#include "support/raster_scene.hpp"
#include "throng/render/compute.hpp"
#include "throng/render/device_picture.hpp"
#include "throng/render/raster.hpp"

namespace throng::render {
namespace {

using test::RasterScene;
using ::testing::HasSubstr;

struct Rgb {
  int r, g, b;
};

Rgb at(const Picture& picture, std::uint32_t x, std::uint32_t y) {
  const std::size_t i = std::size_t{4} * (std::size_t{y} * picture.width_px + x);
  return {picture.rgbx[i], picture.rgbx[i + 1], picture.rgbx[i + 2]};
}

/// North at eye height: right is +X, up is +Z, straight ahead is +Y.
Camera camera_north() {
  Camera camera;
  camera.eye_world = {0.0, 0.0, 2.0};
  camera.target_world = {0.0, 10.0, 2.0};
  return camera;
}

/// Only flat light from everywhere, no ground: a white texel becomes the same grey anywhere.
Look flat_look() {
  Look look;
  look.ground = false;
  look.sun_color = glm::vec3(0.0F);
  look.sky_color = look.ground_light = look.horizon_color = glm::vec3(1.0F);
  return look;
}

/// A cast of one member with these texels (rows from the top, r g b a), drawn as they are.
std::shared_ptr<const Cast> cast_of(std::uint32_t width, std::uint32_t height,
                                    std::vector<std::uint8_t> texels,
                                    std::vector<std::uint8_t> mask = {}, std::uint8_t flags = 0) {
  struct Storage {
    std::vector<std::uint8_t> texels, mask, flags;
  };
  auto storage =
      std::make_shared<Storage>(Storage{std::move(texels), std::move(mask), {flags, flags}});
  CastMember member;
  member.character.name = "flat";
  member.character.height_m = 1.0F;
  member.character.base_color = {width, height, 1, storage->texels};
  if (!storage->mask.empty()) member.character.tint_mask = {width, height, 1, storage->mask};
  member.character.triangle_flags = storage->flags;
  member.character.storage = storage;
  auto cast = std::make_shared<Cast>();
  cast->members.push_back(std::move(member));
  return cast;
}

/// Faces the camera that looks north; 2 `half` metres wide, top left corner has uv (0, 0).
void add_wall(RasterScene& scene, const glm::vec3& centre, float half) {
  scene.add_quad(centre + glm::vec3(-half, 0, half), centre + glm::vec3(half, 0, half),
                 centre + glm::vec3(half, 0, -half), centre + glm::vec3(-half, 0, -half));
}

/// The same, seen from its front: corners counter-clockwise from the camera's side.
void add_facing_wall(RasterScene& scene, const glm::vec3& centre, float half) {
  const glm::vec3 normal(0, -1, 0);
  const auto a = scene.add_vertex(centre + glm::vec3(-half, 0, half), normal, {0, 0});
  const auto b = scene.add_vertex(centre + glm::vec3(half, 0, half), normal, {1, 0});
  const auto c = scene.add_vertex(centre + glm::vec3(half, 0, -half), normal, {1, 1});
  const auto d = scene.add_vertex(centre + glm::vec3(-half, 0, -half), normal, {0, 1});
  scene.add_triangle(a, d, c);
  scene.add_triangle(a, c, b);
}

const std::vector<std::uint8_t> kRedWhite = {255, 0, 0, 255, 255, 255, 255, 255};

class RasterTest : public test::RasterizerFixture {
 protected:
  Picture draw(const RasterScene& scene, const Camera& camera, const Viewport& viewport,
               const Look& look, const glm::dvec3& origin = glm::dvec3(0.0)) {
    Picture picture;
    const auto status =
        rasterizer_->draw(scene.geometry(), camera, viewport, origin, look, picture);
    EXPECT_TRUE(status.ok()) << status;
    EXPECT_EQ(picture.rgbx.size(), std::size_t{4} * viewport.width_px * viewport.height_px);
    return picture;
  }
};

TEST_P(RasterTest, InfoNamesTheDevice) {
  EXPECT_FALSE(rasterizer_->info().name.empty());
  EXPECT_FALSE(rasterizer_->info().detail.empty());
}

TEST_P(RasterTest, ViewportOutsideLimitsIsRejected) {
  Picture picture;
  for (const Viewport viewport :
       {Viewport{0, 10}, Viewport{10, 0}, Viewport{16385, 10}, Viewport{10, 16385}}) {
    const auto status = rasterizer_->draw({}, camera_north(), viewport, {0, 0, 0}, Look{}, picture);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
    EXPECT_THAT(std::string(status.message()), HasSubstr("must be 1 to 16384"));
  }
}

TEST_P(RasterTest, EmptyGeometryGivesTheEmptyScene) {
  const Picture picture = draw({}, camera_north(), {64, 64}, Look{});
  const Rgb sky = at(picture, 32, 4), ground = at(picture, 32, 60);
  EXPECT_GT(sky.b, sky.r);                       // blue above
  EXPECT_LT(std::abs(ground.r - ground.b), 24);  // grey below
  EXPECT_GT(sky.b, ground.b);
  for (std::size_t i = 3; i < picture.rgbx.size(); i += 4) ASSERT_EQ(picture.rgbx[i], 255);
}

TEST_P(RasterTest, GeometryBeforeUploadIsAFailedPrecondition) {
  RasterScene scene;
  scene.begin_instance({0, 5, -2});
  add_facing_wall(scene, {0, 5, 0}, 1.0F);
  Picture picture;
  EXPECT_EQ(rasterizer_->draw(scene.geometry(), camera_north(), {8, 8}, {0, 0, 0}, Look{}, picture)
                .code(),
            absl::StatusCode::kFailedPrecondition);
}

TEST_P(RasterTest, InconsistentGeometryIsRejected) {
  ASSERT_TRUE(rasterizer_->upload(cast_of(2, 1, kRedWhite)).ok());
  RasterScene good;
  good.begin_instance({0, 5, -2});
  add_facing_wall(good, {0, 5, 0}, 1.0F);
  Picture picture;
  const auto code = [&](const FrameGeometry& geometry) {
    return rasterizer_->draw(geometry, camera_north(), {8, 8}, {0, 0, 0}, Look{}, picture).code();
  };
  FrameGeometry geometry = good.geometry();
  geometry.indices = geometry.indices.first(5);
  EXPECT_EQ(code(geometry), absl::StatusCode::kInvalidArgument);
  geometry = good.geometry();
  geometry.vertices = geometry.vertices.first(3);
  EXPECT_EQ(code(geometry), absl::StatusCode::kInvalidArgument);
  geometry = good.geometry();
  geometry.triangle_offset = geometry.triangle_offset.first(1);
  EXPECT_EQ(code(geometry), absl::StatusCode::kInvalidArgument);
  RasterScene unknown = good;
  unknown.instances[0].character = 1;
  EXPECT_EQ(code(unknown.geometry()), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code(good.geometry()), absl::StatusCode::kOk);
}

TEST_P(RasterTest, UploadRejectsEmptyCast) {
  EXPECT_EQ(rasterizer_->upload(nullptr).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(rasterizer_->upload(std::make_shared<Cast>()).code(),
            absl::StatusCode::kInvalidArgument);
}

TEST_P(RasterTest, NearerTriangleHidesFartherOneInEitherOrder) {
  ASSERT_TRUE(rasterizer_->upload(cast_of(2, 1, kRedWhite)).ok());
  for (const bool near_first : {false, true}) {
    RasterScene scene;
    scene.begin_instance({0, 5, -2});
    // the near one shows the white half of the texture only, the far one the red half
    const auto add = [&](float distance, float u) {
      const glm::vec3 normal(0, -1, 0);
      const auto a = scene.add_vertex({-9, distance, 9}, normal, {u, 0}),
                 b = scene.add_vertex({-9, distance, -9}, normal, {u, 0});
      const auto c = scene.add_vertex({9, distance, -9}, normal, {u, 0});
      scene.add_triangle(a, b, c);
    };
    if (near_first) add(5.0F, 1.0F);
    add(5.01F, 0.0F);
    if (!near_first) add(5.0F, 1.0F);
    const Rgb pixel = at(draw(scene, camera_north(), {32, 32}, flat_look()), 8, 24);
    EXPECT_GT(pixel.g, 150) << "near first: " << near_first;
  }
}

TEST_P(RasterTest, NearPlaneCutsWhatIsBehindTheEye) {
  ASSERT_TRUE(rasterizer_->upload(cast_of(2, 1, kRedWhite)).ok());
  RasterScene scene;
  scene.begin_instance({0, -5, -2});
  add_facing_wall(scene, {0, -5, 0}, 50.0F);     // behind
  add_facing_wall(scene, {0, 0.05F, 0}, 50.0F);  // nearer than the near plane
  const Picture with = draw(scene, camera_north(), {32, 32}, flat_look());
  const Picture without = draw({}, camera_north(), {32, 32}, flat_look());
  EXPECT_EQ(with.rgbx, without.rgbx);
}

TEST_P(RasterTest, PointsLandWhereTheMatrixPutsThem) {
  ASSERT_TRUE(rasterizer_->upload(cast_of(2, 1, {255, 0, 0, 255, 255, 0, 0, 255})).ok());
  Camera oblique;
  oblique.eye_world = {3.0, -8.0, 6.0};
  oblique.target_world = {0.0, 0.0, 1.0};
  Camera orthographic = oblique;
  orthographic.ortho_height_m = 12.0;
  const Viewport viewport{200, 120};
  for (const Camera& camera : {oblique, orthographic}) {
    for (const glm::dvec3 place :
         {glm::dvec3(0, 0, 1), glm::dvec3(2, 1, 3), glm::dvec3(-3, 2, 0)}) {
      RasterScene scene;
      const glm::vec3 centre(place - camera.eye_world);
      scene.begin_instance(centre);
      test::add_bone(scene, centre, 0.0F, {0, 0, -0.001F}, {0, 0, 0.001F}, 0.3F, 0.3F,
                     test::Region::kSkin, 12);
      const Picture picture = draw(scene, camera, viewport, flat_look());
      double x_sum = 0, y_sum = 0, count = 0;
      for (std::uint32_t y = 0; y < viewport.height_px; ++y) {
        for (std::uint32_t x = 0; x < viewport.width_px; ++x) {
          const Rgb pixel = at(picture, x, y);
          if (pixel.r <= 2 * pixel.b) continue;
          x_sum += x + 0.5;
          y_sum += y + 0.5;
          ++count;
        }
      }
      ASSERT_GT(count, 4);
      const glm::vec4 clip = clip_from_relative(camera, viewport) * glm::vec4(centre, 1.0F);
      EXPECT_GT(clip.z, 0.0F);
      EXPECT_LT(clip.z, clip.w);
      EXPECT_NEAR(x_sum / count, (0.5 + 0.5 * clip.x / clip.w) * viewport.width_px, 0.7);
      EXPECT_NEAR(y_sum / count, (0.5 - 0.5 * clip.y / clip.w) * viewport.height_px, 0.7);
    }
  }
}

TEST_P(RasterTest, TexturesAreTheRightWayUp) {
  // red top left, green top right, blue bottom left, white bottom right
  ASSERT_TRUE(rasterizer_
                  ->upload(cast_of(
                      2, 2, {255, 0, 0, 255, 0, 255, 0, 255, 0, 0, 255, 255, 255, 255, 255, 255}))
                  .ok());
  RasterScene scene;
  scene.begin_instance({0, 5, -2});
  add_facing_wall(scene, {0, 5, 0}, 1.0F);
  const Picture picture = draw(scene, camera_north(), {64, 64}, flat_look());
  const std::uint32_t low = 21, high = 42;  // the wall covers about a half of the picture's sides
  const Rgb top_left = at(picture, low, low), top_right = at(picture, high, low);
  const Rgb bottom_left = at(picture, low, high), bottom_right = at(picture, high, high);
  EXPECT_GT(top_left.r, top_left.g + 60);
  EXPECT_GT(top_right.g, top_right.r + 60);
  EXPECT_GT(bottom_left.b, bottom_left.r + 60);
  EXPECT_GT(std::min({bottom_right.r, bottom_right.g, bottom_right.b}), 150);
}

TEST_P(RasterTest, TintMultipliesBaseColourWhereTheMaskSaysSo) {
  // left half: plain white; right half: white under the mask of the top
  ASSERT_TRUE(rasterizer_
                  ->upload(cast_of(2, 1, {255, 255, 255, 255, 255, 255, 255, 255},
                                   {0, 0, 0, 0, 0, 0, 255, 0}))
                  .ok());
  const auto halves = [&](std::uint32_t seed) {
    RasterScene scene;
    scene.begin_instance({0, 5, -2}, 0, seed);
    add_facing_wall(scene, {0, 5, 0}, 1.0F);
    const Picture picture = draw(scene, camera_north(), {64, 64}, flat_look());
    return std::pair{at(picture, 20, 32), at(picture, 44, 32)};
  };
  const auto [plain, tinted] = halves(1);
  EXPECT_LT(std::abs(plain.r - plain.b), 8);
  bool any_other = false;
  for (std::uint32_t seed = 2; seed < 8; ++seed) {
    const auto [other_plain, other_tinted] = halves(seed);
    EXPECT_EQ(other_plain.r, plain.r);
    any_other |= std::abs(other_tinted.r - tinted.r) + std::abs(other_tinted.b - tinted.b) > 20;
  }
  EXPECT_TRUE(any_other);
}

TEST_P(RasterTest, TransparentTexelsAreHolesWhereCutOutIsAsked) {
  const std::vector<std::uint8_t> half = {255, 0, 0, 255, 255, 0, 0, 0};
  for (const bool cutout : {false, true}) {
    ASSERT_TRUE(
        rasterizer_
            ->upload(cast_of(2, 1, half, {}, cutout ? kTriangleAlphaCutout : std::uint8_t{0}))
            .ok());
    RasterScene scene;
    scene.begin_instance({0, 5, -2});
    add_facing_wall(scene, {0, 5, 0}, 1.0F);
    const Picture picture = draw(scene, camera_north(), {64, 64}, flat_look());
    const Rgb solid = at(picture, 20, 32), hole = at(picture, 44, 32);
    EXPECT_GT(solid.r, solid.b + 60);
    EXPECT_EQ(hole.r > hole.b + 60, !cutout);
  }
}

TEST_P(RasterTest, BackFacesAreSeenOnlyInDoubleSidedCasts) {
  for (const bool double_sided : {false, true}) {
    ASSERT_TRUE(rasterizer_
                    ->upload(cast_of(2, 1, {255, 0, 0, 255, 255, 0, 0, 255}, {},
                                     double_sided ? kTriangleDoubleSided : std::uint8_t{0}))
                    .ok());
    RasterScene scene;
    scene.begin_instance({0, 5, -2});
    add_wall(scene, {0, 5, 0}, 1.0F);
    const Rgb pixel = at(draw(scene, camera_north(), {64, 64}, flat_look()), 32, 32);
    EXPECT_EQ(pixel.r > pixel.b + 60, double_sided);
  }
}

TEST_P(RasterTest, ChannelsAreColouredOnTheViridisMap) {
  ASSERT_TRUE(rasterizer_->upload(cast_of(2, 1, {255, 255, 255, 255, 255, 255, 255, 255})).ok());
  Look look = flat_look();
  look.color_by_channel = true;
  look.channel_low = 10.0F;
  look.channel_high = 20.0F;
  const auto color = [&](float value) {
    RasterScene scene;
    scene.begin_instance({0, 5, -2}, 0, 3, value);
    add_facing_wall(scene, {0, 5, 0}, 1.0F);
    return at(draw(scene, camera_north(), {64, 64}, look), 32, 32);
  };
  const Rgb low = color(10.0F), middle = color(15.0F), high = color(20.0F);
  const Rgb below = color(-5.0F), none = color(std::nanf(""));
  EXPECT_GT(low.b, low.g + 40);                      // violet
  EXPECT_GT(middle.g, middle.r + 60);                // green-blue
  EXPECT_GT(std::min(high.r, high.g), high.b + 60);  // yellow
  EXPECT_EQ(below.r, low.r);
  EXPECT_LT(std::abs(none.r - none.b), 16);  // grey
}

TEST_P(RasterTest, AnySizeWorksAndComingBackGivesTheSameBytes) {
  ASSERT_TRUE(rasterizer_->upload(test::mannequin_cast()).ok());
  Camera camera;
  camera.eye_world = {0, -6, 3};
  camera.target_world = {0, 0, 1};
  const RasterScene scene = test::mannequin_crowd(camera, 9, 1.5F);
  const Picture first = draw(scene, camera, {96, 64}, Look{});
  for (const Viewport viewport :
       {Viewport{1, 1}, Viewport{3, 7}, Viewport{333, 1}, Viewport{1, 201}, Viewport{101, 67},
        Viewport{64, 96}, Viewport{200, 100}}) {
    draw(scene, camera, viewport, Look{});
  }
  EXPECT_EQ(draw(scene, camera, {96, 64}, Look{}).rgbx, first.rgbx);
}

TEST_P(RasterTest, ThreadsDoNotChangeTheBytes) {
  Camera camera;
  camera.eye_world = {0, -6, 3};
  camera.target_world = {0, 0, 1};
  const RasterScene scene = test::mannequin_crowd(camera, 25, 1.5F);
  std::vector<std::uint8_t> expected;
  for (const unsigned threads : {1u, 2u, 5u}) {
    auto rasterizer = make_rasterizer(GetParam(), threads);
    ASSERT_TRUE(rasterizer.ok()) << rasterizer.status();
    ASSERT_TRUE((*rasterizer)->upload(test::mannequin_cast()).ok());
    Picture picture;
    ASSERT_TRUE(
        (*rasterizer)->draw(scene.geometry(), camera, {160, 120}, {0, 0, 0}, Look{}, picture).ok());
    if (expected.empty()) expected = picture.rgbx;
    EXPECT_EQ(picture.rgbx, expected) << threads << " threads";
  }
}

TEST_P(RasterTest, PictureInTilesHasNoSeams) {
  ASSERT_TRUE(rasterizer_->upload(cast_of(2, 1, {255, 0, 0, 255, 255, 0, 0, 255})).ok());
  // wider than one target; the cuts lie beside the ground's lines and the wall's ends
  Camera camera = camera_north();
  camera.ortho_height_m = 0.02;
  camera.target_world = {0.0, 10.0, 1.0};
  RasterScene scene;
  const glm::vec3 across = glm::vec3(0.0F, 10.0F, -1.0F);
  scene.begin_instance(across);
  add_facing_wall(scene, across, 1.0F);
  Look look;
  look.shadows = false;
  const Picture picture = draw(scene, camera, {9000, 12}, look);
  for (std::uint32_t x = 2048; x < picture.width_px; x += 2048) {
    for (std::uint32_t y = 0; y < picture.height_px; ++y) {
      const Rgb a = at(picture, x - 1, y), b = at(picture, x, y);
      ASSERT_LE(std::abs(a.r - b.r) + std::abs(a.g - b.g) + std::abs(a.b - b.b), 3)
          << "column " << x << ", row " << y;
    }
  }
  // the wall is where it would be in one piece: 2 of 15 metres wide, in the middle
  std::uint32_t covered = 0;
  const Picture empty = draw({}, camera, {9000, 12}, look);
  for (std::uint32_t x = 0; x < picture.width_px; ++x)
    covered += std::abs(at(picture, x, 6).r - at(empty, x, 6).r) > 8;
  EXPECT_NEAR(covered, 1200, 16);
}

TEST_P(RasterTest, ShadowDarkensTheGroundAtTheFeetOnly) {
  ASSERT_TRUE(rasterizer_->upload(test::mannequin_cast()).ok());
  Camera camera;
  camera.eye_world = {0, -6, 4};
  camera.target_world = {0, 0, 0.5};
  RasterScene scene;
  test::add_mannequin(scene, glm::vec3(-camera.eye_world), 0.5F, 0.2F, 5);
  Look look;
  const Picture with = draw(scene, camera, {160, 120}, look);
  look.shadows = false;
  const Picture without = draw(scene, camera, {160, 120}, look);
  std::size_t darker = 0, brighter = 0;
  for (std::size_t i = 0; i < with.rgbx.size(); i += 4) {
    darker += with.rgbx[i] + 15 < without.rgbx[i];
    brighter += with.rgbx[i] > without.rgbx[i] + 15;
  }
  EXPECT_GT(darker, 150u);
  EXPECT_LT(darker, 3000u);
  EXPECT_LT(brighter, darker / 10);
  EXPECT_EQ(at(with, 80, 1).r, at(without, 80, 1).r);
}

TEST_P(RasterTest, FarFromTheOriginNothingChanges) {
  ASSERT_TRUE(rasterizer_->upload(test::mannequin_cast()).ok());
  Camera camera;
  camera.eye_world = {1, -6, 3};
  camera.target_world = {0, 0, 1};
  const RasterScene scene = test::mannequin_crowd(camera, 9, 1.5F);
  const Picture near = draw(scene, camera, {96, 64}, Look{});
  const glm::dvec3 origin(4.0e6, -5.0e6, 1000.0);
  camera.eye_world += origin;
  camera.target_world += origin;
  EXPECT_EQ(draw(scene, camera, {96, 64}, Look{}, origin).rgbx, near.rgbx);
}

TEST_P(RasterTest, CameraUnderTheGroundSeesAgentsAndNoSkyBelow) {
  ASSERT_TRUE(rasterizer_->upload(test::mannequin_cast()).ok());
  Camera camera;
  camera.eye_world = {0, -6, -2};
  camera.target_world = {0, 0, 1};
  const RasterScene scene = test::mannequin_crowd(camera, 9, 1.5F);
  const Picture picture = draw(scene, camera, {96, 64}, Look{});
  const Picture empty = draw({}, camera, {96, 64}, Look{});
  EXPECT_GT(test::compare_images(picture.rgbx, empty.rgbx).share_over_8, 0.02);
  EXPECT_LT(at(empty, 48, 2).r, 110);  // the plane from below is dim
}

TEST_P(RasterTest, TwoRasterizersTakeTurnsOnOneThread) {
  auto other = make_rasterizer(GetParam(), 1);
  ASSERT_TRUE(other.ok()) << other.status();
  ASSERT_TRUE((*other)->upload(cast_of(2, 1, kRedWhite)).ok());
  ASSERT_TRUE(rasterizer_->upload(test::mannequin_cast()).ok());
  const Picture before = draw({}, camera_north(), {40, 30}, Look{});
  Picture picture;
  ASSERT_TRUE((*other)->draw({}, camera_north(), {40, 30}, {0, 0, 0}, Look{}, picture).ok());
  EXPECT_EQ(picture.rgbx, before.rgbx);
  other->reset();
  EXPECT_EQ(draw({}, camera_north(), {40, 30}, Look{}).rgbx, before.rgbx);
}

TEST_P(RasterTest, CoarseLevelsAreDrawnInTheTonesOfTheirCorners) {
  // green on the left, blue on the right, and there it is a top to be dyed; the order is that of
  // add_facing_wall
  const std::uint32_t left = pack_corner_tone({0, 0.5F, 0}, glm::vec4(0.0F));
  const std::uint32_t right = pack_corner_tone({0, 0, 0.5F}, {0, 0, 1, 0});
  const ToneBand bands[] = {{4, 0}};
  const std::uint32_t tones[] = {left, left, right, left, right, right};
  auto cast = std::make_shared<Cast>(*cast_of(2, 1, kRedWhite));
  cast->members[0].character.corner_tones = {bands, tones};
  ASSERT_TRUE(rasterizer_->upload(cast).ok());
  RasterScene scene;
  scene.begin_instance({9, 5, -2});  // so that the toned triangles aren't the frame's first
  add_facing_wall(scene, {9, 5, 0}, 1.0F);
  scene.begin_instance({0, 5, -2});
  add_facing_wall(scene, {0, 5, 0}, 1.0F);
  FrameGeometry geometry = scene.geometry();
  std::vector<VisibleInstance> instances(geometry.instances.begin(), geometry.instances.end());
  geometry.instances = instances;
  Picture picture;
  const auto draw_with = [&](std::uint32_t count) {
    instances[0].vertex_count = 5;
    instances[1].vertex_count = count;
    const auto status = rasterizer_->draw(geometry, camera_north(), {96, 96}, glm::dvec3(0.0),
                                          flat_look(), picture);
    EXPECT_TRUE(status.ok()) << status;
  };
  draw_with(4);
  for (const std::uint32_t y : {40U, 48U, 56U}) {  // both triangles
    const Rgb west = at(picture, 34, y), middle = at(picture, 48, y), east = at(picture, 62, y);
    EXPECT_GT(west.g, west.b + 40) << y;
    EXPECT_GT(east.b, east.g + 10) << y;
    EXPECT_GT(west.g, middle.g) << y;  // in between, what is between
    EXPECT_GT(middle.g, east.g) << y;
    EXPECT_LT(west.r, 40) << y;
  }
  draw_with(5);  // texture
  EXPECT_GT(at(picture, 34, 48).r, 100);
}

INSTANTIATE_TEST_SUITE_P(Kinds, RasterTest,
                         ::testing::Values(RasterKind::kGl, RasterKind::kVisibility),
                         test::kind_name);

/// A wall that is lit so much, in a picture of `width` pixels.
absl::Status draw_wall(Rasterizer& rasterizer, float light, std::uint32_t width, Picture& picture) {
  RasterScene scene;
  scene.begin_instance({0, 5, -2});
  add_facing_wall(scene, {0, 5, 0}, 1.0F);
  Look look = flat_look();
  look.sky_color = look.ground_light = glm::vec3(light);
  return rasterizer.draw(scene.geometry(), camera_north(), {width, 96}, glm::dvec3(0.0), look,
                         picture);
}

TEST(GlReadBackTest, PicturesThatStayAreFetchedByOtherThreadsAndOutliveTheRasterizer) {
  ASSERT_EQ(setenv("THRONG_GL_SAMPLES", "4", 1), 0);  // as on hardware
  auto made = make_rasterizer(RasterKind::kGl, 2);
  unsetenv("THRONG_GL_SAMPLES");
  if (absl::IsUnavailable(made.status())) GTEST_SKIP() << made.status().message();
  ASSERT_TRUE(made.ok()) << made.status();
  std::unique_ptr<Rasterizer> rasterizer = *std::move(made);
  ASSERT_TRUE(rasterizer->upload(cast_of(2, 1, kRedWhite)).ok());
  {  // before any thread with a context has waited for one
    Picture first;
    first.may_stay = true;
    ASSERT_TRUE(draw_wall(*rasterizer, 0.5F, 96, first).ok());
    ASSERT_NE(first.on_device, nullptr);
    std::jthread other([&] { EXPECT_TRUE(first.on_device->fetch(first.rgbx).ok()); });
  }
  // more frames than there are buffers at the first; they grow, too
  for (int round = 0; round < 3; ++round) {
    Picture expected[3], staying[3];
    for (int i = 0; i < 3; ++i) {
      const float light = 0.3F + 0.2F * static_cast<float>(i);
      const std::uint32_t width = round == 2 ? 160 : 96;
      ASSERT_TRUE(draw_wall(*rasterizer, light, width, expected[i]).ok());
      staying[i].may_stay = true;
      ASSERT_TRUE(draw_wall(*rasterizer, light, width, staying[i]).ok());
      ASSERT_NE(staying[i].on_device, nullptr);
      EXPECT_TRUE(staying[i].rgbx.empty());
    }
    if (round == 2) rasterizer.reset();
    std::jthread other([&] {
      for (int i = 0; i < 3; ++i) {
        const absl::Status status = staying[i].on_device->fetch(staying[i].rgbx);
        EXPECT_TRUE(status.ok()) << status;
        EXPECT_EQ(staying[i].rgbx, expected[i].rgbx) << round << ", " << i;
        std::vector<std::uint8_t> jpeg;
        EXPECT_TRUE(absl::IsUnimplemented(staying[i].on_device->encode_jpeg(80, jpeg)));
      }
    });
  }
}

/// What gl draws from the memory of a CUDA device is what it draws from the host's.
TEST(CudaInteropTest, VerticesOfADeviceAreDrawnAsThoseOfTheHost) {
  auto backend = make_backend(BackendKind::kCuda);
  if (!backend.ok()) GTEST_SKIP() << backend.status().message();
  auto rasterizer = make_rasterizer(RasterKind::kGl, 2, BackendKind::kCuda);
  if (!rasterizer.ok()) GTEST_SKIP() << rasterizer.status().message();
  if (!(*rasterizer)->takes_device()) GTEST_SKIP() << (*rasterizer)->info().detail;
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 60, 12.0);
  ASSERT_TRUE((*backend)->upload(cast).ok());
  ASSERT_TRUE((*rasterizer)->upload(cast).ok());
  auto view = (*backend)->make_view();
  ASSERT_TRUE(view.ok()) << view.status();
  const Bracket bracket = crowd->bracket(50'000);
  const auto older = (*backend)->upload(bracket.older), newer = (*backend)->upload(bracket.newer);
  ASSERT_TRUE(older.ok() && newer.ok());
  const auto instances = (*backend)->advance(**older, **newer, 50'000, crowd->settings(), -1, {});
  ASSERT_TRUE(instances.ok()) << instances.status();
  Camera camera;
  camera.eye_world = {0.0, -14.0, 5.0};
  camera.target_world = {0.0, 0.0, 1.0};
  Picture pictures[2];
  for (const bool on_device : {false, true}) {
    ASSERT_TRUE((*backend)->cull(**view, *instances, camera, {320, 200}).ok());
    ASSERT_TRUE((*backend)->select(**view, {.vertex_budget = 20'000, .on_device = on_device}).ok());
    ASSERT_TRUE((*backend)->allocate(**view).ok());
    ASSERT_TRUE((*backend)->generate(**view).ok());
    const FrameGeometry geometry = (*backend)->geometry(**view);
    EXPECT_EQ(geometry.on_device != nullptr, on_device);
    const absl::Status status = (*rasterizer)
                                    ->draw(geometry, camera, {320, 200}, glm::dvec3(0.0), Look(),
                                           pictures[on_device ? 1 : 0]);
    ASSERT_TRUE(status.ok()) << status;
  }
  EXPECT_EQ(pictures[0].rgbx, pictures[1].rgbx);
}

TEST(MakeRasterizerTest, DescribesEveryPlatformTried) { EXPECT_FALSE(describe_egl().empty()); }

/// A driver without its graphics part leaves EGL without a vendor, as in a container that is given
/// nothing but CUDA.
TEST(MakeRasterizerDeathTest, SaysWhatEglWithoutGraphicsLacks) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");  // a process that has not loaded EGL yet
  const auto tell = [] {
    setenv("__EGL_VENDOR_LIBRARY_FILENAMES", "/nonexistent", 1);
    const auto gl = make_rasterizer(RasterKind::kGl, 1);
    std::fprintf(stderr, "%s", gl.status().ToString().c_str());
    // and what is drawn with instead says so
    const auto other = make_rasterizer(RasterKind::kAuto, 1);
    if (!other.ok()) std::_Exit(2);
    std::fprintf(stderr, "\n%s", (*other)->info().detail.c_str());
    std::_Exit(gl.ok() ? 1 : 0);
  };
  EXPECT_EXIT(tell(), testing::ExitedWithCode(0),
              "UNAVAILABLE.*NVIDIA_DRIVER_CAPABILITIES.*\n.*auto: .*NVIDIA_DRIVER_CAPABILITIES");
}

TEST(EglContextTest, SaysWhyItIsNotOnTheCudaDeviceThatWasAskedFor) {
  auto any = gl::EglContext::make();
  if (!any.ok()) GTEST_SKIP() << any.status().message();
  constexpr int kNoDevice = 77;
  const auto context = gl::EglContext::make(kNoDevice);
  ASSERT_TRUE(context.ok()) << context.status();
  EXPECT_THAT((*context)->passed_by(), testing::HasSubstr("no EGL device is CUDA device 77"));
  EXPECT_THAT((*context)->passed_by(), testing::HasSubstr("NVIDIA_DRIVER_CAPABILITIES"));
  EXPECT_THAT((*any)->passed_by(), testing::Not(testing::HasSubstr("CUDA")));
}

}  // namespace
}  // namespace throng::render
