#include "server/batch/synthetic.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <unordered_map>
#include <unordered_set>

namespace throng::server {
namespace {

TEST(SyntheticTest, SameSeedGivesTheSameCrowdAndAnotherDoesNot) {
  trajectory::Frame a, b, c;
  auto first = make_synthetic(200, 7, 1.0), second = make_synthetic(200, 7, 1.0),
       other = make_synthetic(200, 8, 1.0);
  while (*first->next(a)) {
    ASSERT_TRUE(*second->next(b));
    ASSERT_TRUE(*other->next(c));
    EXPECT_EQ(a.x_m, b.x_m);
    EXPECT_EQ(a.ids, b.ids);
    EXPECT_NE(a.x_m, c.x_m);
  }
  EXPECT_FALSE(*second->next(b));
}

TEST(SyntheticTest, PeopleWalkAtHumanSpeedInTheDirectionTheyFace) {
  auto reader = make_synthetic(500, 3, 3.0);
  std::unordered_map<std::uint64_t, std::pair<double, double>> before;
  trajectory::Frame frame;
  std::uint32_t moved = 0;
  std::int64_t last_us = -1;
  while (*reader->next(frame)) {
    EXPECT_GT(frame.time_us, last_us);
    last_us = frame.time_us;
    ASSERT_EQ(std::unordered_set<std::uint64_t>(frame.ids.begin(), frame.ids.end()).size(), 500U);
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      const auto found = before.find(frame.ids[i]);
      if (found == before.end()) continue;
      const double dx = frame.x_m[i] - found->second.first;
      const double dy = frame.y_m[i] - found->second.second;
      const double step = std::hypot(dx, dy);
      EXPECT_LT(step / 0.1, 4.0);
      if (step < 0.01) continue;
      ++moved;
      const double across =
          dx * -std::sin(frame.heading_rad[i]) + dy * std::cos(frame.heading_rad[i]);
      EXPECT_LT(std::abs(across) / step, 0.1);
    }
    before.clear();
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      before[frame.ids[i]] = {frame.x_m[i], frame.y_m[i]};
    }
  }
  EXPECT_EQ(last_us, 3'000'000);
  EXPECT_GT(moved, 10'000U);
}

}  // namespace
}  // namespace throng::server
