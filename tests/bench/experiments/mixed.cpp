// The mixed frame against every single form: SSIM, flicker and CPU time at the same places, judged
// by the full-detail reference of 16 shaded samples a pixel.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <cstdio>

#include "bench/experiments/options.hpp"
#include "bench/experiments/quality.hpp"
#include "bench/experiments/report.hpp"

namespace throng::bench {
namespace {

constexpr double kLeastSsim = 0.95, kMostFlicker = 1.2;
constexpr std::uint64_t kAll = 4'000'000'000;

bool passes(const Judged& way) {
  return way.quality.near_ssim.mean() >= kLeastSsim && way.quality.flicker.mean() <= kMostFlicker;
}

}  // namespace

absl::Status run_mixed(const Common& common, const MixedOptions& options) {
  std::vector<Judged> ways;
  const auto add = [&](std::string name, render::FormRule rule, std::uint64_t budget,
                       float error_px) {
    Form form = kFused;
    form.rule = rule;
    form.error_px = error_px;
    ways.push_back({form, std::move(name), budget, {}, {}});
  };
  for (const double budget : options.budgets_million) {
    add(absl::StrFormat("mesh, N = %g M", budget), render::FormRule::kMesh,
        static_cast<std::uint64_t>(budget * 1e6), 0.5F);
  }
  add("mesh, full detail", render::FormRule::kMesh, kAll, 0.5F);
  add("impostor", render::FormRule::kImpostor, kAll, 0.5F);
  for (const double error_px : options.errors_px) {
    add(absl::StrFormat("mixed, %g px", error_px), render::FormRule::kMixed, kAll,
        static_cast<float>(error_px));
  }
  Places places;
  places.agents = options.agents;
  places.count = options.places;
  places.pictures = options.pictures;
  if (auto status = judge_places(common, places, ways); !status.ok()) return status;

  std::printf("Mixed frame, %u agents, %u places, %ux%u px, visibility.\n%s\n\n", options.agents,
              options.places, common.viewport.width_px, common.viewport.height_px,
              common.machine.line().c_str());
  Table table({"form", "SSIM", "PSNR dB", "flicker", "vertices, M", "frame CPU ms", "passes"});
  nlohmann::ordered_json json = {{"experiment", "mixed"},
                                 {"machine", common.machine.json()},
                                 {"agents", options.agents},
                                 {"places", options.places},
                                 {"width_px", common.viewport.width_px},
                                 {"height_px", common.viewport.height_px},
                                 {"least_ssim", kLeastSsim},
                                 {"most_flicker", kMostFlicker},
                                 {"rows", nlohmann::ordered_json::array()}};
  const Judged* single = nullptr;
  const Judged* mixed = nullptr;
  for (const Judged& way : ways) {
    table.add({way.name, fixed(way.quality.near_ssim.mean(), 3),
               fixed(way.quality.near_psnr_db.mean(), 1), fixed(way.quality.flicker.mean(), 2),
               fixed(way.measured.vertices.mean() * 1e-6, 2), fixed(way.measured.cpu_ms.mean(), 1),
               passes(way) ? "yes" : "no"});
    json["rows"].push_back({{"form", way.name},
                            {"quality", way.quality.json()},
                            {"passes", passes(way)},
                            {"measured", way.measured.json()}});
    const Judged*& best = way.form.rule == render::FormRule::kMixed ? mixed : single;
    if (passes(way) &&
        (best == nullptr || way.measured.cpu_ms.mean() < best->measured.cpu_ms.mean())) {
      best = &way;
    }
  }
  std::printf("%s\n", table.text().c_str());
  if (mixed != nullptr && single != nullptr) {
    std::printf("Cheapest that passes (SSIM %.2f, flicker %.1f): %s %.1f ms; %s %.1f ms.\n",
                kLeastSsim, kMostFlicker, mixed->name.c_str(), mixed->measured.cpu_ms.mean(),
                single->name.c_str(), single->measured.cpu_ms.mean());
  } else {
    std::printf("Nothing %s passes (SSIM %.2f, flicker %.1f).\n",
                mixed == nullptr ? "mixed" : "single", kLeastSsim, kMostFlicker);
  }
  return common.json.empty() ? absl::OkStatus() : write_json(common.json, json);
}

}  // namespace throng::bench
