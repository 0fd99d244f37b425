// Stages of the CPU compute backend, in ns per agent, visible agent, vertex and triangle.
//
// Arguments: agents, then the vertex budget in thousands. The crowd stands in a square of 2 m^2 for
// each agent, seen from one side as a walkthrough would. THRONG_BENCH_THREADS sets the threads (1).

#include <benchmark/benchmark.h>

#include <cmath>
#include <cstdlib>
#include <memory>
#include <vector>

#include "bench_character.hpp"
#include "throng/render/compute.hpp"

namespace throng::render {
namespace {

unsigned thread_count() {
  const char* text = std::getenv("THRONG_BENCH_THREADS");
  return text != nullptr ? static_cast<unsigned>(std::atoi(text)) : 1U;
}

std::shared_ptr<const Cast> bench_cast() {
  static const std::shared_ptr<const Cast> cast = [] {
    auto result = std::make_shared<Cast>();
    for (std::uint32_t i = 0; i < 6; ++i) {
      result->members.push_back(
          {make_character(bench::make_bench_character(60 + 5 * i, 48, 45 + i, i)).value(), 1.0F});
    }
    return result;
  }();
  return cast;
}

AgentFrame frame_of(const std::shared_ptr<const Membership>& membership, std::int64_t time_us) {
  AgentFrame frame;
  frame.time_us = time_us;
  frame.membership = membership;
  const std::size_t agents = membership->ids.size();
  const auto side = static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(agents))));
  frame.position_m.resize(agents);
  for (std::size_t i = 0; i < agents; ++i) {
    const float speed_mps = 0.2F + 0.15F * static_cast<float>(i % 17);
    const float turn_rad = static_cast<float>((i * 7919) % 628) * 0.01F;
    const float way_m = speed_mps * static_cast<float>(time_us) * 1e-6F;
    frame.position_m[i] = {1.4F * static_cast<float>(i % side) + way_m * std::cos(turn_rad),
                           1.4F * static_cast<float>(i / side) + way_m * std::sin(turn_rad), 0.0F};
  }
  return frame;
}

std::shared_ptr<const Membership> membership_of(std::size_t agents) {
  auto membership = std::make_shared<Membership>();
  for (std::size_t i = 0; i < agents; ++i) membership->ids.push_back(i * 2654435761U);
  return membership;
}

struct Scene {
  std::unique_ptr<ComputeBackend> backend = make_backend(BackendKind::kCpu, thread_count()).value();
  std::unique_ptr<Crowd> crowd = std::make_unique<Crowd>(bench_cast(), CrowdSettings{});
  std::shared_ptr<const DeviceSnapshot> older, newer;
  std::shared_ptr<const Instances> instances;
  std::unique_ptr<ViewWork> view;
  Camera camera;
  Viewport viewport;

