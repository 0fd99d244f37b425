#include "simplify/report/measure.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "simplify/report/canvas.hpp"
#include "support/tiny_character.hpp"

namespace throng::simplify {
namespace {

render::Character tiny() { return *render::make_character(test::make_tiny_character()); }

MeasureOptions few() {
  MeasureOptions options;
  options.views = 4;
  options.poses = 3;
  return options;
}

const LevelReport& row(const CharacterReport& report, Method method, std::uint32_t level) {
  for (const LevelReport& one : report.levels) {
    if (one.method == method && one.level == level) return one;
  }
  ADD_FAILURE() << "no row for level " << level;
  return report.levels[0];
}

TEST(PosesTest, AreDifferentAndBeginWithWalk) {
  const render::Character character = tiny();
  const auto poses = choose_poses(character, 6);
  ASSERT_EQ(poses.size(), 6U);
  EXPECT_EQ(pose_name(character, poses[0]), "walk frame 0");
  for (std::size_t i = 0; i < poses.size(); ++i) {
    for (std::size_t k = 0; k < i; ++k)
      EXPECT_FALSE(poses[i].clip == poses[k].clip && poses[i].frame == poses[k].frame);
  }
}

TEST(PosesTest, EndWhereFramesRepeat) {
  render::CharacterData data = test::make_tiny_character();
  for (std::size_t i = 0; i < data.palette.size(); ++i) data.palette[i] = data.palette[i % 2];
  EXPECT_EQ(choose_poses(*render::make_character(std::move(data)), 8).size(), 1U);
}

TEST(LevelsTest, FullLevelIsTheMeshAndCoarserOnesNeverBranchOut) {
  const render::Character character = tiny();
  const LevelMesh full = level_mesh(character, character.vertex_count());
  EXPECT_EQ(full.triangles.size(), character.triangle_count());
  EXPECT_EQ(full.vertices, character.vertex_count());
  const std::uint32_t coarsest = level_vertices(character, 0.0F);
  EXPECT_EQ(coarsest, character.coarsest_count);
  for (const glm::uvec3& corner : level_mesh(character, coarsest).triangles) {
    for (int k = 0; k < 3; ++k) EXPECT_LT(corner[k], coarsest);
  }
}

TEST(MeasureTest, FullLevelEqualsReferenceAndCoarserOnesLose) {
  const auto measured = measure(tiny(), few());
  ASSERT_TRUE(measured.ok()) << measured.status();
  const CharacterReport& report = measured->report;
  EXPECT_EQ(report.views.size(), 4U);
  EXPECT_EQ(report.poses.size(), 3U);
  const LevelReport& full = row(report, Method::kThrong, 0);
  EXPECT_EQ(full.overlap.worst_pose, 1.0);
  EXPECT_EQ(full.ssim.worst_pose, 1.0);
  EXPECT_EQ(full.hausdorff_m, 0.0F);
  const LevelReport& coarsest = row(report, Method::kThrong, 5);
  EXPECT_EQ(coarsest.vertices, 12U);
  EXPECT_LT(coarsest.overlap.median, 0.999);
  EXPECT_GT(coarsest.overlap.worst_pose, 0.5);
  EXPECT_LE(coarsest.overlap.worst_pose, coarsest.overlap.median + 1e-9);
  EXPECT_LT(coarsest.ssim.median, 1.0);
  EXPECT_LT(coarsest.psnr_db.median, 60.0);
  // an octagon of radius 0.25 m becomes a square: corners go in by r (1 - cos 45), bent ones by
  // more
  EXPECT_GT(coarsest.hausdorff_m, 0.25F * (1.0F - std::sqrt(0.5F)) - 0.001F);
  EXPECT_LT(coarsest.hausdorff_m, 0.25F);
}

TEST(MeasureTest, LevelLikeTheFullMeshIsMeasuredAsEqual) {
  render::CharacterData data = test::make_tiny_character();
  data.coarsest_count = static_cast<std::uint32_t>(data.position.size());  // nothing collapses
  for (std::uint32_t n = 0; n < data.legal_count.size(); ++n) {
    data.legal_count[n] = n < data.coarsest_count ? 0 : n;
    if (n < data.coarsest_count) data.triangle_count_at[n] = 0;
  }
  data.tone_band.clear();  // of levels that are not there now
  data.corner_tone.clear();
  auto character = render::make_character(std::move(data));
  ASSERT_TRUE(character.ok()) << character.status();
  const auto measured = measure(*character, few());
  ASSERT_TRUE(measured.ok()) << measured.status();
  for (std::uint32_t level = 0; level < 6; ++level) {
    const LevelReport& one = row(measured->report, Method::kThrong, level);
    EXPECT_EQ(one.overlap.worst_pose, 1.0) << level;
    EXPECT_EQ(one.psnr_db.worst_pose, 99.0) << level;
    EXPECT_NEAR(one.ssim.worst_pose, 1.0, 1e-6) << level;
    EXPECT_LT(one.hausdorff_m, 1e-5F) << level;
  }
}

TEST(MeasureTest, PlainMeshoptimizerIsMeasuredAtNoMoreTriangles) {
  if (plain_meshoptimizer_version().empty()) GTEST_SKIP() << "built without libmeshoptimizer";
  const auto measured = measure(tiny(), few());
  ASSERT_TRUE(measured.ok()) << measured.status();
  const LevelReport &ours = row(measured->report, Method::kThrong, 1),
                    &theirs = row(measured->report, Method::kPlain, 1);
  EXPECT_LE(theirs.triangles, ours.triangles);
  EXPECT_GT(theirs.overlap.median, 0.5);
}

TEST(RivalsTest, MissingPythonOrPackageIsTold) {
  const auto none =
      simplify_with_attributes(tiny(), std::vector<std::uint32_t>{30}, "no_such_python");
  EXPECT_EQ(none.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_NE(none.status().message().find("no_such_python"), std::string::npos);
  EXPECT_EQ(attribute_meshoptimizer_version("false").status().code(),
            absl::StatusCode::kUnavailable);
}

TEST(RivalsTest, AttributeAwareSimplificationKeepsToTheVertices) {
  if (const auto version = attribute_meshoptimizer_version(THRONG_PYTHON); !version.ok())
    GTEST_SKIP() << version.status().message();
  const render::Character character = tiny();
  const auto levels =
      simplify_with_attributes(character, std::vector<std::uint32_t>{40, 20}, THRONG_PYTHON);
  ASSERT_TRUE(levels.ok()) << levels.status();
  ASSERT_EQ(levels->size(), 2U);
  EXPECT_LE((*levels)[0].triangles.size(), 40U);
}

TEST(CanvasTest, WritesInsideItsWidthAndCutsOffOutside) {
  Canvas canvas(60, 30, {255, 255, 255});
  canvas.write("Ab", {5.0F, 20.0F}, 10.0F, {0, 0, 0});
  canvas.write("far outside", {-500.0F, 900.0F}, 10.0F, {0, 0, 0});
  int dark = 0, right = 0;
  for (std::uint32_t i = 0; i < 60 * 30; ++i) {
    if (canvas.picture().rgbx[4 * i] > 128) continue;
    ++dark;
    right = std::max(right, static_cast<int>(i % 60));
  }
  EXPECT_GT(dark, 20);
  EXPECT_LE(right, 5 + static_cast<int>(Canvas::width_of("Ab", 10.0F)) + 2);
}

}  // namespace
}  // namespace throng::simplify
