#include "throng/render/density.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numeric>
#include <random>

#include "render/compute/cpu/work_pool.hpp"
#include "render/compute/element/far_point.hpp"
#include "simplify/points/points.hpp"
#include "support/tiny_character.hpp"

namespace throng::render {
namespace {

constexpr Viewport kViewport{640, 360};

std::shared_ptr<const Cast> cast_with_points() {
  Cast cast;
  for (const float height_m : {1.6F, 1.9F}) {
    CharacterData data = test::make_tiny_character({.height_m = height_m});
    simplify::sample_points(data, {.count = 256});
    auto character = make_character(std::move(data));
    EXPECT_TRUE(character.ok()) << character.status();
    cast.members.push_back({*std::move(character), 1.0F});
  }
  return std::make_shared<const Cast>(std::move(cast));
}

std::vector<glm::vec3> grid(int side, float apart_m) {
  std::vector<glm::vec3> result;
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      result.emplace_back(static_cast<float>(x) * apart_m, static_cast<float>(y) * apart_m, 0.0F);
    }
  }
  return result;
}

void expect_whole(const Triangulation& t, std::size_t agents) {
  EXPECT_EQ(t.vertex_of.size(), agents);
  EXPECT_EQ(t.free_m2.size(), t.vertex_count());
  ASSERT_EQ(t.first_agent.size(), t.vertex_count() + 1U);
  EXPECT_EQ(t.first_agent.back(), t.agents.size());
  for (std::uint32_t v = 0; v < t.vertex_count(); ++v) {
    EXPECT_TRUE(std::isfinite(t.free_m2[v]));
    EXPECT_GE(t.free_m2[v], 0.0F);
    for (std::uint32_t k = t.first_agent[v]; k < t.first_agent[v + 1]; ++k) {
      EXPECT_EQ(t.vertex_of[t.agents[k]], v);
    }
  }
}

TEST(TriangulationTest, FreeSpaceOfAGridIsItsCell) {
  const auto agents = grid(12, 2.0F);
  const Triangulation t = triangulate(agents, {});
  expect_whole(t, agents.size());
  EXPECT_EQ(t.vertex_count(), 144U);
  EXPECT_EQ(t.triangles, 121U);  // squares: four on a circle
  for (std::uint32_t v = 0; v < t.vertex_count(); ++v) {
    // also at the border, where a half or a quarter of the polygons is missing
    EXPECT_NEAR(t.free_m2[v], 4.0F, 1e-3F);
  }
}

TEST(TriangulationTest, DenseAgentsHaveLessSpace) {
  auto agents = grid(10, 0.5F);
  for (const glm::vec3& p : grid(10, 3.0F)) agents.push_back(p + glm::vec3(40.0F, 0.0F, 0.0F));
  const Triangulation t = triangulate(agents, {});
  const auto mean = [&](std::size_t begin, std::size_t end) {
    float sum = 0.0F;
    for (std::size_t i = begin; i < end; ++i) sum += t.free_m2[t.vertex_of[i]];
    return sum / static_cast<float>(end - begin);
  };
  EXPECT_LT(mean(0, 100), 2.0F);
  EXPECT_GT(mean(100, 200), 6.0F);
}

TEST(TriangulationTest, AgentsOfOneGridPointShareAVertexAndItsSpace) {
  std::vector<glm::vec3> agents = grid(5, 2.0F);
  agents.push_back({4.05F, 4.0F, 0.0F});
  agents.push_back({4.0F, 4.1F, 0.0F});
  const Triangulation t = triangulate(agents, {});
  expect_whole(t, agents.size());
  EXPECT_EQ(t.vertex_count(), 25U);
  const std::uint32_t v = t.vertex_of[12];
  EXPECT_EQ(t.vertex_of[25], v);
  EXPECT_EQ(t.vertex_of[26], v);
  EXPECT_NEAR(t.free_m2[v], 4.0F / 3.0F, 1e-3F);
}

