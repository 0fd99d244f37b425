#include <gtest/gtest.h>

#include <cmath>

#include "simplify/impostor/relief.hpp"
#include "support/tiny_character.hpp"
#include "throng/render/frame.hpp"

namespace throng::render {
namespace {

std::shared_ptr<const Cast> cast_with_impostors() {
  Character character = make_character(test::make_tiny_character()).value();
  character.relief = make_relief(simplify::bake_relief(character).value());
  auto cast = std::make_shared<Cast>();
  cast->members.push_back({character, 1.0F});
  return cast;
}

std::unique_ptr<Crowd> rows(const std::shared_ptr<const Cast>& cast, int columns, int rows) {
  auto membership = std::make_shared<Membership>();
  AgentFrame frame;
  for (int i = 0; i < columns * rows; ++i) {
    membership->ids.push_back(static_cast<std::uint64_t>(i + 1));
    frame.position_m.emplace_back(
        1.2F * (static_cast<float>(i % columns) - 0.5F * static_cast<float>(columns - 1)),
        1.5F * static_cast<float>(i / columns), 0.0F);
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
  FramePasses passes;
};

Drawn draw(const std::shared_ptr<const Cast>& cast, const Crowd& crowd, FormRule form,
           const Camera& camera, unsigned threads = 2,
           std::optional<GeometryKind> geometry = std::nullopt, ReliefSearch search = {}) {
  auto pipeline = FramePipeline::make(
      cast, {.raster = RasterKind::kVisibility, .threads = threads, .geometry = geometry});
  EXPECT_TRUE(pipeline.ok()) << pipeline.status();
  ViewSettings view;
  view.camera = camera;
  view.viewport = {317, 203};
  view.selection.form = form;
  view.look.relief_search = search;
  Drawn drawn;
  const absl::Status status =
      (*pipeline)->render(crowd, 0, view, drawn.picture, drawn.stats, &drawn.passes);
  EXPECT_TRUE(status.ok()) << status;
  return drawn;
}

const Camera kNear{.eye_world = {0, -4, 2}, .target_world = {0, 3, 0.9}};
const Camera kFar{.eye_world = {0, -40, 15}, .target_world = {0, 5, 0.9}, .fov_y_rad = 0.4};
const Camera kFlat{.eye_world = {0, -40, 15}, .target_world = {0, 5, 0.9}, .ortho_height_m = 12.0};

TEST(ReliefRasterTest, CoversWhatTheMeshCoversAtItsDepth) {
  const auto cast = cast_with_impostors();
  const auto crowd = rows(cast, 6, 8);
  for (const Camera& camera : {kNear, kFar, kFlat}) {
    const Drawn mesh = draw(cast, *crowd, FormRule::kMesh, camera);
    const Drawn impostor = draw(cast, *crowd, FormRule::kImpostor, camera);
    EXPECT_GT(impostor.stats.counters.drawn_as[2], 10U);
    std::size_t both = 0, either = 0, same = 0;
    double off_m = 0.0;
    for (std::size_t i = 0; i < mesh.passes.instance.size(); ++i) {
      const std::uint32_t a = mesh.passes.instance[i], b = impostor.passes.instance[i];
      either += a != FramePasses::kNothing || b != FramePasses::kNothing;
      if (a == FramePasses::kNothing || b == FramePasses::kNothing) continue;
      ++both;
      if (mesh.passes.instances[a].agent_id != impostor.passes.instances[b].agent_id) continue;
      ++same;
      off_m += std::abs(mesh.passes.depth_m[i] - impostor.passes.depth_m[i]);
    }
    ASSERT_GT(either, 2000U);
    EXPECT_GT(static_cast<double>(both) / static_cast<double>(either), 0.93);
    EXPECT_GT(static_cast<double>(same) / static_cast<double>(both), 0.95);
    EXPECT_LT(off_m / static_cast<double>(same), 0.03);
  }
}

TEST(ReliefRasterTest, NumberOfThreadsAndKindOfGeometryDoNotMatter) {
  const auto cast = cast_with_impostors();
  const auto crowd = rows(cast, 12, 30);
  for (const Camera& camera : {kNear, kFar}) {
    const Drawn one = draw(cast, *crowd, FormRule::kImpostor, camera, 1);
    EXPECT_EQ(one.picture.rgbx, draw(cast, *crowd, FormRule::kImpostor, camera, 5).picture.rgbx);
    EXPECT_EQ(
        one.picture.rgbx,
        draw(cast, *crowd, FormRule::kImpostor, camera, 3, GeometryKind::kBatched).picture.rgbx);
  }
}

TEST(ReliefRasterTest, FewerStepsShowTheSameFigure) {
  const auto cast = cast_with_impostors();
  const auto crowd = rows(cast, 6, 8);
  const Drawn published = draw(cast, *crowd, FormRule::kImpostor, kFar, 2, std::nullopt,
                               {.linear_steps = 16, .binary_steps = 7, .adaptive = false});
  const Drawn adaptive = draw(cast, *crowd, FormRule::kImpostor, kFar);
  std::size_t differ = 0, seen = 0;
  for (std::size_t i = 0; i < published.passes.instance.size(); ++i) {
    seen += published.passes.instance[i] != FramePasses::kNothing;
    differ += published.passes.instance[i] != adaptive.passes.instance[i];
  }
  EXPECT_LT(20 * differ, seen);
}

TEST(ReliefRasterTest, WhoHasNoImpostorKeepsTheMesh) {
  auto cast = std::make_shared<Cast>();
  cast->members.push_back({make_character(test::make_tiny_character()).value(), 1.0F});
  const auto crowd = rows(cast, 3, 3);
  const Drawn mesh = draw(cast, *crowd, FormRule::kMesh, kNear);
  const Drawn asked = draw(cast, *crowd, FormRule::kImpostor, kNear);
  EXPECT_EQ(mesh.picture.rgbx, asked.picture.rgbx);
  EXPECT_EQ(asked.stats.counters.drawn_as[2], 0U);
}

double mean_difference(const Picture& a, const Picture& b) {
  EXPECT_EQ(a.rgbx.size(), b.rgbx.size());
  double sum = 0.0;
  for (std::size_t i = 0; i < std::min(a.rgbx.size(), b.rgbx.size()); ++i) {
    sum += std::abs(int{a.rgbx[i]} - int{b.rgbx[i]});
  }
  return sum / static_cast<double>(std::max<std::size_t>(a.rgbx.size(), 1));
}

TEST(ReliefRasterTest, OpenGlDrawsTheSameImpostors) {
  const auto cast = cast_with_impostors();
  const auto crowd = rows(cast, 6, 8);
  auto pipeline = FramePipeline::make(cast, {.raster = RasterKind::kGl, .threads = 2});
  if (!pipeline.ok()) GTEST_SKIP() << pipeline.status();
  for (const Camera& camera : {kNear, kFar, kFlat}) {
    ViewSettings view;
    view.camera = camera;
    view.viewport = {317, 203};
    view.look.shadows = false;  // impostors have blobs, meshes the figure's own shadow
    const auto picture_of = [&](FormRule form) {
      view.selection.form = form;
      Picture picture;
      FrameStats stats;
      const absl::Status status = (*pipeline)->render(*crowd, 0, view, picture, stats);
      EXPECT_TRUE(status.ok()) << status;
      EXPECT_EQ(stats.counters.drawn_as[2] > 0, form == FormRule::kImpostor);
      return picture;
    };
    const Picture mesh = picture_of(FormRule::kMesh), impostor = picture_of(FormRule::kImpostor);
    auto own = FramePipeline::make(cast, {.raster = RasterKind::kVisibility, .threads = 2});
    ASSERT_TRUE(own.ok()) << own.status();
    Picture visibility;
    FrameStats stats;
    ASSERT_TRUE((*own)->render(*crowd, 0, view, visibility, stats).ok());
    EXPECT_LT(mean_difference(impostor, mesh), 4.0);
    EXPECT_LT(mean_difference(impostor, visibility), 3.0);
    EXPECT_GT(mean_difference(impostor, mesh), 0.0);
  }
}

TEST(ReliefRasterTest, EyeWithinABoxDrawsSomething) {
  const auto cast = cast_with_impostors();
  const auto crowd = rows(cast, 3, 3);
  const Camera inside{.eye_world = {0, -0.6, 0.9}, .target_world = {0, 3, 0.9}};
  const Drawn drawn = draw(cast, *crowd, FormRule::kImpostor, inside);
  EXPECT_GT(drawn.stats.raster.shaded, 0U);
}

}  // namespace
}  // namespace throng::render
