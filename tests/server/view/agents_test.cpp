#include "server/view/agents.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <utility>
#include <vector>

#include "throng/render/asset.hpp"
#include "throng/render/crowd.hpp"
#include "throng/render/environment.hpp"

namespace throng::server {
namespace {

/// Agents that stand.
AgentsAt standing(std::vector<glm::vec3> position_m) {
  auto cast = std::make_shared<render::Cast>();
  cast->members.resize(1);
  render::Crowd crowd(std::move(cast), {});
  auto membership = std::make_shared<render::Membership>();
  membership->epoch = 1;
  for (std::size_t i = 0; i < position_m.size(); ++i) membership->ids.push_back(i + 1);
  render::AgentFrame frame;
  frame.time_us = 0;
  frame.membership = std::move(membership);
  frame.position_m = std::move(position_m);
  EXPECT_TRUE(crowd.push(frame).ok());
  return {crowd.bracket(0), nullptr, 0, crowd.settings().origin_world, 0};
}

double sum_of(const DensityMap& map) {
  double sum = 0.0;
  for (const float density : map.density) sum += double{density} * map.cell_m * map.cell_m;
  return sum;
}

TEST(DensityMapTest, EachAgentCountsOnce) {
  EXPECT_NEAR(sum_of(density_map(standing({{0, 0, 0}, {5.3F, 1, 0}, {5.3F, 1.2F, 0}}))), 3.0, 1e-3);
  EXPECT_TRUE(density_map(standing({})).density.empty());
}

TEST(DensityMapTest, NothingIsOutsideOfTheWalkableArea) {
  AgentsAt agents = standing({{0.3F, 2, 0}, {4, 2, 0}});
  auto site = std::make_shared<render::Environment>();
  site->rings = {{{0, 0}, {8, 0}, {8, 4}, {0, 4}, {0, 0}},
                 {{4.2, 0}, {5, 0}, {5, 4}, {4.2, 4}, {4.2, 0}}};  // a hole beside who stands there
  agents.environment = site;
  const DensityMap map = density_map(agents);
  int inside = 0;
  for (std::uint32_t row = 0; row < map.rows; ++row) {
    for (std::uint32_t column = 0; column < map.columns; ++column) {
      const double x = map.low_world.x + column * map.cell_m,
                   y = map.low_world.y + row * map.cell_m;
      const float density = map.density[row * map.columns + column];
      const bool is_inside = x > 0 && x < 8 && y > 0 && y < 4 && !(x > 4.2 && x < 5);
      const bool is_outside = !is_inside && x != 0.0 && y != 0.0 && y != 4.0;
      EXPECT_TRUE(!is_outside || density == 0.0F) << x << ' ' << y;
      inside += is_inside && density > 0.0F ? 1 : 0;
    }
  }
  EXPECT_GT(inside, 20);
  EXPECT_LT(sum_of(map), 1.8);
}

}  // namespace
}  // namespace throng::server
