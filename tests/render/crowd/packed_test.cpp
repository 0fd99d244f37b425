#include "render/crowd/packed.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <random>

#include "throng/render/crowd.hpp"

namespace throng::render {
namespace {

std::shared_ptr<const Cast> one_character() {
  auto cast = std::make_shared<Cast>();
  cast->members.resize(1);
  return cast;
}

AgentFrame frame_of(std::int64_t time_us, std::shared_ptr<const Membership> membership,
                    const std::function<glm::vec3(std::uint64_t)>& position) {
  AgentFrame frame;
  frame.time_us = time_us;
  for (const std::uint64_t id : membership->ids) frame.position_m.push_back(position(id));
  frame.membership = std::move(membership);
  return frame;
}

std::shared_ptr<const Membership> members(std::uint64_t first, std::uint64_t last) {
  auto membership = std::make_shared<Membership>();
  for (std::uint64_t id = first; id <= last; ++id) membership->ids.push_back(id);
  return membership;
}

/// People who walk in circles, come and go; every frame, so that all of it can be compared.
std::vector<std::shared_ptr<const Snapshot>> walk(int frames, double far_m = 0.0) {
  CrowdSettings settings;
  settings.channel_names = {"mood"};
  Crowd crowd(one_character(), settings);
  std::mt19937 random(7);
  std::uniform_real_distribution<float> mood(-1.0F, 1.0F);
  std::vector<std::shared_ptr<const Snapshot>> snapshots;
  std::shared_ptr<const Membership> membership;
  for (int i = 0; i < frames; ++i) {
    if (i % 5 == 0)
      membership =
          members(1 + static_cast<std::uint64_t>(i / 5), 40 + static_cast<std::uint64_t>(i % 7));
    AgentFrame frame = frame_of(i * 100'000, membership, [&](std::uint64_t id) {
      const double angle = 0.01 * i * static_cast<double>(id % 9) + static_cast<double>(id);
      return glm::vec3(far_m + 20.0 * std::cos(angle), 20.0 * std::sin(angle), 0.1 * (id % 3));
    });
    frame.channels.resize(1);
    for (std::size_t c = 0; c < frame.position_m.size(); ++c)
      frame.channels[0].push_back(mood(random));
    EXPECT_TRUE(crowd.push(std::move(frame)).ok());
    snapshots.push_back(crowd.newest());
  }
  return snapshots;
}

float turned(float a, float b) { return std::abs(std::remainder(a - b, 6.2831853F)); }

TEST(PackedTest, WhatComesBackIsTheSameToTheEye) {
  const auto before = walk(32);
  const PackedSnapshots packed = pack(before);
  EXPECT_EQ(packed.count, 32U);
  EXPECT_EQ(packed.first_time_us, 0);
  EXPECT_EQ(packed.last_time_us, 3'100'000);
  const auto after = unpack(packed);
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t f = 0; f < before.size(); ++f) {
    const Snapshot& a = *before[f];
    const Snapshot& b = *after[f];
    EXPECT_EQ(a.time_us, b.time_us);
    EXPECT_EQ(a.present, b.present);
    EXPECT_EQ(a.present_count, b.present_count);
    EXPECT_EQ(a.roster->id, b.roster->id);
    EXPECT_EQ(a.roster->character, b.roster->character);
    EXPECT_EQ(a.roster->scale, b.roster->scale);
    EXPECT_EQ(a.roster->seed, b.roster->seed);
    if (f > 0) {
      EXPECT_EQ(a.roster == before[f - 1]->roster, b.roster == after[f - 1]->roster);
    }
    for (std::size_t i = 0; i < a.present.size(); ++i) {
      if (a.present[i] == 0) continue;
      EXPECT_LE(glm::length(a.position_m[i] - b.position_m[i]), 0.9e-3F);
      EXPECT_LE(glm::length(a.velocity_mps[i] - b.velocity_mps[i]), 0.9e-3F);
      EXPECT_NEAR(a.speed_mps[i], b.speed_mps[i], 1.5e-3);
      EXPECT_NEAR(a.walked_cycles[i], b.walked_cycles[i], 0.5001 / 4096.0);
      EXPECT_EQ(a.channels[0][i], b.channels[0][i]);
      EXPECT_EQ(std::isnan(a.heading_rad[i]), std::isnan(b.heading_rad[i]));
      if (!std::isnan(a.heading_rad[i])) {
        EXPECT_LE(turned(a.heading_rad[i], b.heading_rad[i]), 0.5e-4F);
      }
    }
    EXPECT_LE(glm::length(a.low_m - b.low_m), 0.9e-3F);
    EXPECT_LE(glm::length(a.high_m - b.high_m), 0.9e-3F);
  }
}

