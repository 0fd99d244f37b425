#include "server/rpc/frame_assembler.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "throng/v1/ingest.pb.h"

namespace throng::server {
namespace {

using testing::HasSubstr;
using Verdict = FrameAssembler::Verdict;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

template <typename T>
std::string bytes_of(const std::vector<T>& values) {
  std::string bytes(values.size() * sizeof(T), '\0');
  if (!values.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

v1::Membership membership_of(std::uint64_t epoch, std::vector<std::uint64_t> ids) {
  v1::Membership membership;
  membership.set_epoch(epoch);
  membership.set_ids(bytes_of(ids));
  return membership;
}

/// Rows [first, first + count), each at (row, frame, 0).
v1::AgentChunk chunk_of(std::uint64_t frame, std::uint64_t epoch, std::uint32_t first,
                        std::uint32_t count) {
  v1::AgentChunk chunk;
  chunk.set_frame_index(frame);
  chunk.set_scene_time_us(static_cast<std::int64_t>(frame) * 100'000);
  chunk.set_epoch(epoch);
  chunk.set_first_agent(first);
  std::vector<float> positions;
  for (std::uint32_t i = 0; i < count; ++i) {
    positions.insert(positions.end(),
                     {static_cast<float>(first + i), static_cast<float>(frame), 0.0F});
  }
  chunk.set_positions(bytes_of(positions));
  return chunk;
}

class FrameAssemblerTest : public testing::Test {
 protected:
  void expect_refused(const absl::Status& status, const char* text) {
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(text));
  }

  FrameAssembler assembler{1000, 2};
};

TEST_F(FrameAssemblerTest, OneChunkMakesAFrame) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {10, 20, 30})).ok());
  const auto result = assembler.add(chunk_of(1, 1, 0, 3));
  ASSERT_TRUE(result.ok());
  ASSERT_TRUE(result->complete.has_value());
  EXPECT_EQ(result->frame_index, 1U);
  EXPECT_EQ(result->complete->time_us, 100'000);
  EXPECT_EQ(result->complete->position_m.at(2), glm::vec3(2, 1, 0));
  EXPECT_TRUE(result->complete->heading_rad.empty());
  EXPECT_TRUE(result->complete->channels.empty());
  EXPECT_EQ(result->complete->membership->ids.at(2), 30U);
}

TEST_F(FrameAssemblerTest, ChunksMayComeInAnyOrder) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {1, 2, 3, 4, 5, 6})).ok());
  EXPECT_FALSE(assembler.add(chunk_of(1, 1, 4, 2))->complete.has_value());
  EXPECT_FALSE(assembler.add(chunk_of(1, 1, 0, 1))->complete.has_value());
  EXPECT_FALSE(assembler.add(chunk_of(1, 1, 2, 2))->complete.has_value());
  const auto result = assembler.add(chunk_of(1, 1, 1, 1));
  ASSERT_TRUE(result->complete.has_value());
  for (int row = 0; row < 6; ++row) {
    EXPECT_EQ(result->complete->position_m.at(row), glm::vec3(row, 1, 0));
  }
}

TEST_F(FrameAssemblerTest, AFrameOfNobodyIsAFrame) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {})).ok());
  const auto result = assembler.add(chunk_of(1, 1, 0, 0));
  ASSERT_TRUE(result.ok());
  ASSERT_TRUE(result->complete.has_value());
  EXPECT_TRUE(result->complete->position_m.empty());
}

TEST_F(FrameAssemblerTest, ANewFrameDiscardsAnIncompleteOne) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {1, 2})).ok());
  EXPECT_TRUE(assembler.add(chunk_of(1, 1, 0, 1))->refused.empty());
  const auto result = assembler.add(chunk_of(2, 1, 0, 2));
  ASSERT_EQ(result->refused.size(), 1U);
  EXPECT_EQ(result->refused[0].frame_index, 1U);
  EXPECT_EQ(result->refused[0].verdict, Verdict::kIncomplete);
  EXPECT_TRUE(result->complete.has_value());
  // what comes of it now is late
  const auto late = assembler.add(chunk_of(1, 1, 1, 1));
  ASSERT_EQ(late->refused.size(), 1U);
  EXPECT_EQ(late->refused[0].verdict, Verdict::kLate);
}