TEST(TriangulationTest, NobodyAndOneAndTwo) {
  expect_whole(triangulate({}, {}), 0);
  const std::vector<glm::vec3> one{{3, 4, 0}}, two{{0, 0, 0}, {0, 3, 0}};
  const Triangulation alone = triangulate(one, {});
  expect_whole(alone, 1);
  EXPECT_FLOAT_EQ(alone.free_m2[0], TriangulationOptions{}.most_free_m2);
  const Triangulation pair = triangulate(two, {});
  expect_whole(pair, 2);
  EXPECT_NEAR(pair.free_m2[0], 9.0F, 1e-3F);
}

TEST(TriangulationTest, CollinearAgentsHaveTheSquareOfTheirDistance) {
  std::vector<glm::vec3> agents;
  for (int i = 0; i < 200; ++i) agents.emplace_back(2.0F * static_cast<float>(i), 5.0F, 0.0F);
  const Triangulation t = triangulate(agents, {});
  expect_whole(t, agents.size());
  EXPECT_EQ(t.triangles, 0U);
  for (const float free_m2 : t.free_m2) EXPECT_NEAR(free_m2, 4.0F, 1e-3F);
  // slanted as well, where the grid makes steps of it
  for (glm::vec3& p : agents) p.y = 0.37F * p.x;
  expect_whole(triangulate(agents, {}), agents.size());
}

TEST(TriangulationTest, PlacesThatAreNoneGetNoVertex) {
  const float nan = std::nanf(""), infinite = std::numeric_limits<float>::infinity();
  std::vector<glm::vec3> agents = grid(4, 2.0F);
  agents.insert(agents.begin(), {nan, 0, 0});
  agents.push_back({0, infinite, 0});
  agents.push_back({-3e38F, 0, 0});
  agents.push_back({nan, nan, nan});
  const Triangulation t = triangulate(agents, {});
  expect_whole(t, agents.size());
  EXPECT_EQ(t.vertex_count(), 16U);
  EXPECT_EQ(t.vertex_of[0], Triangulation::kNoVertex);
  EXPECT_EQ(t.vertex_of[18], Triangulation::kNoVertex);
  const std::vector<glm::vec3> none(5, glm::vec3(nan));
  EXPECT_EQ(triangulate(none, {}).vertex_count(), 0U);
}

TEST(TriangulationTest, AMillionInOnePlaceAreOneVertex) {
  const std::vector<glm::vec3> agents(1'000'000, glm::vec3(12.5F, -3.0F, 0.0F));
  const Triangulation t = triangulate(agents, {});
  EXPECT_EQ(t.vertex_count(), 1U);
  EXPECT_EQ(t.agents.size(), agents.size());
  EXPECT_LE(t.free_m2[0], 1e-3F);
}

TEST(TriangulationTest, CellsGrowUntilTheVerticesAreFew) {
  const auto agents = grid(60, 1.0F);
  const Triangulation t = triangulate(agents, {}, {.most_vertices = 500});
  expect_whole(t, agents.size());
  EXPECT_LE(t.vertex_count(), 500U);
  EXPECT_GT(t.vertex_count(), 100U);
  // two agents at the ends of the world make no endless grid
  const std::vector<glm::vec3> far{{-1e7F, -1e7F, 0}, {1e7F, 1e7F, 0}};
  expect_whole(triangulate(far, {}), 2);
}

TEST(TriangulationTest, AbsentAgentsAreLeftOut) {
  const auto agents = grid(3, 2.0F);
  std::vector<std::uint8_t> present(9, 1);
  present[4] = 0;
  const Triangulation t = triangulate(agents, present);
  expect_whole(t, 9);
  EXPECT_EQ(t.vertex_count(), 8U);
  EXPECT_EQ(t.vertex_of[4], Triangulation::kNoVertex);
}

