// Walls beside a crowd, through all stages of a frame.
#include <gtest/gtest.h>

#include <cstdlib>

#include "render/compute/frame_fixture.hpp"
#include "throng/render/environment.hpp"
#include "throng/render/frame.hpp"

namespace throng::render {
namespace {

/// Ten metres square around the origin, with an obstacle of 2 m east of the middle.
constexpr char kRoom[] = "POLYGON ((-5 -5, 5 -5, 5 5, -5 5, -5 -5), (2 -1, 4 -1, 4 1, 2 1, 2 -1))";

class SurroundingsTest : public testing::TestWithParam<RasterKind> {
 protected:
  void SetUp() override {
    auto made = FramePipeline::make(cast_, {.raster = GetParam(), .threads = 2});
    if (!made.ok()) GTEST_SKIP() << made.status().message();
    pipeline_ = *std::move(made);
    view_.viewport = {120, 120};
    view_.camera.eye_world = {0, 0, 30};
    view_.camera.target_world = {0, 0, 0};
    view_.camera.ortho_height_m = 12.0;  // 10 px a metre
    view_.look.shadows = false;
  }

  std::unique_ptr<Crowd> crowd(const char* wkt) const {
    auto crowd = test::standing_crowd(cast_, {{0, 0, 0}, {-3, 3, 0}});
    if (wkt != nullptr) crowd->set_environment(make_environment(wkt, {}).value());
    return crowd;
  }

  Picture draw(const Crowd& crowd) {
    Picture picture;
    const absl::Status status = pipeline_->render(crowd, 0, view_, picture, stats_);
    EXPECT_TRUE(status.ok()) << status;
    return picture;
  }

  /// Of the pixel over a point of the ground.
  static int red(const Picture& picture, double x_m, double y_m) {
    const int x = static_cast<int>(60 + 10 * x_m), y = static_cast<int>(60 - 10 * y_m);
    return picture.rgbx[4 * (static_cast<std::size_t>(y) * 120 + static_cast<std::size_t>(x))];
  }

  /// Pixels that shadows make darker, but where agents are seen.
  int darkened(const Crowd& crowd, const Crowd& nobody) {
    view_.look.shadows = false;
    const Picture bare = draw(crowd), empty = draw(nobody);
    view_.look.shadows = true;
    const Picture shaded = draw(crowd), alone = draw(nobody);
    int count = 0;
    for (std::size_t i = 0; i < shaded.rgbx.size(); i += 4) {
      const bool is_agent = bare.rgbx[i] != empty.rgbx[i] || bare.rgbx[i + 1] != empty.rgbx[i + 1];
      count += !is_agent && alone.rgbx[i] - shaded.rgbx[i] > 10 ? 1 : 0;
    }
    return count;
  }

