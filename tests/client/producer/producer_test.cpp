#include "throng/client/producer.hpp"

#include <gmock/gmock.h>

#include <limits>
#include <numeric>

#include "server/rpc/test_server.hpp"

namespace throng::client {
namespace {

using std::chrono::milliseconds;
using test::TestServer;
using testing::HasSubstr;

constexpr milliseconds kLong{60'000};

std::vector<std::uint64_t> ids_to(std::size_t count) {
  std::vector<std::uint64_t> ids(count);
  std::iota(ids.begin(), ids.end(), 1);
  return ids;
}

bool publish_tenths(Producer& producer, std::int64_t tenths, std::size_t agents) {
  return producer.publish(tenths * 100'000, ids_to(agents), std::vector<double>(2 * agents, 1.0));
}

TEST(ProducerTest, PublishedFramesAreApplied) {
  const TestServer server;
  auto producer = Producer::connect(server.address(), "station");
  ASSERT_TRUE(producer->wait_connected(kLong).ok());
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(publish_tenths(*producer, i, 10));
  EXPECT_TRUE(producer->flush(kLong).ok());
  const ProducerStats stats = producer->stats();
  EXPECT_EQ(stats.published, 5U);
  EXPECT_EQ(stats.applied, 5U);
  EXPECT_EQ(stats.dropped, 0U);
  EXPECT_EQ(stats.connects, 1U);
  EXPECT_EQ(server.crowd("station").agents(), 10U);
  EXPECT_EQ(server.crowd("station").producer(), "throng C++ producer");
}

TEST(ProducerTest, AgentsMayComeAndGoInEveryFrame) {
  const TestServer server;
  auto producer = Producer::connect(server.address(), "station");
  for (int i = 0; i < 8; ++i) EXPECT_TRUE(publish_tenths(*producer, i, i % 3 * 5));
  EXPECT_TRUE(producer->flush(kLong).ok());
  EXPECT_EQ(producer->stats().applied, 8U);
  EXPECT_EQ(server.crowd("station").agents(), 5U);
}

TEST(ProducerTest, LargeFramesAreSplitBelowTheServersLimit) {
  server::ServerOptions options;
  options.limits.max_message_bytes = 100'000;
  const TestServer server(options);
  ProducerOptions producer_options;
  producer_options.channels = {"speed", "density"};
  auto producer = Producer::connect(server.address(), "station", producer_options);
  constexpr std::size_t kAgents = 12'000;
  const std::vector<float> column(kAgents, 0.5F);
  const std::vector<std::span<const float>> channels = {column, column};
  EXPECT_TRUE(producer->publish(0, ids_to(kAgents), std::vector<double>(3 * kAgents, 1.0), column,
                                channels));
  ASSERT_TRUE(producer->flush(kLong).ok()) << producer->stats().last_error;
  EXPECT_EQ(producer->stats().applied, 1U);
  EXPECT_EQ(server.crowd("station").agents(), kAgents);
}

TEST(ProducerTest, ColumnsOfAnEarlierFrameAreNotSentAgain) {
  const TestServer server;
  ProducerOptions options;
  options.channels = {"speed"};
  auto producer = Producer::connect(server.address(), "station", options);
  const std::vector<float> column(2, 1.5F);
  const std::vector<std::span<const float>> channels = {column};
  EXPECT_TRUE(
      producer->publish(0, ids_to(2), std::vector<double>{0.0, 0.0, 5.0, 0.0}, column, channels));
  // The same agents, so no membership comes between the two.
  EXPECT_TRUE(producer->publish(100'000, ids_to(2), std::vector<double>{0.2, 0.0, 5.2, 0.0}));
  ASSERT_TRUE(producer->flush(kLong).ok()) << producer->stats().last_error;
  const auto crowd = server.server->registry().find("station");
  ASSERT_TRUE(crowd.ok());
  const auto newest = (*crowd)->moment(server::Clock::now()).crowd->newest();
  ASSERT_EQ(newest->time_us, 100'000);
  EXPECT_TRUE(newest->channels.empty());
  for (const float heading_rad : newest->heading_rad) EXPECT_NE(heading_rad, 1.5F);
}

TEST(ProducerTest, MotionsArriveAndEndWithTheirFrame) {
  const TestServer server;
  auto producer = Producer::connect(server.address(), "station");
  const std::vector<double> positions = {0.0, 0.0, 5.0, 0.0};
  const std::vector<std::string> names = {"cheer", "idle"};
  const std::vector<std::uint8_t> motion = {0, 2};
  EXPECT_TRUE(producer->publish(0, ids_to(2), positions, {}, {}, {motion, names}));
  ASSERT_TRUE(producer->flush(kLong).ok()) << producer->stats().last_error;
  const auto crowd = server.server->registry().find("station");
  ASSERT_TRUE(crowd.ok());
  const auto newest = [&] { return (*crowd)->moment(server::Clock::now()).crowd->newest(); };
  ASSERT_EQ(newest()->motion.size(), 2U);
  EXPECT_EQ(newest()->motion[0] & 0xffU, 0U);
  EXPECT_NE(newest()->motion[1] & 0xffU, 0U);
  EXPECT_TRUE(producer->publish(10'000'000, ids_to(2), positions));
  ASSERT_TRUE(producer->flush(kLong).ok()) << producer->stats().last_error;
  EXPECT_EQ(newest()->motion[1] & 0xffU, 0U);
  EXPECT_FALSE(producer->publish(20'000'000, ids_to(2), positions, {}, {}, {motion, {}}));
  EXPECT_THAT(std::string(producer->stats().last_error.message()), HasSubstr("a motion is 2"));
}

TEST(ProducerTest, OriginKeepsFarCoordinatesExact) {
  const TestServer server;
  ProducerOptions options;
  options.origin_m = {692'000.0, 5'337'000.0, 0.0};
  auto producer = Producer::connect(server.address(), "station", options);
  EXPECT_TRUE(producer->publish(0, ids_to(1), std::vector<double>{692'152.25, 5'337'384.5}));
  ASSERT_TRUE(producer->flush(kLong).ok());
  EXPECT_EQ(server.crowd("station").low().x(), 692'152.25);
  EXPECT_EQ(server.crowd("station").low().y(), 5'337'384.5);
}

TEST(ProducerTest, ColumnsThatDoNotFitAreRejectedHere) {
  const TestServer server;
  auto producer = Producer::connect(server.address(), "station");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(producer->publish(0, ids_to(2), std::vector<double>(5)));
  EXPECT_FALSE(producer->publish(0, ids_to(2), std::vector<double>(4), std::vector<float>(1)));
  EXPECT_FALSE(producer->publish(0, ids_to(1), std::vector<double>{nan, 0.0}));
  EXPECT_FALSE(producer->publish(0, ids_to(1), std::vector<double>{1e9, 0.0}));
  EXPECT_FALSE(producer->publish(0, std::vector<std::uint64_t>{7, 7}, std::vector<double>(4)));
  EXPECT_THAT(std::string(producer->stats().last_error.message()),
              HasSubstr("id 7 is there twice"));
  EXPECT_TRUE(publish_tenths(*producer, 1, 2));
  EXPECT_TRUE(producer->flush(kLong).ok());
  EXPECT_EQ(producer->stats().rejected, 5U);
  EXPECT_EQ(producer->stats().applied, 1U);
}

TEST(ProducerTest, WithoutAServerItDropsTheOldestAndCounts) {
  int port = 0;
  {
    const TestServer gone;
    port = gone.server->port();
  }
  ProducerOptions options;
  options.queue_frames = 4;
  auto producer = Producer::connect("127.0.0.1:" + std::to_string(port), "station", options);
  for (int i = 0; i < 10; ++i) EXPECT_TRUE(publish_tenths(*producer, i, 3));
  EXPECT_EQ(producer->stats().dropped, 6U);
  const absl::Status status = producer->wait_connected(milliseconds(1));
  EXPECT_FALSE(status.ok());
  producer->close(milliseconds(1));
  EXPECT_EQ(producer->stats().dropped, 10U);
}

TEST(ProducerTest, ReconnectsByItselfAndContinuesItsRun) {
  auto first = std::make_unique<TestServer>();
  const int port = first->server->port();
  auto producer = Producer::connect(first->address(), "station");
  EXPECT_TRUE(publish_tenths(*producer, 0, 3));
  ASSERT_TRUE(producer->flush(kLong).ok());
  first.reset();

  // The same address again, with another server behind it.
  server::ServerOptions options;
  options.listen.listen = "127.0.0.1:" + std::to_string(port);
  absl::StatusOr<std::unique_ptr<server::Server>> second = absl::UnavailableError("not yet");
  const auto log = std::make_shared<test::PainterLog>();
  for (int attempt = 0; attempt < 1000 && !second.ok(); ++attempt) {
    second = server::Server::start(options, test::nobody_cast(), test::painter(log));
  }
  if (!second.ok()) GTEST_SKIP() << "the port was taken by somebody else";
  EXPECT_TRUE(publish_tenths(*producer, 1, 3));
  ASSERT_TRUE(producer->flush(kLong).ok()) << producer->stats().last_error;
  const ProducerStats stats = producer->stats();
  EXPECT_EQ(stats.connects, 2U);
  EXPECT_EQ(stats.applied, 2U);
  EXPECT_EQ((*second)->registry().list().at(0).agents, 3U);
}

TEST(ProducerTest, GivesWayToAProducerThatTookOver) {
  const TestServer server;
  auto first = Producer::connect(server.address(), "station");
  ASSERT_TRUE(first->wait_connected(kLong).ok());
  ProducerOptions options;
  options.take_over = true;
  auto second = Producer::connect(server.address(), "station", options);
  ASSERT_TRUE(second->wait_connected(kLong).ok());
  EXPECT_TRUE(publish_tenths(*first, 0, 1));
  EXPECT_FALSE(first->flush(kLong).ok());
  EXPECT_TRUE(first->stats().ended);
  EXPECT_TRUE(publish_tenths(*second, 0, 1));
  EXPECT_TRUE(second->flush(kLong).ok());
}

TEST(ProducerTest, SaysWhyItIsRefused) {
  const TestServer server;
  auto first = Producer::connect(server.address(), "station");
  ASSERT_TRUE(first->wait_connected(kLong).ok());
  auto second = Producer::connect(server.address(), "station");
  EXPECT_EQ(second->wait_connected(kLong).code(), absl::StatusCode::kAlreadyExists);
  auto nameless = Producer::connect(server.address(), "no such name!");
  EXPECT_EQ(nameless->wait_connected(kLong).code(), absl::StatusCode::kInvalidArgument);
  auto lost = Producer::connect("not an address", "station");
  EXPECT_TRUE(lost->stats().ended);
  EXPECT_FALSE(publish_tenths(*lost, 0, 1) && lost->flush(milliseconds(1)).ok() &&
               lost->stats().dropped == 0);
}

TEST(ConnectionTest, ReadsUrls) {
  const auto address = [](const char* url) {
    ConnectionOptions options;
    options.url = url;
    const auto connection = Connection::open(options);
    return connection.ok() ? (*connection)->address() : std::string("refused");
  };
  EXPECT_EQ(address("localhost:1"), "localhost:1");
  EXPECT_EQ(address("grpc://localhost:1/"), "localhost:1");
  EXPECT_EQ(address("grpcs://[::1]:1"), "[::1]:1");
  for (const char* url : {"localhost", ":1", "localhost:", "localhost:x", "http://localhost:1"}) {
    EXPECT_EQ(address(url), "refused") << url;
  }
}

}  // namespace
}  // namespace throng::client
