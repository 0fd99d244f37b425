// The whole frame at 1280x720, from snapshots to JPEG (quality 75, 4:2:0): every stage in ms of the
// processor. The built-in cast is taken from the build folder, or from THRONG_CAST.
#include <benchmark/benchmark.h>

#include <cstdlib>
#include <memory>
#include <string>
#include <utility>

#include "server/batch/synthetic.hpp"
#include "throng/render/encode.hpp"
#include "throng/render/frame.hpp"

namespace throng::render {
namespace {

std::shared_ptr<const Cast> built_in_cast() {
  static const std::shared_ptr<const Cast> cast = [] {
    const char* set = std::getenv("THRONG_CAST");
    absl::StatusOr<Cast> read =
        read_cast(set != nullptr ? set : std::string(THRONG_BINARY_DIR) + "/cast");
    return read.ok() ? std::make_shared<const Cast>(*std::move(read)) : nullptr;
  }();
  return cast;
}

unsigned bench_threads() {
  const char* set = std::getenv("THRONG_BENCH_THREADS");
  return set != nullptr ? static_cast<unsigned>(std::atoi(set)) : 0;
}

/// A second of the synthetic crowd, 10 frames a second.
std::unique_ptr<Crowd> walking_crowd(const std::shared_ptr<const Cast>& cast,
                                     std::uint32_t agents) {
  auto crowd = std::make_unique<Crowd>(cast, CrowdSettings{});
  auto reader = server::make_synthetic(agents, 7, 1.0);
  trajectory::Frame frame;
  std::shared_ptr<const Membership> membership;
  while (*reader->next(frame)) {
    if (membership == nullptr || membership->ids != frame.ids) {
      auto next = std::make_shared<Membership>();
      next->epoch = membership == nullptr ? 1 : membership->epoch + 1;
      next->ids = frame.ids;
      membership = next;
    }
    AgentFrame agents_frame;
    agents_frame.time_us = frame.time_us;
    agents_frame.membership = membership;
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      agents_frame.position_m.emplace_back(frame.x_m[i], frame.y_m[i], 0.0);
    }
    agents_frame.heading_rad = frame.heading_rad;
    if (!crowd->push(std::move(agents_frame)).ok()) return nullptr;
  }
  return crowd;
}

enum class Place { kAbove, kStreet };

void BM_Frame(benchmark::State& state, RasterKind raster, Place place, FormRule form) {
  const auto cast = built_in_cast();
  if (cast == nullptr) {
    state.SkipWithError("no built-in cast in the build folder");
    return;
  }
  const auto agents = static_cast<std::uint32_t>(state.range(0));
  const auto crowd = walking_crowd(cast, agents);
  auto pipeline = FramePipeline::make(
      cast, {.raster = raster, .threads = bench_threads(), .measure_cpu_times = true});
  if (crowd == nullptr || !pipeline.ok()) {
    state.SkipWithError(std::string(pipeline.status().message()).c_str());
    return;
  }
  ViewSettings view;
  const auto newest = crowd->newest();
  view.camera = overview_camera(newest->low_m, newest->high_m, view.viewport);
  if (place == Place::kStreet) {  // a person's eyes, the crowd ahead
    view.camera.eye_world = {0.0, 0.75 * newest->low_m.y, 1.7};
    view.camera.target_world = {0.0, 0.0, 1.5};
  }
  view.selection.form = form;
  view.selection.vertex_budget = static_cast<std::uint64_t>(state.range(1)) * 1'000'000;
  JpegEncoder jpeg;
  Picture picture;
  FrameStats stats;
  StageTimes sum;
  std::int64_t time_us = 0;
  double triangles = 0, specks = 0, frames = 0;
  if (!(*pipeline)
           ->render(*crowd, 0, view, picture, stats)
           .ok()) {  // tables are made, buffers grow
    state.SkipWithError("render failed");
    return;
  }
  for (auto _ : state) {
    time_us = (time_us + 16'667) % 1'000'000;  // never the same instances twice in a row
    if (!(*pipeline)->render(*crowd, time_us, view, picture, stats).ok()) {
      state.SkipWithError("render failed");
      return;
    }
    auto bytes = jpeg.encode(picture.rgbx, picture.width_px, picture.height_px, 75);
    benchmark::DoNotOptimize(bytes);
    sum.advance_ms += stats.cpu_times.advance_ms;
    sum.cull_ms += stats.cpu_times.cull_ms;
    sum.select_ms += stats.cpu_times.select_ms;
    sum.generate_ms += stats.cpu_times.generate_ms;
    sum.raster_ms += stats.cpu_times.raster_ms;
    triangles += static_cast<double>(stats.counters.triangles);
    specks += stats.counters.drawn_as[static_cast<std::size_t>(Representation::kSpeck)];
    frames += 1;
  }
  state.counters["advance_ms"] = sum.advance_ms / frames;
  state.counters["cull_ms"] = sum.cull_ms / frames;
  state.counters["select_ms"] = sum.select_ms / frames;
  state.counters["generate_ms"] = sum.generate_ms / frames;
  state.counters["raster_ms"] = sum.raster_ms / frames;
  state.counters["kspecks"] = specks / frames * 1e-3;
  state.counters["Mtri"] = triangles / frames * 1e-6;
}

constexpr auto kAbove = Place::kAbove, kStreet = Place::kStreet;
constexpr auto kMesh = FormRule::kMesh, kMixed = FormRule::kMixed;

void settings(benchmark::internal::Benchmark* bench) {
  bench->ArgNames({"agents", "N_million"})
      ->Unit(benchmark::kMillisecond)
      ->MeasureProcessCPUTime()
      ->UseRealTime();
}

BENCHMARK_CAPTURE(BM_Frame, visibility, RasterKind::kVisibility, kAbove, kMesh)
    ->Args({1'000, 1})
    ->Args({30'000, 1})
    ->Args({30'000, 5})
    ->Args({100'000, 1})
    ->Apply(settings);
BENCHMARK_CAPTURE(BM_Frame, gl, RasterKind::kGl, kAbove, kMesh)
    ->Args({1'000, 1})
    ->Args({30'000, 1})
    ->Apply(settings);
// what is too small to be seen decides here
BENCHMARK_CAPTURE(BM_Frame, mixed, RasterKind::kVisibility, kAbove, kMixed)
    ->Args({100'000, 1})
    ->Args({1'000'000, 1})
    ->Apply(settings);
BENCHMARK_CAPTURE(BM_Frame, mixed_street, RasterKind::kVisibility, kStreet, kMixed)
    ->Args({100'000, 1})
    ->Args({1'000'000, 1})
    ->Apply(settings);
BENCHMARK_CAPTURE(BM_Frame, street, RasterKind::kVisibility, kStreet, kMesh)
    ->Args({100'000, 1})
    ->Args({1'000'000, 1})
    ->Apply(settings);

}  // namespace
}  // namespace throng::render
