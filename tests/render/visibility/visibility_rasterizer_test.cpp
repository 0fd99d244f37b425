#include <gtest/gtest.h>

#include <hwy/highway.h>

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <numbers>

#include <thread>

#include "render/raster/visibility/visibility_rasterizer.hpp"
#include "support/image_compare.hpp"
#include "support/tiny_character.hpp"
#include "throng/render/frame.hpp"

namespace throng::render {
namespace {

std::shared_ptr<const Cast> tiny_cast() {
  Cast cast;
  for (const glm::u8vec3 color : {glm::u8vec3{200, 120, 60}, glm::u8vec3{90, 140, 210}}) {
    absl::StatusOr<Character> character =
        make_character(test::make_tiny_character({.name = "tiny", .color = color}));
    EXPECT_TRUE(character.ok()) << character.status();
    cast.members.push_back({*std::move(character), 1.0F});
  }
  return std::make_shared<const Cast>(std::move(cast));
}

/// People in rows from y = 0 on, `apart` metres from each other.
void push_rows(Crowd& crowd, int columns, int rows, float apart) {
  auto membership = std::make_shared<Membership>();
  AgentFrame frame;
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      membership->ids.push_back(static_cast<std::uint64_t>(row * columns + column + 1));
      frame.position_m.emplace_back(
          (static_cast<float>(column) - 0.5F * static_cast<float>(columns - 1)) * apart,
          static_cast<float>(row) * apart, 0.0F);
      frame.heading_rad.push_back(0.7F * static_cast<float>(row + column));
    }
  }
  membership->epoch = 1;
  frame.membership = membership;
  ASSERT_TRUE(crowd.push(frame).ok());
}

Picture rendered(const std::shared_ptr<const Cast>& cast, const Crowd& crowd, RasterKind raster,
                 unsigned threads, const ViewSettings& view,
                 std::optional<GeometryKind> geometry = std::nullopt) {
  auto pipeline =
      FramePipeline::make(cast, {.raster = raster, .threads = threads, .geometry = geometry});
  EXPECT_TRUE(pipeline.ok()) << pipeline.status();
  Picture picture;
  FrameStats stats;
  const absl::Status status = (*pipeline)->render(crowd, 0, view, picture, stats);
  EXPECT_TRUE(status.ok()) << status;
  return picture;
}

ViewSettings looking_north(std::uint32_t width, std::uint32_t height) {
  ViewSettings view;
  view.camera = {.eye_world = {0, -6, 3}, .target_world = {0, 4, 1}};
  view.viewport = {width, height};
  return view;
}

TEST(VisibilityRasterizerTest, NumberOfThreadsDoesNotMatter) {
  const auto cast = tiny_cast();
  Crowd crowd(cast, {});
  push_rows(crowd, 30, 40, 0.8F);
  const ViewSettings view = looking_north(333, 217);
  const Picture one = rendered(cast, crowd, RasterKind::kVisibility, 1, view);
  for (const unsigned threads : {2U, 7U}) {
    EXPECT_EQ(one.rgbx, rendered(cast, crowd, RasterKind::kVisibility, threads, view).rgbx)
        << threads;
  }
}

