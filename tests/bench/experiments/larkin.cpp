// Larkin, Paris, Dobbyn & O'Sullivan, "Every Last Detail": a crowd far away under a fixed budget of
// points; generate and raster take the same time for any number of agents.
#include <absl/strings/str_cat.h>

#include <cstdio>
#include <random>

#include "bench/experiments/clock.hpp"
#include "bench/experiments/numbers.hpp"
#include "bench/experiments/options.hpp"
#include "bench/experiments/plot.hpp"
#include "bench/experiments/quality.hpp"
#include "bench/experiments/report.hpp"
#include "bench/experiments/table.hpp"
#include "render/compute/cpu/work_pool.hpp"
#include "throng/render/density.hpp"
#include "throng/render/quality.hpp"

namespace throng::bench {
namespace {

constexpr double kPerM2 = 0.5;  // agents, over the whole square

/// People on a square: two of three in knots of up to 4 to the square metre, the rest anywhere.
absl::StatusOr<std::unique_ptr<render::Crowd>> make_crowd(
    const std::shared_ptr<const render::Cast>& cast, std::uint32_t agents) {
  std::mt19937 random(7);
  const auto uniform = [&] { return static_cast<float>(random() >> 8) * (1.0F / 16777216.0F); };
  const auto side_m = static_cast<float>(std::sqrt(agents / kPerM2));
  auto membership = std::make_shared<render::Membership>();
  render::AgentFrame frame;
  glm::vec2 knot_m(0.0F);
  float radius_m = 0.0F;
  std::uint32_t left = 0;
  for (std::uint32_t i = 0; i < agents; ++i) {
    glm::vec2 p(side_m * (uniform() - 0.5F), side_m * (uniform() - 0.5F));
    if (i % 3 != 0) {
      if (left == 0) {
        left = 20 + random() % 400;
        knot_m = p;
        radius_m = std::sqrt(static_cast<float>(left) / (3.1416F * (1.0F + 3.0F * uniform())));
      }
      --left;
      const float angle_rad = 6.2831853F * uniform(), r = radius_m * std::sqrt(uniform());
      p = glm::clamp(knot_m + r * glm::vec2(std::cos(angle_rad), std::sin(angle_rad)),
                     -0.5F * side_m, 0.5F * side_m);
    }
    membership->ids.push_back(i + 1);
    frame.position_m.emplace_back(p.x, p.y, 0.0F);
    frame.heading_rad.push_back(6.2831853F * uniform());
  }
  membership->epoch = 1;
  frame.membership = membership;
  auto crowd = std::make_unique<render::Crowd>(cast, render::CrowdSettings{});
  if (absl::Status status = crowd->push(std::move(frame)); !status.ok()) return status;
  return crowd;
}

render::FarView far_view(const render::Camera& camera, const render::Viewport& viewport) {
  render::FarView view;
  view.eye_world = camera.eye_world;
  view.clip_from_relative = render::clip_from_relative(camera, viewport);
  view.px_per_tangent =
      static_cast<float>(0.5 * viewport.height_px / std::tan(0.5 * camera.fov_y_rad));
  return view;
}

struct Stages {
  Range colors, triangulate, share, generate, raster;  // CPU ms
  std::uint64_t points = 0;
  std::uint32_t vertices = 0, drawn = 0, visible = 0;
};

nlohmann::ordered_json json_of(std::uint32_t agents, const Stages& stages) {
  return {{"agents", agents},
          {"visible", stages.visible},
          {"triangulation_vertices", stages.vertices},
          {"agents_with_points", stages.drawn},
          {"points", stages.points},
          {"cpu_ms",
           {{"colors_once", stages.colors.mean()},
            {"triangulate_off_thread", stages.triangulate.mean()},
            {"share", stages.share.mean()},
            {"generate", stages.generate.mean()},
            {"raster", stages.raster.mean()}}}};
}

double cpu_ms_since(const Ticks& start) { return 1e3 * Ticks::now().since(start).cpu_s; }

absl::Status measure(const Common& common, const LarkinOptions& options,
                     const render::CrowdCloud& cloud, render::Rasterizer& rasterizer,
                     render::WorkPool& pool, std::uint32_t agents, Stages& stages) {
  auto crowd = make_crowd(common.cast, agents);
  if (!crowd.ok()) return crowd.status();
  const auto snapshot = (*crowd)->newest();
  const render::Camera camera = render::overview_camera(
      snapshot->low_m, glm::dvec3(snapshot->high_m) + glm::dvec3(0.0, 0.0, 1.9), common.viewport);
  const render::FarView view = far_view(camera, common.viewport);
  Ticks start = Ticks::now();
  const render::FarAgents far = make_far_agents(*common.cast, cloud, *snapshot->roster);
  stages.colors.add(cpu_ms_since(start));
  start = Ticks::now();
  const render::Triangulation triangulation =
      render::triangulate(snapshot->position_m, snapshot->present);
  stages.triangulate.add(cpu_ms_since(start));
  stages.vertices = triangulation.vertex_count();
  render::FarPlan plan;
  std::vector<render::Splat> splats;
  render::Picture picture;
  for (std::uint32_t frame = 0; frame <= options.frames && !stop_requested; ++frame) {
    start = Ticks::now();
    plan.make(triangulation, far, cloud, view, options.points, render::PointShare::kDensity);
    const double share_ms = cpu_ms_since(start);
    start = Ticks::now();
    generate_far(plan, far, cloud, snapshot->position_m, snapshot->heading_rad, view, pool, splats);
    const double generate_ms = cpu_ms_since(start);
    render::FrameGeometry geometry;
    geometry.splats = splats;
    start = Ticks::now();
    if (absl::Status status = rasterizer.draw(geometry, camera, common.viewport, glm::dvec3(0.0),
                                              render::Look{}, picture);
        !status.ok()) {
      return status;
    }
    const double raster_ms = cpu_ms_since(start);
    if (frame == 0) continue;  // buffers grow
    stages.share.add(share_ms);
    stages.generate.add(generate_ms);
    stages.raster.add(raster_ms);
  }
  stages.points = plan.points();
  stages.drawn = static_cast<std::uint32_t>(plan.shares().size());
  stages.visible = plan.visible();
  if (options.pictures.empty()) return absl::OkStatus();
  return write_png(absl::StrCat(options.pictures, "/larkin-", agents, ".png"), picture);
}

struct Judgement {
  std::string name;
  std::uint64_t points = 0;
  render::PictureError near, whole;
};

/// Both ways to share a budget, against everybody at full detail.
absl::Status judge_shares(const Common& common, const LarkinOptions& options,
                          const render::CrowdCloud& cloud, render::Rasterizer& rasterizer,
                          render::WorkPool& pool, std::vector<Judgement>& judged) {
  auto crowd = make_crowd(common.cast, options.quality_agents);
  if (!crowd.ok()) return crowd.status();
  const auto snapshot = (*crowd)->newest();
  // low over the crowd, so that some are near and many far and covered
  const double half_m = 0.5 * std::sqrt(options.quality_agents / kPerM2);
  render::ViewSettings settings;
  settings.viewport = common.viewport;
  settings.camera.eye_world = {0.0, -half_m - 60.0, 22.0};
  settings.camera.target_world = {0.0, 0.0, 0.0};
  settings.look.shadows = false;
  auto reference = Reference::make(common.cast, common.threads);
  if (!reference.ok()) return reference.status();
  const auto wanted = reference->draw(**crowd, 0, settings);
  if (!wanted.ok()) return wanted.status();
  const auto mask = render::pixels_near(wanted->covered, wanted->covered, common.viewport.width_px,
                                        common.viewport.height_px, 8);
  if (!mask.ok()) return mask.status();
  const render::FarAgents far = make_far_agents(*common.cast, cloud, *snapshot->roster);
  const render::Triangulation triangulation =
      render::triangulate(snapshot->position_m, snapshot->present);
  const render::FarView view = far_view(settings.camera, common.viewport);
  render::FarPlan plan;
  std::vector<render::Splat> splats;
  render::Picture picture;
  if (!options.pictures.empty()) {
    if (auto status = write_png(options.pictures + "/larkin-reference.png", wanted->picture);
        !status.ok()) {
      return status;
    }
  }
  for (const std::uint64_t budget : options.quality_points) {
    for (const render::PointShare share :
         {render::PointShare::kDensity, render::PointShare::kEqual}) {
      const bool is_density = share == render::PointShare::kDensity;
      plan.make(triangulation, far, cloud, view, budget, share);
      generate_far(plan, far, cloud, snapshot->position_m, snapshot->heading_rad, view, pool,
                   splats);
      render::FrameGeometry geometry;
      geometry.splats = splats;
      if (absl::Status status = rasterizer.draw(geometry, settings.camera, common.viewport,
                                                glm::dvec3(0.0), settings.look, picture);
          !status.ok()) {
        return status;
      }
      const auto near = render::compare_pictures(picture, wanted->picture, *mask);
      const auto whole = render::compare_pictures(picture, wanted->picture);
      if (!near.ok()) return near.status();
      if (!whole.ok()) return whole.status();
      judged.push_back(
          {is_density ? "by density" : "the same for each", plan.points(), *near, *whole});
      if (options.pictures.empty()) continue;
      const std::string file = absl::StrCat(options.pictures, "/larkin-", budget, "-",
                                            is_density ? "density" : "equal", ".png");
      if (auto status = write_png(file, picture); !status.ok()) return status;
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status run_larkin(const Common& common, const LarkinOptions& options) {
  auto cloud = render::make_crowd_cloud(*common.cast);
  if (!cloud.ok()) return cloud.status();
  auto rasterizer = render::make_rasterizer(render::RasterKind::kVisibility, common.threads);
  if (!rasterizer.ok()) return rasterizer.status();
  if (auto status = (*rasterizer)->upload(common.cast); !status.ok()) return status;
  render::WorkPool pool(common.threads);

  Table table({"agents", "in view", "vertices", "points", "triangulate", "share", "generate",
               "raster", "generate + raster"});
  nlohmann::ordered_json rows = nlohmann::ordered_json::array();
  Plot times{
      "Far crowd under a fixed budget of points", "agents", "CPU ms a frame", true, true, {}};
  times.series = {
      {"generate", {}, {}}, {"raster", {}, {}}, {"share", {}, {}}, {"triangulate (apart)", {}, {}}};
  Progress progress("larkin", options.counts.size());
  for (const std::uint32_t agents : options.counts) {
    if (stop_requested) break;
    Stages stages;
    if (auto status = measure(common, options, *cloud, **rasterizer, pool, agents, stages);
        !status.ok()) {
      return status;
    }
    table.add({grouped(agents), grouped(stages.visible), grouped(stages.vertices),
               grouped(static_cast<double>(stages.points)), fixed(stages.triangulate.mean(), 1),
               fixed(stages.share.mean(), 1), fixed(stages.generate.mean(), 1),
               fixed(stages.raster.mean(), 1),
               fixed(stages.generate.mean() + stages.raster.mean(), 1)});
    rows.push_back(json_of(agents, stages));
    const double values[] = {stages.generate.mean(), stages.raster.mean(), stages.share.mean(),
                             stages.triangulate.mean()};
    for (std::size_t i = 0; i < std::size(values); ++i) {
      times.series[i].x.push_back(agents);
      times.series[i].y.push_back(values[i]);
    }
    progress.step(grouped(agents));
  }
  std::printf(
      "Larkin et al.: a crowd in view of an overview camera, %ux%u px, %s points in all; CPU ms of "
      "all threads.\ntriangulate runs in a thread of its own, at a bounded rate.\n%s\n\n%s\n",
      common.viewport.width_px, common.viewport.height_px,
      grouped(static_cast<double>(options.points)).c_str(), common.machine.line().c_str(),
      table.text().c_str());

  std::vector<Judgement> judged;
  if (options.quality_agents > 0 && !stop_requested) {
    if (auto status = judge_shares(common, options, *cloud, **rasterizer, pool, judged);
        !status.ok()) {
      return status;
    }
    Table quality({"points", "shared", "SSIM", "PSNR dB", "frame SSIM"});
    for (const Judgement& each : judged) {
      quality.add({grouped(static_cast<double>(each.points)), each.name, fixed(each.near.ssim, 4),
                   fixed(each.near.psnr_db, 2), fixed(each.whole.ssim, 4)});
    }
    std::printf(
        "%s agents, seen from low, against each at full detail (SSIM and PSNR within 8 px "
        "of one):\n%s\n",
        grouped(options.quality_agents).c_str(), quality.text().c_str());
  }
  if (common.json.empty()) return absl::OkStatus();
  nlohmann::ordered_json json = {{"experiment", "larkin"},
                                 {"machine", common.machine.json()},
                                 {"width_px", common.viewport.width_px},
                                 {"height_px", common.viewport.height_px},
                                 {"budget_points", options.points},
                                 {"cloud_points", cloud->count()},
                                 {"rows", std::move(rows)},
                                 {"quality_agents", options.quality_agents},
                                 {"quality", nlohmann::ordered_json::array()}};
  Plot quality{"Picture quality at the same number of points",
               "points",
               "SSIM against full detail",
               true,
               false,
               {}};
  quality.series = {{"by density", {}, {}}, {"the same for each", {}, {}}};
  for (const Judgement& each : judged) {
    json["quality"].push_back({{"points", each.points},
                               {"shared", each.name},
                               {"ssim", each.near.ssim},
                               {"psnr_db", each.near.psnr_db},
                               {"frame_ssim", each.whole.ssim}});
    Series& series = quality.series[each.name == "by density" ? 0 : 1];
    series.x.push_back(static_cast<double>(each.points));
    series.y.push_back(each.near.ssim);
  }
  std::vector<Plot> plots{times};
  if (!judged.empty()) plots.push_back(quality);
  if (auto status = write_plots(plot_file(common.json), plots); !status.ok()) return status;
  return write_json(common.json, json);
}

}  // namespace throng::bench
