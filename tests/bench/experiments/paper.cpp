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
  std::size_t form = 0;  // of the options' forms
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
  std::vector<std::unique_ptr<render::FramePipeline>> pipelines;
  for (const Form& form : options.forms) {
    auto pipeline = render::FramePipeline::make(common.cast, {.backend = options.compute,
                                                              .raster = options.raster,
                                                              .threads = common.threads,
                                                              .measure_cpu_times = true,
                                                              .geometry = form.geometry});
    if (!pipeline.ok()) return pipeline.status();
    pipelines.push_back(*std::move(pipeline));
  }

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
    // a microsecond later each time: instances of a time that was drawn before are kept
    const auto draw = [&](const Config& config, Measured& measured) {
      view.selection.vertex_budget = static_cast<std::uint64_t>(config.budget_million * 1e6);
      view.pose_mode = options.forms[config.form].pose;
      return measure_frame(*pipelines[config.form], walkthrough->crowd(), time_us++, view, jpeg,
                           picture, measured);
    };
    // buffers that grow at this frame grow now, for the largest budget, and not on the clock
    for (std::size_t form = 0; form < options.forms.size(); ++form) {
      const Config* largest = nullptr;
      for (const Config& config : configs) {
        if (config.form != form) continue;
        if (largest == nullptr || config.budget_million > largest->budget_million) {
          largest = &config;
        }
      }
      Measured unused;
      if (largest == nullptr) continue;
      if (absl::Status status = draw(*largest, unused); !status.ok()) return status;
    }
    for (Config& config : configs) {
      if (absl::Status status = draw(config, config.measured); !status.ok()) return status;
      progress.step(absl::StrFormat(
          "%s, N = %.3g M, %.1f ms", options.forms[config.form].name, config.budget_million,
          config.measured.wall_ms.sum / static_cast<double>(config.measured.frames)));
    }
  }
  return absl::OkStatus();
}

void print_table(const std::vector<Config>& configs, std::size_t form, bool equal_triangles) {
  Table speed({"N (M)", "fps / paper's", "fps", "paper", "frame ms", "frame CPU ms", "Mtri min",
               "max", "avg", "avg, paper", "JPEG CPU ms"});
  Table stages({"N (M)", "cull+select ms", "CPU ms", "paper", "LOD mesh generation ms", "CPU ms",
                "paper", "raster ms", "CPU ms", "paper"});
  for (const Config& config : configs) {
    if (config.form != form || config.equal_triangles != equal_triangles ||
        config.measured.frames == 0) {
      continue;
    }
    const Measured& m = config.measured;
    const std::string n = absl::StrFormat("%.3g", config.budget_million);
    const auto paper = [&](double PaperRow::*column) {
      return config.paper == nullptr ? std::nan("") : config.paper->*column;
    };
    speed.add({n, fixed(m.fps() / paper(&PaperRow::fps), 2), fixed(m.fps(), 2),
               fixed(paper(&PaperRow::fps), 2), fixed(m.wall_ms.mean(), 1),
               fixed(m.cpu_ms.mean(), 1), fixed(m.triangles.min * 1e-6, 2),
               fixed(m.triangles.max * 1e-6, 2), fixed(m.triangles.mean() * 1e-6, 2),
               fixed(paper(&PaperRow::avg_million), 2), fixed(m.encode_cpu_ms.mean(), 1)});
    const auto add = [&](std::vector<std::string>& row,
                         std::initializer_list<double StageTimes::*> parts,
                         double PaperRow::*column) {
      double wall_ms = 0, cpu_ms = 0;
      for (double StageTimes::*part : parts) {
        wall_ms += m.stage_ms(part);
        cpu_ms += m.cpu_stage_ms(part);
      }
      row.insert(row.end(), {fixed(wall_ms, 2), fixed(cpu_ms, 2), fixed(paper(column), 2)});
    };
    std::vector<std::string> row{n};
    add(row, {&StageTimes::cull_ms, &StageTimes::select_ms, &StageTimes::allocate_ms},
        &PaperRow::cull_select_ms);
    add(row, {&StageTimes::generate_ms}, &PaperRow::generate_ms);
    add(row, {&StageTimes::raster_ms, &StageTimes::resolve_ms, &StageTimes::read_back_ms},
        &PaperRow::draw_ms);
    stages.add(std::move(row));
  }
  std::printf("%s\n%s\n", speed.text().c_str(), stages.text().c_str());
}

/// ms = a + b N over the rows, N in millions of vertices (or of triangles).
struct Fit {
  Line wall, cpu, wall_by_triangles, paper;
};

