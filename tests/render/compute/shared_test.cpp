#include <gtest/gtest.h>

#include <absl/status/status.h>

#include <cstring>

#include "frame_fixture.hpp"
#include "render/compute/cpu/levels.hpp"
#include "render/compute/cpu/posed_bank.hpp"
#include "render/compute/element/shared_pose.hpp"
#include "render/crowd/motion_graph.hpp"

namespace throng::render {
namespace {

constexpr Selection kShared{.vertex_budget = 20'000, .pose_mode = PoseMode::kShared};
constexpr Selection kFused{
    .vertex_budget = 20'000, .pose_mode = PoseMode::kShared, .geometry = GeometryKind::kFused};

TEST(SharedPoseTest, NumberOfASharedPoseIsItself) {
  const element::Gait gait = gait_of(test::tiny_cast()->members[0].character);
  ASSERT_GT(gait.idle.frame_count, 0U);
  ASSERT_GT(gait.walk.frame_count, 0U);
  for (std::uint32_t number = 0; number <= element::kPhases * element::kShares; ++number) {
    const element::Pose pose = element::shared_pose(gait, number);
    EXPECT_LT(pose.a_frame1, 24U);
    ASSERT_EQ(element::shared_pose_of(pose, gait, 0), number);
  }
}

TEST(SharedPoseTest, ActionsHaveRowsOfTheirOwn) {
  element::Gait gait = gait_of(test::tiny_cast()->members[0].character);
  gait.action[3] = {{100, 20, 10.0F}, 0.4F, 0};
  for (const double cycles : {0.0, 0.3, 0.999}) {
    const element::Motion cheering{4, 4, 1.0F};
    const element::Pose pose = element::choose_pose(
        gait, 5, 0.0F, 0.0F, 0.0, static_cast<std::int64_t>(2e6 * cycles), cheering);
    EXPECT_EQ(pose.action, 4U);
    for (std::uint32_t tier = 0; tier < element::kTiers; ++tier) {
      const std::uint32_t number = element::shared_pose_of(pose, gait, tier);
      EXPECT_EQ(number / element::kPhases, element::kFirstActionRow + 3);
      const element::Pose shared = element::shared_pose(gait, number);
      EXPECT_GE(shared.a_frame0, 100U);
      EXPECT_EQ(element::shared_pose_of(shared, gait, tier), number);
    }
  }
  // who has just begun is still shown as what it did
  const element::Pose begun =
      element::choose_pose(gait, 5, 0.0F, 0.0F, 0.0, 0, element::Motion{4, 0, 0.1F});
  EXPECT_LT(element::shared_pose_of(begun, gait, 0) / element::kPhases, element::kFirstActionRow);
}

TEST(SharedPoseTest, CoarserTiersTakeFewerPoses) {
  const element::Gait gait = gait_of(test::tiny_cast()->members[0].character);
  for (std::uint32_t tier = 0; tier < element::kTiers; ++tier) {
    std::vector<bool> taken(element::kSharedPoses, false);
    for (int i = 0; i < 4000; ++i) {
      element::Pose pose;
      element::sample_clip(gait.walk, static_cast<double>(i) / 4000.0, pose.a_frame0, pose.a_frame1,
                           pose.a_t);
      taken[element::shared_pose_of(pose, gait, tier)] = true;
    }
    EXPECT_EQ(std::count(taken.begin(), taken.end(), true),
              static_cast<std::ptrdiff_t>(element::kPhases >> tier));
  }
}

TEST(SharedPoseTest, EveryPoseOfEveryAgentHasANumber) {
  element::Gait gait = gait_of(test::tiny_cast()->members[0].character);
  gait.turn = {30, 10, 20.0F};
  gait.action[0] = {{100, 20, 10.0F}, 0.4F, 0};
  gait.action[1] = {{120, 20, 10.0F}, 0.9F, 1};
  for (int i = 0; i < 5000; ++i) {
    const float speed_mps = 4.0F * static_cast<float>(test::noise(5 * i));
    const auto told = [i](int k) {
      return static_cast<std::uint32_t>(4.0 * test::noise(5 * i + k));
    };
    const element::Pose pose =
        element::choose_pose(gait, static_cast<std::uint32_t>(i), speed_mps,
                             static_cast<float>(4.0 * test::noise(5 * i + 4) - 2.0),
                             100.0 * test::noise(5 * i + 1) - 50.0, 12'345 * i,
                             {told(2), told(3), static_cast<float>(test::noise(7 * i))});
    EXPECT_GE(pose.b_weight, 0.0F);
    EXPECT_LE(pose.b_weight, 1.0F);
    EXPECT_GE(pose.c_weight, 0.0F);
    EXPECT_LE(pose.c_weight, 1.0F);
    for (std::uint32_t tier = 0; tier < element::kTiers; ++tier) {
      ASSERT_LT(element::shared_pose_of(pose, gait, tier), element::kSharedPoses);
    }
  }
}

TEST(LevelsTest, CornersAreThoseOfTheChainWalk) {
  const auto cast = test::tiny_cast();
  const LevelTable table = make_levels(*cast);
  ASSERT_GE(table.levels.size(), 4U);
  for (const Level& level : table.levels) {
    const Character& character = cast->members[level.character].character;
    ASSERT_EQ(level.triangle_count, character.triangle_count_at[level.vertex_count]);
    EXPECT_EQ(character.legal_count[level.vertex_count], level.vertex_count);
    for (std::uint32_t t = 0; t < level.triangle_count; ++t) {
      for (int k = 0; k < 3; ++k) {
        std::uint32_t corner = character.triangle[t][k];
        while (corner >= level.vertex_count) corner = character.collapse_target[corner];
        EXPECT_EQ(corner_of(table.corners[level.first_triangle + t], k), corner);
      }
    }
  }
  const std::uint32_t full = cast->members[0].character.vertex_count();
  EXPECT_EQ(table.levels[table.level_at[0][full]].vertex_count, full);
  EXPECT_EQ(table.levels[table.level_at[0][full - 1]].vertex_count <= full - 1, true);
}

TEST(SharedTest, NearAgentsKeepTheirOwnPose) {
  const auto cast = test::tiny_cast();
  test::Stage stage(cast);
  stage.camera.eye_world = {0, -15, 7};
  const auto crowd = test::standing_crowd(cast, {{0, 0, 0}, {0, 100, 0}});
  stage.advance(*crowd, 0);
  stage.finish(kFused);
  ASSERT_EQ(stage.geometry().shared.size(), 2U);
  EXPECT_EQ(stage.geometry().shared[0].level, SharedInstance::kOwn);
  EXPECT_NE(stage.geometry().shared[1].level, SharedInstance::kOwn);
  EXPECT_EQ(stage.counters().shared_poses, 1U);
  Selection exact = kFused;
  exact.pose_mode = PoseMode::kExact;
  stage.finish(exact);
  EXPECT_EQ(stage.counters().shared_poses, 0U);
  EXPECT_EQ(stage.geometry().vertices.size(), stage.counters().vertices);
}

TEST(SharedTest, NobodyAtTheNearPlaneShares) {
  const auto cast = test::tiny_cast();
  test::Stage stage(cast);
  stage.viewport = {8, 8};  // everybody is small
  stage.camera.near_m = 33.0;
  const auto crowd = test::standing_crowd(cast, {{0, 0, 0}, {0, 4, 0}, {0, 50, 0}});
  stage.advance(*crowd, 0);
  stage.finish(kFused);
  for (std::size_t v = 0; v < stage.geometry().instances.size(); ++v) {
    const bool is_far = stage.geometry().instances[v].slot != 0;
    EXPECT_EQ(stage.geometry().shared[v].level != SharedInstance::kOwn, is_far);
  }
}

TEST(SharedTest, BatchedAndFusedHaveTheSamePlaces) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 3000, 200.0, 4);
  test::Stage batched(cast), fused(cast);
  batched.advance(*crowd, 234'567);
  fused.advance(*crowd, 234'567);
  batched.finish(kShared);
  fused.finish(kFused);
  const FrameGeometry a = batched.geometry(), b = fused.geometry();
  const LevelTable levels = make_levels(*cast);
  ASSERT_EQ(a.instances.size(), b.instances.size());
  EXPECT_EQ(batched.counters().vertices, fused.counters().vertices);
  EXPECT_EQ(a.vertices.size(), batched.counters().vertices);
  EXPECT_LT(b.vertices.size(), a.vertices.size() / 2);
  EXPECT_LE(a.vertices.size(), 20'000U);
  std::size_t compared = 0;
  for (std::size_t v = 0; v < a.instances.size(); ++v) {
    EXPECT_EQ(std::memcmp(&a.instances[v], &b.instances[v], sizeof(VisibleInstance)), 0);
    const SharedInstance& shared = b.shared[v];
    if (shared.level == SharedInstance::kOwn) continue;
    const float* column = b.posed + shared.posed + kPosedHeader;
    const VisibleInstance& instance = b.instances[v];
    ASSERT_EQ(levels.levels[shared.level].vertex_count, instance.vertex_count);
    for (std::uint32_t i = 0; i < instance.vertex_count; ++i, ++compared) {
      const float x = column[i], y = column[shared.stride + i], z = column[2 * shared.stride + i];
      const glm::vec3 place =
          instance.position_relative + glm::vec3(x * shared.cosine_scale - y * shared.sine_scale,
                                                 x * shared.sine_scale + y * shared.cosine_scale,
                                                 z * instance.scale);
      ASSERT_EQ(place, a.vertices[a.vertex_offset[v] + i].position_relative);
      for (int k = 0; k < 3; ++k) {
        ASSERT_GE(k == 0 ? x : (k == 1 ? y : z), b.posed[shared.posed + k]);
        ASSERT_LE(k == 0 ? x : (k == 1 ? y : z), b.posed[shared.posed + 3 + k]);
      }
    }
  }
  EXPECT_GT(compared, 5000U);
}

TEST(SharedTest, SharedPosesAreNearTheExactOnes) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 2000, 250.0, 4);
  test::Stage shared(cast), exact(cast);
  shared.advance(*crowd, 234'567);
  exact.advance(*crowd, 234'567);
  // everybody at full detail: the same vertices
  Selection selection = kShared;
  selection.vertex_budget = 1'000'000'000;
  shared.finish(selection);
  selection.pose_mode = PoseMode::kExact;
  exact.finish(selection);
  const FrameGeometry a = shared.geometry(), b = exact.geometry();
  ASSERT_EQ(a.vertices.size(), b.vertices.size());
  const float focal_px = 0.5F * static_cast<float>(shared.viewport.height_px) /
                         std::tan(0.5F * static_cast<float>(shared.camera.fov_y_rad));
  double worst_px = 0.0;
  for (std::size_t v = 0; v < a.instances.size(); ++v) {
    double sum = 0.0;
    for (std::uint32_t i = a.vertex_offset[v]; i < a.vertex_offset[v + 1]; ++i) {
      const glm::vec3 p = b.vertices[i].position_relative;
      const double off_px =
          glm::length(a.vertices[i].position_relative - p) * focal_px / glm::length(p);
      sum += off_px * off_px;
    }
    worst_px = std::max(worst_px, std::sqrt(sum / a.instances[v].vertex_count));
  }
  EXPECT_LT(worst_px, 0.5);
  EXPECT_GT(worst_px, 0.0);
}

TEST(SharedTest, SameBytesForAnyNumberOfThreadsAndWhateverWasThere) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 12'000, 300.0, 4);
  std::vector<std::vector<float>> expected;
  for (const unsigned threads : {1U, 2U, 7U}) {
    test::Stage stage(cast, BackendKind::kCpu, threads);
    for (unsigned before = 0; before < threads; ++before) {
      stage.advance(*crowd, 31'000 * before);
      stage.finish(kFused);
    }
    stage.advance(*crowd, 250'000);
    stage.finish(kFused);
    const FrameGeometry geometry = stage.geometry();
    std::vector<std::vector<float>> meshes;
    for (std::size_t v = 0; v < geometry.instances.size(); ++v) {
      std::vector<float>& mesh = meshes.emplace_back();
      const SharedInstance& shared = geometry.shared[v];
      if (shared.level == SharedInstance::kOwn) continue;
      const float* column = geometry.posed + shared.posed + kPosedHeader;
      for (std::uint32_t k = 0; k < 4; ++k) {
        mesh.insert(mesh.end(), column + k * shared.stride,
                    column + k * shared.stride + geometry.instances[v].vertex_count);
      }
    }
    if (expected.empty()) {
      expected = meshes;
    } else {
      ASSERT_EQ(meshes.size(), expected.size());
      for (std::size_t v = 0; v < meshes.size(); ++v) {
        ASSERT_EQ(std::memcmp(meshes[v].data(), expected[v].data(), 4 * meshes[v].size()), 0);
      }
    }
  }
}

TEST(SharedTest, FramesReuseWhatIsThere) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 3000, 200.0, 4);
  test::Stage stage(cast);
  stage.advance(*crowd, 234'567);
  stage.finish(kFused);
  EXPECT_GT(stage.counters().posed_meshes, 0U);
  const std::uint64_t bytes = stage.counters().posed_bytes;
  EXPECT_GT(bytes, 0U);
  stage.finish(kFused);
  EXPECT_EQ(stage.counters().posed_meshes, 0U);
  EXPECT_EQ(stage.counters().posed_bytes, bytes);
  EXPECT_GT(stage.counters().view_bytes, 3000U * sizeof(VisibleInstance));
}

TEST(PosedBankTest, BeginsAnewWhenFullAndRefusesWhatNeverFits) {
  const auto table = make_cast_table(test::tiny_cast()).value();
  const std::uint64_t mesh_bytes = 4 * (kPosedHeader + 4 * 32);
  PosedBank bank(3 * mesh_bytes);
  bank.use(table);
  std::vector<PosedBank::Want> two = {{5, 20}, {7, 30}, {5, 31}, {5, 12}};
  EXPECT_TRUE(bank.reserve(two).value());
  ASSERT_EQ(two.size(), 2U) << "one mesh serves all its levels";
  EXPECT_TRUE(bank.has({5, 32}));
  EXPECT_FALSE(bank.has({5, 33}));
  EXPECT_EQ(bank.used_bytes(), 2 * mesh_bytes);
  const auto block = bank.block();
  std::vector<PosedBank::Want> more = {{8, 20}, {9, 20}};
  EXPECT_FALSE(bank.reserve(more).value()) << "full: wanted again by the caller";
  EXPECT_FALSE(bank.has({5, 20}));
  EXPECT_TRUE(bank.reserve(more).value());
  EXPECT_NE(bank.block(), block) << "who still draws from the old block keeps it";
  std::vector<PosedBank::Want> many = {{1, 20}, {2, 20}, {3, 20}, {4, 20}};
  EXPECT_FALSE(bank.reserve(many).value());
  EXPECT_EQ(bank.reserve(many).status().code(), absl::StatusCode::kResourceExhausted);
}

}  // namespace
}  // namespace throng::render
