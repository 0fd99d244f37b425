#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "simplify/points/points.hpp"
#include "support/tiny_character.hpp"
#include "throng/render/frame.hpp"

namespace throng::render {
namespace {

std::shared_ptr<const Cast> cast_with_points() {
  CharacterData data = test::make_tiny_character();
  simplify::sample_points(data, {.count = 512});
  auto cast = std::make_shared<Cast>();
  cast->members.push_back({make_character(std::move(data)).value(), 1.0F});
  return cast;
}

std::unique_ptr<Crowd> square(const std::shared_ptr<const Cast>& cast, int side) {
  auto membership = std::make_shared<Membership>();
  AgentFrame frame;
  for (int i = 0; i < side * side; ++i) {
    membership->ids.push_back(static_cast<std::uint64_t>(i + 1));
    frame.position_m.emplace_back(2.0F * static_cast<float>(i % side - side / 2),
                                  2.0F * static_cast<float>(i / side - side / 2), 0.0F);
    frame.heading_rad.push_back(0.7F * static_cast<float>(i));
  }
  membership->epoch = 1;
  frame.membership = membership;
  auto crowd = std::make_unique<Crowd>(cast, CrowdSettings{});
  EXPECT_TRUE(crowd->push(frame).ok());
  return crowd;
}

struct Drawn {
  Picture picture;
  FrameStats stats;
};

Drawn draw(const std::shared_ptr<const Cast>& cast, const Crowd& crowd, double away_m,
           float error_px, unsigned threads = 2, bool specks = true, bool shadows = true) {
  auto pipeline =
      FramePipeline::make(cast, {.raster = RasterKind::kVisibility, .threads = threads});
  EXPECT_TRUE(pipeline.ok()) << pipeline.status();
  ViewSettings view;
  view.camera.eye_world = {0.0, -away_m, 0.6 * away_m};
  view.camera.target_world = {0.0, 0.0, 0.0};
  view.viewport = {317, 203};
  view.selection.vertex_budget = 20'000'000;
  view.selection.form = specks ? FormRule::kMixed : FormRule::kMesh;  // those at full detail
  view.selection.mixed.error_px = error_px;
  view.look.shadows = shadows;
  Drawn drawn;
  const absl::Status status = (*pipeline)->render(crowd, 0, view, drawn.picture, drawn.stats);
  EXPECT_TRUE(status.ok()) << status;
  return drawn;
}

double mean(const Picture& picture) {
  double sum = 0.0;
  for (std::size_t i = 0; i < picture.rgbx.size(); ++i) sum += i % 4 == 3 ? 0 : picture.rgbx[i];
  return sum / (0.75 * static_cast<double>(picture.rgbx.size()));
}

TEST(SpecksRasterTest, CoverAndColourAsMeshesDo) {
  const auto cast = cast_with_points();
  const auto crowd = square(cast, 40);
  const auto nobody = std::make_unique<Crowd>(cast, CrowdSettings{});
  for (const double away_m : {60.0, 120.0}) {
    for (const bool shadows : {false, true}) {
      const Drawn specks = draw(cast, *crowd, away_m, 1.0F, 2, true, shadows);
      const Drawn meshes = draw(cast, *crowd, away_m, 0.05F, 2, false, shadows);
      const Drawn empty = draw(cast, *nobody, away_m, 1.0F, 2, true, shadows);
      EXPECT_GT(specks.stats.counters.drawn_as[static_cast<std::size_t>(Representation::kSpeck)],
                1000U);
      const double shown = mean(meshes.picture) - mean(empty.picture);
      EXPECT_GT(std::abs(shown), 0.5);
      EXPECT_NEAR(mean(specks.picture) - mean(empty.picture), shown, 0.25 * std::abs(shown));
    }
  }
}

TEST(OversamplingTest, ShowsTheMeanOfFourPixels) {
  const auto cast = cast_with_points();
  const auto crowd = square(cast, 8);
  auto pipeline = FramePipeline::make(cast, {.raster = RasterKind::kVisibility, .threads = 2});
  ASSERT_TRUE(pipeline.ok()) << pipeline.status();
  ViewSettings view;
  view.camera.eye_world = {0.0, -12.0, 6.0};
  view.camera.target_world = {0.0, 0.0, 1.0};
  view.viewport = {101, 67};
  view.oversampling = 2;
  Picture small, large;
  FrameStats stats;
  ASSERT_TRUE((*pipeline)->render(*crowd, 0, view, small, stats).ok());
  ASSERT_EQ(small.rgbx.size(), 4U * 101 * 67);
  view.oversampling = 1;
  view.viewport = {202, 134};
  view.selection.pose_error_px *= 2.0F;
  ASSERT_TRUE((*pipeline)->render(*crowd, 0, view, large, stats).ok());
  const auto linear = [](std::uint8_t code) {
    const double v = code / 255.0;
    return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  };
  for (std::size_t y = 0; y < 67; ++y) {
    for (std::size_t x = 0; x < 101; ++x) {
      for (std::size_t c = 0; c < 3; ++c) {
        const std::size_t at = 4 * (2 * y * 202 + 2 * x) + c, below = at + std::size_t{4} * 202;
        const double mean = 0.25 * (linear(large.rgbx[at]) + linear(large.rgbx[at + 4]) +
                                    linear(large.rgbx[below]) + linear(large.rgbx[below + 4]));
        const double srgb =
            mean <= 0.0031308 ? 12.92 * mean : 1.055 * std::pow(mean, 1.0 / 2.4) - 0.055;
        ASSERT_NEAR(small.rgbx[4 * (y * 101 + x) + c], 255.0 * srgb, 0.6);
      }
    }
  }
  view.oversampling = 3;
  EXPECT_EQ((*pipeline)->render(*crowd, 0, view, large, stats).code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(SpecksRasterTest, AnyNumberOfThreadsDrawsTheSame) {
  const auto cast = cast_with_points();
  const auto crowd = square(cast, 40);
  const Drawn one = draw(cast, *crowd, 90.0, 0.3F, 1);
  EXPECT_EQ(one.picture.rgbx, draw(cast, *crowd, 90.0, 0.3F, 3).picture.rgbx);
}

}  // namespace
}  // namespace throng::render