TEST_F(FrameAssemblerTest, UnknownEpochIsToldOnceAndHealedByTheMembership) {
  const auto first = assembler.add(chunk_of(1, 7, 0, 1));
  ASSERT_EQ(first->refused.size(), 1U);
  EXPECT_EQ(first->refused[0].verdict, Verdict::kUnknownEpoch);
  EXPECT_TRUE(assembler.add(chunk_of(1, 7, 1, 1))->refused.empty());
  ASSERT_TRUE(assembler.set_membership(membership_of(7, {1, 2})).ok());
  EXPECT_TRUE(assembler.add(chunk_of(2, 7, 0, 2))->complete.has_value());
}

TEST_F(FrameAssemblerTest, AnOldEpochIsUnknown) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {1})).ok());
  ASSERT_TRUE(assembler.set_membership(membership_of(2, {1, 2})).ok());
  EXPECT_EQ(assembler.add(chunk_of(1, 1, 0, 1))->refused.at(0).verdict, Verdict::kUnknownEpoch);
}

TEST_F(FrameAssemblerTest, AMembershipInTheMiddleOfAFrameLeavesTheFrameAlone) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {1, 2})).ok());
  ASSERT_TRUE(assembler.add(chunk_of(1, 1, 0, 1)).ok());
  ASSERT_TRUE(assembler.set_membership(membership_of(2, {1, 2, 3})).ok());
  const auto result = assembler.add(chunk_of(1, 1, 1, 1));
  ASSERT_TRUE(result->complete.has_value());
  EXPECT_EQ(result->complete->membership->epoch, 1U);
}

TEST_F(FrameAssemblerTest, RefusesBadMemberships) {
  expect_refused(assembler.set_membership(membership_of(0, {1})), "membership.epoch");
  v1::Membership odd = membership_of(1, {1});
  odd.mutable_ids()->push_back('x');
  expect_refused(assembler.set_membership(odd), "9 bytes");
  expect_refused(assembler.set_membership(membership_of(1, {5, 6, 5})), "5 is there twice");
  v1::Membership names = membership_of(1, {1, 2});
  names.add_names("one");
  expect_refused(assembler.set_membership(names), "membership.names");
  v1::Membership characters = membership_of(1, {1, 2});
  characters.set_characters("abc");
  expect_refused(assembler.set_membership(characters), "membership.characters");
  EXPECT_EQ(assembler.set_membership(membership_of(1, std::vector<std::uint64_t>(1001))).code(),
            absl::StatusCode::kResourceExhausted);
  ASSERT_TRUE(assembler.set_membership(membership_of(5, {1})).ok());
  expect_refused(assembler.set_membership(membership_of(4, {1})), "must be over 5");
  EXPECT_TRUE(assembler.set_membership(membership_of(5, {1})).ok());
}

TEST_F(FrameAssemblerTest, RefusesBadChunks) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {1, 2, 3, 4})).ok());
  expect_refused(assembler.add(chunk_of(0, 1, 0, 1)).status(), "chunk.frame_index");
  expect_refused(assembler.add(chunk_of(1, 1, 2, 3)).status(), "rows 2 to 5");
  expect_refused(assembler.add(chunk_of(2, 1, 0xffffffffU, 2)).status(), "rows 4294967295");
  v1::AgentChunk ragged = chunk_of(3, 1, 0, 1);
  ragged.mutable_positions()->push_back('x');
  expect_refused(assembler.add(ragged).status(), "chunk.positions");
  v1::AgentChunk headings = chunk_of(4, 1, 0, 2);
  headings.set_headings(std::string(4, '\0'));
  expect_refused(assembler.add(headings).status(), "chunk.headings");
  v1::AgentChunk quaternions = chunk_of(5, 1, 0, 2);
  quaternions.set_quaternions(std::string(16, '\0'));
  expect_refused(assembler.add(quaternions).status(), "chunk.quaternions");
  v1::AgentChunk channels = chunk_of(6, 1, 0, 1);
  channels.add_channels(std::string(4, '\0'));
  expect_refused(assembler.add(channels).status(), "chunk.channels: 1, must be 0 or 2");
  channels.add_channels(std::string(5, '\0'));
  channels.set_frame_index(7);
  expect_refused(assembler.add(channels).status(), "chunk.channels[1]");
  v1::AgentChunk time = chunk_of(8, 1, 0, 1);
  time.set_scene_time_us(std::numeric_limits<std::int64_t>::min());
  expect_refused(assembler.add(time).status(), "chunk.scene_time_us");
}

