#include <gtest/gtest.h>

#include <cstring>
#include <thread>

#include "frame_fixture.hpp"
#include "render/compute/element/pose.hpp"
#include "render/crowd/motion_graph.hpp"

namespace throng::render {
namespace {

TEST(GenerateTest, OffsetsAreExclusivePrefixSums) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 400, 50.0);
  test::Stage stage(cast);
  stage.advance(*crowd, 0);
  stage.finish({.vertex_budget = 6000});
  const FrameGeometry geometry = stage.geometry();
  ASSERT_EQ(geometry.vertex_offset.size(), geometry.instances.size() + 1);
  ASSERT_EQ(geometry.triangle_offset.size(), geometry.instances.size() + 1);
  std::uint32_t vertices = 0, triangles = 0;
  for (std::size_t v = 0; v < geometry.instances.size(); ++v) {
    EXPECT_EQ(geometry.vertex_offset[v], vertices);
    EXPECT_EQ(geometry.triangle_offset[v], triangles);
    vertices += geometry.instances[v].vertex_count;
    triangles += geometry.instances[v].triangle_count;
  }
  EXPECT_EQ(geometry.vertices.size(), vertices);
  EXPECT_EQ(geometry.indices.size(), 3U * triangles);
  EXPECT_EQ(stage.counters().vertices, vertices);
  EXPECT_EQ(stage.counters().triangles, triangles);
}

TEST(GenerateTest, TrianglesAgreeWithThePlainChainWalkAtEveryLevel) {
  auto one = std::make_shared<Cast>(*test::tiny_cast());
  one->members.resize(1);
  const Character& character = one->members[0].character;
  const auto crowd = test::standing_crowd(one, {{0, 0, 0}});
  test::Stage stage(one);
  std::uint32_t levels = 0;
  for (std::uint32_t n = character.coarsest_count; n <= character.vertex_count(); ++n) {
    if (character.legal_count[n] != n) continue;
    ++levels;
    stage.advance(*crowd, 0);
    stage.finish({.vertex_budget = n});
    const FrameGeometry geometry = stage.geometry();
    ASSERT_EQ(geometry.instances[0].vertex_count, n);
    ASSERT_EQ(geometry.indices.size(), 3U * character.triangle_count_at[n]);
    for (std::uint32_t t = 0; t < character.triangle_count_at[n]; ++t) {
      for (int i = 0; i < 3; ++i) {
        std::uint32_t corner = character.triangle[t][i];
        while (corner >= n) corner = character.collapse_target[corner];
        EXPECT_EQ(geometry.indices[3 * t + i], corner) << "n " << n << " triangle " << t;
      }
      EXPECT_NE(geometry.indices[3 * t], geometry.indices[3 * t + 1]);
      EXPECT_NE(geometry.indices[3 * t + 1], geometry.indices[3 * t + 2]);
      EXPECT_NE(geometry.indices[3 * t + 2], geometry.indices[3 * t]);
    }
  }
  EXPECT_GE(levels, 15U);
}

TEST(GenerateTest, CoarserLevelIsAPrefixOfTheFiner) {
  auto one = std::make_shared<Cast>(*test::tiny_cast());
  one->members.resize(1);
  const auto crowd = test::standing_crowd(one, {{0.4F, 0.3F, 0}});
  test::Stage stage(one);
  stage.advance(*crowd, 0);
  stage.finish({.vertex_budget = 38});
  const std::vector<BatchVertex> full(stage.geometry().vertices.begin(),
                                      stage.geometry().vertices.end());
  for (std::uint64_t n = 12; n < 38; ++n) {
    stage.finish({.vertex_budget = n});
    const auto coarse = stage.geometry().vertices;
    ASSERT_LE(coarse.size(), n);
    EXPECT_EQ(std::memcmp(coarse.data(), full.data(), coarse.size_bytes()), 0) << n;
  }
}

