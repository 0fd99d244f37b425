#include "bench/experiments/gpu_frames.hpp"

#include <absl/strings/str_format.h>

#include <cstdio>
#include <cstdlib>

#include "bench/experiments/clock.hpp"
#include "bench/experiments/measure.hpp"
#include "bench/experiments/numbers.hpp"
#include "bench/experiments/report.hpp"
#include "bench/experiments/table.hpp"
#include "bench/experiments/walkthrough.hpp"
#include "throng/render/device_picture.hpp"
#include "throng/render/encode.hpp"
#include "throng/render/gpu.hpp"

namespace throng::bench {
namespace {

struct Case {
  std::uint32_t agents;
  double budget_million;
  std::string file = {};  // whose crowd it is, empty: the walkthrough's
};
/// Table 2 and figure 6, then figure 7's crowds and beyond.
const Case kCases[] = {{30'000, 1},  {30'000, 5},   {30'000, 10},   {30'000, 15},
                       {30'000, 20}, {1'000, 5},    {10'000, 5},    {20'000, 5},
                       {100'000, 5}, {100'000, 20}, {1'000'000, 5}, {1'000'000, 20}};

struct Side {
  const char* name = "";
  render::RasterKind raster = render::RasterKind::kVisibility;
  std::string missing;  // why it can't draw, empty: it does
  std::unique_ptr<render::FramePipeline> pipeline;
  // milliseconds: until the picture is there, until its JPEG is, and of the device's stages
  std::vector<double> frame_ms, encode_ms, cull_ms, select_ms, allocate_ms, generate_ms, shadows_ms,
      triangles_ms, resolve_ms;
  Range triangles, vertices, visible, own_pose;
  std::uint64_t held_bytes = 0, raster_bytes = 0;
};

/// What must move at least (design, section 6): 32 bytes a vertex that has a place of its own in
/// the batched arrays, an agent's state, and a word a sample cleared and read.
double least_mb(const Side& side, const Case& one, const render::Viewport& viewport) {
  const double pixels = static_cast<double>(viewport.width_px) * viewport.height_px;
  return 1e-6 * (32.0 * side.vertices.mean() + 64.0 * one.agents + pixels * (4 * 8 * 2 + 4));
}

/// Share of pixels with a channel off by more than `codes`.
double different_share(const render::Picture& a, const render::Picture& b, int codes) {
  if (a.rgbx.size() != b.rgbx.size() || a.rgbx.empty()) return 1.0;
  std::size_t different = 0;
  for (std::size_t pixel = 0; pixel < a.rgbx.size(); pixel += 4) {
    bool is_off = false;
    for (std::size_t c = 0; c < 3; ++c) {
      is_off = is_off || std::abs(int{a.rgbx[pixel + c]} - int{b.rgbx[pixel + c]}) > codes;
    }
    different += is_off ? 1 : 0;
  }
  return 4.0 * static_cast<double>(different) / static_cast<double>(a.rgbx.size());
}

/// One frame; the picture's JPEG is made where the picture is.
absl::Status draw(const Walkthrough& walkthrough, std::int64_t time_us, render::ViewSettings& view,
                  bool is_timed, Side& side) {
  render::Picture picture;
  picture.may_stay = true;
  render::FrameStats stats;
  const Ticks began = Ticks::now();
  if (absl::Status status =
          side.pipeline->render(walkthrough.crowd(), time_us, view, picture, stats);
      !status.ok()) {
    return status;
  }
  std::vector<std::uint8_t> jpeg;
  Ticks drawn = Ticks::now();
  absl::Status encoded = absl::UnimplementedError("not on the device");
  if (picture.on_device != nullptr) {
    // the first call waits for the picture, the second for its JPEG alone
    encoded = picture.on_device->encode_jpeg(75, jpeg);
    drawn = Ticks::now();
    if (encoded.ok()) encoded = picture.on_device->encode_jpeg(75, jpeg);
    if (absl::IsUnimplemented(encoded)) {
      if (absl::Status status = picture.on_device->fetch(picture.rgbx); !status.ok()) return status;
      drawn = Ticks::now();
    }
  }
  if (absl::IsUnimplemented(encoded)) {
    render::JpegEncoder encoder;
    const auto bytes = encoder.encode(picture.rgbx, picture.width_px, picture.height_px, 75);
    encoded = bytes.status();
  }
  if (!encoded.ok()) return encoded;
  const Ticks done = Ticks::now();
  if (!is_timed) return absl::OkStatus();
  side.frame_ms.push_back(1e3 * drawn.since(began).wall_s);
  side.encode_ms.push_back(1e3 * done.since(drawn).wall_s);
  const render::DeviceTimes& device = stats.counters.device;
  side.cull_ms.push_back(device.cull_ms);
  side.select_ms.push_back(device.select_ms);
  side.allocate_ms.push_back(device.allocate_ms);
  side.generate_ms.push_back(device.generate_ms);
  side.shadows_ms.push_back(stats.raster.device_shadows_ms);
  side.triangles_ms.push_back(stats.raster.device_triangles_ms);
  side.resolve_ms.push_back(stats.raster.device_resolve_ms);
  side.triangles.add(static_cast<double>(stats.counters.triangles));
  side.vertices.add(static_cast<double>(stats.counters.vertices));
  side.visible.add(stats.counters.visible);
  side.own_pose.add(stats.counters.visible - stats.counters.shared_poses);
  side.held_bytes = std::max(side.held_bytes, render::gpu_memory_held());
  side.raster_bytes = std::max(side.raster_bytes, stats.raster.size_bytes);
  return absl::OkStatus();
}

absl::Status measure(const Common& common, const Case& one, const std::string& camera_path,
                     std::uint32_t frames, std::vector<Side>& sides,
                     std::vector<double>& different) {
  auto walkthrough = one.file.empty() ? Walkthrough::make(common.cast, one.agents, camera_path)
                                      : Walkthrough::of_file(common.cast, one.file);
  if (!walkthrough.ok()) return walkthrough.status();
  for (Side& side : sides) {
    auto pipeline = render::FramePipeline::make(
        common.cast, {.backend = render::BackendKind::kCuda, .raster = side.raster});
    if (!pipeline.ok()) {
      if (side.raster == render::RasterKind::kVisibility) return pipeline.status();
      side.missing = std::string(pipeline.status().message());
      continue;
    }
    side.pipeline = *std::move(pipeline);
  }
  render::ViewSettings view;
  view.viewport = common.viewport;
  view.selection.rule = render::LodRule::kDong2019;
  view.selection.vertex_budget = static_cast<std::uint64_t>(one.budget_million * 1e6);
  // the crowd of the first moments: to walk a million agents to the end takes the host minutes
  if (absl::Status status = walkthrough->advance_to(1); !status.ok()) return status;
  std::int64_t time_us = Walkthrough::time_us(0);
  for (std::uint32_t i = 0; i < frames && !stop_requested; ++i) {
    const auto frame = static_cast<std::uint32_t>(std::uint64_t{i} * Walkthrough::kFrames / frames);
    view.camera = walkthrough->camera(frame);
    for (Side& side : sides) {
      if (side.pipeline == nullptr) continue;
      // buffers grow and poses are made off the clock; a microsecond later nothing is known yet
      for (const bool is_timed : {false, true}) {
        if (auto status = draw(*walkthrough, time_us++, view, is_timed, side); !status.ok()) {
          return status;
        }
      }
    }
    if (i % 4 != 0 || sides[1].pipeline == nullptr) continue;
    // edges are smoothed in other ways, so colours may be off a little there
    render::Picture pictures[2];
    render::FrameStats stats;
    for (int s = 0; s < 2; ++s) {
      if (auto status =
              sides[s].pipeline->render(walkthrough->crowd(), time_us, view, pictures[s], stats);
          !status.ok()) {
        return status;
      }
    }
    different.push_back(different_share(pictures[0], pictures[1], 64));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<nlohmann::ordered_json> measure_gpu_frames(const Common& common,
                                                          std::uint32_t frames,
                                                          const GpuOptions& options) {
  std::vector<Case> cases;
  for (const std::string& file : options.trajectories) cases.push_back({0, 1.0, file});
  if (cases.empty()) {
    for (const Case& one : kCases) {
      if (one.agents <= options.most_agents) cases.push_back(one);
    }
  }
  Table table({"agents", "N (M)", "raster", "frame ms", "JPEG ms", "cull", "select", "allocate",
               "generate", "shadows", "triangles", "resolve", "Mtri", "Gtri/s", "least MB",
               "MiB held"});
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  Progress progress("gpu frames", cases.size());
  for (const Case& one : cases) {
    if (stop_requested) break;
    std::vector<Side> sides(2);
    sides[0].name = "visibility";
    sides[1].name = "gl";
    sides[1].raster = render::RasterKind::kGl;
    std::vector<double> different;
    if (auto status = measure(common, one, options.camera_path, frames, sides, different);
        !status.ok()) {
      return status;
    }
    for (const Side& side : sides) {
      nlohmann::ordered_json row = {
          {"agents", one.agents}, {"budget_million", one.budget_million}, {"raster", side.name}};
      if (!one.file.empty()) row["trajectory"] = one.file.substr(one.file.rfind('/') + 1);
      if (!side.missing.empty()) row["missing"] = side.missing;
      if (!side.frame_ms.empty()) {
        const double mtri = 1e-6 * side.triangles.mean();
        const double triangles_ms = median(side.triangles_ms);
        const double gtri = triangles_ms > 0 ? mtri / triangles_ms : 0.0;
        table.add({grouped(one.agents), fixed(one.budget_million, 0), side.name,
                   fixed(median(side.frame_ms), 2), fixed(median(side.encode_ms), 2),
                   fixed(median(side.cull_ms), 3), fixed(median(side.select_ms), 3),
                   fixed(median(side.allocate_ms), 3), fixed(median(side.generate_ms), 3),
                   fixed(median(side.shadows_ms), 3), fixed(triangles_ms, 3),
                   fixed(median(side.resolve_ms), 3), fixed(mtri, 2), fixed(gtri, 2),
                   fixed(least_mb(side, one, common.viewport), 0),
                   fixed(static_cast<double>(side.held_bytes) / (1 << 20), 0)});
        row.update({{"frames", side.frame_ms.size()},
                    {"frame_wall_ms_median", median(side.frame_ms)},
                    {"frame_wall_ms", side.frame_ms},
                    {"jpeg_wall_ms_median", median(side.encode_ms)},
                    {"device_ms_median",
                     {{"cull", median(side.cull_ms)},
                      {"select", median(side.select_ms)},
                      {"allocate", median(side.allocate_ms)},
                      {"generate", median(side.generate_ms)},
                      {"shadows", median(side.shadows_ms)},
                      {"triangles", triangles_ms},
                      {"resolve", median(side.resolve_ms)}}},
                    {"visible_mean", side.visible.mean()},
                    {"own_pose_mean", side.own_pose.mean()},
                    {"vertices_mean", side.vertices.mean()},
                    {"triangles_mean", side.triangles.mean()},
                    {"gtri_per_s", gtri},
                    {"least_mb", least_mb(side, one, common.viewport)},
                    {"peak_held_mib", static_cast<double>(side.held_bytes) / (1 << 20)},
                    {"raster_mib", static_cast<double>(side.raster_bytes) / (1 << 20)}});
        if (!different.empty()) {
          // issue 5: at most a thousandth of the pixels
          constexpr double kMostUnlike = 0.001;
          row["pixels_unlike_gl_median"] = median(different);
          row["is_like_gl"] = median(different) <= kMostUnlike;
        }
      }
      rows.push_back(std::move(row));
    }
    progress.step(absl::StrFormat("%u agents, N = %.3g M", one.agents, one.budget_million));
  }
  std::printf(
      "Whole frames on a CUDA device, %ux%u px; ms by the device's clock but for the first "
      "two, medians of %u frames.\n\n%s\n",
      common.viewport.width_px, common.viewport.height_px, frames, table.text().c_str());
  return rows;
}

}  // namespace throng::bench