TEST_F(FrameAssemblerTest, RefusesRowsThatWereSentBefore) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {1, 2, 3, 4})).ok());
  for (const auto& [first, count] : std::vector<std::pair<std::uint32_t, std::uint32_t>>{
           {1, 2}, {0, 2}, {2, 2}, {0, 4}, {1, 1}, {2, 1}}) {
    FrameAssembler fresh(1000, 0);
    ASSERT_TRUE(fresh.set_membership(membership_of(1, {1, 2, 3, 4})).ok());
    ASSERT_TRUE(fresh.add(chunk_of(1, 1, 1, 2)).ok());
    expect_refused(fresh.add(chunk_of(1, 1, first, count)).status(), "were sent before");
  }
}

TEST_F(FrameAssemblerTest, RefusesChunksOfOneFrameThatDiffer) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {1, 2})).ok());
  ASSERT_TRUE(assembler.add(chunk_of(1, 1, 0, 1)).ok());
  v1::AgentChunk other_time = chunk_of(1, 1, 1, 1);
  other_time.set_scene_time_us(5);
  expect_refused(assembler.add(other_time).status(), "chunk.scene_time_us");
  expect_refused(assembler.add(chunk_of(1, 2, 1, 1)).status(), "chunk.epoch");
}

TEST_F(FrameAssemblerTest, OrientationMayBeMissingInSomeChunksAndRows) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {1, 2, 3, 4})).ok());
  v1::AgentChunk with = chunk_of(1, 1, 0, 2);
  with.set_headings(bytes_of<float>({1.5F, std::numeric_limits<float>::infinity()}));
  ASSERT_TRUE(assembler.add(with).ok());
  v1::AgentChunk turned = chunk_of(1, 1, 3, 1);
  const float half = std::numbers::sqrt2_v<float> / 2;
  turned.set_quaternions(bytes_of<float>({0, 0, half, half}));
  ASSERT_TRUE(assembler.add(turned).ok());
  const auto result = assembler.add(chunk_of(1, 1, 2, 1));
  const std::vector<float>& heading = result->complete->heading_rad;
  EXPECT_EQ(heading.at(0), 1.5F);
  EXPECT_TRUE(std::isnan(heading.at(1)));
  EXPECT_TRUE(std::isnan(heading.at(2)));
  EXPECT_NEAR(heading.at(3), std::numbers::pi / 2, 1e-6);
}

TEST_F(FrameAssemblerTest, ChannelsMayBeMissing) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {1, 2})).ok());
  v1::AgentChunk with = chunk_of(1, 1, 1, 1);
  with.add_channels(bytes_of<float>({3.0F}));
  with.add_channels(bytes_of<float>({4.0F}));
  ASSERT_TRUE(assembler.add(with).ok());
  const auto result = assembler.add(chunk_of(1, 1, 0, 1));
  ASSERT_EQ(result->complete->channels.size(), 2U);
  EXPECT_TRUE(std::isnan(result->complete->channels[0].at(0)));
  EXPECT_EQ(result->complete->channels[1].at(1), 4.0F);
}

TEST_F(FrameAssemblerTest, MotionsMayBeMissingInSomeChunksAndKeepTheirNames) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {5, 6, 7})).ok());
  v1::AgentChunk told = chunk_of(1, 1, 1, 2);
  told.set_motions(std::string("\x02\x01", 2));
  told.add_motion_names("sit");
  told.add_motion_names("cheer");
  ASSERT_TRUE(assembler.add(chunk_of(1, 1, 0, 1)).ok());
  const auto result = assembler.add(told);
  ASSERT_TRUE(result.ok() && result->complete.has_value()) << result.status();
  EXPECT_EQ(result->complete->motion, (std::vector<std::uint8_t>{0, 2, 1}));
  EXPECT_EQ(result->complete->motion_names, (std::vector<std::string>{"sit", "cheer"}));
}