TEST(CrowdCloudTest, PointsAreOrderedByRemovalOfNearestNeighbours) {
  const auto cast = cast_with_points();
  const auto cloud = make_crowd_cloud(*cast, 128);
  ASSERT_TRUE(cloud.ok()) << cloud.status();
  ASSERT_EQ(cloud->count(), 128U);
  // each prefix is spread: its nearest two are farther apart than those of longer ones
  const auto nearest = [&](std::uint32_t n) {
    float least = std::numeric_limits<float>::max();
    for (std::uint32_t i = 0; i < n; ++i) {
      for (std::uint32_t k = 0; k < i; ++k) {
        least = std::min(least, glm::distance(cloud->position[i], cloud->position[k]));
      }
    }
    return least;
  };
  EXPECT_GT(nearest(8), nearest(32));
  EXPECT_GT(nearest(32), nearest(128));
  // a metre high, whoever it is the average of
  float top = 0.0F;
  for (const glm::vec3& p : cloud->position) top = std::max(top, p.z);
  EXPECT_NEAR(top, 1.0F, 0.08F);
  for (std::uint32_t i = 1; i < 128; ++i) EXPECT_LE(cloud->radius[i], cloud->radius[i - 1]);
}

TEST(FarFiguresTest, EachHasItsShapeInEveryNumberOfPoints) {
  const auto cast = cast_with_points();
  const auto figures = make_far_figures(*cast);
  ASSERT_TRUE(figures.ok()) << figures.status();
  EXPECT_EQ(FarFigures::level_of(1), 0U);
  EXPECT_EQ(FarFigures::level_of(5), 3U);
  EXPECT_EQ(FarFigures::level_of(511), FarFigures::kLevels - 2);
  EXPECT_EQ(FarFigures::level_of(1'000'000), FarFigures::kLevels - 1);
  std::uint32_t all = 0;
  for (std::uint32_t level = 0; level < FarFigures::kLevels; ++level) {
    const std::uint32_t count = FarFigures::kCounts[level];
    all += count;
    float low = 2.0F, high = -2.0F, largest = 0.0F;
    for (std::uint32_t i = 0; i < std::min(count, 256U); ++i) {
      const FarFigures::Point& point = figures->level(1, 0, level)[i];
      const float radius = std::abs(point.radius);  // negative: without a side
      low = std::min(low, point.position.z - radius);
      high = std::max(high, point.position.z + radius);
      largest = std::max(largest, radius);
    }
    // within the figure but for what rounds it off
    EXPECT_GT(low, -0.2F) << count;
    EXPECT_LT(high, 1.2F) << count;
    EXPECT_LT(largest, 0.7F) << count;
    if (count > 2) {
      EXPECT_GT(high - low, 0.7F) << count;
    }
  }
  EXPECT_EQ(all, FarFigures::kPointsOfAll);
}

TEST(FarFiguresTest, AreMadeOfThoseWhoOccur) {
  const auto cast = cast_with_points();
  auto figures = begin_far_figures(*cast);
  ASSERT_TRUE(figures.ok()) << figures.status();
  const std::size_t none = figures->points.size();
  const std::uint16_t second[] = {1, 1};
  add_far_figures(*cast, second, *figures);
  EXPECT_EQ(figures->points.size(), 2 * none);
  add_far_figures(*cast, second, *figures);
  EXPECT_EQ(figures->points.size(), 2 * none);
  EXPECT_NE(figures->level(1, 0, 0)->radius, 0.0F);
  EXPECT_EQ(figures->level(0, 0, 0)->radius, 0.0F);
  const auto all = make_far_figures(*cast);
  EXPECT_EQ(figures->level(1, 3, 5)->position, all->level(1, 3, 5)->position);
}

TEST(FarFiguresTest, ThereAreNoMoreThanTheirLimit) {
  Cast cast;
  const auto two = cast_with_points();
  for (int m = 0; m < 4; ++m) cast.members.push_back(two->members[1]);
  FarFigures figures = *begin_far_figures(cast);
  const std::size_t one = figures.points.size();
  const std::uint16_t all[] = {0, 1, 2, 3};
  constexpr std::uint32_t kMost = 2;
  add_far_figures(cast, all, figures, kMost);
  EXPECT_EQ(figures.points.size(), (1 + kMost) * one);
  for (const std::uint16_t late : {2, 3}) {
    EXPECT_NE(figures.block[late], FarFigures::kNobody);
    EXPECT_LE(figures.block[late], kMost);
  }
}

