#include "throng/render/crowd.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <limits>
#include <map>
#include <thread>

#include "render/compute/crowd_fixture.hpp"

namespace throng::render {
namespace {

using test::frame_at;
using test::members;
using test::tiny_cast;

std::uint32_t slot_of(const Snapshot& snapshot, std::uint64_t id) {
  for (std::uint32_t slot = 0; slot < snapshot.present.size(); ++slot) {
    if (snapshot.present[slot] != 0 && snapshot.roster->id[slot] == id) return slot;
  }
  return 0xffffffffU;
}

std::vector<glm::vec3> places(std::size_t count) { return std::vector<glm::vec3>(count); }

TEST(CrowdTest, EmptyCrowdHasNothingToShow) {
  Crowd crowd(tiny_cast(), {});
  EXPECT_EQ(crowd.bracket(0).older, nullptr);
  EXPECT_EQ(crowd.bracket(0).newer, nullptr);
  EXPECT_EQ(crowd.newest(), nullptr);
  EXPECT_EQ(crowd.oldest_time_us(), 0);
}

TEST(CrowdTest, SlotsStayWhileAgentsLiveAndAreReusedAfterwards) {
  Crowd crowd(tiny_cast(), {});
  ASSERT_TRUE(crowd.push(frame_at(0, members({10, 20, 30}), places(3))).ok());
  const std::uint32_t slot_20 = slot_of(*crowd.newest(), 20);
  const std::uint32_t slot_30 = slot_of(*crowd.newest(), 30);
  const std::uint32_t slot_10 = slot_of(*crowd.newest(), 10);
  // 10 leaves, 40 comes, the order of columns changes
  ASSERT_TRUE(
      crowd.push(frame_at(1, members({40, 30, 20}, 2), {{4, 0, 0}, {3, 0, 0}, {2, 0, 0}})).ok());
  EXPECT_EQ(slot_of(*crowd.newest(), 20), slot_20);
  EXPECT_EQ(slot_of(*crowd.newest(), 30), slot_30);
  EXPECT_EQ(slot_of(*crowd.newest(), 40), slot_10);
  EXPECT_EQ(crowd.newest()->position_m[slot_20].x, 2.0F);
  EXPECT_EQ(crowd.newest()->position_m[slot_30].x, 3.0F);
  EXPECT_EQ(crowd.newest()->present_count, 3U);
  // all leave, then more come than ever
  ASSERT_TRUE(crowd.push(frame_at(2, members({}, 3), {})).ok());
  EXPECT_EQ(crowd.newest()->present_count, 0U);
  EXPECT_EQ(crowd.newest()->present.size(), 3U);
  ASSERT_TRUE(crowd.push(frame_at(3, members({1, 2, 3, 4, 5}, 4), places(5))).ok());
  EXPECT_EQ(crowd.newest()->present.size(), 5U);
}

TEST(CrowdTest, RosterIsSharedUntilTheMembershipChanges) {
  Crowd crowd(tiny_cast(), {});
  const auto who = members({1, 2});
  ASSERT_TRUE(crowd.push(frame_at(0, who, places(2))).ok());
  const auto roster = crowd.newest()->roster;
  ASSERT_TRUE(crowd.push(frame_at(1, who, places(2))).ok());
  EXPECT_EQ(crowd.newest()->roster, roster);
  ASSERT_TRUE(crowd.push(frame_at(2, members({1}, 2), places(1))).ok());
  EXPECT_NE(crowd.newest()->roster, roster);
  EXPECT_EQ(roster->id.size(), 2U) << "old snapshots are immutable";
}

TEST(CrowdTest, RandomMembershipChangesKeepSlotsAndIdsTogether) {
  Crowd crowd(tiny_cast(), {});
  std::vector<std::uint64_t> alive;
  std::map<std::uint64_t, std::uint32_t> known;
  std::uint64_t next_id = 1;
  for (int step = 0; step < 200; ++step) {
    std::erase_if(alive, [&](std::uint64_t id) { return test::noise(id * 977 + step) < 0.1; });
    for (int i = 0; i < 5; ++i) {
      const auto at =
          static_cast<std::size_t>(test::noise(next_id) * static_cast<double>(alive.size()));
      alive.insert(alive.begin() + static_cast<std::ptrdiff_t>(at), next_id++);
    }
    std::vector<glm::vec3> position_m;
    for (const std::uint64_t id : alive) position_m.push_back({static_cast<float>(id), 0, 0});
    ASSERT_TRUE(crowd.push(frame_at(step, members(alive, step), position_m)).ok());
    const Snapshot& snapshot = *crowd.newest();
    std::map<std::uint64_t, std::uint32_t> now;
    for (const std::uint64_t id : alive) {
      const std::uint32_t slot = slot_of(snapshot, id);
      ASSERT_LT(slot, snapshot.present.size());
      EXPECT_EQ(snapshot.position_m[slot].x, static_cast<float>(id));
      const auto before = known.find(id);
      EXPECT_TRUE(before == known.end() || before->second == slot);
      now[id] = slot;
    }
    known = now;
    EXPECT_EQ(snapshot.present_count, alive.size());
    EXPECT_LE(snapshot.present.size(), alive.size() + 30) << "slots are reused";
  }
}

TEST(CrowdTest, IdentityDependsOnIdAndSeedAlone) {
  const auto cast = tiny_cast();
  CrowdSettings settings;
  settings.seed = 42;
  Crowd first(cast, settings), second(cast, settings), other(cast, {});
  std::vector<std::uint64_t> ids(1000), reversed(1000);
  for (std::uint64_t i = 0; i < 1000; ++i) {
    ids[i] = i * i + 7;
    reversed[999 - i] = ids[i];
  }
  ASSERT_TRUE(first.push(frame_at(0, members(ids), places(1000))).ok());
  ASSERT_TRUE(second.push(frame_at(0, members({99'999'999}), places(1))).ok());
  ASSERT_TRUE(second.push(frame_at(5, members(reversed, 2), places(1000))).ok());
  ASSERT_TRUE(other.push(frame_at(0, members(ids), places(1000))).ok());
  std::size_t same_as_other = 0, wide = 0;
  for (const std::uint64_t id : ids) {
    const Roster& a = *first.newest()->roster;
    const Roster& b = *second.newest()->roster;
    const Roster& c = *other.newest()->roster;
    const std::uint32_t i = slot_of(*first.newest(), id), j = slot_of(*second.newest(), id);
    EXPECT_EQ(a.seed[i], b.seed[j]);
    EXPECT_EQ(a.scale[i], b.scale[j]);
    EXPECT_EQ(a.character[i], b.character[j]);
    EXPECT_GE(a.scale[i], 0.92F);
    EXPECT_LE(a.scale[i], 1.08F);
    same_as_other += a.seed[i] == c.seed[slot_of(*other.newest(), id)];
    wide += a.character[i];
  }
  EXPECT_LT(same_as_other, 5U) << "another crowd seed, another look";
  EXPECT_NEAR(static_cast<double>(wide) / 1000.0, 0.75, 0.05) << "weights 1 : 3";
}

TEST(CrowdTest, IdentityIsTheSameOnEveryMachine) {
  // recorded values: a change would give every agent of every recording another face
  Crowd crowd(tiny_cast(), {});
  ASSERT_TRUE(crowd.push(frame_at(0, members({0, 1, 0xffffffffffffffffULL}), places(3))).ok());
  const Roster& roster = *crowd.newest()->roster;
  const std::vector<std::uint32_t> expected{2802244911U, 146079144U, 769141896U};
  for (std::uint32_t slot = 0; slot < 3; ++slot) EXPECT_EQ(roster.seed[slot], expected[slot]);
}

TEST(CrowdTest, ProducerMayChooseTheCharacter) {
  Crowd crowd(tiny_cast(), {});
  auto who = std::make_shared<Membership>(*members({1, 2, 3}));
  who->characters = {0, 1, -1};
  ASSERT_TRUE(crowd.push(frame_at(0, who, places(3))).ok());
  EXPECT_EQ(crowd.newest()->roster->character[0], 0);
  EXPECT_EQ(crowd.newest()->roster->character[1], 1);
  EXPECT_LT(crowd.newest()->roster->character[2], 2);
}

TEST(CrowdTest, LateAndDuplicateFramesAreCountedAndDropped) {
  Crowd crowd(tiny_cast(), {});
  const auto who = members({1});
  ASSERT_TRUE(crowd.push(frame_at(1000, who, places(1))).ok());
  EXPECT_TRUE(crowd.push(frame_at(1000, who, {{5, 0, 0}})).ok());
  EXPECT_TRUE(crowd.push(frame_at(500, who, {{5, 0, 0}})).ok());
  EXPECT_TRUE(crowd.push(frame_at(500, members({1, 2}, 2), places(2))).ok());
  EXPECT_EQ(crowd.counters().frames, 1U);
  EXPECT_EQ(crowd.counters().duplicate_frames, 1U);
  EXPECT_EQ(crowd.counters().late_frames, 2U);
  EXPECT_EQ(crowd.newest()->position_m[0].x, 0.0F);
  ASSERT_TRUE(crowd.push(frame_at(2000, who, places(1))).ok());
  EXPECT_EQ(crowd.newest()->present_count, 1U);
}

TEST(CrowdTest, BracketFindsTheSnapshotsAround) {
  Crowd crowd(tiny_cast(), {});
  const auto who = members({1});
  for (std::int64_t t = 0; t < 10; ++t)
    ASSERT_TRUE(crowd.push(frame_at(100 * t, who, places(1))).ok());
  const auto times = [&](std::int64_t t) {
    const Bracket bracket = crowd.bracket(t);
    return std::pair(bracket.older->time_us, bracket.newer->time_us);
  };
  EXPECT_EQ(times(-5), std::pair(std::int64_t{0}, std::int64_t{0}));
  EXPECT_EQ(times(0), std::pair(std::int64_t{0}, std::int64_t{100}));
  EXPECT_EQ(times(99), std::pair(std::int64_t{0}, std::int64_t{100}));
  EXPECT_EQ(times(100), std::pair(std::int64_t{100}, std::int64_t{200}));
  EXPECT_EQ(times(899), std::pair(std::int64_t{800}, std::int64_t{900}));
  EXPECT_EQ(times(900), std::pair(std::int64_t{900}, std::int64_t{900}));
  EXPECT_EQ(times(9999), std::pair(std::int64_t{900}, std::int64_t{900}));
}

TEST(CrowdTest, HistoryIsBoundedByBytes) {
  CrowdSettings settings;
  settings.history_limit_bytes = 100'000;
  Crowd crowd(tiny_cast(), settings);
  // 100 agents are about 4.5 kB a frame
  std::vector<std::uint64_t> ids(100);
  for (std::uint64_t i = 0; i < 100; ++i) ids[i] = i;
  auto who = members(ids);
  for (std::int64_t t = 0; t < 300; ++t) {
    if (t % 7 == 0) who = members(ids, t);
    ASSERT_TRUE(crowd.push(frame_at(t, who, places(100))).ok());
  }
  EXPECT_EQ(crowd.newest()->time_us, 299);
  EXPECT_GT(crowd.oldest_time_us(), 270);
  EXPECT_LT(crowd.oldest_time_us(), 290);
  EXPECT_EQ(crowd.counters().forgotten_frames, static_cast<std::uint64_t>(crowd.oldest_time_us()));
}

TEST(CrowdTest, HistoryKeepsTwoSnapshotsHoweverSmallTheLimit) {
  CrowdSettings settings;
  settings.history_limit_bytes = 1;
  Crowd crowd(tiny_cast(), settings);
  const auto who = members({1});
  for (std::int64_t t = 0; t < 5; ++t) ASSERT_TRUE(crowd.push(frame_at(t, who, places(1))).ok());
  EXPECT_EQ(crowd.oldest_time_us(), 3);
}

TEST(CrowdTest, ResetForgetsHistoryAndSlots) {
  Crowd crowd(tiny_cast(), {});
  const auto who = members({1, 2});
  ASSERT_TRUE(crowd.push(frame_at(5000, who, places(2))).ok());
  crowd.reset();
  EXPECT_EQ(crowd.newest(), nullptr);
  EXPECT_EQ(crowd.oldest_time_us(), 0);
  // time may start again, and the same membership object is taken anew
  ASSERT_TRUE(crowd.push(frame_at(10, who, places(2))).ok());
  EXPECT_EQ(crowd.newest()->time_us, 10);
  EXPECT_EQ(crowd.newest()->present.size(), 2U);
}

struct BadFrame {
  AgentFrame frame;
  const char* message;
};

TEST(CrowdTest, BadFramesAreRefusedWithColumnRowValueAndLimit) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  CrowdSettings settings;
  settings.channel_names = {"density"};
  Crowd crowd(tiny_cast(), settings);
  const auto who = members({7, 8});
  ASSERT_TRUE(crowd.push(frame_at(0, who, places(2))).ok());
  auto unknown_character = std::make_shared<Membership>(*who);
  unknown_character->characters = {0, 2};
  auto short_characters = std::make_shared<Membership>(*who);
  short_characters->characters = {0};
  AgentFrame extra_channel = frame_at(1, who, places(2));
  extra_channel.channels = {{1, 2}, {3, 4}};
  AgentFrame short_channel = frame_at(1, who, places(2));
  short_channel.channels = {{1}};
  const std::vector<BadFrame> bad = {
      {frame_at(1, who, {{0, 0, 0}, {1, nan, 2}}),
       "push: position_m[1].y (id 8) is nan, must be a number within +-1e7"},
      {frame_at(1, who, {{0, 0, -infinity}, {0, 0, 0}}),
       "push: position_m[0].z (id 7) is -inf, must be a number within +-1e7"},
      {frame_at(1, who, {{2e7F, 0, 0}, {0, 0, 0}}),
       "push: position_m[0].x (id 7) is 2e+07, must be a number within +-1e7"},
      {frame_at(1, who, places(3)),
       "push: position_m has 3 rows, must have 2 (one for each id of the membership)"},
      {frame_at(1, who, places(2), {0.0F}),
       "push: heading_rad has 1 rows, must have 2 (one for each id of the membership)"},
      {frame_at(1, members({3, 3}, 2), places(2)),
       "push: membership.ids[1] is 3, which is there twice"},
      {frame_at(1, members({7, 7}, 2), places(2)),
       "push: membership.ids[1] is 7, which is there twice"},
      {frame_at(1, unknown_character, places(2)),
       "push: membership.characters[1] (id 8) is 2, must be -1 or less than 2"},
      {frame_at(1, short_characters, places(2)),
       "push: membership.characters has 1 rows, must have 2 (one for each id of the membership)"},
      {frame_at(1, nullptr, places(2)), "push: membership is missing"},
      {frame_at(std::numeric_limits<std::int64_t>::max(), who, places(2)),
       "push: time_us is 9223372036854775807, must be within +-9007199254740992"},
      {extra_channel, "push: 2 channels, the crowd was made with 1"},
      {short_channel,
       "push: channel 'density' has 1 rows, must have 2 (one for each id of the membership)"},
  };
  for (const BadFrame& each : bad) {
    const absl::Status status = crowd.push(each.frame);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << each.message;
    EXPECT_EQ(status.message(), each.message);
  }
  // nothing has changed: the old membership still works
  EXPECT_EQ(crowd.counters().frames, 1U);
  ASSERT_TRUE(crowd.push(frame_at(2, who, {{1, 0, 0}, {2, 0, 0}})).ok());
  EXPECT_EQ(crowd.newest()->present.size(), 2U);
  EXPECT_EQ(crowd.newest()->position_m[slot_of(*crowd.newest(), 8)].x, 2.0F);
}

TEST(CrowdTest, CastWithoutCharactersIsAnErrorNotACrash) {
  Crowd crowd(std::make_shared<Cast>(), {});
  EXPECT_EQ(crowd.push(frame_at(0, members({1}), places(1))).code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(crowd.push(frame_at(0, members({}), {})).ok());
}

TEST(CrowdTest, BoxHoldsThePresentAgents) {
  Crowd crowd(tiny_cast(), {});
  ASSERT_TRUE(
      crowd.push(frame_at(0, members({1, 2, 3}), {{-900, 0, 0}, {1, 2, 3}, {4, -5, 6}})).ok());
  ASSERT_TRUE(crowd.push(frame_at(1, members({2, 3}, 2), {{1, 2, 3}, {4, -5, 6}})).ok());
  EXPECT_EQ(crowd.newest()->low_m, glm::vec3(1, -5, 3));
  EXPECT_EQ(crowd.newest()->high_m, glm::vec3(4, 2, 6));
}

TEST(CrowdTest, ManyMayLookWhileOnePushes) {
  CrowdSettings settings;
  settings.history_limit_bytes = 200'000;
  Crowd crowd(tiny_cast(), settings);
  std::atomic<bool> done{false};
  std::vector<std::jthread> viewers;
  for (int v = 0; v < 3; ++v) {
    viewers.emplace_back([&] {
      while (!done.load()) {
        const auto newest = crowd.newest();
        if (newest == nullptr) continue;
        const Bracket bracket = crowd.bracket(newest->time_us - 150);
        if (bracket.older == nullptr) continue;  // reset
        ASSERT_LE(bracket.older->time_us, bracket.newer->time_us);
        ASSERT_EQ(bracket.older->present.size(), bracket.older->position_m.size());
        static_cast<void>(crowd.counters());
        static_cast<void>(crowd.oldest_time_us());
      }
    });
  }
  std::vector<std::uint64_t> ids;
  for (std::int64_t t = 1; t <= 300; ++t) {
    if (t % 10 == 1) ids.push_back(static_cast<std::uint64_t>(t));
    ASSERT_TRUE(crowd.push(frame_at(100 * t, members(ids, t), places(ids.size()))).ok());
    if (t == 150) crowd.reset();
  }
  done = true;
}

}  // namespace
}  // namespace throng::render
