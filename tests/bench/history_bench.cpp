// What it costs to keep a long history: packing, unpacking, and how small it gets.
#include <benchmark/benchmark.h>

#include <cmath>
#include <random>

#include "render/crowd/packed.hpp"

namespace {

using namespace throng::render;

/// `agents` who walk with the sway and noise of a recording, 32 frames at 10 Hz.
std::vector<std::shared_ptr<const Snapshot>> walk(std::size_t agents) {
  auto cast = std::make_shared<Cast>();
  cast->members.resize(1);
  Crowd crowd(cast, CrowdSettings());
  auto membership = std::make_shared<Membership>();
  for (std::uint64_t id = 1; id <= agents; ++id) membership->ids.push_back(id);
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0.0F, 0.005F);
  std::vector<std::shared_ptr<const Snapshot>> snapshots;
  for (int i = 0; i < 32; ++i) {
    AgentFrame frame;
    frame.time_us = i * 100'000;
    frame.membership = membership;
    for (std::uint64_t id = 1; id <= agents; ++id) {
      const double phase = static_cast<double>(id), t = 0.1 * i;
      const double x =
          std::fmod(phase * 0.37, 200.0) + (0.9 + 0.01 * static_cast<double>(id % 60)) * t;
      const double y = std::fmod(phase * 0.61, 90.0) + 0.04 * std::sin(6.0 * t + phase);
      frame.position_m.emplace_back(static_cast<float>(x) + noise(random),
                                    static_cast<float>(y) + noise(random), 0.0F);
    }
    if (crowd.push(std::move(frame)).ok()) snapshots.push_back(crowd.newest());
  }
  return snapshots;
}

void BM_PackHistory(benchmark::State& state) {
  const auto snapshots = walk(static_cast<std::size_t>(state.range(0)));
  std::size_t bytes = 0;
  for (auto _ : state) bytes = pack(snapshots).size_bytes();
  const double samples = 32.0 * static_cast<double>(state.range(0));
  state.counters["bytes_per_agent"] = static_cast<double>(bytes) / samples;
  state.counters["ns_per_agent"] = benchmark::Counter(
      samples * 1e-9, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(BM_PackHistory)->Arg(1'000)->Arg(10'000);

void BM_UnpackHistory(benchmark::State& state) {
  const PackedSnapshots packed = pack(walk(static_cast<std::size_t>(state.range(0))));
  for (auto _ : state) benchmark::DoNotOptimize(unpack(packed));
  state.counters["ns_per_agent"] = benchmark::Counter(
      32e-9 * static_cast<double>(state.range(0)),
      benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}
BENCHMARK(BM_UnpackHistory)->Arg(1'000)->Arg(10'000);

}  // namespace
