#include "server/scene/playout_clock.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>

#include "server/scene/overview.hpp"

namespace throng::server {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

const Clock::time_point kBegin = Clock::time_point(std::chrono::hours(1));

/// Feeds a producer of `rate_hz` that runs `pace` times real time and looks 60 times a second.
/// Calls `look(wall_us, scene_us)` for each look.
template <typename Look>
void play(PlayoutClock& clock, double rate_hz, double pace, double seconds, Look look,
          std::int64_t wall_begin_us = 0, std::int64_t scene_begin_us = 0) {
  const double period_us = 1e6 / rate_hz;
  double next_frame_us = 0;
  for (double wall_us = 0; wall_us < seconds * 1e6; wall_us += 1e6 / 60) {
    while (next_frame_us <= wall_us) {
      clock.on_frame(
          scene_begin_us + static_cast<std::int64_t>(next_frame_us * pace),
          kBegin + microseconds(wall_begin_us + static_cast<std::int64_t>(next_frame_us)));
      next_frame_us += period_us;
    }
    const auto now = kBegin + microseconds(wall_begin_us + static_cast<std::int64_t>(wall_us));
    look(static_cast<std::int64_t>(wall_us), clock.at(now));
  }
}

TEST(PlayoutClockTest, ShowsZeroBeforeAnyFrame) {
  PlayoutClock clock;
  clock.start(10.0);
  EXPECT_EQ(clock.at(kBegin), 0);
}

TEST(PlayoutClockTest, FollowsALiveProducerSmoothlyOneAndAHalfPeriodsBehind) {
  PlayoutClock clock;
  clock.start(10.0);
  std::int64_t before_us = 0;
  play(clock, 10.0, 1.0, 8.0, [&](std::int64_t wall_us, std::int64_t scene_us) {
    EXPECT_GE(scene_us, before_us);
    if (wall_us > 2'000'000) {
      // One look is 16,667 us of the wall clock; a smooth playhead does just that.
      EXPECT_NEAR(static_cast<double>(scene_us - before_us), 16'667.0, 1'000.0);
      EXPECT_NEAR(static_cast<double>(wall_us - scene_us), 150'000.0, 20'000.0);
    }
    before_us = scene_us;
  });
}

TEST(PlayoutClockTest, ArrivalsThatJitterAreCoveredByTheDelay) {
  PlayoutClock clock;
  clock.start(25.0);
  std::uint32_t random = 1;
  std::int64_t frame = 0, before_us = 0, next_us = 0, arrived_us = 0;
  for (std::int64_t wall_us = 0; wall_us < 10'000'000; wall_us += 16'667) {
    while (next_us <= wall_us) {
      clock.on_frame(40'000 * frame++, kBegin + microseconds(next_us));
      arrived_us = next_us;
      // up to 100 ms late, but never out of order
      random = random * 1664525U + 1013904223U;
      next_us =
          std::max(arrived_us, 40'000 * frame + static_cast<std::int64_t>(random >> 8) % 100'000);
    }
    const std::int64_t scene_us = clock.at(kBegin + microseconds(wall_us));
    if (wall_us > 4'000'000) {
      EXPECT_GT(scene_us - before_us, 16'667 * 7 / 10) << wall_us;
      EXPECT_LT(scene_us - before_us, 16'667 * 13 / 10) << wall_us;
    }
    before_us = scene_us;
  }
}

TEST(PlayoutClockTest, HoldsFirstFrameUntilTheDelayIsFilled) {
  PlayoutClock clock;
  clock.start(10.0);
  clock.on_frame(5'000'000, kBegin);
  EXPECT_EQ(clock.at(kBegin), 5'000'000);
  clock.on_frame(5'100'000, kBegin + milliseconds(100));
  EXPECT_EQ(clock.at(kBegin + milliseconds(100)), 5'000'000);
  EXPECT_GT(clock.at(kBegin + milliseconds(190)), 5'000'000);
}

TEST(PlayoutClockTest, HoldsNewestFrameWhenTheProducerStops) {
  PlayoutClock clock;
  clock.start(0.0);
  play(clock, 20.0, 1.0, 3.0, [](std::int64_t, std::int64_t) {});
  std::int64_t last_us = 0;
  for (int ms = 3'000; ms < 6'000; ms += 16) last_us = clock.at(kBegin + milliseconds(ms));
  EXPECT_EQ(last_us, 2'950'000);
}

TEST(PlayoutClockTest, FollowsAProducerThatRunsFasterThanRealTime) {
  PlayoutClock clock;
  clock.start(0.0);
  std::int64_t before_us = 0;
  play(clock, 25.0, 5.0, 6.0, [&](std::int64_t wall_us, std::int64_t scene_us) {
    if (wall_us > 3'000'000) {
      EXPECT_NEAR(static_cast<double>(scene_us - before_us), 5 * 16'667.0, 8'000.0);
    }
    before_us = scene_us;
  });
  EXPECT_NEAR(clock.pace(), 5.0, 0.1);
}

TEST(PlayoutClockTest, JumpsAfterALongPauseInsteadOfHurrying) {
  PlayoutClock clock;
  clock.start(10.0);
  play(clock, 10.0, 1.0, 2.0, [](std::int64_t, std::int64_t) {});
  for (int ms = 2'000; ms < 20'000; ms += 16) clock.at(kBegin + milliseconds(ms));
  std::int64_t shown_us = 0;
  play(
      clock, 10.0, 1.0, 2.0, [&](std::int64_t, std::int64_t scene_us) { shown_us = scene_us; },
      20'000'000, 18'000'000);
  EXPECT_GT(shown_us, 19'500'000);
}

TEST(PlayoutClockTest, DelayStaysWithinItsBounds) {
  PlayoutClock fast;
  fast.start(1000.0);
  EXPECT_EQ(fast.delay(), milliseconds(40));
  PlayoutClock slow;
  slow.start(0.1);
  EXPECT_EQ(slow.delay(), milliseconds(2000));
}

TEST(PlayoutClockTest, ANewRunForgetsTheOldOne) {
  PlayoutClock clock;
  clock.start(10.0);
  play(clock, 10.0, 1.0, 2.0, [](std::int64_t, std::int64_t) {});
  clock.start(10.0);
  EXPECT_EQ(clock.at(kBegin + milliseconds(2'100)), 0);
}

TEST(OverviewBoxTest, GrowsQuicklyAndShrinksSlowly) {
  OverviewBox overview;
  const WorldBox small{{0, 0, 0}, {10, 10, 0}}, large{{0, 0, 0}, {50, 10, 0}};
  Clock::time_point now = kBegin;
  EXPECT_NEAR(overview.follow(small, now).high.x, 11.0, 1e-9);
  for (int i = 0; i < 60; ++i) overview.follow(large, now += milliseconds(33));
  const double grown_m = overview.follow(large, now += milliseconds(33)).high.x;
  EXPECT_GT(grown_m, 49.0);
  for (int i = 0; i < 60; ++i) overview.follow(small, now += milliseconds(33));
  EXPECT_GT(overview.follow(small, now).high.x, 35.0);
  for (int i = 0; i < 6000; ++i) overview.follow(small, now += milliseconds(33));
  EXPECT_EQ(overview.follow(small, now += milliseconds(33)).high.x, 11.0);
}

TEST(OverviewBoxTest, OfAMomentThatStandsStillOnlyGrows) {
  OverviewBox overview;
  const WorldBox small{{0, 0, 0}, {10, 10, 0}}, large{{0, 0, 0}, {50, 10, 0}};
  Clock::time_point now = kBegin;
  overview.follow(large, now);
  for (int i = 0; i < 60; ++i) overview.follow(small, now += milliseconds(33), false);
  EXPECT_EQ(overview.follow(small, now, false).high.x, 51.0);
  EXPECT_LT(overview.follow(small, now += milliseconds(33)).high.x, 51.0);
  overview.forget();
  overview.follow(small, now);
  for (int i = 0; i < 120; ++i) overview.follow(large, now += milliseconds(33), false);
  EXPECT_EQ(overview.follow(large, now, false).high.x, 51.0);
}

TEST(OverviewBoxTest, SingleAgentGetsARoomAroundIt) {
  OverviewBox overview;
  const WorldBox box = overview.follow({{5, 5, 1}, {5, 5, 1}}, kBegin);
  EXPECT_NEAR(box.high.x - box.low.x, 6.0, 1e-9);
  EXPECT_NEAR(box.high.z - box.low.z, 2.0, 1e-9);
}

}  // namespace
}  // namespace throng::server
