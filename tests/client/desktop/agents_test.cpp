#include "client/desktop/agents.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "throng/v1/view.pb.h"

namespace throng::client {
namespace {

template <typename T>
std::string bytes_of(const std::vector<T>& values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

TEST(UnpackAgentsTest, ColumnsAreAddedToTheOrigin) {
  v1::AgentColumns columns;
  columns.set_ids(bytes_of<std::uint64_t>({7, ~std::uint64_t{0}}));
  columns.set_positions(bytes_of<float>({1, 2, 3, 4, 5, 6}));
  columns.mutable_origin()->set_x(1e6);
  std::vector<Agent> agents = unpack_agents(columns);
  ASSERT_EQ(agents.size(), 2U);
  EXPECT_EQ(agents[1].id, ~std::uint64_t{0});
  EXPECT_EQ(agents[1].position_world, glm::dvec3(1e6 + 4, 5, 6));
  EXPECT_TRUE(std::isnan(agents[0].value));
  columns.set_values(bytes_of<float>({0.5F, 1.5F}));
  EXPECT_EQ(unpack_agents(columns)[1].value, 1.5F);
}

TEST(UnpackAgentsTest, WhatAColumnIsTooShortForIsLeftOut) {
  v1::AgentColumns columns;
  EXPECT_TRUE(unpack_agents(columns).empty());
  columns.set_ids(std::string(8 * 3 + 5, 'x'));
  columns.set_positions(std::string(12 + 11, 'x'));
  columns.set_values(std::string(3, 'x'));
  const std::vector<Agent> agents = unpack_agents(columns);
  ASSERT_EQ(agents.size(), 1U);
  EXPECT_TRUE(std::isnan(agents[0].value));
}

std::vector<Agent> at(double x) { return {Agent{1, {x, 0.0, 0.0}, 0.0F}}; }

TEST(TrailsTest, KeepTheLastSecondsOnly) {
  Trails trails;
  for (std::int64_t t = 0; t <= 20'000'000; t += 50'000) {
    trails.add(t, at(static_cast<double>(t) * 1e-6));
  }
  const Trails::Trail* trail = trails.of(1);
  ASSERT_NE(trail, nullptr);
  EXPECT_GE(trail->front().time_us, 14'000'000);
  EXPECT_LE(trail->size(), 61U);
  EXPECT_EQ(trails.of(2), nullptr);
}

TEST(TrailsTest, AreTakenBackWhenPlayedBackwards) {
  Trails trails;
  for (std::int64_t t = 0; t <= 2'000'000; t += 100'000) trails.add(t, at(0.0));
  trails.add(1'000'000, at(0.0));
  EXPECT_LE(trails.of(1)->back().time_us, 1'000'000);
}

TEST(TrailsTest, AnotherMomentBeginsAnew) {
  Trails trails;
  trails.add(0, at(0.0));
  trails.add(9'000'000, at(5.0));
  ASSERT_EQ(trails.of(1)->size(), 1U);
  EXPECT_EQ(trails.of(1)->front().time_us, 9'000'000);
}

}  // namespace
}  // namespace throng::client
