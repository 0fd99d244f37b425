// The visibility rasterizer on a CUDA device: triangles a second by the size of meshes, by CUDA
// events, and what the device does at most.
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "bench/experiments/clock.hpp"
#include "bench/experiments/gpu_frames.hpp"
#include "bench/experiments/numbers.hpp"
#include "bench/experiments/options.hpp"
#include "bench/experiments/raster_case.hpp"
#include "bench/experiments/report.hpp"
#include "bench/experiments/table.hpp"
#include "throng/render/gpu.hpp"
#include "throng/render/raster.hpp"
#if THRONG_WITH_CUDA
#include "bench/experiments/gpu_rates.hpp"
#endif

namespace throng::bench {
namespace {

struct Row {
  RasterCase about;
  double mtri = 0, mvertices = 0;
  std::vector<double> device_ms;
  double size_mib = 0;
  double surviving = 0;       // of the triangles
  bool same_picture = false;  // as the processor's, but for rounding
};

/// What must move at least: a vertex and a corner's number once each, a word a sample cleared and
/// read, the picture.
double least_mb(const Row& row, const render::Viewport& viewport) {
  const double pixels = static_cast<double>(viewport.width_px) * viewport.height_px;
  return row.mvertices * sizeof(render::BatchVertex) + row.mtri * 12 +
         1e-6 * pixels * (4 * 8 * 2 + 4);
}

/// A time over that of moving no more than what must move, as fast as the device copies; 0:
/// unknown.
double times_floor(double device_ms, double least_mb, double copy_mb_per_ms) {
  return least_mb > 0 ? device_ms * copy_mb_per_ms / least_mb : 0.0;
}

absl::Status measure(const Common& common, std::uint32_t draws, Row& row) {
  const render::Camera camera = raster_camera(common.viewport);
  const RasterScene scene = raster_scene(row.about, camera, common.viewport);
  row.mtri = static_cast<double>(scene.indices.size() / 3) * 1e-6;
  row.mvertices = static_cast<double>(scene.vertices.size()) * 1e-6;
  render::Look look;
  look.ground = look.shadows = false;
  render::Picture ours, theirs;
  const auto draw = [&](render::BackendKind compute, std::uint32_t times,
                        render::Picture& picture) -> absl::Status {
    auto rasterizer =
        render::make_rasterizer(render::RasterKind::kVisibility, common.threads, compute);
    if (!rasterizer.ok()) return rasterizer.status();
    absl::Status status = (*rasterizer)->upload(test::mannequin_cast());
    for (std::uint32_t i = 0; i < times && status.ok() && !stop_requested; ++i) {
      status =
          (*rasterizer)
              ->draw(scene.geometry(), camera, common.viewport, glm::dvec3(0.0), look, picture);
      const render::RasterCounters counters = (*rasterizer)->counters();
      if (compute != render::BackendKind::kCuda || i == 0) continue;  // buffers grow once
      row.device_ms.push_back(counters.device_ms);
      row.size_mib = static_cast<double>(counters.size_bytes) / (1 << 20);
      row.surviving = 1e-6 * static_cast<double>(counters.surviving) / row.mtri;
    }
    return status;
  };
  if (absl::Status status = draw(render::BackendKind::kCuda, draws + 1, ours); !status.ok()) {
    return status;
  }
  if (absl::Status status = draw(render::BackendKind::kCpu, 1, theirs); !status.ok()) {
    return status;
  }
  row.same_picture = ours.rgbx.size() == theirs.rgbx.size();
  for (std::size_t i = 0; row.same_picture && i < ours.rgbx.size(); ++i) {
    row.same_picture = std::abs(int{ours.rgbx[i]} - int{theirs.rgbx[i]}) <= 4;
  }
  return absl::OkStatus();
}

/// The crowds of files, and nothing else.
absl::Status run_gpu_files(const Common& common, const GpuOptions& options) {
  auto frames = measure_gpu_frames(common, options.draws, options);
  if (!frames.ok()) return frames.status();
  if (common.json.empty()) return absl::OkStatus();
  return write_json(common.json, {{"experiment", "gpu trajectories"},
                                  {"machine", common.machine.json()},
                                  {"devices", render::describe_cuda()},
                                  {"width_px", common.viewport.width_px},
                                  {"height_px", common.viewport.height_px},
                                  {"frames", *std::move(frames)}});
}

}  // namespace

absl::Status run_gpu(const Common& common, const GpuOptions& options) {
  if (!options.trajectories.empty()) return run_gpu_files(common, options);
  const std::uint32_t draws = options.draws;
  std::vector<Row> rows;
  Progress progress("gpu", std::size(kRasterCases));
  for (const RasterCase& one : kRasterCases) {
    if (stop_requested) break;
    Row row;
    row.about = one;
    if (absl::Status status = measure(common, draws, row); !status.ok()) return status;
    if (row.device_ms.empty()) break;
    progress.step(row.about.name());
    rows.push_back(std::move(row));
  }
  if (rows.empty()) return absl::CancelledError("gpu: stopped before the first row");
  double copy_mb_per_ms = 0;
#if THRONG_WITH_CUDA
  const GpuRates rates = measure_gpu_rates();
  if (!rates.error.empty()) return absl::InternalError("gpu: rates: " + rates.error);
  copy_mb_per_ms = rates.copy_gb_per_s;
#endif
  Table table({"instances x triangles, height", "Mtri", "device ms min", "median", "Gtri/s",
               "surviving", "least MB moved", "times floor", "MiB on the device",
               "as the processor's"});
  nlohmann::ordered_json json = {{"experiment", "gpu"},
                                 {"machine", common.machine.json()},
                                 {"devices", render::describe_cuda()},
                                 {"width_px", common.viewport.width_px},
                                 {"height_px", common.viewport.height_px},
                                 {"draws", draws},
                                 {"rows", nlohmann::ordered_json::array()}};
  for (const Row& row : rows) {
    const double least = *std::min_element(row.device_ms.begin(), row.device_ms.end());
    const double gtri = least > 0 ? row.mtri / least : 0.0;
    table.add({row.about.name(), fixed(row.mtri, 2), fixed(least, 3),
               fixed(median(row.device_ms), 3), fixed(gtri, 2), fixed(row.surviving, 2),
               fixed(least_mb(row, common.viewport), 0),
               fixed(times_floor(least, least_mb(row, common.viewport), copy_mb_per_ms), 1),
               fixed(row.size_mib, 0), row.same_picture ? "yes" : "NO"});
    json["rows"].push_back(
        {{"case", row.about.name()},
         {"triangles_per_mesh", row.about.triangles()},
         {"mtri", row.mtri},
         {"mvertices", row.mvertices},
         {"device_ms_min", least},
         {"device_ms_median", median(row.device_ms)},
         {"gtri_per_s", gtri},
         {"surviving", row.surviving},
         {"least_mb", least_mb(row, common.viewport)},
         {"times_floor", times_floor(least, least_mb(row, common.viewport), copy_mb_per_ms)},
         {"device_mib", row.size_mib},
         {"same_picture_as_processor", row.same_picture}});
  }
  std::printf("Visibility rasterizer on a CUDA device, %ux%u px, %u draws a case.\n%s\n\n%s\n",
              common.viewport.width_px, common.viewport.height_px, draws,
              common.machine.line().c_str(), table.text().c_str());
#if THRONG_WITH_CUDA
  std::printf(
      "Copies %.0f GB/s; 64-bit maxima %.1f G/s each on a word of its own, %.1f 32 to a word, %.2f "
      "all on one; %.0f MiB of device memory in use.\n",
      rates.copy_gb_per_s, rates.spread_atomics_g_per_s, rates.near_atomics_g_per_s,
      rates.one_atomic_g_per_s, rates.used_mib);
  json["rates"] = {{"copy_gb_per_s", rates.copy_gb_per_s},
                   {"spread_atomics_g_per_s", rates.spread_atomics_g_per_s},
                   {"near_atomics_g_per_s", rates.near_atomics_g_per_s},
                   {"one_atomic_g_per_s", rates.one_atomic_g_per_s},
                   {"used_mib", rates.used_mib}};
#endif
  if (common.cast != nullptr) {
    auto frames = measure_gpu_frames(common, draws, options);
    if (!frames.ok()) return frames.status();
    for (auto& frame : *frames) {
      if (!frame.contains("device_ms_median")) continue;
      double device_ms = 0;
      for (const auto& [stage, ms] : frame["device_ms_median"].items())
        device_ms += ms.get<double>();
      frame["times_floor"] =
          times_floor(device_ms, frame["least_mb"].get<double>(), copy_mb_per_ms);
    }
    json["frames"] = *std::move(frames);
  }
  if (common.json.empty()) return absl::OkStatus();
  return write_json(common.json, json);
}

}  // namespace throng::bench
