#include "throng/render/far_crowd.hpp"

#include <gtest/gtest.h>

#include <array>

#include "simplify/points/points.hpp"
#include "support/tiny_character.hpp"
#include "throng/render/frame.hpp"

namespace throng::render {
namespace {

std::shared_ptr<const Cast> cast_with_points() {
  auto cast = std::make_shared<Cast>();
  CharacterData data = test::make_tiny_character();
  simplify::sample_points(data, {.count = 256});
  cast->members.push_back({make_character(std::move(data)).value(), 1.0F});
  return cast;
}

/// People on a square of 60 m who walk north, two snapshots a second apart.
std::unique_ptr<Crowd> walkers(const std::shared_ptr<const Cast>& cast, std::uint32_t count) {
  auto membership = std::make_shared<Membership>();
  AgentFrame frame;
  for (std::uint32_t i = 0; i < count; ++i) {
    membership->ids.push_back(i + 1);
    frame.position_m.emplace_back(1.5F * static_cast<float>(i % 40) - 30.0F,
                                  1.5F * static_cast<float>(i / 40) - 30.0F, 0.0F);
  }
  membership->epoch = 1;
  frame.membership = membership;
  auto crowd = std::make_unique<Crowd>(cast, CrowdSettings{});
  EXPECT_TRUE(crowd->push(frame).ok());
  frame.time_us = 1'000'000;
  for (glm::vec3& p : frame.position_m) p.y += 1.3F;
  EXPECT_TRUE(crowd->push(frame).ok());
  return crowd;
}

struct Drawn {
  absl::Status status;
  Picture picture;
  FrameStats stats;
};

Drawn draw(const std::shared_ptr<const Cast>& cast, const Crowd& crowd, const FarSettings& far,
           std::int64_t time_us = 300'000, RasterKind kind = RasterKind::kVisibility,
           unsigned threads = 2) {
  Drawn drawn;
  auto pipeline = FramePipeline::make(cast, {.raster = kind, .threads = threads});
  drawn.status = pipeline.status();
  if (!pipeline.ok()) return drawn;
  ViewSettings view;
  view.camera = {.eye_world = {0, -40, 6}, .target_world = {0, 10, 0}};
  view.viewport = {317, 203};
  view.far = far;
  drawn.status = (*pipeline)->render(crowd, time_us, view, drawn.picture, drawn.stats);
  return drawn;
}

double mean_difference(const Picture& a, const Picture& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.rgbx.size(); ++i) {
    sum += std::abs(int{a.rgbx[i]} - int{b.rgbx[i]});
  }
  return sum / static_cast<double>(a.rgbx.size());
}

TEST(FarCrowdTest, EverybodyIsDrawnOnceNearOrFar) {
  const auto cast = cast_with_points();
  const auto crowd = walkers(cast, 1600);
  const Drawn mesh = draw(cast, *crowd, {});
  ASSERT_TRUE(mesh.status.ok()) << mesh.status;
  EXPECT_EQ(mesh.stats.counters.drawn_as[3], 0U);
  for (const bool published : {false, true}) {
    for (const float distance_m : {20.0F, 45.0F, 70.0F}) {
      // so many points that nobody in the open goes without
      const Drawn mixed = draw(
          cast, *crowd,
          {.enabled = true, .distance_m = distance_m, .points = 400'000, .published = published});
      ASSERT_TRUE(mixed.status.ok()) << mixed.status;
      const auto& counters = mixed.stats.counters;
      EXPECT_GT(counters.drawn_as[3], 50U);
      // a vertex at the border of the view may have agents beyond it
      EXPECT_LE(counters.drawn_as[1] + counters.drawn_as[3], mesh.stats.counters.drawn_as[1] + 40U);
      if (published) {  // which deals to those who are hidden, too
        EXPECT_GT(counters.drawn_as[1] + counters.drawn_as[3] + 40U,
                  mesh.stats.counters.drawn_as[1]);
      }
      const double off = mean_difference(mesh.picture, mixed.picture);
      EXPECT_GT(off, 0.0);
      EXPECT_LT(off, 8.0) << distance_m;
    }
  }
}

TEST(FarCrowdTest, APictureDependsOnItsMomentAlone) {
  const auto cast = cast_with_points();
  const auto crowd = walkers(cast, 1600);
  const FarSettings far{.enabled = true, .distance_m = 30.0F, .points = 5'000};
  const Drawn first = draw(cast, *crowd, far, 700'000);
  EXPECT_EQ(first.picture.rgbx,
            draw(cast, *crowd, far, 700'000, RasterKind::kVisibility, 5).picture.rgbx);
  // the same loop after other moments
  auto pipeline = FramePipeline::make(cast, {.raster = RasterKind::kVisibility, .threads = 2});
  ASSERT_TRUE(pipeline.ok());
  ViewSettings view;
  view.camera = {.eye_world = {0, -40, 6}, .target_world = {0, 10, 0}};
  view.viewport = {317, 203};
  view.far = far;
  Picture picture;
  FrameStats stats;
  for (const std::int64_t time_us : {0, 999'000, 100'000, 700'000}) {
    ASSERT_TRUE((*pipeline)->render(*crowd, time_us, view, picture, stats).ok());
  }
  EXPECT_EQ(picture.rgbx, first.picture.rgbx);
  // off the thread that draws: the first one waits, so it is there at once
  view.far.wait = false;
  ASSERT_TRUE((*pipeline)->render(*crowd, 700'000, view, picture, stats).ok());
  EXPECT_GT(stats.counters.drawn_as[3], 50U);
}

TEST(FarCrowdTest, SharesAreKeptWhileTheViewAndThePeopleAreTheSame) {
  const auto cast = cast_with_points();
  const auto crowd = walkers(cast, 400);
  auto far = FarCrowd::make(cast, 1);
  ASSERT_TRUE(far.ok());
  const FarSettings settings{.enabled = true, .points = 2'000};
  Camera camera{.eye_world = {0, -40, 6}, .target_world = {0, 10, 0}};
  const auto versions = [&](std::int64_t time_us, const FarSettings& own) {
    FarCounters counters;
    const FarView view = make_far_view(camera, {317, 203}, glm::dvec3(0.0));
    const FarPoints& points = **(*far)->plan(*crowd, time_us, view, own, counters);
    EXPECT_FALSE(points.shares.empty());
    return std::array{points.shares_version, points.shape_version, points.agents_version};
  };
  const auto first = versions(100'000, settings);
  EXPECT_EQ(versions(400'000, settings), first);  // they walk, their shares stay
  camera.eye_world.x += 1.0;
  const auto moved = versions(400'000, settings);
  EXPECT_NE(moved[0], first[0]);
  EXPECT_EQ(moved[1], first[1]);
  EXPECT_EQ(moved[2], first[2]);
  FarSettings published = settings;
  published.published = true;
  const auto cloud = versions(400'000, published);
  EXPECT_NE(cloud[1], first[1]);
  EXPECT_NE(cloud[2], first[2]);
}

TEST(FarCrowdTest, OpenGlDrawsItToo) {
  const auto cast = cast_with_points();
  const auto crowd = walkers(cast, 1600);
  const FarSettings far{.enabled = true, .distance_m = 30.0F, .points = 20'000};
  const Drawn other = draw(cast, *crowd, far, 300'000, RasterKind::kGl);
  if (!other.status.ok()) GTEST_SKIP() << other.status;
  EXPECT_GT(other.stats.counters.drawn_as[3], 50U);
  EXPECT_LT(mean_difference(other.picture, draw(cast, *crowd, far).picture), 4.0);
}

TEST(FarCrowdTest, NoPointsAndNoCrowd) {
  const auto cast = cast_with_points();
  const auto crowd = walkers(cast, 40);
  const Drawn none = draw(cast, *crowd, {.enabled = true, .points = 0});
  EXPECT_EQ(none.status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(none.status.message().find("budget is 0"), std::string::npos) << none.status;
  const Crowd empty(cast, CrowdSettings{});
  EXPECT_TRUE(draw(cast, empty, {.enabled = true}).status.ok());
}

}  // namespace
}  // namespace throng::render