TEST(VisibilityRasterizerTest, InstructionSetDoesNotMatter) {
  // from figures that are cut at the near plane to ones of a few pixels
  const auto cast = tiny_cast();
  Crowd crowd(cast, {});
  push_rows(crowd, 30, 60, 0.8F);
  ViewSettings view = looking_north(333, 217);
  view.camera.eye_world = {0.2, 0.5, 1.6};
  std::vector<std::uint8_t> first;
  for (const PoseMode mode : {PoseMode::kShared, PoseMode::kExact}) {
    view.pose_mode = mode;
    first.clear();
    const std::int64_t all = hwy::SupportedTargets();
    for (std::int64_t rest = all; rest != 0; rest &= rest - 1) {
      const std::int64_t target = rest & -rest;
      hwy::SetSupportedTargetsForTest(target);
      hwy::GetChosenTarget().Update(hwy::SupportedTargets());
      const Picture picture = rendered(cast, crowd, RasterKind::kVisibility, 2, view);
      if (first.empty()) first = picture.rgbx;
      EXPECT_EQ(picture.rgbx, first) << hwy::TargetName(target);
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
}

TEST(VisibilityRasterizerTest, WhoIsBehindAWallChangesNothing) {
  // a row of people shoulder to shoulder and the same with a thousand more behind its middle
  const auto cast = tiny_cast();
  ViewSettings view;
  view.camera = {.eye_world = {0, -3, 0.9}, .target_world = {0, 0, 0.9}, .fov_y_rad = 0.5};
  view.viewport = {96, 96};
  view.look.shadows = false;
  view.selection.vertex_budget = 1'000'000'000;
  const auto wall = [](bool crowded) {
    auto membership = std::make_shared<Membership>();
    AgentFrame frame;
    const auto add = [&](std::uint64_t id, float x, float y) {
      membership->ids.push_back(id);
      membership->characters.push_back(0);
      frame.position_m.emplace_back(x, y, 0.0F);
      frame.heading_rad.push_back(0.0F);
    };
    for (int i = -20; i <= 20; ++i)
      add(static_cast<std::uint64_t>(100 + i), 0.1F * static_cast<float>(i), 0.0F);
    for (int i = 0; crowded && i < 1000; ++i) {
      add(static_cast<std::uint64_t>(1000 + i), 0.02F * static_cast<float>(i % 20 - 10),
          3.0F + 0.05F * static_cast<float>(i / 20));
    }
    membership->epoch = 1;
    frame.membership = membership;
    return frame;
  };
  Crowd alone(cast, {}), crowded(cast, {});
  ASSERT_TRUE(alone.push(wall(false)).ok());
  ASSERT_TRUE(crowded.push(wall(true)).ok());
  EXPECT_EQ(rendered(cast, alone, RasterKind::kVisibility, 2, view).rgbx,
            rendered(cast, crowded, RasterKind::kVisibility, 2, view).rgbx);
}

/// A crowd that begins at the camera and ends where people are a few pixels high.
ViewSettings down_the_street() {
  ViewSettings view;
  view.camera = {.eye_world = {0, -5, 4}, .target_world = {0, 30, 0}};
  view.viewport = {640, 360};
  view.selection.vertex_budget = 60'000;
  return view;
}

TEST(VisibilityRasterizerTest, FusedAndBatchedGeometryShowTheSamePicture) {
  const auto cast = tiny_cast();
  Crowd crowd(cast, {});
  push_rows(crowd, 40, 80, 1.1F);
  const ViewSettings view = down_the_street();
  const Picture fused =
      rendered(cast, crowd, RasterKind::kVisibility, 2, view, GeometryKind::kFused);
  const Picture batched =
      rendered(cast, crowd, RasterKind::kVisibility, 2, view, GeometryKind::kBatched);
  const test::ImageDifference difference = test::compare_images(fused.rgbx, batched.rgbx);
  // the same samples of the same triangles; normals are rounded once more when batched
  EXPECT_GT(difference.psnr_db, 50.0);
  EXPECT_LT(difference.share_over_8, 0.001);
  for (const unsigned threads : {1U, 7U}) {
    EXPECT_EQ(fused.rgbx, rendered(cast, crowd, RasterKind::kVisibility, threads, view).rgbx)
        << "fused is the default";
  }
}

TEST(VisibilityRasterizerTest, SharedPosesShowNearlyTheExactPicture) {
  const auto cast = tiny_cast();
  Crowd crowd(cast, {});
  push_rows(crowd, 40, 80, 1.1F);
  ViewSettings view = down_the_street();
  const Picture shared = rendered(cast, crowd, RasterKind::kVisibility, 2, view);
  view.pose_mode = PoseMode::kExact;
  const Picture exact = rendered(cast, crowd, RasterKind::kVisibility, 2, view);
  const test::ImageDifference difference = test::compare_images(shared.rgbx, exact.rgbx);
  EXPECT_GT(difference.psnr_db, 30.0);
  EXPECT_LT(difference.mean, 1.0);
  EXPECT_GT(difference.mean, 0.0) << "somebody should have shared";
}

TEST(VisibilityRasterizerTest, FusedGeometryNeedsARasterizerThatTakesIt) {
  if (auto gl = make_rasterizer(RasterKind::kGl); !gl.ok()) GTEST_SKIP() << gl.status().message();
  EXPECT_EQ(FramePipeline::make(tiny_cast(),
                                {.raster = RasterKind::kGl, .geometry = GeometryKind::kFused})
                .status()
                .code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(VisibilityRasterizerTest, OcclusionLeavesOutNobodyWhoIsSeen) {
  // against brute force: every instance drawn in every tile it may be seen in
  const auto cast = tiny_cast();
  auto backend = make_backend(BackendKind::kCpu, 2).value();
  ASSERT_TRUE(backend->upload(cast).ok());
  auto view = backend->make_view().value();
  auto with = visibility::make_visibility_rasterizer(2, "").value();
  auto without = visibility::make_visibility_rasterizer(2, "", /*occlusion=*/false).value();
  ASSERT_TRUE(with->upload(cast).ok() && without->upload(cast).ok());
  std::uint64_t hidden = 0;
  for (int round = 0; round < 8; ++round) {
    Crowd crowd(cast, {});
    push_rows(crowd, 60, 60 + 10 * round, 0.15F + 0.05F * static_cast<float>(round % 4));
    const Bracket bracket = crowd.bracket(0);
    const auto snapshot = backend->upload(bracket.older).value();
    const auto instances =
        backend->advance(*snapshot, *snapshot, 0, crowd.settings(), -1, {}).value();
    const Camera camera{.eye_world = {0.3 * round, -3.0 - round, 1.2 + 0.2 * round},
                        .target_world = {0, 6, 0.9}};
    const Viewport viewport{320 + 17U * static_cast<std::uint32_t>(round), 180};
    for (const GeometryKind geometry : {GeometryKind::kFused, GeometryKind::kBatched}) {
      const Selection selection{
          .vertex_budget = 400'000, .pose_mode = PoseMode::kShared, .geometry = geometry};
      ASSERT_TRUE(backend->cull(*view, instances, camera, viewport).ok());
      ASSERT_TRUE(backend->select(*view, selection).ok());
      ASSERT_TRUE(backend->allocate(*view).ok());
      ASSERT_TRUE(backend->generate(*view).ok());
      Picture a, b;
      const FrameGeometry frame = backend->geometry(*view);
      ASSERT_TRUE(with->draw(frame, camera, viewport, {}, {}, a).ok());
      ASSERT_TRUE(without->draw(frame, camera, viewport, {}, {}, b).ok());
      EXPECT_EQ(a.rgbx, b.rgbx) << round;
      const RasterCounters counted = with->counters(), all = without->counters();
      EXPECT_EQ(all.hidden, 0U);
      EXPECT_EQ(counted.drawn + counted.hidden, all.drawn);
      EXPECT_EQ(counted.shaded, all.shaded);
      hidden += counted.hidden;
    }
  }
  EXPECT_GT(hidden, 10'000U);
}

TEST(VisibilityRasterizerTest, AMillionAgentsOfAPixel) {
  const auto cast = tiny_cast();
  Crowd crowd(cast, {});
  push_rows(crowd, 1000, 1000, 0.7F);
  ViewSettings view;
  view.camera = {.eye_world = {0, 350, 1500}, .target_world = {0, 350.1, 0}};
  view.viewport = {640, 640};
  view.selection.vertex_budget = 1'000'000;
  auto pipeline = FramePipeline::make(cast, {.raster = RasterKind::kVisibility, .threads = 2});
  ASSERT_TRUE(pipeline.ok()) << pipeline.status();
  Picture picture;
  FrameStats stats;
  const absl::Status status = (*pipeline)->render(crowd, 0, view, picture, stats);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(stats.counters.visible, 1'000'000U);
  EXPECT_EQ(stats.counters.shared_poses, 1'000'000U);
  EXPECT_GT(stats.raster.shaded, 100'000U);
  EXPECT_LT(stats.counters.view_bytes + stats.raster.size_bytes, 600'000'000U);
  // the crowd's square is darker or lighter than the ground around it nearly everywhere
  const auto at = [&](std::size_t x, std::size_t y) { return &picture.rgbx[4 * (y * 640 + x)]; };
  EXPECT_NE(std::memcmp(at(320, 320), at(5, 5), 3), 0);
}

TEST(VisibilityRasterizerTest, ViewsOfOneProcessDoNotDisturbEachOther) {
  const auto cast = tiny_cast();
  Crowd crowd(cast, {});
  push_rows(crowd, 30, 30, 1.1F);
  std::vector<ViewSettings> views(3, down_the_street());
  views[1].viewport = {200, 300};
  views[2].camera.eye_world = {20, 10, 30};
  std::vector<Picture> alone, together(views.size());
  for (const ViewSettings& view : views) {
    alone.push_back(rendered(cast, crowd, RasterKind::kVisibility, 2, view));
  }
  {
    std::vector<std::jthread> threads;
    for (std::size_t i = 0; i < views.size(); ++i) {
      threads.emplace_back([&, i] {
        for (int round = 0; round < 3; ++round) {
          together[i] = rendered(cast, crowd, RasterKind::kVisibility, 2, views[i]);
        }
      });
    }
  }
  for (std::size_t i = 0; i < views.size(); ++i) EXPECT_EQ(alone[i].rgbx, together[i].rgbx) << i;
  // and one pipeline that changes between them
  auto pipeline = FramePipeline::make(cast, {.raster = RasterKind::kVisibility, .threads = 2});
  ASSERT_TRUE(pipeline.ok());
  Picture picture;
  FrameStats stats;
  for (int round = 0; round < 2; ++round) {
    for (std::size_t i = 0; i < views.size(); ++i) {
      ASSERT_TRUE((*pipeline)->render(crowd, 0, views[i], picture, stats).ok());
      EXPECT_EQ(alone[i].rgbx, picture.rgbx) << i;
    }
  }
}

TEST(VisibilityRasterizerTest, EverySizeIsDrawn) {
  const auto cast = tiny_cast();
  Crowd crowd(cast, {});
  push_rows(crowd, 5, 5, 1.0F);
  for (const auto& [width, height] : std::vector<std::pair<std::uint32_t, std::uint32_t>>{
           {1, 1}, {31, 33}, {64, 64}, {65, 1}, {1280, 720}, {3840, 2160}}) {
    const Picture picture =
        rendered(cast, crowd, RasterKind::kVisibility, 2, looking_north(width, height));
    ASSERT_EQ(picture.rgbx.size(), std::size_t{4} * width * height);
    for (std::size_t i = 3; i < picture.rgbx.size(); i += 4) ASSERT_EQ(picture.rgbx[i], 255);
  }
}

TEST(VisibilityRasterizerTest, RefusesWhatCanNotBeDrawn) {
  auto rasterizer = make_rasterizer(RasterKind::kVisibility, 1);
  ASSERT_TRUE(rasterizer.ok());
  Picture picture;
  EXPECT_EQ((*rasterizer)->draw({}, {}, {0, 5}, {}, {}, picture).code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ((*rasterizer)->draw({}, {}, {5, 16385}, {}, {}, picture).code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ((*rasterizer)->upload(nullptr).code(), absl::StatusCode::kInvalidArgument);
  const std::vector<VisibleInstance> instances(1);
  FrameGeometry geometry;
  geometry.instances = instances;
  EXPECT_EQ((*rasterizer)->draw(geometry, {}, {5, 5}, {}, {}, picture).code(),
            absl::StatusCode::kFailedPrecondition);
  ASSERT_TRUE((*rasterizer)->upload(tiny_cast()).ok());
  EXPECT_EQ((*rasterizer)->draw(geometry, {}, {5, 5}, {}, {}, picture).code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(VisibilityRasterizerTest, ShowsWhatGlShows) {
  const auto cast = tiny_cast();
  setenv("THRONG_GL_SAMPLES", "4", 1);  // as many as the visibility rasterizer has
  if (auto gl = make_rasterizer(RasterKind::kGl); !gl.ok()) GTEST_SKIP() << gl.status().message();
  Crowd crowd(cast, {});
  push_rows(crowd, 12, 12, 1.2F);
  ViewSettings views[4] = {looking_north(640, 360), looking_north(640, 360),
                           looking_north(320, 320), looking_north(640, 360)};
  views[1].camera = {.eye_world = {3, 4, 9}, .target_world = {3, 4.1, 0}};  // from above
  views[2].camera = {.eye_world = {0, 4, 20}, .target_world = {0, 4, 0}, .ortho_height_m = 14.0};
  views[3].camera = {.eye_world = {0.3, 0.2, 1.0}, .target_world = {2, 8, 1}};  // inside somebody
  for (const ViewSettings& view : views) {
    const Picture gl = rendered(cast, crowd, RasterKind::kGl, 2, view);
    const Picture visibility = rendered(cast, crowd, RasterKind::kVisibility, 2, view);
    const test::ImageDifference difference = test::compare_images(gl.rgbx, visibility.rgbx);
    // other sample positions at edges, other mip level choice inside; the rest agrees
    EXPECT_LT(difference.mean, 1.5) << &view - views;
    EXPECT_LT(difference.share_over_8, 0.12) << &view - views;
    EXPECT_GT(difference.psnr_db, 28.0) << &view - views;
  }
}

}  // namespace
}  // namespace throng::render