TEST_F(FrameAssemblerTest, RefusesBadMotions) {
  ASSERT_TRUE(assembler.set_membership(membership_of(1, {5, 6, 7})).ok());
  v1::AgentChunk chunk = chunk_of(1, 1, 0, 2);
  chunk.set_motions("x");
  expect_refused(assembler.add(chunk).status(), "chunk.motions: it has 1 bytes, must have 2");
  chunk = chunk_of(2, 1, 0, 2);
  chunk.set_motions(std::string(2, '\1'));
  for (int i = 0; i < 65; ++i) chunk.add_motion_names("sit");
  expect_refused(assembler.add(chunk).status(), "chunk.motion_names: 65, at most 64");
  chunk = chunk_of(3, 1, 0, 2);
  chunk.set_motions(std::string(2, '\1'));
  chunk.add_motion_names("sit");
  ASSERT_TRUE(assembler.add(chunk).ok());
  chunk = chunk_of(3, 1, 2, 1);
  chunk.set_motions(std::string(1, '\1'));
  chunk.add_motion_names("cheer");
  expect_refused(assembler.add(chunk).status(), "not those of the chunks before of frame 3");
}

TEST_F(FrameAssemblerTest, RandomMessagesNeverBreakIt) {
  std::mt19937 random(1);
  const auto pick = [&](std::uint32_t below) {
    return static_cast<std::uint32_t>(random() % below);
  };
  int complete = 0;
  for (int i = 0; i < 20'000; ++i) {
    if (pick(10) == 0) {
      v1::Membership membership;
      membership.set_epoch(pick(50));
      membership.set_ids(std::string(pick(40), static_cast<char>(pick(256))));
      membership.set_characters(std::string(pick(3) * 4, '\0'));
      (void)assembler.set_membership(membership);
      continue;
    }
    v1::AgentChunk chunk = chunk_of(i / 3, pick(50), pick(6), pick(5));
    if (pick(4) == 0) chunk.set_first_agent(random());
    if (pick(3) == 0) chunk.set_headings(std::string(pick(20), '\x7f'));
    if (pick(5) == 0) chunk.set_quaternions(std::string(pick(50), '\x01'));
    for (std::uint32_t c = pick(4); c > 1; --c) chunk.add_channels(std::string(pick(16), '\0'));
    const auto result = assembler.add(chunk);
    if (!result.ok() || !result->complete.has_value()) continue;
    ++complete;
    const std::size_t agents = result->complete->membership->ids.size();
    EXPECT_EQ(result->complete->position_m.size(), agents);
    EXPECT_TRUE(result->complete->heading_rad.empty() ||
                result->complete->heading_rad.size() == agents);
  }
  EXPECT_GT(complete, 0);
}

TEST(HeadingOfQuaternionTest, TurnsLikeTheRotationItIs) {
  for (double angle = -3.1; angle < 3.2; angle += 0.1) {
    // scaled: senders do not always normalise
    const auto z = static_cast<float>(3.0 * std::sin(angle / 2));
    const auto w = static_cast<float>(3.0 * std::cos(angle / 2));
    EXPECT_NEAR(std::remainder(heading_of_quaternion(0, 0, z, w) - angle, 2 * std::numbers::pi), 0,
                1e-5);
    EXPECT_NEAR(std::remainder(heading_of_quaternion(0, 0, -z, -w) - angle, 2 * std::numbers::pi),
                0, 1e-5);
  }
}

TEST(HeadingOfQuaternionTest, UnknownWhereThereIsNone) {
  EXPECT_TRUE(std::isnan(heading_of_quaternion(0, 0, 0, 0)));
  EXPECT_TRUE(std::isnan(heading_of_quaternion(kNan, 0, 0, 1)));
  EXPECT_TRUE(std::isnan(heading_of_quaternion(0, std::numeric_limits<float>::infinity(), 0, 1)));
  EXPECT_TRUE(std::isnan(heading_of_quaternion(3e38F, 0, 0, 3e38F)) == false);
  const float half = std::numbers::sqrt2_v<float> / 2;
  EXPECT_TRUE(std::isnan(heading_of_quaternion(0, half, 0, half)));  // facing straight down
}

}  // namespace
}  // namespace throng::server
