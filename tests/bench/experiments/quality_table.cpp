// What a vertex budget costs and how far its pictures are from the reference.
#include <absl/strings/str_format.h>

#include <cstdio>

#include "bench/experiments/options.hpp"
#include "bench/experiments/quality.hpp"
#include "bench/experiments/report.hpp"

namespace throng::bench {

absl::Status run_quality(const Common& common, const QualityOptions& options) {
  auto pipeline = render::FramePipeline::make(
      common.cast,
      {.raster = options.raster, .threads = common.threads, .measure_cpu_times = true});
  if (!pipeline.ok()) return pipeline.status();
  std::vector<Judged> ways;
  render::Selection selection;
  selection.rule = options.lod;
  for (const double budget : options.budgets_million) {
    selection.vertex_budget = static_cast<std::uint64_t>(budget * 1e6);
    ways.push_back({absl::StrFormat("%g", budget), selection, {}, {}});
  }
  selection.vertex_budget = 4'000'000'000;
  ways.push_back({"full detail", selection, {}, {}});
  Places places{options.agents, options.camera_path, options.places, {}, options.pictures};
  places.look.shadows = options.shadows;
  if (auto status = judge_places(common, places, **pipeline, ways); !status.ok()) return status;

  std::printf(
      "Against the reference (full detail, own poses, 16 shaded pixels for each), pixels within 8 "
      "px of an agent.\n%s agents, %s in view on average, %ux%u px, raster %s, %u places of the "
      "walkthrough, two frames each.\n%s\n\n%s\n",
      grouped(options.agents).c_str(), grouped(ways.front().measured.visible.mean()).c_str(),
      common.viewport.width_px, common.viewport.height_px,
      options.raster == render::RasterKind::kGl ? "gl" : "visibility", options.places,
      common.machine.line().c_str(), quality_table(ways).text().c_str());
  if (common.json.empty()) return absl::OkStatus();
  nlohmann::ordered_json json = {{"experiment", "quality"},
                                 {"machine", common.machine.json()},
                                 {"agents", options.agents},
                                 {"width_px", common.viewport.width_px},
                                 {"height_px", common.viewport.height_px},
                                 {"shadows", options.shadows},
                                 {"rows", nlohmann::ordered_json::array()}};
  for (const Judged& way : ways) {
    nlohmann::ordered_json one = {{"budget_million", way.name}, {"quality", way.quality.json()}};
    one.update(way.measured.json());
    json["rows"].push_back(std::move(one));
  }
  return write_json(common.json, json);
}

}  // namespace throng::bench