  explicit Scene(std::size_t agents) {
    backend->upload(bench_cast()).IgnoreError();
    const auto membership = membership_of(agents);
    for (int f = 0; f < 3; ++f) crowd->push(frame_of(membership, 100'000 * f)).IgnoreError();
    const Bracket bracket = crowd->bracket(150'000);
    older = backend->upload(bracket.older).value();
    newer = backend->upload(bracket.newer).value();
    view = backend->make_view().value();
    const double side_m = 1.4 * std::sqrt(static_cast<double>(agents));
    camera.eye_world = {0.5 * side_m, -0.05 * side_m - 3.0, 0.15 * side_m + 2.0};
    camera.target_world = {0.5 * side_m, 0.4 * side_m, 0.0};
    advance();
  }

  void advance() {
    instances = backend->advance(*older, *newer, 150'000, crowd->settings(), -1, {}).value();
  }
  void cull() { backend->cull(*view, instances, camera, viewport).IgnoreError(); }
  void select(std::int64_t thousands) {
    backend->select(*view, {.vertex_budget = static_cast<std::uint64_t>(thousands) * 1000})
        .IgnoreError();
  }
  void allocate() { backend->allocate(*view).IgnoreError(); }
  void generate() { backend->generate(*view).IgnoreError(); }
};

void report(benchmark::State& state, const char* unit, double count) {
  state.counters[std::string("ns_per_") + unit] = benchmark::Counter(
      count, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void BM_Push(benchmark::State& state) {
  Crowd crowd(bench_cast(), CrowdSettings{});
  const auto membership = membership_of(static_cast<std::size_t>(state.range(0)));
  const AgentFrame base = frame_of(membership, 0);
  std::int64_t time_us = 0;
  for (auto _ : state) {
    AgentFrame frame = base;
    frame.time_us = time_us += 100'000;
    crowd.push(std::move(frame)).IgnoreError();
  }
  report(state, "agent", static_cast<double>(state.range(0)));
}
BENCHMARK(BM_Push)->Arg(1000)->Arg(100'000)->MeasureProcessCPUTime();

void BM_PushNewMembership(benchmark::State& state) {
  Crowd crowd(bench_cast(), CrowdSettings{});
  const auto agents = static_cast<std::size_t>(state.range(0));
  const auto all = membership_of(agents);
  const AgentFrame base = frame_of(all, 0);
  std::int64_t time_us = 0;
  for (auto _ : state) {
    // one agent of a hundred is exchanged
    auto membership = std::make_shared<Membership>(*all);
    for (std::size_t i = 0; i < agents; i += 100)
      membership->ids[i] += static_cast<std::uint64_t>(time_us);
    AgentFrame frame = base;
    frame.membership = std::move(membership);
    frame.time_us = time_us += 100'000;
    crowd.push(std::move(frame)).IgnoreError();
  }
  report(state, "agent", static_cast<double>(agents));
}
BENCHMARK(BM_PushNewMembership)->Arg(100'000)->MeasureProcessCPUTime();

void BM_Advance(benchmark::State& state) {
  Scene scene(static_cast<std::size_t>(state.range(0)));
  for (auto _ : state) scene.advance();
  report(state, "agent", static_cast<double>(state.range(0)));
}
BENCHMARK(BM_Advance)->Arg(1000)->Arg(30'000)->Arg(100'000)->MeasureProcessCPUTime();

void BM_Cull(benchmark::State& state) {
  Scene scene(static_cast<std::size_t>(state.range(0)));
  for (auto _ : state) scene.cull();
  report(state, "agent", static_cast<double>(state.range(0)));
  state.counters["visible"] = scene.backend->counters(*scene.view).visible;
}
BENCHMARK(BM_Cull)->Arg(1000)->Arg(30'000)->Arg(100'000)->MeasureProcessCPUTime();

void BM_Select(benchmark::State& state) {
  Scene scene(static_cast<std::size_t>(state.range(0)));
  scene.cull();
  for (auto _ : state) scene.select(state.range(1));
  const ComputeCounters counters = scene.backend->counters(*scene.view);
  report(state, "visible", counters.visible);
  state.counters["used"] =
      static_cast<double>(counters.vertices) / static_cast<double>(counters.effective_budget);
}
BENCHMARK(BM_Select)
    ->Args({1000, 1000})
    ->Args({30'000, 1000})
    ->Args({30'000, 5000})
    ->MeasureProcessCPUTime();

void BM_Allocate(benchmark::State& state) {
  Scene scene(static_cast<std::size_t>(state.range(0)));
  scene.cull();
  scene.select(state.range(1));
  for (auto _ : state) scene.allocate();
  report(state, "visible", scene.backend->counters(*scene.view).visible);
}
BENCHMARK(BM_Allocate)->Args({30'000, 1000})->MeasureProcessCPUTime();

void BM_Generate(benchmark::State& state) {
  Scene scene(static_cast<std::size_t>(state.range(0)));
  scene.cull();
  scene.select(state.range(1));
  scene.allocate();
  for (auto _ : state) scene.generate();
  const ComputeCounters counters = scene.backend->counters(*scene.view);
  report(state, "vertex", static_cast<double>(counters.vertices));
  state.counters["triangles"] = static_cast<double>(counters.triangles);
  state.counters["vertices"] = static_cast<double>(counters.vertices);
  state.counters["visible"] = counters.visible;
}
BENCHMARK(BM_Generate)
    ->Args({1000, 1000})
    ->Args({30'000, 1000})
    ->Args({30'000, 5000})
    ->Args({30'000, 20'000})
    ->MeasureProcessCPUTime();

}  // namespace
}  // namespace throng::render
