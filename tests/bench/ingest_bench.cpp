// Frames per second through real gRPC on loopback: client, transport, assembling, derived columns
// and acknowledgement, in one process on the machine's cores.
#include <benchmark/benchmark.h>
#include <grpcpp/grpcpp.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "server/rpc/server.hpp"
#include "server/view/painter.hpp"
#include "throng/client/producer.hpp"
#include "throng/v1/ingest.grpc.pb.h"

namespace throng {
namespace {

constexpr std::uint64_t kInFlight = 4;  // frames that are sent before the first ack is waited for
constexpr std::uint64_t kLaps = 16;     // different frames; then they repeat with later times
constexpr std::uint32_t kChunkAgents = 50'000;

template <typename T>
std::string bytes_of(const std::vector<T>& values, std::size_t first, std::size_t count) {
  std::string bytes(count * sizeof(T), '\0');
  std::memcpy(bytes.data(), values.data() + first, bytes.size());
  return bytes;
}

std::unique_ptr<server::Server> start_server() {
  spdlog::set_level(spdlog::level::off);
  server::ServerOptions options;
  options.listen.listen = "127.0.0.1:0";
  auto server = server::Server::start(options, test::nobody_cast(),
                                      test::painter(std::make_shared<test::PainterLog>()));
  return server.ok() ? *std::move(server) : nullptr;
}

/// Agents on circles, so that each frame moves everybody by some centimetres.
void place(std::uint64_t frame, std::size_t agents, std::vector<float>& positions,
           std::vector<float>& headings) {
  positions.resize(3 * agents);
  headings.resize(agents);
  for (std::size_t i = 0; i < agents; ++i) {
    const float angle = static_cast<float>(frame) * 0.01F + static_cast<float>(i);
    positions[3 * i] = static_cast<float>(i % 300) + 5.0F * std::cos(angle);
    positions[3 * i + 1] = static_cast<float>(i / 300) + 5.0F * std::sin(angle);
    positions[3 * i + 2] = 0.0F;
    headings[i] = angle;
  }
}

/// Messages made beforehand: what the transport and the server can do.
void BM_Ingest(benchmark::State& state) {
  const auto agents = static_cast<std::size_t>(state.range(0));
  const bool with_headings = state.range(1) != 0;
  const auto server = start_server();
  if (server == nullptr) return state.SkipWithError("no server");
  const auto channel = grpc::CreateChannel(server->address(), grpc::InsecureChannelCredentials());
  const auto stub = v1::IngestService::NewStub(channel);
  grpc::ClientContext context;
  const auto stream = stub->PublishAgents(&context);
  v1::PublishAgentsRequest request;
  v1::PublishAgentsResponse response;
  request.mutable_start()->set_crowd_name("bench");
  stream->Write(request);
  std::vector<std::uint64_t> ids(agents);
  for (std::size_t i = 0; i < agents; ++i) ids[i] = i + 1;
  request.mutable_membership()->set_epoch(1);
  request.mutable_membership()->set_ids(bytes_of(ids, 0, agents));
  stream->Write(request);
  stream->Read(&response);
  stream->Read(&response);

  std::vector<std::vector<v1::PublishAgentsRequest>> laps(kLaps);
  std::vector<float> positions, headings;
  for (std::uint64_t lap = 0; lap < kLaps; ++lap) {
    place(lap, agents, positions, headings);
    for (std::size_t first = 0; first < agents; first += kChunkAgents) {
      const std::size_t count = std::min<std::size_t>(kChunkAgents, agents - first);
      v1::AgentChunk& chunk = *laps[lap].emplace_back().mutable_chunk();
      chunk.set_epoch(1);
      chunk.set_first_agent(static_cast<std::uint32_t>(first));
      chunk.set_positions(bytes_of(positions, 3 * first, 3 * count));
      if (with_headings) chunk.set_headings(bytes_of(headings, first, count));
    }
  }

  std::uint64_t sent = 0, acked = 0, applied = 0;
  const auto read_ack = [&] {
    if (!stream->Read(&response)) return false;
    ++acked;
    if (response.frame().outcome() == v1::FrameAck::OUTCOME_APPLIED) ++applied;
    return true;
  };
  for (auto _ : state) {
    ++sent;
    for (v1::PublishAgentsRequest& message : laps[sent % kLaps]) {
      message.mutable_chunk()->set_frame_index(sent);
      message.mutable_chunk()->set_scene_time_us(static_cast<std::int64_t>(sent) * 40'000);
      stream->Write(message);
    }
    if (sent - acked >= kInFlight && !read_ack()) return state.SkipWithError("the stream ended");
  }
  while (acked < sent && read_ack()) {
  }
  stream->WritesDone();
  stream->Finish();
  if (applied != sent) state.SkipWithError("frames were not applied");
  state.counters["frames/s"] =
      benchmark::Counter(static_cast<double>(sent), benchmark::Counter::kIsRate);
  state.counters["MB/s"] = benchmark::Counter(
      static_cast<double>(sent) * static_cast<double>(agents) * (with_headings ? 16e-6 : 12e-6),
      benchmark::Counter::kIsRate);
}
BENCHMARK(BM_Ingest)
    ->Args({1'000, 1})
    ->Args({30'000, 1})
    ->Args({100'000, 0})
    ->Args({100'000, 1})
    ->ArgNames({"agents", "headings"})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

/// The same through the C++ producer, from float64 columns.
void BM_Publish(benchmark::State& state) {
  const auto agents = static_cast<std::size_t>(state.range(0));
  const auto server = start_server();
  if (server == nullptr) return state.SkipWithError("no server");
  auto producer = client::Producer::connect(server->address(), "bench");
  std::vector<float> positions, headings;
  place(1, agents, positions, headings);
  std::vector<double> wide(positions.begin(), positions.end());
  std::vector<std::uint64_t> ids(agents);
  for (std::size_t i = 0; i < agents; ++i) ids[i] = i + 1;
  std::int64_t time_us = 0;
  for (auto _ : state) {
    producer->publish(time_us += 40'000, ids, wide, headings);
    if (time_us % (kInFlight * 40'000) == 0) {
      if (!producer->flush(std::chrono::seconds(60)).ok()) return state.SkipWithError("no flush");
    }
  }
  if (!producer->flush(std::chrono::seconds(60)).ok()) return state.SkipWithError("no flush");
  if (producer->stats().applied != producer->stats().published) {
    state.SkipWithError("frames were not applied");
  }
  state.counters["frames/s"] =
      benchmark::Counter(static_cast<double>(time_us) / 40'000.0, benchmark::Counter::kIsRate);
}
BENCHMARK(BM_Publish)
    ->Arg(100'000)
    ->ArgName("agents")
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace throng
