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
           float error_px, unsigned threads = 2, bool specks = true) {
  auto pipeline =
      FramePipeline::make(cast, {.raster = RasterKind::kVisibility, .threads = threads});
  EXPECT_TRUE(pipeline.ok()) << pipeline.status();
  ViewSettings view;
  view.camera.eye_world = {0.0, -away_m, 0.6 * away_m};
  view.camera.target_world = {0.0, 0.0, 0.0};
  view.viewport = {317, 203};
  view.selection.vertex_budget = 20'000'000;
  view.selection.form = FormRule::kMixed;
  view.selection.mixed.error_px = error_px;
  view.selection.mixed.specks = specks;
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
    const Drawn specks = draw(cast, *crowd, away_m, 1.0F);
    const Drawn meshes = draw(cast, *crowd, away_m, 0.05F, 2, false);
    const Drawn empty = draw(cast, *nobody, away_m, 1.0F);
    EXPECT_GT(specks.stats.counters.drawn_as[static_cast<std::size_t>(Representation::kSpeck)],
              1000U);
    const double shown = mean(meshes.picture) - mean(empty.picture);
    EXPECT_GT(std::abs(shown), 0.5);
    EXPECT_NEAR(mean(specks.picture) - mean(empty.picture), shown, 0.25 * std::abs(shown));
  }
}

TEST(SpecksRasterTest, AnyNumberOfThreadsDrawsTheSame) {
  const auto cast = cast_with_points();
  const auto crowd = square(cast, 40);
  const Drawn one = draw(cast, *crowd, 90.0, 0.3F, 1);
  EXPECT_EQ(one.picture.rgbx, draw(cast, *crowd, 90.0, 0.3F, 3).picture.rgbx);
}

}  // namespace
}  // namespace throng::render