Fit fit(const std::vector<Config>& configs, std::size_t form) {
  std::vector<double> n, triangles, wall, cpu, paper_n, paper_ms;
  for (const Config& config : configs) {
    if (config.form != form || config.equal_triangles || config.measured.frames == 0) continue;
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

/// Rows with the budgets that lead to the paper's average triangles.
absl::Status add_equal_triangles(const Common& common, const PaperOptions& options,
                                 std::size_t form, std::vector<Config>& configs) {
  auto count = TriangleCount::make(common.cast, common.threads, common.viewport, options.lod,
                                   options.forms[form].pose);
  if (!count.ok()) return count.status();
  auto walkthrough = Walkthrough::make(common.cast, options.agents, options.camera_path);
  if (!walkthrough.ok()) return walkthrough.status();
  const std::uint32_t frames = std::min(options.frames, 25U);
  for (std::uint32_t i = 0; i < frames; ++i) {
    const auto frame = static_cast<std::uint32_t>(std::uint64_t{i} * Walkthrough::kFrames / frames);
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
    configs.push_back({form, *equal, row, true, {}});
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status run_paper(const Common& common, const PaperOptions& options) {
  std::vector<Config> configs;
  const bool published = options.agents == Walkthrough::kAgents;
  for (std::size_t form = 0; form < options.forms.size(); ++form) {
    for (const double budget : options.budgets_million) {
      configs.push_back({form, budget, published ? paper_row(budget) : nullptr, false, {}});
    }
    if (!published || !options.equal_triangles) continue;
    if (auto status = add_equal_triangles(common, options, form, configs); !status.ok()) {
      return status;
    }
  }
  if (absl::Status status = measure_all(common, options, configs); !status.ok()) return status;
  if (configs.empty() || configs.front().measured.frames == 0) {
    return absl::CancelledError("paper: stopped before the first frame");
  }
  std::vector<Judged> judged;
  if (options.quality_places > 0 && !stop_requested) {
    for (const Config& config : configs) {
      if (config.equal_triangles) continue;
      judged.push_back({options.forms[config.form],
                        absl::StrFormat("%g", config.budget_million),
                        static_cast<std::uint64_t>(config.budget_million * 1e6),
                        {},
                        {}});
    }
    Places places;
    places.agents = options.agents;
    places.camera_path = options.camera_path;
    places.count = options.quality_places;
    places.raster = options.raster;
    places.lod = options.lod;
    if (auto status = judge_places(common, places, judged); !status.ok()) return status;
  }

  const char* raster = options.raster == render::RasterKind::kGl ? "gl" : "visibility";
  const Range& visible = configs.front().measured.visible;
  std::printf(
      "Dong & Peng 2019, table 2: %s instances, %ux%u px, raster %s, %s frames of the "
      "walkthrough.\n%s\n\n"
      "Instances in view: min %s, avg %s, max %s (paper: 5,038, 15,771, 29,967).\n\n",
      grouped(options.agents).c_str(), common.viewport.width_px, common.viewport.height_px, raster,
      grouped(static_cast<double>(configs.front().measured.frames)).c_str(),
      common.machine.line().c_str(), grouped(visible.min).c_str(), grouped(visible.mean()).c_str(),
      grouped(visible.max).c_str());
  nlohmann::ordered_json fits;
  for (std::size_t form = 0; form < options.forms.size(); ++form) {
    const char* name = options.forms[form].name;
    std::printf("Geometry %s, at equal N:\n\n", name);
    print_table(configs, form, false);
    if (published && options.equal_triangles) {
      std::printf("Geometry %s, at the paper's average triangles:\n\n", name);
      print_table(configs, form, true);
    }
    const Fit line = fit(configs, form);
    std::printf(
        "Fit over N in millions, %s: ms = %.1f + %.2f N; CPU ms = %.1f + %.2f N; paper's fps: ms = "
        "%.1f + %.2f N.\nOver triangles drawn in millions: ms = %.1f + %.2f T.\n\n",
        name, line.wall.a, line.wall.b, line.cpu.a, line.cpu.b, line.paper.a, line.paper.b,
        line.wall_by_triangles.a, line.wall_by_triangles.b);
    const auto json_of = [](const Line& one) {
      return nlohmann::ordered_json{{"a_ms", one.a}, {"b_ms_per_million", one.b}};
    };
    fits[name] = {{"wall", json_of(line.wall)},
                  {"cpu", json_of(line.cpu)},
                  {"wall_by_triangles", json_of(line.wall_by_triangles)},
                  {"paper", json_of(line.paper)}};
  }
  if (!judged.empty()) {
    std::printf("Quality against full detail, near agents, at %u places:\n\n%s\n",
                options.quality_places, quality_table(judged).text().c_str());
  }

  if (common.json.empty()) return absl::OkStatus();
  nlohmann::ordered_json json = {
      {"experiment", "paper"},
      {"machine", common.machine.json()},
      {"agents", options.agents},
      {"width_px", common.viewport.width_px},
      {"height_px", common.viewport.height_px},
      {"raster", raster},
      {"compute", options.compute == render::BackendKind::kCpu ? "cpu" : "cuda"},
      {"lod", options.lod == render::LodRule::kDong2019 ? "dong2019" : "budget"},
      {"fit", fits},
      {"rows", nlohmann::ordered_json::array()}};
  for (const Config& config : configs) {
    nlohmann::ordered_json row = {{"geometry", options.forms[config.form].name},
                                  {"budget_million", config.budget_million},
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
      if (!config.equal_triangles && one.form.name == options.forms[config.form].name &&
          one.budget == static_cast<std::uint64_t>(config.budget_million * 1e6)) {
        row["quality"] = one.quality.json();
      }
    }
    json["rows"].push_back(std::move(row));
  }
  return write_json(common.json, json);
}

}  // namespace throng::bench
