// The mixed frame against every single form: SSIM, flicker and CPU time at the same places, judged
// by the full-detail reference of 16 shaded samples a pixel.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <cstdio>
#include <filesystem>

#include "bench/experiments/options.hpp"
#include "bench/experiments/plot.hpp"
#include "bench/experiments/quality.hpp"
#include "bench/experiments/report.hpp"

namespace throng::bench {
namespace {

constexpr double kLeastSsim = 0.95, kMostFlicker = 1.2;
constexpr std::uint64_t kAll = 4'000'000'000;
constexpr std::uint32_t kMostAtFullDetail = 10'000, kMostImpostors = 10'000;

bool passes(const Judged& way) {
  return way.quality.near_ssim.mean() >= kLeastSsim && way.quality.flicker.mean() <= kMostFlicker;
}

constexpr const char* kPlaces[] = {"walkthrough", "street", "above"};

void add_ways(const MixedOptions& options, std::uint32_t agents, std::uint32_t oversampling,
              std::vector<Judged>& ways) {
  const auto add = [&](std::string name, Form form, std::uint64_t budget) {
    if (oversampling > 1) absl::StrAppend(&name, ", 2x2");
    ways.push_back({form, std::move(name), budget, {}, {}});
  };
  Form form = kFused;
  form.oversampling = oversampling;
  for (const double budget : options.budgets_million) {
    add(absl::StrFormat("mesh, N = %g M", budget), form, static_cast<std::uint64_t>(budget * 1e6));
  }
  // full detail of more is beyond memory, and nobody would draw it
  if (agents <= kMostAtFullDetail) add("mesh, full detail", form, kAll);
  form.rule = render::FormRule::kPoints;
  for (const double size_px : options.points_px) {
    form.point_px = static_cast<float>(size_px);
    add(absl::StrFormat("points, %g px", size_px), form, kAll);
  }
  if (agents <= kMostImpostors) {
    form.rule = render::FormRule::kImpostor;
    add("impostor", form, kAll);
  }
  form.rule = render::FormRule::kMixed;
  for (const double error_px : options.errors_px) {
    form.error_px = static_cast<float>(error_px);
    add(absl::StrFormat("mixed, %g px", error_px), form, kAll);
  }
}

/// The cheapest that passes, or null.
const Judged* best_of(const std::vector<Judged>& ways, bool mixed) {
  const Judged* best = nullptr;
  for (const Judged& way : ways) {
    if ((way.form.rule == render::FormRule::kMixed) != mixed || !passes(way)) continue;
    if (best == nullptr || way.measured.cpu_ms.mean() < best->measured.cpu_ms.mean()) best = &way;
  }
  return best;
}

}  // namespace

absl::Status run_mixed(const Common& common, const MixedOptions& options) {
  nlohmann::ordered_json json = {{"experiment", "mixed"},
                                 {"machine", common.machine.json()},
                                 {"width_px", common.viewport.width_px},
                                 {"height_px", common.viewport.height_px},
                                 {"least_ssim", kLeastSsim},
                                 {"most_flicker", kMostFlicker},
                                 {"time", "CPU ms of all threads, the least of the repeats"},
                                 {"repeats", options.repeats},
                                 {"views", nlohmann::ordered_json::array()}};
  Plot plot{"Cheapest that passes the gate", "agents", "CPU ms a frame", true, true, {}};
  for (const Place place : options.places) {
    const std::string where = kPlaces[static_cast<std::size_t>(place)];
    Series single{where + ", one form", {}, {}}, mixed{where + ", mixed", {}, {}};
    for (const std::uint32_t agents : options.counts) {
      std::vector<Judged> ways;
      for (const std::uint32_t oversampling : options.oversampling) {
        add_ways(options, agents, oversampling, ways);
      }
      Places places;
      places.agents = agents;
      places.place = place;
      places.count = options.frames;
      places.repeats = options.repeats;
      places.pictures = options.pictures;
      if (!places.pictures.empty()) {
        absl::StrAppend(&places.pictures, "/", where, "-", agents);
        std::filesystem::create_directories(places.pictures);
      }
      if (auto status = judge_places(common, places, ways); !status.ok()) return status;
      std::printf("Mixed frame, %s agents, %s, %ux%u px, visibility.\n%s\n\n",
                  grouped(agents).c_str(), where.c_str(), common.viewport.width_px,
                  common.viewport.height_px, common.machine.line().c_str());
      Table table(
          {"form", "SSIM", "PSNR dB", "flicker", "vertices, M", "CPU ms", "wall ms", "passes"});
      nlohmann::ordered_json rows = nlohmann::ordered_json::array();
      for (const Judged& way : ways) {
        table.add({way.name, fixed(way.quality.near_ssim.mean(), 3),
                   fixed(way.quality.near_psnr_db.mean(), 1), fixed(way.quality.flicker.mean(), 2),
                   fixed(way.measured.vertices.mean() * 1e-6, 2),
                   fixed(way.measured.cpu_ms.mean(), 1), fixed(way.measured.wall_ms.mean(), 1),
                   passes(way) ? "yes" : "no"});
        rows.push_back({{"form", way.name},
                        {"quality", way.quality.json()},
                        {"passes", passes(way)},
                        {"measured", way.measured.json()}});
      }
      json["views"].push_back({{"agents", agents}, {"place", where}, {"rows", std::move(rows)}});
      std::printf("%s\n", table.text().c_str());
      for (const bool is_mixed : {false, true}) {
        const Judged* best = best_of(ways, is_mixed);
        if (best == nullptr) {
          std::printf("%s passes (SSIM %.2f, flicker %.1f).\n",
                      is_mixed ? "No mixed frame" : "No single form", kLeastSsim, kMostFlicker);
          continue;
        }
        std::printf("Cheapest that passes: %s, %.1f CPU ms.\n", best->name.c_str(),
                    best->measured.cpu_ms.mean());
        Series& series = is_mixed ? mixed : single;
        series.x.push_back(agents);
        series.y.push_back(best->measured.cpu_ms.mean());
      }
      std::printf("\n");
      std::fflush(stdout);
    }
    plot.series.push_back(std::move(single));
    plot.series.push_back(std::move(mixed));
  }
  if (common.json.empty()) return absl::OkStatus();
  if (auto status = write_plots(plot_file(common.json), {plot}); !status.ok()) return status;
  return write_json(common.json, json);
}

}  // namespace throng::bench