TEST(GenerateTest, FarAgentsKeepTheirPoseUntilTheirFrameIsDue) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 300, 50.0, 8);
  test::Stage stage(cast), always(cast);
  Selection selection{.vertex_budget = 9000};
  selection.motion = {.distance_m = 30.0F, .k_per_m = 0.4F, .frame = 11};
  // by slot: from the feet
  std::vector<std::vector<glm::vec3>> before;
  std::size_t held = 0, due = 0, near = 0;
  for (int frame = 0; frame < 5; ++frame, ++selection.motion.frame) {
    const std::int64_t time_us = 300'000 + 40'000 * frame;
    stage.advance(*crowd, time_us);
    stage.finish(selection);
    always.advance(*crowd, time_us);
    always.finish({.vertex_budget = 9000});
    const FrameGeometry geometry = stage.geometry(), expected = always.geometry();
    ASSERT_EQ(geometry.vertices.size(), expected.vertices.size());
    std::vector<std::vector<glm::vec3>> now(stage.instances->count);
    for (std::size_t v = 0; v < geometry.instances.size(); ++v) {
      const VisibleInstance& instance = geometry.instances[v];
      const glm::vec3 centre =
          instance.position_relative +
          glm::vec3(0.0F, 0.0F,
                    instance.scale * cast->members[instance.character].character.gait_bounds.z);
      const float beyond_m = glm::length(centre) - selection.motion.distance_m;
      if (std::abs(beyond_m * selection.motion.k_per_m -
                   std::round(beyond_m * selection.motion.k_per_m)) < 1e-3F) {
        continue;  // may round to either side
      }
      const auto every =
          beyond_m > 0.0F ? 1 + static_cast<std::uint64_t>(selection.motion.k_per_m * beyond_m) : 1;
      const bool is_due = (selection.motion.frame + instance.slot) % every == 0;
      std::vector<glm::vec3>& mine = now[instance.slot];
      float most_m = 0.0F;
      for (std::uint32_t i = geometry.vertex_offset[v]; i < geometry.vertex_offset[v + 1]; ++i) {
        mine.push_back(geometry.vertices[i].position_relative - instance.position_relative);
        if (is_due) {
          ASSERT_EQ(geometry.vertices[i].position_relative, expected.vertices[i].position_relative);
        }
      }
      const bool was_there = frame > 0 && before[instance.slot].size() == mine.size();
      if (is_due || !was_there) {
        ++(beyond_m > 0.0F ? due : near);
        continue;
      }
      ++held;
      for (std::size_t i = 0; i < mine.size(); ++i) {
        most_m = std::max(most_m, glm::length(mine[i] - before[instance.slot][i]));
      }
      EXPECT_LT(most_m, 1e-4F) << "slot " << instance.slot;
    }
    before = std::move(now);
  }
  // every other to every fourth frame, so more are held than due
  EXPECT_GT(held, due / 2);
  EXPECT_GT(due, 50U);
  EXPECT_GT(near, 50U);
}

TEST(GenerateTest, WithoutADistanceNobodyIsHeld) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 100, 50.0, 8);
  test::Stage stage(cast), fresh(cast);
  Selection selection{.vertex_budget = 3000};
  selection.motion = {.distance_m = 1.0F, .k_per_m = 0.4F, .frame = 1};
  stage.advance(*crowd, 300'000);
  stage.finish(selection);
  stage.advance(*crowd, 400'000);
  stage.finish({.vertex_budget = 3000});
  fresh.advance(*crowd, 400'000);
  fresh.finish({.vertex_budget = 3000});
  const auto a = stage.geometry().vertices, b = fresh.geometry().vertices;
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size_bytes()), 0);
}

