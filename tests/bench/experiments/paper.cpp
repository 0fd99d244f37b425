// Table 2 of Dong & Peng 2019: 30,000 instances along a walkthrough, for several vertex budgets.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <cmath>
#include <cstdio>

#include "bench/experiments/measure.hpp"
#include "bench/experiments/options.hpp"
#include "bench/experiments/quality.hpp"
#include "bench/experiments/report.hpp"
#include "bench/experiments/table.hpp"
#include "bench/experiments/triangle_count.hpp"
#include "bench/experiments/walkthrough.hpp"

namespace throng::bench {
namespace {

using render::StageTimes;

/// A row of the published table (GeForce GTX 980 Ti).
struct PaperRow {
  double budget_million, fps, min_million, max_million, avg_million;
  double cull_select_ms, generate_ms, draw_ms;
};
constexpr PaperRow kPaper[] = {{1, 47.91, 1.88, 9.70, 5.20, 0.68, 2.87, 26.06},
                               {5, 43.30, 6.12, 10.14, 7.50, 0.65, 3.87, 26.44},
                               {10, 32.82, 11.64, 13.78, 13.04, 0.65, 6.27, 29.40},
                               {15, 23.00, 17.88, 20.73, 19.54, 0.71, 9.45, 36.43},
                               {20, 18.71, 23.13, 27.73, 26.23, 0.68, 12.52, 42.85}};

struct Config {
  double budget_million = 0;
  const PaperRow* paper = nullptr;  // what it is compared with
  bool equal_triangles = false;     // its budget was chosen for the paper's triangles
  Measured measured;
};

/// Draws frames spread evenly over the walkthrough; all configurations take turns at each frame, so
/// that whoever else uses the machine slows all of them down alike.
absl::Status measure_all(const Common& common, const PaperOptions& options,
                         std::vector<Config>& configs) {
  auto walkthrough = Walkthrough::make(common.cast, options.agents, options.camera_path);
  if (!walkthrough.ok()) return walkthrough.status();
  auto pipeline = render::FramePipeline::make(common.cast, {.backend = options.compute,
                                                            .raster = options.raster,
                                                            .threads = common.threads,
                                                            .measure_cpu_times = true});
  if (!pipeline.ok()) return pipeline.status();

  render::ViewSettings view;
  view.viewport = common.viewport;
  view.selection.rule = options.lod;
  render::JpegEncoder jpeg;
  render::Picture picture;
  Progress progress("paper", std::size_t{options.frames} * configs.size());
  for (std::uint32_t i = 0; i < options.frames && !stop_requested; ++i) {
    const std::uint32_t frame =
        static_cast<std::uint32_t>(std::uint64_t{i} * Walkthrough::kFrames / options.frames);
    if (absl::Status status = walkthrough->advance_to(frame); !status.ok()) return status;
    view.camera = walkthrough->camera(frame);
    std::int64_t time_us = Walkthrough::time_us(frame);
    for (Config& config : configs) {
      view.selection.vertex_budget = static_cast<std::uint64_t>(config.budget_million * 1e6);
      if (i == 0) {
        // buffers grow and caches fill once
        Measured unused;
        if (absl::Status status = measure_frame(**pipeline, walkthrough->crowd(), time_us++, view,
                                                jpeg, picture, unused);
            !status.ok()) {
          return status;
        }
      }
      // a microsecond later each time: instances of a time that was drawn before are kept
      if (absl::Status status = measure_frame(**pipeline, walkthrough->crowd(), time_us++, view,
                                              jpeg, picture, config.measured);
          !status.ok()) {
        return status;
      }
      progress.step(absl::StrFormat("N = %g M, %.1f ms", config.budget_million,
                                    config.measured.wall_ms.sum / config.measured.frames));
    }
  }
  return absl::OkStatus();
}

std::string times(double ours, double theirs) {
  return theirs > 0 && ours > 0 ? fixed(ours / theirs, 2) : "-";
}

void print_table(const std::vector<Config>& configs, bool equal_triangles) {
  Table table({"N (M)", "fps", "fps / paper's", "Mtri min", "max", "avg", "avg, paper",
               "cull+select ms", "paper", "generate ms", "paper", "raster ms", "paper", "frame ms",
               "frame CPU ms", "JPEG CPU ms"});
  for (const Config& config : configs) {
    if (config.equal_triangles != equal_triangles || config.measured.frames == 0) continue;
    const Measured& m = config.measured;
    const PaperRow* p = config.paper;
    const auto theirs = [&](double value) {
      return p == nullptr ? std::string("-") : fixed(value, 2);
    };
    table.add({absl::StrFormat("%.3g", config.budget_million), fixed(m.fps(), 2),
               p == nullptr ? "-" : times(m.fps(), p->fps), fixed(m.triangles.min * 1e-6, 2),
               fixed(m.triangles.max * 1e-6, 2), fixed(m.triangles.mean() * 1e-6, 2),
               theirs(p == nullptr ? 0 : p->avg_million),
               fixed(m.stage_ms(&StageTimes::cull_ms) + m.stage_ms(&StageTimes::select_ms) +
                         m.stage_ms(&StageTimes::allocate_ms),
                     2),
               theirs(p == nullptr ? 0 : p->cull_select_ms),
               fixed(m.stage_ms(&StageTimes::generate_ms), 2),
               theirs(p == nullptr ? 0 : p->generate_ms),
               fixed(m.stage_ms(&StageTimes::raster_ms) + m.stage_ms(&StageTimes::resolve_ms) +
                         m.stage_ms(&StageTimes::read_back_ms),
                     2),
               theirs(p == nullptr ? 0 : p->draw_ms), fixed(m.wall_ms.mean(), 2),
               fixed(m.cpu_ms.mean(), 2), fixed(m.encode_cpu_ms.mean(), 2)});
  }
  std::printf("%s\n", table.text().c_str());
}

/// ms = a + b N over the rows, N in millions of vertices (or of triangles).
struct Fit {
  Line wall, cpu, wall_by_triangles, paper;
};

Fit fit(const std::vector<Config>& configs) {
  std::vector<double> n, triangles, wall, cpu, paper_n, paper_ms;
  for (const Config& config : configs) {
    if (config.equal_triangles || config.measured.frames == 0) continue;
    n.push_back(config.budget_million);
    triangles.push_back(config.measured.triangles.mean() * 1e-6);
    wall.push_back(config.measured.wall_ms.mean());
    cpu.push_back(config.measured.cpu_ms.mean());
  }
  for (const PaperRow& row : kPaper) {
    paper_n.push_back(row.budget_million);
    paper_ms.push_back(1000.0 / row.fps);
  }
  return {fit_line(n, wall), fit_line(n, cpu), fit_line(triangles, wall),
          fit_line(paper_n, paper_ms)};
}

const PaperRow* paper_row(double budget_million) {
  for (const PaperRow& row : kPaper) {
    if (std::abs(row.budget_million - budget_million) < 1e-9) return &row;
  }
  return nullptr;
}

}  // namespace

absl::Status run_paper(const Common& common, const PaperOptions& options) {
  std::vector<Config> configs;
  for (const double budget : options.budgets_million) {
    configs.push_back(
        {budget, options.agents == Walkthrough::kAgents ? paper_row(budget) : nullptr, false, {}});
  }
  if (options.equal_triangles && options.agents == Walkthrough::kAgents) {
    auto count = TriangleCount::make(common.cast, common.threads, common.viewport, options.lod);
    if (!count.ok()) return count.status();
    auto walkthrough = Walkthrough::make(common.cast, options.agents, options.camera_path);
    if (!walkthrough.ok()) return walkthrough.status();
    const std::uint32_t frames = std::min(options.frames, 25U);
    for (std::uint32_t i = 0; i < frames; ++i) {
      const auto frame =
          static_cast<std::uint32_t>(std::uint64_t{i} * Walkthrough::kFrames / frames);
      if (auto status = walkthrough->advance_to(frame); !status.ok()) return status;
      if (auto status = count->add(walkthrough->crowd(), Walkthrough::time_us(frame),
                                   walkthrough->camera(frame));
          !status.ok()) {
        return status;
      }
    }
    for (const double budget : options.budgets_million) {
      const PaperRow* row = paper_row(budget);
      if (row == nullptr) continue;
      const absl::StatusOr<double> equal = count->budget_for(row->avg_million * 1e6);
      if (!equal.ok()) return equal.status();
      configs.push_back({*equal, row, true, {}});
    }
  }
  if (absl::Status status = measure_all(common, options, configs); !status.ok()) return status;
  std::vector<Judged> judged;
  if (options.quality_places > 0 && !stop_requested) {
    auto pipeline = render::FramePipeline::make(
        common.cast, {.raster = options.raster, .threads = common.threads});
    if (!pipeline.ok()) return pipeline.status();
    for (const Config& config : configs) {
      if (config.equal_triangles) continue;
      render::Selection selection;
      selection.rule = options.lod;
      selection.vertex_budget = static_cast<std::uint64_t>(config.budget_million * 1e6);
      judged.push_back({absl::StrFormat("%g", config.budget_million), selection, {}, {}});
    }
    const Places places{options.agents, options.camera_path, options.quality_places, {}, ""};
    if (auto status = judge_places(common, places, **pipeline, judged); !status.ok()) return status;
  }
  if (configs.empty() || configs.front().measured.frames == 0) {
    return absl::CancelledError("paper: stopped before the first frame");
  }

  const char* raster = options.raster == render::RasterKind::kGl ? "gl" : "visibility";
  const Range& visible = configs.front().measured.visible;
  std::printf(
      "Dong & Peng 2019, table 2: %s instances, %ux%u px, raster %s, geometry batched, "
      "%s frames of the walkthrough.\n%s\n\n"
      "Instances in view: min %s, avg %s, max %s (paper: 5,038, 15,771, 29,967).\n\n"
      "At equal N:\n\n",
      grouped(options.agents).c_str(), common.viewport.width_px, common.viewport.height_px, raster,
      grouped(static_cast<double>(configs.front().measured.frames)).c_str(),
      common.machine.line().c_str(), grouped(visible.min).c_str(), grouped(visible.mean()).c_str(),
      grouped(visible.max).c_str());
  print_table(configs, false);
  if (configs.back().equal_triangles) {
    std::printf("At the paper's average triangles:\n\n");
    print_table(configs, true);
  }
  if (!judged.empty()) {
    std::printf("Quality against full detail, near agents, at %u places:\n\n%s\n",
                options.quality_places, quality_table(judged).text().c_str());
  }
  const Fit line = fit(configs);
  std::printf(
      "Fit over N in millions: ms = %.1f + %.2f N; CPU ms = %.1f + %.2f N; paper's fps: ms = "
      "%.1f + %.2f N.\nOver triangles drawn in millions: ms = %.1f + %.2f T.\n",
      line.wall.a, line.wall.b, line.cpu.a, line.cpu.b, line.paper.a, line.paper.b,
      line.wall_by_triangles.a, line.wall_by_triangles.b);

  if (common.json.empty()) return absl::OkStatus();
  nlohmann::ordered_json json = {
      {"experiment", "paper"},
      {"machine", common.machine.json()},
      {"agents", options.agents},
      {"width_px", common.viewport.width_px},
      {"height_px", common.viewport.height_px},
      {"raster", raster},
      {"geometry", "batched"},
      {"lod", options.lod == render::LodRule::kDong2019 ? "dong2019" : "budget"},
      {"rows", nlohmann::ordered_json::array()}};
  for (const Config& config : configs) {
    nlohmann::ordered_json row = {{"budget_million", config.budget_million},
                                  {"equal_triangles", config.equal_triangles}};
    row.update(config.measured.json());
    if (config.paper != nullptr) {
      const PaperRow& p = *config.paper;
      row["paper"] = {{"budget_million", p.budget_million},
                      {"fps", p.fps},
                      {"triangles",
                       {{"min", p.min_million * 1e6},
                        {"max", p.max_million * 1e6},
                        {"mean", p.avg_million * 1e6}}},
                      {"cull_select_ms", p.cull_select_ms},
                      {"generate_ms", p.generate_ms},
                      {"draw_ms", p.draw_ms}};
    }
    for (const Judged& one : judged) {
      if (!config.equal_triangles && one.name == absl::StrFormat("%g", config.budget_million)) {
        row["quality"] = one.quality.json();
      }
    }
    json["rows"].push_back(std::move(row));
  }
  const auto json_of = [](const Line& one) {
    return nlohmann::ordered_json{{"a_ms", one.a}, {"b_ms_per_million", one.b}};
  };
  json["fit"] = {{"wall", json_of(line.wall)},
                 {"cpu", json_of(line.cpu)},
                 {"wall_by_triangles", json_of(line.wall_by_triangles)},
                 {"paper", json_of(line.paper)}};
  return write_json(common.json, json);
}

}  // namespace throng::bench
