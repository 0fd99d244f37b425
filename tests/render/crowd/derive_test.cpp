#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

#include "render/compute/crowd_fixture.hpp"
#include "render/compute/element/angle.hpp"
#include "throng/render/crowd.hpp"

namespace throng::render {
namespace {

using test::frame_at;
using test::members;

/// One agent of a one-character cast on a path, sampled at a rate; the snapshots in order.
std::vector<std::shared_ptr<const Snapshot>> sampled(
    double rate_hz, double seconds, const std::function<glm::vec3(double)>& path,
    const std::function<float(double)>& heading = nullptr, std::uint64_t id = 5) {
  auto cast = std::make_shared<Cast>(*test::tiny_cast());
  cast->members.resize(1);
  Crowd crowd(cast, {});
  const auto who = members({id});
  std::vector<std::shared_ptr<const Snapshot>> result;
  const int frames = static_cast<int>(seconds * rate_hz);
  for (int f = 0; f <= frames; ++f) {
    const double t = f / rate_hz;
    std::vector<float> heading_rad;
    if (heading != nullptr) heading_rad.push_back(heading(t));
    EXPECT_TRUE(crowd.push(frame_at(std::llround(t * 1e6), who, {path(t)}, heading_rad)).ok());
    result.push_back(crowd.newest());
  }
  return result;
}

float turn_between(float a, float b) { return std::fabs(element::wrap_angle(b - a)); }

TEST(DeriveTest, HeadingFollowsTheMotion) {
  for (const double rate_hz : {1.0, 3.0, 10.0, 25.0, 100.0}) {
    const auto snapshots =
        sampled(rate_hz, 4.0, [](double t) { return glm::vec3(-0.6 * t, 0.6 * t, 0.0); });
    EXPECT_TRUE(std::isnan(snapshots[0]->heading_rad[0])) << "no motion seen yet";
    for (std::size_t i = 1; i < snapshots.size(); ++i) {
      EXPECT_NEAR(snapshots[i]->heading_rad[0], 0.75 * std::numbers::pi, 0.02)
          << rate_hz << " Hz, " << i;
    }
  }
}

TEST(DeriveTest, GivenHeadingIsKeptAndWrapped) {
  const auto snapshots = sampled(
      10.0, 1.0, [](double t) { return glm::vec3(t, 0.0, 0.0); }, [](double) { return 100.0F; });
  for (const auto& snapshot : snapshots) {
    EXPECT_NEAR(snapshot->heading_rad[0], std::remainder(100.0, 2.0 * std::numbers::pi), 1e-4);
  }
}

TEST(DeriveTest, MissingHeadingOfSomeRowsIsDerived) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const auto snapshots = sampled(
      10.0, 2.0, [](double t) { return glm::vec3(0.0, t, 0.0); },
      [nan](double t) { return t < 1.0 ? nan : 0.5F; });
  EXPECT_NEAR(snapshots[5]->heading_rad[0], 0.5 * std::numbers::pi, 0.01);
  EXPECT_NEAR(snapshots[15]->heading_rad[0], 0.5, 1e-6);
}

TEST(DeriveTest, StandingAgentDoesNotTurnInTheNoise) {
  // walks for two seconds, then stands with a noise of 5 mm at 25 Hz
  const auto snapshots = sampled(25.0, 12.0, [](double t) {
    const auto n = static_cast<std::uint64_t>(std::llround(t * 25.0));
    return glm::vec3(std::min(t, 2.0) + 0.01 * (test::noise(2 * n) - 0.5),
                     0.01 * (test::noise(2 * n + 1) - 0.5), 0.0);
  });
  const float at_stop_rad = snapshots[75]->heading_rad[0];
  EXPECT_LT(std::fabs(at_stop_rad), 0.4F);
  for (std::size_t i = 75; i < snapshots.size(); ++i) {
    EXPECT_LT(turn_between(snapshots[i]->heading_rad[0], at_stop_rad), 0.35F) << i;
  }
}

TEST(DeriveTest, AgentThatSwaysInAQueueFacesForward) {
  // 5 cm to either side once a second, as heads do, and 15 cm/s forward
  const auto snapshots = sampled(25.0, 12.0, [](double t) {
    return glm::vec3(0.15 * t, 0.05 * std::sin(2.0 * std::numbers::pi * t), 0.0);
  });
  for (std::size_t i = 75; i < snapshots.size(); ++i) {
    EXPECT_LT(std::fabs(snapshots[i]->heading_rad[0]), 0.5F) << i;
  }
}

TEST(DeriveTest, WalkerRoundACornerTurnsWithinAMetre) {
  for (const double rate_hz : {2.0, 10.0, 25.0}) {
    const auto snapshots = sampled(rate_hz, 5.0, [](double t) {
      return t < 2.0 ? glm::vec3(1.3 * t, 0.0, 0.0) : glm::vec3(2.6, 1.3 * (t - 2.0), 0.0);
    });
    const auto after = static_cast<std::size_t>(2.8 * rate_hz + 0.5);
    EXPECT_GT(snapshots[after]->heading_rad[0], 1.2F) << rate_hz;
  }
}

TEST(DeriveTest, HeadingHardlyLagsOnACircle) {
  for (const double rate_hz : {5.0, 10.0, 25.0}) {
    const double turn_radps = 1.3 / 3.0;
    const auto snapshots = sampled(rate_hz, 6.0, [&](double t) {
      return glm::vec3(3.0 * std::sin(turn_radps * t), 3.0 - 3.0 * std::cos(turn_radps * t), 0.0);
    });
    for (auto i = static_cast<std::size_t>(3.0 * rate_hz); i < snapshots.size(); ++i) {
      const auto along_rad = static_cast<float>(turn_radps * static_cast<double>(i) / rate_hz);
      // the mean of the motion itself is 0.11 behind
      EXPECT_LT(turn_between(snapshots[i]->heading_rad[0], along_rad), 0.03F) << rate_hz;
    }
  }
}

TEST(DeriveTest, WalkerRoundACornerHardlyTurnsTooFar) {
  for (const double rate_hz : {5.0, 10.0, 25.0}) {
    const auto snapshots = sampled(rate_hz, 5.0, [](double t) {
      return t < 2.0 ? glm::vec3(1.3 * t, 0.0, 0.0) : glm::vec3(2.6, 1.3 * (t - 2.0), 0.0);
    });
    for (std::size_t i = 1; i < snapshots.size(); ++i) {
      EXPECT_LT(snapshots[i]->heading_rad[0], 1.5708F + 0.25F) << rate_hz;
    }
    EXPECT_NEAR(snapshots.back()->heading_rad[0], 1.5708F, 0.02F);
  }
}

TEST(DeriveTest, WalkerWhoSwaysHardlyTurns) {
  // 2 cm to either side once a second at 1.3 m/s: the motion itself turns by 0.1
  const auto snapshots = sampled(25.0, 12.0, [](double t) {
    return glm::vec3(1.3 * t, 0.02 * std::sin(2.0 * std::numbers::pi * t), 0.0);
  });
  float most_rad = 0.0F;
  for (std::size_t i = 75; i < snapshots.size(); ++i)
    most_rad = std::max(most_rad, std::fabs(snapshots[i]->heading_rad[0]));
  EXPECT_LT(most_rad, 0.1F);
}

TEST(DeriveTest, AgentThatTurnsRoundDoesNotFlip) {
  const auto snapshots =
      sampled(25.0, 6.0, [](double t) { return glm::vec3(t < 3.0 ? t : 6.0 - t, 0.0, 0.0); });
  for (std::size_t i = 2; i < snapshots.size(); ++i) {
    EXPECT_LE(turn_between(snapshots[i]->heading_rad[0], snapshots[i - 1]->heading_rad[0]),
              4.5F / 25.0F + 1e-4F);
  }
  EXPECT_NEAR(std::fabs(snapshots.back()->heading_rad[0]), std::numbers::pi, 0.05);
}

TEST(DeriveTest, SpeedIsThatOfTheMotion) {
  for (const double rate_hz : {1.0, 10.0, 50.0}) {
    const auto snapshots =
        sampled(rate_hz, 5.0, [](double t) { return glm::vec3(0.0, 1.3 * t, 0.0); });
    EXPECT_NEAR(snapshots.back()->speed_mps[0], 1.3, 0.01);
    EXPECT_NEAR(snapshots.back()->velocity_mps[0].y, 1.3, 0.01);
  }
}

TEST(DeriveTest, FeetDoNotSlide) {
  // at the clip's own speed a cycle covers exactly the stride, whatever the sampling
  double expected = 0.0;
  for (const double rate_hz : {1.0, 2.0, 10.0, 60.0}) {
    const auto snapshots =
        sampled(rate_hz, 20.0, [](double t) { return glm::vec3(1.5 * t, 0.0, 0.0); });
    const float scale = snapshots[0]->roster->scale[0];
    const double cycles = snapshots.back()->walked_cycles[0] - snapshots[0]->walked_cycles[0];
    EXPECT_NEAR(cycles, 30.0 / (1.4 * scale), 0.02) << rate_hz << " Hz";
    if (expected == 0.0) expected = cycles;
    EXPECT_NEAR(cycles, expected, 0.01);
  }
}

TEST(DeriveTest, CyclesNeverRunBackwardsOnACurve) {
  const auto snapshots = sampled(10.0, 30.0, [](double t) {
    return glm::vec3(3.0 * std::cos(0.4 * t), 3.0 * std::sin(0.4 * t), 0.0);
  });
  for (std::size_t i = 2; i < snapshots.size(); ++i) {
    EXPECT_GT(snapshots[i]->walked_cycles[0], snapshots[i - 1]->walked_cycles[0]);
    const double along = element::wrap_angle(
        snapshots[i]->heading_rad[0] -
        static_cast<float>(0.04 * static_cast<double>(i) + std::numbers::pi / 2));
    EXPECT_TRUE(i <= 10 || std::fabs(along) < 0.25) << "faces along the circle";
  }
}

TEST(DeriveTest, StandingAgentTakesNoSteps) {
  const auto snapshots = sampled(25.0, 10.0, [](double) { return glm::vec3(1.0, 2.0, 0.0); });
  EXPECT_EQ(snapshots.back()->walked_cycles[0], snapshots[0]->walked_cycles[0]);
  EXPECT_EQ(snapshots.back()->speed_mps[0], 0.0F);
}

TEST(DeriveTest, AgentThatFacesBackIsWalkedBackwards) {
  const auto snapshots = sampled(
      10.0, 5.0, [](double t) { return glm::vec3(t, 0.0, 0.0); }, [](double) { return 3.14159F; });
  EXPECT_LT(snapshots.back()->walked_cycles[0], snapshots[0]->walked_cycles[0] - 2.0);
}

TEST(DeriveTest, TeleportTakesNoStepsAndKeepsSpeedAndHeading) {
  const auto snapshots =
      sampled(10.0, 4.0, [](double t) { return glm::vec3(t < 2.05 ? t : t + 500.0, 0.0, 0.0); });
  const std::size_t jump = 21;
  EXPECT_EQ(snapshots[jump]->walked_cycles[0], snapshots[jump - 1]->walked_cycles[0]);
  EXPECT_NEAR(snapshots[jump]->speed_mps[0], 1.0, 0.01);
  EXPECT_NEAR(snapshots[jump]->heading_rad[0], 0.0, 0.01);
  EXPECT_NEAR(snapshots.back()->speed_mps[0], 1.0, 0.01);
  EXPECT_LT(snapshots.back()->walked_cycles[0], 6.0);
}

TEST(DeriveTest, NearlyEqualTimeStampsDoNotMakeARocket) {
  auto cast = test::tiny_cast();
  Crowd crowd(cast, {});
  const auto who = members({5});
  ASSERT_TRUE(crowd.push(frame_at(0, who, {{0, 0, 0}})).ok());
  ASSERT_TRUE(crowd.push(frame_at(1, who, {{0.3F, 0, 0}})).ok());
  EXPECT_LE(crowd.newest()->speed_mps[0], 12.0F);
  EXPECT_LE(glm::length(crowd.newest()->velocity_mps[0]), 12.01F);
}

TEST(DeriveTest, WalkersStartInDifferentPhases) {
  float least = 1.0F, most = 0.0F;
  for (std::uint64_t id = 0; id < 50; ++id) {
    const auto snapshots = sampled(
        1.0, 0.0, [](double) { return glm::vec3(0.0F); }, nullptr, id);
    const auto phase = static_cast<float>(snapshots[0]->walked_cycles[0]);
    least = std::min(least, phase);
    most = std::max(most, phase);
  }
  EXPECT_LT(least, 0.1F);
  EXPECT_GT(most, 0.9F);
}

TEST(DeriveTest, AgentThatComesBackStartsAnew) {
  Crowd crowd(test::tiny_cast(), {});
  const auto who = members({5});
  for (int f = 0; f < 10; ++f) {
    ASSERT_TRUE(
        crowd.push(frame_at(100'000 * f, who, {{0.15F * static_cast<float>(f), 0, 0}})).ok());
  }
  ASSERT_TRUE(crowd.push(frame_at(1'000'000, members({}, 2), {})).ok());
  ASSERT_TRUE(crowd.push(frame_at(1'100'000, who, {{90, 0, 0}})).ok());
  EXPECT_EQ(crowd.newest()->speed_mps[0], 0.0F);
  EXPECT_LT(crowd.newest()->walked_cycles[0], 1.0);
  EXPECT_TRUE(std::isnan(crowd.newest()->heading_rad[0]));
}

}  // namespace
}  // namespace throng::render