TEST(GenerateTest, VerticesAgreeWithDoublePrecisionSkinning) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 200, 30.0, 5);
  test::Stage stage(cast);
  stage.advance(*crowd, 400'000);
  stage.finish();
  const FrameGeometry geometry = stage.geometry();
  const Snapshot& snapshot = *crowd->newest();
  ASSERT_GT(geometry.instances.size(), 100U);
  double worst_m = 0.0, worst_normal = 0.0;
  for (std::size_t v = 0; v < geometry.instances.size(); ++v) {
    const VisibleInstance& instance = geometry.instances[v];
    const Character& character = cast->members[instance.character].character;
    const element::Gait gait = gait_of(character);
    const element::Pose pose =
        element::choose_pose(gait, instance.seed, snapshot.speed_mps[instance.slot], 0.0F,
                             snapshot.walked_cycles[instance.slot], 400'000);
    const double heading = snapshot.heading_rad[instance.slot];
    for (std::uint32_t i = 0; i < instance.vertex_count; ++i) {
      // equation 2, with the palette interpolated element by element
      glm::dvec3 position(0.0), normal(0.0);
      const glm::dvec4 source(glm::dvec3(character.position[i]), 1.0);
      const glm::dvec4 direction(glm::dvec3(decode_octahedral(character.normal[i])), 0.0);
      for (int k = 0; k < 4; ++k) {
        const double weight = character.joint_weight[i][k] / 255.0;
        const std::uint32_t joint = character.joint_index[i][k];
        const auto row_at = [&](std::uint32_t frame, int r) {
          return glm::dvec4(character.palette[frame * character.joint_count() + joint].row[r]);
        };
        for (int r = 0; r < 3; ++r) {
          const glm::dvec4 a = glm::mix(row_at(pose.a_frame0, r), row_at(pose.a_frame1, r),
                                        static_cast<double>(pose.a_t));
          const glm::dvec4 b = glm::mix(row_at(pose.b_frame0, r), row_at(pose.b_frame1, r),
                                        static_cast<double>(pose.b_t));
          const glm::dvec4 row = glm::mix(a, b, static_cast<double>(pose.b_weight));
          position[r] += weight * glm::dot(row, source);
          normal[r] += weight * glm::dot(row, direction);
        }
      }
      const double c = std::cos(heading), s = std::sin(heading), scale = instance.scale;
      const auto turned = [&](const glm::dvec3& p) {
        return glm::dvec3(c * p.x - s * p.y, s * p.x + c * p.y, p.z);
      };
      const glm::dvec3 expected = glm::dvec3(snapshot.position_m[instance.slot]) -
                                  stage.camera.eye_world + scale * turned(position);
      const BatchVertex& vertex = geometry.vertices[geometry.vertex_offset[v] + i];
      worst_m = std::max(worst_m, glm::length(glm::dvec3(vertex.position_relative) - expected));
      const glm::dvec3 unit = glm::normalize(turned(normal));
      worst_normal =
          std::max(worst_normal, glm::length(glm::dvec3(decode_octahedral(vertex.normal)) - unit));
      EXPECT_EQ(vertex.uv, character.uv[i]);
      EXPECT_EQ(vertex.visible, v);
    }
  }
  EXPECT_LT(worst_m, 1e-5);
  EXPECT_LT(worst_normal, 2e-4);
}

TEST(GenerateTest, SameBytesForAnyNumberOfThreads) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 12'000, 150.0, 4);
  std::vector<std::byte> expected;
  for (const unsigned threads : {1U, 2U, 7U}) {
    test::Stage stage(cast, BackendKind::kCpu, threads);
    stage.advance(*crowd, 250'000);
    stage.finish({.vertex_budget = 150'000});
    const FrameGeometry geometry = stage.geometry();
    std::vector<std::byte> bytes;
    const auto append = [&bytes](const auto& span) {
      const auto raw = std::as_bytes(span);
      bytes.insert(bytes.end(), raw.begin(), raw.end());
    };
    append(geometry.instances);
    append(geometry.vertex_offset);
    append(geometry.triangle_offset);
    append(geometry.vertices);
    append(geometry.indices);
    if (expected.empty()) {
      expected = bytes;
    } else {
      EXPECT_TRUE(bytes == expected) << threads << " threads";
    }
  }
  EXPECT_GT(expected.size(), 1'000'000U);
}

TEST(GenerateTest, ViewsOfOneCrowdMayBeUsedFromDifferentThreads) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 2000, 60.0);
  test::Stage stage(cast, BackendKind::kCpu, 3);
  stage.advance(*crowd, 50'000);
  std::vector<std::uint64_t> vertices(4, 0);
  std::vector<std::jthread> threads;
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    threads.emplace_back([&, i] {
      auto view = stage.backend->make_view().value();
      Camera camera = stage.camera;
      camera.eye_world.x += 5.0 * static_cast<double>(i % 2);
      for (int round = 0; round < 5; ++round) {
        ASSERT_TRUE(stage.backend->cull(*view, stage.instances, camera, stage.viewport).ok());
        ASSERT_TRUE(stage.backend->select(*view, {.vertex_budget = 20'000}).ok());
        ASSERT_TRUE(stage.backend->allocate(*view).ok());
        ASSERT_TRUE(stage.backend->generate(*view).ok());
      }
      vertices[i] = stage.backend->counters(*view).vertices;
    });
  }
  threads.clear();
  EXPECT_EQ(vertices[0], vertices[2]);
  EXPECT_EQ(vertices[1], vertices[3]);
  EXPECT_GT(vertices[0], 0U);
}

}  // namespace
}  // namespace throng::render