TEST(PackedTest, TakesFarLessMemory) {
  const auto snapshots = walk(32);
  std::size_t raw = 0;
  for (const auto& snapshot : snapshots) raw += snapshot->present.size() * 45;  // with its channel
  EXPECT_LT(pack(snapshots).size_bytes() * 2, raw) << "of which 4 bytes an agent are random noise";
}

TEST(PackedTest, FarFromTheOriginStepsGrowInsteadOfOverflowing) {
  const auto before = walk(3, 9.9e6);
  const auto after = unpack(pack(before));
  for (std::size_t i = 0; i < before[2]->present.size(); ++i) {
    if (before[2]->present[i] == 0) continue;
    EXPECT_LE(glm::length(before[2]->position_m[i] - after[2]->position_m[i]), 1.01F);
  }
}

TEST(PackedTest, OneEmptySnapshotIsLegal) {
  CrowdSettings settings;
  Crowd crowd(one_character(), settings);
  ASSERT_TRUE(crowd.push(frame_of(5, std::make_shared<Membership>(), nullptr)).ok());
  const std::shared_ptr<const Snapshot> only = crowd.newest();
  const auto after = unpack(pack({&only, 1}));
  ASSERT_EQ(after.size(), 1U);
  EXPECT_EQ(after[0]->time_us, 5);
  EXPECT_EQ(after[0]->present_count, 0U);
}

/// A crowd of 2,000 whose history is larger than what stays unpacked.
class PackedHistoryTest : public testing::Test {
 protected:
  static constexpr std::int64_t kPeriodUs = 100'000;

  void push(int frames, std::size_t limit_bytes) {
    CrowdSettings settings;
    settings.history_limit_bytes = limit_bytes;
    crowd = std::make_unique<Crowd>(one_character(), settings);
    const auto membership = members(1, 2000);
    for (int i = 0; i < frames; ++i) {
      ASSERT_TRUE(crowd
                      ->push(frame_of(i * kPeriodUs, membership,
                                      [&](std::uint64_t id) { return where(id, 0.1 * i); }))
                      .ok());
    }
  }
  static glm::vec3 where(std::uint64_t id, double t) {
    return {0.1 * static_cast<double>(id) + 1.25 * t, 0.02 * static_cast<double>(id % 50), 0.0};
  }

  std::unique_ptr<Crowd> crowd;
};

TEST_F(PackedHistoryTest, EveryMomentIsBracketedByItsFrames) {
  push(200, 16u << 20);
  EXPECT_LT(crowd->history_bytes(), std::size_t{8} << 20) << "nothing was packed";
  EXPECT_EQ(crowd->counters().forgotten_frames, 0U);
  EXPECT_EQ(crowd->oldest_time_us(), 0);
  for (int i = 0; i < 199; ++i) {
    const Bracket bracket = crowd->bracket(i * kPeriodUs + 30'000);
    ASSERT_EQ(bracket.older->time_us, i * kPeriodUs);
    ASSERT_EQ(bracket.newer->time_us, (i + 1) * kPeriodUs);
    EXPECT_NEAR(bracket.older->position_m[777].x, where(778, 0.1 * i).x, 1e-3);
    // A frame belongs to the interval that it begins.
    EXPECT_EQ(crowd->bracket(i * kPeriodUs).older->time_us, i * kPeriodUs);
  }
  EXPECT_EQ(crowd->bracket(-5).older->time_us, 0);
  EXPECT_EQ(crowd->bracket(-5).newer->time_us, 0);
  EXPECT_EQ(crowd->bracket(1'000'000'000).newer->time_us, 199 * kPeriodUs);
}

TEST_F(PackedHistoryTest, KeepsToItsLimitAndForgetsTheOldest) {
  push(600, 2u << 20);
  EXPECT_LE(crowd->history_bytes(), std::size_t{2} << 20);
  EXPECT_GT(crowd->counters().forgotten_frames, 0U);
  const std::int64_t oldest = crowd->oldest_time_us();
  EXPECT_GT(oldest, 0);
  EXPECT_EQ(crowd->bracket(0).older->time_us, oldest);
  // Unpacked, 2 MiB hold 25 frames of 82 kB.
  EXPECT_GT(599 - oldest / kPeriodUs, 80);
}

TEST_F(PackedHistoryTest, LooksAtTheSameSnapshotsWhileTheyAreInUse) {
  push(200, 16u << 20);
  EXPECT_EQ(crowd->bracket(150'000).older, crowd->bracket(160'000).older);
}

TEST_F(PackedHistoryTest, ResetForgetsWhatWasPacked) {
  push(200, 16u << 20);
  crowd->reset();
  EXPECT_EQ(crowd->history_bytes(), 0U);
  EXPECT_EQ(crowd->bracket(0).older, nullptr);
}

}  // namespace
}  // namespace throng::render
