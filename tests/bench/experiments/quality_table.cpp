// What a vertex budget costs and how far its pictures are from the reference.
#include <absl/strings/str_format.h>

#include <cstdio>

#include "bench/experiments/options.hpp"
#include "bench/experiments/quality.hpp"
#include "bench/experiments/report.hpp"

namespace throng::bench {

absl::Status run_quality(const Common& common, const QualityOptions& options) {
  std::vector<Judged> ways;
  for (const Form& form : options.forms) {
    for (const double budget : options.budgets_million) {
      ways.push_back(
          {form, absl::StrFormat("%g", budget), static_cast<std::uint64_t>(budget * 1e6), {}, {}});
    }
    ways.push_back({form, "full detail", 4'000'000'000, {}, {}});
  }
  Places places;
  places.agents = options.agents;
  places.camera_path = options.camera_path;
  places.count = options.places;
  places.raster = options.raster;
  places.lod = options.lod;
  places.look.shadows = options.shadows;
  places.pictures = options.pictures;
  if (auto status = judge_places(common, places, ways); !status.ok()) return status;

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
    nlohmann::ordered_json one = {
        {"geometry", way.form.name}, {"budget_million", way.name}, {"quality", way.quality.json()}};
    one.update(way.measured.json());
    json["rows"].push_back(std::move(one));
  }
  return write_json(common.json, json);
}

}  // namespace throng::bench
