#include <gmock/gmock.h>

#include <functional>
#include <limits>

#include "server/rpc/test_server.hpp"

namespace throng::test {
namespace {

using testing::HasSubstr;
using v1::FrameAck;

TEST(IngestServiceTest, AcknowledgesStartMembershipAndFrame) {
  const TestServer server;
  Publishing publishing(server.channel());
  ASSERT_TRUE(publishing.start("station"));
  ASSERT_TRUE(publishing.membership(1, {1, 2, 3}));
  ASSERT_TRUE(publishing.chunk(1, 1, 0, 3));
  const auto start = publishing.read();
  ASSERT_TRUE(start.has_value() && start->has_start());
  EXPECT_FALSE(start->start().server_run_id().empty());
  EXPECT_EQ(start->start().max_chunk_bytes(), 64u << 20);
  const auto membership = publishing.read();
  ASSERT_TRUE(membership.has_value() && membership->has_membership());
  EXPECT_EQ(membership->membership().epoch(), 1U);
  const auto frame = publishing.read();
  ASSERT_TRUE(frame.has_value() && frame->has_frame());
  EXPECT_EQ(frame->frame().frame_index(), 1U);
  EXPECT_EQ(frame->frame().outcome(), FrameAck::OUTCOME_APPLIED);
  EXPECT_EQ(server.crowd("station").agents(), 3U);
  EXPECT_TRUE(server.crowd("station").live());
  EXPECT_TRUE(publishing.finish().ok());
  // the crowd stays as it is
  EXPECT_EQ(server.crowd("station").agents(), 3U);
  EXPECT_FALSE(server.crowd("station").live());
}

TEST(IngestServiceTest, UnknownEpochIsAckedAndTheMembershipSentAgainHealsIt) {
  const TestServer server;
  Publishing publishing(server.channel());
  ASSERT_TRUE(publishing.start("station"));
  ASSERT_TRUE(publishing.chunk(1, 5, 0, 2));
  EXPECT_EQ(publishing.outcome(), FrameAck::OUTCOME_UNKNOWN_EPOCH);
  ASSERT_TRUE(publishing.membership(5, {1, 2}));
  ASSERT_TRUE(publishing.chunk(2, 5, 0, 2));
  EXPECT_EQ(publishing.outcome(), FrameAck::OUTCOME_APPLIED);
  EXPECT_TRUE(publishing.finish().ok());
}

TEST(IngestServiceTest, FramesInChunksAreAppliedWhenCompleteAndCountedWhenNot) {
  const TestServer server;
  Publishing publishing(server.channel());
  ASSERT_TRUE(publishing.start("station"));
  ASSERT_TRUE(publishing.membership(1, {1, 2, 3, 4}));
  ASSERT_TRUE(publishing.chunk(1, 1, 2, 2));
  ASSERT_TRUE(publishing.chunk(1, 1, 0, 2));
  EXPECT_EQ(publishing.outcome(), FrameAck::OUTCOME_APPLIED);
  ASSERT_TRUE(publishing.chunk(2, 1, 0, 2));
  ASSERT_TRUE(publishing.chunk(3, 1, 0, 4));
  EXPECT_EQ(publishing.outcome(), FrameAck::OUTCOME_INCOMPLETE);
  EXPECT_EQ(publishing.outcome(), FrameAck::OUTCOME_APPLIED);
  EXPECT_EQ(server.crowd("station").incomplete_frames(), 1U);
  EXPECT_EQ(server.crowd("station").frames(), 2U);
}

TEST(IngestServiceTest, LateFramesAreAckedAsLate) {
  const TestServer server;
  Publishing publishing(server.channel());
  ASSERT_TRUE(publishing.start("station"));
  ASSERT_TRUE(publishing.membership(1, {1}));
  ASSERT_TRUE(publishing.chunk(5, 1, 0, 1));
  EXPECT_EQ(publishing.outcome(), FrameAck::OUTCOME_APPLIED);
  ASSERT_TRUE(publishing.chunk(4, 1, 0, 1));
  EXPECT_EQ(publishing.outcome(), FrameAck::OUTCOME_LATE);
  EXPECT_EQ(server.crowd("station").late_frames(), 1U);
}

TEST(IngestServiceTest, AProducerThatReconnectsContinuesItsRun) {
  const TestServer server;
  {
    Publishing first(server.channel());
    ASSERT_TRUE(first.start("station", "run-1"));
    ASSERT_TRUE(first.membership(1, {1, 2}));
    ASSERT_TRUE(first.chunk(1, 1, 0, 2));
    EXPECT_EQ(first.outcome(), FrameAck::OUTCOME_APPLIED);
    // gone without a word
  }
  Publishing second(server.channel());
  ASSERT_TRUE(second.start("station", "run-1"));
  ASSERT_TRUE(second.membership(1, {1, 2}));
  ASSERT_TRUE(second.chunk(2, 1, 0, 2));
  EXPECT_EQ(second.outcome(), FrameAck::OUTCOME_APPLIED);
  EXPECT_EQ(server.crowd("station").frames(), 2U);
  EXPECT_EQ(server.crowd("station").oldest_time_us(), 100'000);
  EXPECT_TRUE(second.finish().ok());
  Publishing third(server.channel());
  ASSERT_TRUE(third.start("station", "run-2"));
  ASSERT_TRUE(third.read().has_value());
  EXPECT_EQ(server.crowd("station").frames(), 0U);
}

TEST(IngestServiceTest, OneProducerAtATimeUnlessItTakesOver) {
  const TestServer server;
  Publishing first(server.channel());
  ASSERT_TRUE(first.start("station", "one"));
  ASSERT_TRUE(first.read().has_value());
  Publishing refused(server.channel());
  refused.start("station", "two");
  EXPECT_EQ(refused.end().error_code(), grpc::StatusCode::ALREADY_EXISTS);
  Publishing second(server.channel());
  ASSERT_TRUE(second.start("station", "two", true));
  ASSERT_TRUE(second.read().has_value());
  EXPECT_EQ(first.end().error_code(), grpc::StatusCode::ABORTED);
  EXPECT_TRUE(server.crowd("station").live());
}

TEST(IngestServiceTest, HostileMessagesGetTheirStatusAndOthersAreServed) {
  server::ServerOptions options;
  options.limits.max_message_bytes = 1 << 20;
  options.limits.max_agents_per_crowd = 1000;
  options.limits.max_crowds = 3;
  const TestServer server(options);
  Publishing honest(server.channel());
  ASSERT_TRUE(honest.start("honest", "h"));
  ASSERT_TRUE(honest.membership(1, {1}));

  using Speech = std::function<void(Publishing&)>;
  const auto request = [](auto fill) {
    return [fill](Publishing& publishing) {
      publishing.start("hostile", "");
      publishing.membership(1, {1, 2});
      v1::PublishAgentsRequest message;
      fill(message);
      publishing.send(message);
    };
  };
  struct Case {
    const char* what;
    Speech speech;
    grpc::StatusCode code;
    const char* text;
  };
  const std::vector<Case> cases = {
      {"nothing first", [](Publishing& p) { p.send({}); }, grpc::StatusCode::FAILED_PRECONDITION,
       "start"},
      {"membership first", [](Publishing& p) { p.membership(1, {1}); },
       grpc::StatusCode::FAILED_PRECONDITION, "start"},
      {"bad name", [](Publishing& p) { p.start("../etc"); }, grpc::StatusCode::INVALID_ARGUMENT,
       "crowd_name"},
      {"start twice",
       [](Publishing& p) {
         p.start("hostile", "");
         p.start("hostile", "");
       },
       grpc::StatusCode::INVALID_ARGUMENT, "start"},
      {"empty message", request([](auto&) {}), grpc::StatusCode::INVALID_ARGUMENT, "message"},
      {"too many agents", request([](auto& m) {
         m.mutable_membership()->set_epoch(2);
         m.mutable_membership()->set_ids(std::string(8008, 'x'));
       }),
       grpc::StatusCode::RESOURCE_EXHAUSTED, "at most 1000"},
      {"same id twice", request([](auto& m) {
         m.mutable_membership()->set_epoch(2);
         m.mutable_membership()->set_ids(std::string(16, 'x'));
       }),
       grpc::StatusCode::INVALID_ARGUMENT, "twice"},
      {"unknown character",
       [](Publishing& p) {
         p.start("hostile", "");
         v1::PublishAgentsRequest m;
         m.mutable_membership()->set_epoch(1);
         m.mutable_membership()->set_ids(std::string(8, 'x'));
         m.mutable_membership()->set_characters(bytes_of<std::int32_t>({77}));
         p.send(m);
         p.chunk(1, 1, 0, 1);
       },
       grpc::StatusCode::INVALID_ARGUMENT, "character"},
      {"rows beyond",
       [](Publishing& p) {
         p.start("hostile", "");
         p.membership(1, {1});
         p.chunk(1, 1, 0xfffffff0U, 4);
       },
       grpc::StatusCode::INVALID_ARGUMENT, "rows"},
      {"position of NaN", request([](auto& m) {
         m.mutable_chunk()->set_frame_index(1);
         m.mutable_chunk()->set_epoch(1);
         m.mutable_chunk()->set_positions(
             bytes_of(std::vector<float>(6, std::numeric_limits<float>::quiet_NaN())));
       }),
       grpc::StatusCode::INVALID_ARGUMENT, "position"},
      {"oversized message", request([](auto& m) {
         m.mutable_environment()->set_walkable_area_wkt(std::string(2 << 20, ' '));
       }),
       grpc::StatusCode::RESOURCE_EXHAUSTED, "larger"},
      {"origin of NaN",
       [](Publishing& p) {
         v1::PublishAgentsRequest m;
         m.mutable_start()->set_crowd_name("hostile");
         m.mutable_start()->mutable_origin()->set_x(std::numeric_limits<double>::quiet_NaN());
         p.send(m);
       },
       grpc::StatusCode::INVALID_ARGUMENT, "origin"},
  };
  std::uint64_t frame = 0;
  for (const Case& test : cases) {
    SCOPED_TRACE(test.what);
    Publishing hostile(server.channel());
    test.speech(hostile);
    const grpc::Status status = hostile.end();
    EXPECT_EQ(status.error_code(), test.code) << status.error_message();
    EXPECT_THAT(status.error_message(), HasSubstr(test.text));
    ASSERT_TRUE(honest.chunk(++frame, 1, 0, 1));
    EXPECT_EQ(honest.outcome(), FrameAck::OUTCOME_APPLIED);
  }
  EXPECT_TRUE(honest.finish().ok());
}

TEST(IngestServiceTest, RefusesOneCrowdTooMany) {
  server::ServerOptions options;
  options.limits.max_crowds = 1;
  const TestServer server(options);
  Publishing one(server.channel());
  ASSERT_TRUE(one.start("one"));
  ASSERT_TRUE(one.read().has_value());
  Publishing two(server.channel());
  two.start("two");
  EXPECT_EQ(two.end().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
}

TEST(IngestServiceTest, KeepsTheWalkableArea) {
  const TestServer server;
  Publishing publishing(server.channel());
  ASSERT_TRUE(publishing.start("station"));
  v1::PublishAgentsRequest message;
  message.mutable_environment()->set_walkable_area_wkt("POLYGON ((0 0, 1 0, 1 1, 0 0))");
  ASSERT_TRUE(publishing.send(message));
  EXPECT_TRUE(publishing.finish().ok());
  EXPECT_EQ(server.crowd("station").walkable_area_wkt(), "POLYGON ((0 0, 1 0, 1 1, 0 0))");
}

}  // namespace
}  // namespace throng::test
