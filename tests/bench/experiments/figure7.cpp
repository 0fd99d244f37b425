// Figure 7 of Dong & Peng 2019: all instances in view of a fixed camera, their number on the x
// axis; vertex budgets against full detail by pseudo-instancing and against discrete levels of
// detail.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>

#include "bench/experiments/instancing.hpp"
#include "bench/experiments/measure.hpp"
#include "bench/experiments/options.hpp"
#include "bench/experiments/report.hpp"
#include "bench/experiments/table.hpp"
#include "bench/experiments/walkthrough.hpp"

namespace throng::bench {
namespace {

struct Timing {
  Range wall_ms, cpu_ms;
  double triangles = 0;
};

/// A way to draw the crowd of a count; `draw` renders one frame and tells its triangles.
struct Way {
  std::string name;
  std::function<absl::StatusOr<double>(Walkthrough&, std::uint32_t frame, const render::Camera&)>
      draw;
  std::vector<Timing> by_count;
  bool too_large = false;  // larger counts need more memory than there is
};

constexpr std::uint64_t kFullDetail = 4'000'000'000;  // vertices: more than any crowd has
constexpr double kLongFrameS = 2.0;                   // a frame longer than this is drawn once
constexpr double kBatchLimitBytes = 3.0 * (1ULL << 30);

nlohmann::ordered_json json_of(const Timing& timing) {
  if (timing.wall_ms.count == 0) return nullptr;
  return {{"fps", 1000.0 / timing.wall_ms.mean()},
          {"frame_wall_ms", timing.wall_ms.mean()},
          {"frame_cpu_ms", timing.cpu_ms.mean()},
          {"frames", timing.wall_ms.count},
          {"triangles", timing.triangles}};
}

}  // namespace

absl::Status run_figure7(const Common& common, const PaperOptions& options) {
  auto pipeline = render::FramePipeline::make(
      common.cast,
      {.backend = options.compute, .raster = options.raster, .threads = common.threads});
  if (!pipeline.ok()) return pipeline.status();
  auto instancing = Instancing::make(common.cast);
  if (!instancing.ok()) return instancing.status();

  double mean_vertices = 0;
  for (const render::CastMember& member : common.cast->members) {
    mean_vertices +=
        member.character.vertex_count() / static_cast<double>(common.cast->members.size());
  }
  render::Picture picture;
  const auto ours = [&](const std::string& name, std::uint64_t budget, render::LodRule rule) {
    return Way{name,
               [&, budget, rule](Walkthrough& crowd, std::uint32_t frame,
                                 const render::Camera& camera) -> absl::StatusOr<double> {
                 render::ViewSettings view;
                 view.camera = camera;
                 view.viewport = common.viewport;
                 view.selection.vertex_budget = budget;
                 view.selection.rule = rule;
                 if (budget >= kFullDetail) view.pose_mode = render::PoseMode::kExact;
                 render::FrameStats stats;
                 static std::int64_t later_us = 0;  // so that no instances are kept
                 const absl::Status status = (*pipeline)->render(
                     crowd.crowd(), Walkthrough::time_us(frame) + ++later_us % 1000, view, picture,
                     stats);
                 if (!status.ok()) return status;
                 return static_cast<double>(stats.counters.triangles);
               },
               {},
               false};
  };
  // the point-based method: surface samples as large as is told, each agent in its own pose
  const auto points = [&](const std::string& name, float size_px) {
    return Way{name,
               [&, size_px](Walkthrough& crowd, std::uint32_t frame,
                            const render::Camera& camera) -> absl::StatusOr<double> {
                 render::ViewSettings view;
                 view.camera = camera;
                 view.viewport = common.viewport;
                 view.selection.form = render::FormRule::kPoints;
                 view.selection.point_size_px = size_px;
                 view.pose_mode = render::PoseMode::kExact;
                 render::FrameStats stats;
                 const absl::Status status = (*pipeline)->render(
                     crowd.crowd(), Walkthrough::time_us(frame), view, picture, stats);
                 if (!status.ok()) return status;
                 return static_cast<double>(stats.counters.vertices);  // points
               },
               {},
               false};
  };
  const auto theirs = [&](const std::string& name, bool discrete) {
    return Way{name,
               [&, discrete](Walkthrough& crowd, std::uint32_t frame,
                             const render::Camera& camera) -> absl::StatusOr<double> {
                 const render::Bracket bracket = crowd.crowd().bracket(Walkthrough::time_us(frame));
                 const std::vector<InstancedAgent> agents = instanced_agents(
                     *bracket.newer, *common.cast, camera, common.viewport, discrete);
                 const absl::Status status =
                     (*instancing)->draw(agents, camera, common.viewport, picture);
                 if (!status.ok()) return status;
                 double triangles = 0;
                 for (const InstancedAgent& agent : agents) {
                   triangles += (*instancing)->triangles(agent.character, agent.level);
                 }
                 return triangles;
               },
               {},
               false};
  };
  const std::string raster = options.raster == render::RasterKind::kGl ? "gl" : "visibility";
  std::vector<Way> ways;
  for (const double budget : options.budgets_million) {
    ways.push_back(ours(absl::StrFormat("N = %g M", budget),
                        static_cast<std::uint64_t>(budget * 1e6), options.lod));
  }
  ways.push_back(ours("full detail, " + raster, kFullDetail, render::LodRule::kBudget));
  const std::size_t full = ways.size() - 1;
  ways.push_back(points("points of 1.25 px", 1.25F));
  ways.push_back(points("points of 3 px", 3.0F));
  ways.push_back(theirs("discrete LOD, gl instancing", true));
  ways.push_back(theirs("full detail, gl pseudo-instancing", false));

  Progress progress("figure 7", options.counts.size() * ways.size());
  std::size_t done = 0;
  for (const std::uint32_t count : options.counts) {
    auto crowd = Walkthrough::make(common.cast, count);
    if (!crowd.ok()) return crowd.status();
    if (auto status = crowd->advance_to(0); !status.ok()) return status;
    const auto newest = crowd->crowd().newest();
    const glm::dvec3 person_m(0.0, 0.0, 1.9);
    const render::Camera camera = render::overview_camera(
        newest->low_m, glm::dvec3(newest->high_m) + person_m, common.viewport);
    for (Way& way : ways) way.by_count.emplace_back();
    ways[full].too_large = count * mean_vertices * 72.0 > kBatchLimitBytes;
    for (std::uint32_t frame = 0; frame <= options.frames && !stop_requested; ++frame) {
      if (auto status = crowd->advance_to(frame); !status.ok()) return status;
      for (Way& way : ways) {
        Timing& timing = way.by_count.back();
        const bool warm_up = frame == 0;
        if (way.too_large || (!warm_up && timing.wall_ms.max > 1e3 * kLongFrameS)) continue;
        const Ticks start = Ticks::now();
        const absl::StatusOr<double> triangles = way.draw(*crowd, frame, camera);
        if (!triangles.ok()) return triangles.status();
        const Ticks took = Ticks::now().since(start);
        // the first frame grows buffers; it counts only where one frame is all there is time for
        if (warm_up && took.wall_s <= kLongFrameS) continue;
        if (!options.pictures.empty() && frame <= 1) {
          std::string file =
              absl::StrCat(options.pictures, "/figure7-", count, "-", way.name, ".png");
          std::replace(file.begin(), file.end(), ' ', '_');
          if (auto status = write_png(file, picture); !status.ok()) return status;
        }
        timing.wall_ms.add(1e3 * took.wall_s);
        timing.cpu_ms.add(1e3 * took.cpu_s);
        timing.triangles = *triangles;
      }
    }
    for (const Way& way : ways) progress.step(absl::StrCat(count, " ", way.name));
    if (!stop_requested) ++done;
  }
  if (done == 0) return absl::CancelledError("figure 7: stopped before the first count was done");

  // the last way is what the others are compared with
  const auto head = [&](const std::string& corner) {
    std::vector<std::string> cells{corner};
    for (std::size_t c = 0; c < done; ++c) cells.push_back(grouped(options.counts[c]));
    return cells;
  };
  Table fps(head("frames per second")), cpu(head("CPU ms a frame")),
      ratio(head("CPU time of " + ways.back().name + " over"));
  for (std::size_t i = 0; i < ways.size(); ++i) {
    std::vector<std::string> rows[3] = {{ways[i].name}, {ways[i].name}, {ways[i].name}};
    for (std::size_t c = 0; c < done; ++c) {
      const Timing& t = ways[i].by_count[c];
      const bool there = t.wall_ms.count > 0;
      rows[0].push_back(there ? fixed(1000.0 / t.wall_ms.mean(), 2) : "-");
      rows[1].push_back(there ? fixed(t.cpu_ms.mean(), 0) : "-");
      rows[2].push_back(there ? fixed(ways.back().by_count[c].cpu_ms.mean() / t.cpu_ms.mean(), 1)
                              : "-");
    }
    fps.add(std::move(rows[0]));
    cpu.add(std::move(rows[1]));
    ratio.add(std::move(rows[2]));
  }
  std::printf(
      "Dong & Peng 2019, figure 7: all instances in view of a fixed camera, %ux%u px, raster %s; a "
      "column for each number of instances.\n%s\n\n%s\n%s\n%s\ngl: OpenGL instancing with skinning "
      "in the vertex shader, one palette frame, one sample a pixel, no ground or shadows.\nA frame "
      "over %.0f s is drawn once; - needs over %.0f GiB in batched form.\n",
      common.viewport.width_px, common.viewport.height_px, raster.c_str(),
      common.machine.line().c_str(), ratio.text().c_str(), fps.text().c_str(), cpu.text().c_str(),
      kLongFrameS, kBatchLimitBytes / (1ULL << 30));
  if (common.json.empty()) return absl::OkStatus();
  nlohmann::ordered_json json = {{"experiment", "figure7"},
                                 {"machine", common.machine.json()},
                                 {"width_px", common.viewport.width_px},
                                 {"height_px", common.viewport.height_px},
                                 {"raster", (*pipeline)->raster_info().name},
                                 {"instancing", (*instancing)->device()},
                                 {"rows", nlohmann::ordered_json::array()}};
  for (std::size_t c = 0; c < done; ++c) {
    nlohmann::ordered_json row = {{"instances", options.counts[c]}};
    for (const Way& way : ways) row[way.name] = json_of(way.by_count[c]);
    json["rows"].push_back(std::move(row));
  }
  return write_json(common.json, json);
}

}  // namespace throng::bench