  std::shared_ptr<const Cast> cast_ = test::tiny_cast();
  std::unique_ptr<FramePipeline> pipeline_;
  ViewSettings view_;
  FrameStats stats_;
};

INSTANTIATE_TEST_SUITE_P(Rasterizers, SurroundingsTest,
                         testing::Values(RasterKind::kVisibility, RasterKind::kGl),
                         [](const auto& info) {
                           return info.param == RasterKind::kGl ? "Gl" : "Visibility";
                         });

TEST_P(SurroundingsTest, StandWhereTheyAreAndCountAsNobody) {
  const Picture open = draw(*crowd(nullptr));
  EXPECT_EQ(stats_.counters.visible, 2U);
  const std::uint64_t triangles = stats_.counters.triangles;
  const Picture room = draw(*crowd(kRoom));
  EXPECT_EQ(stats_.counters.visible, 2U);
  EXPECT_EQ(stats_.counters.agents, 2U);
  EXPECT_GT(stats_.counters.triangles, triangles);
  for (const auto& [x_m, y_m] : {std::pair{3.0, 0.0}, {5.1, 2.0}, {-2.0, -5.1}, {-5.1, 5.1}}) {
    EXPECT_GT(std::abs(red(room, x_m, y_m) - red(open, x_m, y_m)), 8) << x_m << ' ' << y_m;
  }
  for (const auto& [x_m, y_m] : {std::pair{1.5, 0.0}, {4.7, 2.0}, {5.6, 5.6}, {0.0, 0.0}}) {
    EXPECT_LE(std::abs(red(room, x_m, y_m) - red(open, x_m, y_m)), 1) << x_m << ' ' << y_m;
  }
}

TEST_P(SurroundingsTest, EveryCrowdHasItsOwn) {
  const auto room = crowd(kRoom), open = crowd(nullptr),
             hall = crowd("POLYGON ((-4 -4, 4 -4, 4 4, -4 4, -4 -4))");
  const Picture first = draw(*room);
  const Picture other = draw(*hall);
  EXPECT_NE(first.rgbx, other.rgbx);
  EXPECT_EQ(draw(*room).rgbx, first.rgbx);
  EXPECT_EQ(draw(*hall).rgbx, other.rgbx);
  const Picture none = draw(*open);
  open->set_environment(room->environment());
  EXPECT_EQ(draw(*open).rgbx, first.rgbx);
  open->set_environment(nullptr);
  EXPECT_EQ(draw(*open).rgbx, none.rgbx);
}

TEST_P(SurroundingsTest, HideWhoStandsBehindThem) {
  view_.camera = {.eye_world = {0, -20, 0.8}, .target_world = {0, 0, 0.8}};
  view_.camera.fov_y_rad = 0.3;
  const auto crowd = test::standing_crowd(cast_, {{0, 0, 0}});
  const Picture seen = draw(*crowd);
  crowd->set_environment(
      make_environment("POLYGON ((-5 -5, 5 -5, 5 5, -5 5, -5 -5))", {}, {.wall_height_m = 3})
          .value());
  const Picture hidden = draw(*crowd);
  // the same wall with nobody behind it
  const auto nobody = test::standing_crowd(cast_, {{0, 100, 0}});
  nobody->set_environment(crowd->environment());
  EXPECT_NE(seen.rgbx, hidden.rgbx);
  EXPECT_EQ(draw(*nobody).rgbx, hidden.rgbx);
}

TEST_P(SurroundingsTest, CastShadowsFromBesideAndBehindTheEye) {
  // along a wall that begins behind the eye; its shadow falls to the side that the sun is not on
  view_.look.sun_direction_world = {-0.6, 0.0, 0.8};
  view_.camera = {.eye_world = {1.0, -4.0, 1.6}, .target_world = {1.0, 4.0, 0.0}};
  const auto room = test::standing_crowd(cast_, {{0, 100, 0}});
  room->set_environment(make_environment("POLYGON ((0 -5, 2 -5, 2 5, 0 5, 0 -5))", {}).value());
  const Picture bare = draw(*room);
  view_.look.shadows = true;
  const Picture shaded = draw(*room);
  // the ground at the foot of the western wall, low in the picture: ahead of the eye by 1 to 3 m
  int darker = 0;
  for (std::size_t y = 90; y < 120; ++y) {
    for (std::size_t x = 0; x < 120; ++x) {
      darker += bare.rgbx[4 * (y * 120 + x)] - shaded.rgbx[4 * (y * 120 + x)] > 20 ? 1 : 0;
    }
  }
  EXPECT_GT(darker, 300);
}

TEST_P(SurroundingsTest, WallsShowTheShadowsOfWhoStandsBeforeThem) {
  // the sun comes low over the agent to the wall's western face, which fills most of the picture
  view_.look.sun_direction_world = {-0.95, 0.0, 0.3};
  view_.camera = {.eye_world = {-2.0, -3.0, 0.7}, .target_world = {1.0, 0.6, 0.7}};
  view_.camera.fov_y_rad = 0.4;
  const auto stands = [&](double x_m, double y_m) {
    auto crowd = test::standing_crowd(cast_, {{x_m, y_m, 0}});
    crowd->set_environment(
        make_environment("POLYGON ((-9 -9, 9 -9, 9 9, -9 9, -9 -9), (1 -4, 3 -4, 3 4, 1 4, 1 -4))",
                         {}, {.wall_height_m = 3})
            .value());
    return crowd;
  };
  const auto nobody = stands(0, 100);
  EXPECT_GT(darkened(*stands(-1.0, 0.6), *nobody), 150);
  EXPECT_EQ(darkened(*stands(8.0, 0.6), *nobody), 0) << "behind the wall";
  view_.look.sun_direction_world = {0.95, 0.0, 0.3};
  EXPECT_EQ(darkened(*stands(-1.0, 0.6), *nobody), 0) << "the face has no sun";
}

TEST_P(SurroundingsTest, FloorsShowTheGroundsShadowsAndThrowNone) {
  const auto on_floor = [&](const glm::dvec3& at_m) {
    auto crowd = test::standing_crowd(cast_, {at_m});
    crowd->set_environment(
        make_environment(
            "POLYGON ((-9 -9, 9 -9, 9 9, -9 9, -9 -9), (-3 -3, 3 -3, 3 3, -3 3, -3 -3))", {},
            {.wall_height_m = 0.02})
            .value());
    return crowd;
  };
  const auto without = test::standing_crowd(cast_, {{0, 0, 0}});
  const auto nobody = test::standing_crowd(cast_, {{0, 100, 0}});
  const int ground = darkened(*without, *nobody);
  const auto floor = on_floor({0, 0, 0}), empty = on_floor({0, 100, 0});
  EXPECT_GT(ground, 20);
  EXPECT_NEAR(darkened(*floor, *empty), ground, 0.2 * ground);
  // draw(*empty) with shadows: as without
  const Picture shaded = draw(*empty);
  view_.look.shadows = false;
  const Picture bare = draw(*empty);
  for (const auto& [x_m, y_m] : {std::pair{0.0, 0.0}, {2.0, 2.0}, {-2.5, 1.0}}) {
    EXPECT_EQ(red(shaded, x_m, y_m), red(bare, x_m, y_m)) << x_m << ' ' << y_m;
  }
}

TEST_P(SurroundingsTest, AreForgottenWithTheirCrowd) {
  const Picture first = draw(*crowd(kRoom));
  for (int i = 0; i < 5; ++i) EXPECT_EQ(draw(*crowd(kRoom)).rgbx, first.rgbx);
}

}  // namespace
}  // namespace throng::render