TEST(CrowdCloudTest, CastWithoutPointsIsRefused) {
  Cast cast;
  cast.members.push_back({*make_character(test::make_tiny_character()), 1.0F});
  EXPECT_EQ(make_crowd_cloud(cast).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(make_far_figures(cast).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(make_crowd_cloud(*cast_with_points(), 0).status().code(),
            absl::StatusCode::kInvalidArgument);
}

struct Far {
  std::shared_ptr<const Cast> cast = cast_with_points();
  CrowdCloud cloud = *make_crowd_cloud(*cast, 128);
  FarFigures figures = *make_far_figures(*cast);
  std::shared_ptr<Snapshot> snapshot = std::make_shared<Snapshot>();
  Bracket bracket{snapshot, snapshot};
  FarAgents agents;
  Triangulation triangulation;
  FarView view;

  explicit Far(std::vector<glm::vec3> at) {
    const std::size_t count = at.size();
    auto roster = std::make_shared<Roster>();
    for (std::size_t i = 0; i < count; ++i) {
      roster->id.push_back(i);
      roster->character.push_back(static_cast<std::uint16_t>(i % 2));
      roster->scale.push_back(1.0F);
      roster->seed.push_back(static_cast<std::uint32_t>(i));
    }
    snapshot->position_m = std::move(at);
    snapshot->heading_rad.assign(count, 0.3F);
    snapshot->velocity_mps.assign(count, glm::vec3(0.0F));
    snapshot->speed_mps.assign(count, 0.0F);
    snapshot->turn_radps.assign(count, 0.0F);
    snapshot->walked_cycles.assign(count, 0.0);
    snapshot->present.assign(count, 1);
    snapshot->roster = roster;
    agents = make_far_agents(*cast, cloud, *roster);
    triangulation = triangulate(snapshot->position_m, {});
    Camera camera;
    camera.eye_world = {20.0, -150.0, 30.0};
    camera.target_world = {20.0, 20.0, 0.0};
    view = make_far_view(camera, kViewport, glm::dvec3(0.0));
  }

  FarPlan plan(std::uint64_t budget, const FarRule& rule = {}) const {
    FarPlan made;
    const absl::Status status = made.make(triangulation, agents, cloud, view, budget, rule);
    EXPECT_TRUE(status.ok()) << status;
    return made;
  }

  std::vector<Splat> splats(const FarPlan& plan, bool own, unsigned threads = 2) const {
    WorkPool pool(threads);
    std::vector<FarPlace> places;
    std::vector<Splat> result;
    place_far(plan, *cast, nullptr, bracket, 0, CrowdSettings{}, view, pool, places);
    if (own) {
      generate_far(plan, agents, figures, places, view, pool, result);
    } else {
      generate_far(plan, agents, cloud, places, view, pool, result);
    }
    return result;
  }

  std::uint64_t points_of(const FarPlan& plan) const {
    std::uint64_t sum = 0;
    for (const FarShare& share : plan.shares()) sum += share.points;
    return sum;
  }
};

TEST(FarPlanTest, NeverExceedsTheBudgetAndUsesIt) {
  const Far far(grid(40, 1.0F));
  for (const PointShare share : {PointShare::kDensity, PointShare::kEqual, PointShare::kVisible}) {
    for (const bool own : {false, true}) {
      for (const std::uint64_t budget : {1U, 17U, 400U, 1600U, 5000U}) {
        const FarPlan plan = far.plan(budget, {share, own});
        EXPECT_EQ(plan.points(), far.points_of(plan));
        EXPECT_LE(plan.points(), budget);
        // beyond this, more points than show would be left to the near ones
        if (budget <= 1600U) {
          EXPECT_GE(plan.points() + 2, budget);
        }
        EXPECT_EQ(plan.visible(), 1600U);
        EXPECT_EQ(far.splats(plan, own).size(), plan.points());
      }
    }
  }
}

TEST(FarPlanTest, BudgetOfNoneIsRefusedByName) {
  const Far far(grid(3, 1.0F));
  FarPlan plan;
  const absl::Status status =
      plan.make(far.triangulation, far.agents, far.cloud, far.view, 0, FarRule{});
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_NE(status.message().find("budget is 0"), std::string::npos) << status;
  // and agents that are not those of the triangulation
  EXPECT_EQ(plan.make(far.triangulation, {}, far.cloud, far.view, 9, FarRule{}).code(),
            absl::StatusCode::kInvalidArgument);
}

TEST(FarPlanTest, NobodyGetsMoreThanTheCloudHasOrThanShows) {
  const Far far(grid(6, 3.0F));
  const FarPlan plan = far.plan(10'000'000);
  EXPECT_LT(plan.points(), 36U * 400U);
  for (const FarShare& share : plan.shares()) EXPECT_LE(share.points, far.cloud.count());
}

TEST(FarPlanTest, WhoHasSpaceAndIsNearGetsMore) {
  // left a dense crowd, right a thin one at the same distances
  auto at = grid(20, 0.5F);
  for (const glm::vec3& p : grid(20, 2.5F)) at.push_back(p + glm::vec3(30.0F, 0.0F, 0.0F));
  const Far far(at);
  const FarPlan plan = far.plan(4000);
  std::uint64_t dense = 0, thin = 0;
  for (const FarShare& share : plan.shares()) (share.agent < 400 ? dense : thin) += share.points;
  EXPECT_GT(thin, dense + dense / 4);
}

TEST(FarPlanTest, WhoIsHiddenByOthersGetsHardlyAPoint) {
  // a wall of people, and some behind it whom an eye as high as theirs can't see
  std::vector<glm::vec3> at;
  for (int i = 0; i < 900; ++i) {
    at.emplace_back(0.2F * static_cast<float>(i % 300), 0.4F * static_cast<float>(i / 300), 0.0F);
  }
  for (int i = 0; i < 50; ++i) at.emplace_back(20.0F + 0.4F * static_cast<float>(i), 8.0F, 0.0F);
  Far far(at);
  Camera camera;
  camera.eye_world = {30.0, -30.0, 1.0};
  camera.target_world = {30.0, 0.0, 1.0};
  far.view = make_far_view(camera, kViewport, glm::dvec3(0.0));
  std::uint64_t hidden[2] = {};
  for (const PointShare share : {PointShare::kDensity, PointShare::kVisible}) {
    const FarPlan plan = far.plan(3000, {share, false});
    for (const FarShare& each : plan.shares()) {
      if (each.agent >= 900) hidden[share == PointShare::kVisible] += each.points;
    }
  }
  EXPECT_GT(hidden[0], 20U);
  EXPECT_LT(10 * hidden[1], hidden[0]);
}

TEST(FarPlanTest, WhoIsNearIsLeftToOtherForms) {
  Far far(grid(40, 1.0F));
  const auto all = far.splats(far.plan(20'000), false);
  far.view.least_m = 170.0F;
  std::uint32_t near = 0;
  const auto rest = far.splats(far.plan(20'000), false);
  for (const Splat& splat : rest) near += glm::length(splat.position_relative) < 168.0F ? 1U : 0U;
  EXPECT_EQ(near, 0U);
  EXPECT_GT(rest.size(), 500U);
  EXPECT_LT(rest.size(), all.size());
}

TEST(FarPlanTest, WhoHasGoneOrChangedIsNotShown) {
  Far far(grid(10, 1.0F));
  const FarPlan plan = far.plan(1000);
  far.snapshot->present[3] = 0;
  const std::size_t before = far.splats(plan, false).size();
  EXPECT_LT(before, plan.points());
  // slot 5 belongs to somebody else now
  Roster other = *far.snapshot->roster;
  other.id[5] = 1'000;
  WorkPool pool(1);
  std::vector<FarPlace> places;
  place_far(plan, *far.cast, &other, far.bracket, 0, CrowdSettings{}, far.view, pool, places);
  for (std::size_t i = 0; i < places.size(); ++i) {
    const std::uint32_t agent = plan.shares()[i].agent;
    EXPECT_EQ(places[i].visible, agent == 3 || agent == 5 ? 0U : 1U);
  }
}

TEST(FarPlanTest, NothingInViewGetsNothing) {
  Far far(grid(5, 1.0F));
  far.view.eye_world = {0.0, 500.0, 10.0};  // looks away from it
  for (const PointShare share : {PointShare::kDensity, PointShare::kEqual, PointShare::kVisible}) {
    const FarPlan plan = far.plan(100, {share, false});
    EXPECT_TRUE(plan.shares().empty());
    EXPECT_TRUE(far.splats(plan, false).empty());
  }
  FarPlan plan;
  EXPECT_TRUE(plan.make({}, {}, far.cloud, far.view, 100, {PointShare::kEqual, false}).ok());
  EXPECT_TRUE(plan.shares().empty());
}

TEST(FarPlanTest, AMillionInOnePlaceShareTheBudget) {
  const Far far(std::vector<glm::vec3>(1'000'000, glm::vec3(20.0F, 0.0F, 0.0F)));
  for (const PointShare share : {PointShare::kDensity, PointShare::kEqual, PointShare::kVisible}) {
    const FarPlan plan = far.plan(500, {share, true});
    EXPECT_LE(plan.points(), 500U);
    EXPECT_GT(plan.points(), 0U);
  }
}

TEST(FarFiguresTest, OnePointIsAsSlimAsItsFigure) {
  const Far far(grid(20, 3.0F));
  const FarPlan plan = far.plan(400, {PointShare::kVisible, true});
  const std::vector<Splat> splats = far.splats(plan, true);
  ASSERT_EQ(splats.size(), plan.points());
  std::size_t at = 0, alone = 0;
  for (const FarShare& share : plan.shares()) {
    const Splat& splat = splats[at];
    at += share.points;
    if (share.points > 1) continue;
    ++alone;
    EXPECT_LT(splat.radius_m, 0.0F);
    EXPECT_GT(splat.regions, 0U);
    EXPECT_LT(splat.regions, 255U);
  }
  EXPECT_GT(alone, 0U);
}

TEST(FarPlanTest, SplatsDoNotDependOnThreads) {
  const Far far(grid(30, 1.0F));
  for (const bool own : {false, true}) {
    const FarPlan plan = far.plan(9000, {PointShare::kVisible, own});
    const std::vector<Splat> a = far.splats(plan, own, 1), b = far.splats(plan, own, 4);
    ASSERT_EQ(a.size(), plan.points());
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(a[i].position_relative, b[i].position_relative);
      EXPECT_EQ(a[i].base, b[i].base);
      EXPECT_EQ(a[i].visible, kNobody);
    }
  }
}

TEST(TriangulationWorkerTest, GivesTheNewestOfWhatWasAskedFor) {
  TriangulationWorker worker(std::chrono::milliseconds(0));
  EXPECT_EQ(worker.newest(), nullptr);
  for (int side = 2; side < 6; ++side) {
    auto snapshot = std::make_shared<Snapshot>();
    snapshot->position_m = grid(side, 2.0F);
    snapshot->present.assign(snapshot->position_m.size(), 1);
    worker.request(snapshot);
  }
  worker.wait();
  ASSERT_NE(worker.newest(), nullptr);
  EXPECT_EQ(worker.newest()->vertex_count(), 25U);
}

TEST(FarFiguresTest, LevelsBeginWhereTheOnesBeforeEnd) {
  EXPECT_EQ(element::kFarPointsOfPose, FarFigures::kPointsOfAll);
  EXPECT_EQ(element::kFarPoses, FarFigures::kPoses);
  for (std::uint32_t points = 1; points < 600; ++points) {
    std::uint32_t begin = 0;
    for (std::uint32_t k = 0; k < FarFigures::level_of(points); ++k)
      begin += FarFigures::kCounts[k];
    EXPECT_EQ(element::far_level_begin(points), begin) << points;
  }
}

}  // namespace
}  // namespace throng::render
