// What a vertex budget costs and how far its pictures are from the reference.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <cstdio>

#include "bench/experiments/measure.hpp"
#include "bench/experiments/options.hpp"
#include "bench/experiments/quality.hpp"
#include "bench/experiments/report.hpp"
#include "bench/experiments/table.hpp"
#include "bench/experiments/walkthrough.hpp"

namespace throng::bench {
namespace {

struct Row {
  std::string name;
  std::uint64_t budget = 0;
  render::FramePipeline* pipeline = nullptr;
  Measured measured;
  Quality quality;
};

}  // namespace

absl::Status run_quality(const Common& common, const QualityOptions& options) {
  auto walkthrough = Walkthrough::make(common.cast, options.agents, options.camera_path);
  if (!walkthrough.ok()) return walkthrough.status();
  auto reference = Reference::make(common.cast, common.threads);
  if (!reference.ok()) return reference.status();
  auto pipeline = render::FramePipeline::make(
      common.cast,
      {.raster = options.raster, .threads = common.threads, .measure_cpu_times = true});
  if (!pipeline.ok()) return pipeline.status();

  std::vector<Row> rows;
  for (const double budget : options.budgets_million) {
    rows.push_back({absl::StrFormat("%g", budget),
                    static_cast<std::uint64_t>(budget * 1e6),
                    pipeline->get(),
                    {},
                    {}});
  }
  rows.push_back({"full detail", 4'000'000'000, pipeline->get(), {}, {}});

  render::ViewSettings view;
  view.viewport = common.viewport;
  view.selection.rule = options.lod;
  view.look.shadows = options.shadows;
  render::JpegEncoder jpeg;
  Progress progress("quality", std::size_t{options.places} * (rows.size() + 1));
  for (std::uint32_t place = 0; place < options.places && !stop_requested; ++place) {
    const auto first = static_cast<std::uint32_t>(
        (2 * std::uint64_t{place} + 1) * (Walkthrough::kFrames - 2) / (2 * options.places));
    std::array<Reference::Frame, 2> references;
    std::vector<std::array<Reference::Frame, 2>> frames(rows.size());
    for (const std::uint32_t i : {0U, 1U}) {
      const std::uint32_t frame = first + i;
      if (auto status = walkthrough->advance_to(frame); !status.ok()) return status;
      view.camera = walkthrough->camera(frame);
      const std::int64_t time_us = Walkthrough::time_us(frame);
      auto drawn = reference->draw(walkthrough->crowd(), time_us, view);
      if (!drawn.ok()) return drawn.status();
      references[i] = *std::move(drawn);
      for (std::size_t r = 0; r < rows.size(); ++r) {
        view.selection.vertex_budget = rows[r].budget;
        if (auto status = measure_frame(*rows[r].pipeline, walkthrough->crowd(), time_us, view,
                                        jpeg, frames[r][i].picture, rows[r].measured);
            !status.ok()) {
          return status;
        }
        auto covered = covered_pixels(*rows[r].pipeline, walkthrough->crowd(), time_us, view);
        if (!covered.ok()) return covered.status();
        frames[r][i].covered = *std::move(covered);
        if (options.pictures.empty()) continue;
        const std::string name =
            absl::StrCat(options.pictures, "/quality-", absl::Dec(frame, absl::kZeroPad4), "-");
        if (auto status = write_png(name + rows[r].name + ".png", frames[r][i].picture);
            !status.ok()) {
          return status;
        }
        if (r > 0) continue;
        if (auto status = write_png(name + "reference.png", references[i].picture); !status.ok()) {
          return status;
        }
      }
    }
    progress.step("reference");
    for (std::size_t r = 0; r < rows.size(); ++r) {
      if (auto status = judge(frames[r], references, rows[r].quality); !status.ok()) return status;
      progress.step(
          absl::StrFormat("N = %s M: SSIM %.3f", rows[r].name, rows[r].quality.near_ssim.mean()));
    }
  }
  if (rows.front().measured.frames == 0) {
    return absl::CancelledError("quality: stopped before the first frame");
  }

  Table table({"N (M)", "SSIM", "PSNR dB", "flicker", "SSIM, whole frame", "PSNR dB, whole", "Mtri",
               "frame CPU ms", "frame ms"});
  for (const Row& row : rows) {
    table.add({row.name, fixed(row.quality.near_ssim.mean(), 3),
               fixed(row.quality.near_psnr_db.mean(), 1), fixed(row.quality.flicker.mean(), 2),
               fixed(row.quality.frame_ssim.mean(), 3), fixed(row.quality.frame_psnr_db.mean(), 1),
               fixed(row.measured.triangles.mean() * 1e-6, 2), fixed(row.measured.cpu_ms.mean(), 1),
               fixed(row.measured.wall_ms.mean(), 1)});
  }
  const Range& visible = rows.front().measured.visible;
  std::printf(
      "Against the reference (full detail, own poses, 16 shaded pixels for each), pixels within 8 "
      "px "
      "of an agent.\n%s agents, %s in view on average, %ux%u px, raster %s, %u places of the "
      "walkthrough, two frames each.\n%s\n\n%s\n",
      grouped(options.agents).c_str(), grouped(visible.mean()).c_str(), common.viewport.width_px,
      common.viewport.height_px, options.raster == render::RasterKind::kGl ? "gl" : "visibility",
      options.places, common.machine.line().c_str(), table.text().c_str());
  if (common.json.empty()) return absl::OkStatus();
  nlohmann::ordered_json json = {{"experiment", "quality"},
                                 {"machine", common.machine.json()},
                                 {"agents", options.agents},
                                 {"width_px", common.viewport.width_px},
                                 {"height_px", common.viewport.height_px},
                                 {"shadows", options.shadows},
                                 {"rows", nlohmann::ordered_json::array()}};
  for (const Row& row : rows) {
    nlohmann::ordered_json one = {{"budget_million", row.name}, {"quality", row.quality.json()}};
    one.update(row.measured.json());
    json["rows"].push_back(std::move(one));
  }
  return write_json(common.json, json);
}

}  // namespace throng::bench
