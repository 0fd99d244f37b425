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

/// What is measured: the paper's way, the same for each, and what goes beyond it.
struct Way {
  const char* name;
  const char* file;  // of its pictures
  render::FarRule rule;
};
constexpr Way kWays[] = {
    {"by density", "density", {render::PointShare::kDensity, false}},
    {"the same for each", "equal", {render::PointShare::kEqual, false}},
    {"by what is seen", "seen", {render::PointShare::kVisible, false}},
    {"by what is seen, own figures", "figures", {render::PointShare::kVisible, true}}};

/// What does not change from frame to frame.
struct FarCast {
  render::CrowdCloud cloud;
  render::FarFigures figures;
};

/// The stages of a far crowd, at the time of its only snapshot.
class FarCrowd {
 public:
  FarCrowd(const Common& common, const FarCast& cast, const render::Crowd& crowd,
           render::WorkPool& pool)
      : common_(common),
        cast_(cast),
        crowd_(crowd),
        bracket_(crowd.bracket(0)),
        agents_(make_far_agents(*common.cast, cast.cloud, *bracket_.newer->roster)),
        pool_(pool) {}

  void triangulate() {
    triangulation_ = render::triangulate(bracket_.newer->position_m, bracket_.newer->present);
  }
  absl::Status share(const render::FarView& view, std::uint64_t budget,
                     const render::FarRule& rule) {
    rule_ = rule;
    return plan_.make(triangulation_, agents_, cast_.cloud, view, budget, rule);
  }
  void generate(const render::FarView& view) {
    place_far(plan_, *common_.cast, nullptr, bracket_, 0, crowd_.settings(), view, pool_, places_);
    if (rule_.figures) {
      generate_far(plan_, agents_, cast_.figures, places_, view, pool_, splats_);
    } else {
      generate_far(plan_, agents_, cast_.cloud, places_, view, pool_, splats_);
    }
  }
  const render::Triangulation& triangulation() const { return triangulation_; }
  const render::FarPlan& plan() const { return plan_; }
  std::span<const render::Splat> splats() const { return splats_; }

 private:
  const Common& common_;
  const FarCast& cast_;
  const render::Crowd& crowd_;
  render::Bracket bracket_;
  render::FarAgents agents_;
  render::Triangulation triangulation_;
  render::FarPlan plan_;
  render::FarRule rule_;
  std::vector<render::FarPlace> places_;
  std::vector<render::Splat> splats_;
  render::WorkPool& pool_;
};

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

absl::Status measure(const Common& common, const LarkinOptions& options, const FarCast& cast,
                     const render::FarRule& rule, render::Rasterizer& rasterizer,
                     render::WorkPool& pool, std::uint32_t agents, Stages& stages) {
  auto crowd = make_crowd(common.cast, agents);
  if (!crowd.ok()) return crowd.status();
  const auto snapshot = (*crowd)->newest();
  const render::Camera camera = render::overview_camera(
      snapshot->low_m, glm::dvec3(snapshot->high_m) + glm::dvec3(0.0, 0.0, 1.9), common.viewport);
  const render::FarView view = render::make_far_view(camera, common.viewport, glm::dvec3(0.0));
  Ticks start = Ticks::now();
  FarCrowd far(common, cast, **crowd, pool);
  stages.colors.add(cpu_ms_since(start));
  start = Ticks::now();
  far.triangulate();
  stages.triangulate.add(cpu_ms_since(start));
  stages.vertices = far.triangulation().vertex_count();
  render::Picture picture;
  for (std::uint32_t frame = 0; frame <= options.frames && !stop_requested; ++frame) {
    start = Ticks::now();
    if (auto status = far.share(view, options.points, rule); !status.ok()) return status;
    const double share_ms = cpu_ms_since(start);
    start = Ticks::now();
    far.generate(view);
    const double generate_ms = cpu_ms_since(start);
    render::FrameGeometry geometry;
    geometry.splats = far.splats();
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
  stages.points = far.plan().points();
  stages.drawn = static_cast<std::uint32_t>(far.plan().shares().size());
  stages.visible = far.plan().visible();
  if (options.pictures.empty()) return absl::OkStatus();
  return write_png(
      absl::StrCat(options.pictures, "/larkin-", agents, rule.figures ? "-figures" : "", ".png"),
      picture);
}

struct Judgement {
  std::string view, name;
  std::uint64_t points = 0;
  double cpu_ms = 0;  // share, generate and raster
  render::PictureError near, whole;
};

/// All ways to share a budget, against everybody at full detail.
absl::Status judge_shares(const Common& common, const LarkinOptions& options, const FarCast& cast,
                          render::Rasterizer& rasterizer, render::WorkPool& pool,
                          std::vector<Judgement>& judged) {
  auto crowd = make_crowd(common.cast, options.quality_agents);
  if (!crowd.ok()) return crowd.status();
  const double half_m = 0.5 * std::sqrt(options.quality_agents / kPerM2);
  auto reference = Reference::make(common.cast, common.threads);
  if (!reference.ok()) return reference.status();
  FarCrowd far(common, cast, **crowd, pool);
  far.triangulate();
  render::Picture picture;
  // low over the crowd, so that some are near and many far and covered; and as one of them sees it
  const std::pair<std::string, render::Camera> views[] = {
      {"low", {.eye_world = {0.0, -half_m - 60.0, 22.0}, .target_world = {0.0, 0.0, 0.0}}},
      {"street", {.eye_world = {0.0, -half_m - 12.0, 3.0}, .target_world = {0.0, 0.0, 1.0}}}};
  for (const auto& [place, camera] : views) {
    render::ViewSettings settings;
    settings.viewport = common.viewport;
    settings.camera = camera;
    settings.look.shadows = false;
    const auto wanted = reference->draw(**crowd, 0, settings);
    if (!wanted.ok()) return wanted.status();
    const auto mask = render::pixels_near(wanted->covered, wanted->covered,
                                          common.viewport.width_px, common.viewport.height_px, 8);
    if (!mask.ok()) return mask.status();
    const render::FarView view = render::make_far_view(camera, common.viewport, glm::dvec3(0.0));
    if (!options.pictures.empty()) {
      if (auto status = write_png(
              absl::StrCat(options.pictures, "/larkin-", place, "-reference.png"), wanted->picture);
          !status.ok()) {
        return status;
      }
    }
    for (const std::uint64_t budget : options.quality_points) {
      for (const Way& way : kWays) {
        if (stop_requested) return absl::OkStatus();
        double cpu_ms = 0.0;
        for (int round = 0; round < 2; ++round) {  // buffers grow in the first one
          const Ticks start = Ticks::now();
          if (auto status = far.share(view, budget, way.rule); !status.ok()) return status;
          far.generate(view);
          render::FrameGeometry geometry;
          geometry.splats = far.splats();
          if (absl::Status status = rasterizer.draw(geometry, camera, common.viewport,
                                                    glm::dvec3(0.0), settings.look, picture);
              !status.ok()) {
            return status;
          }
          cpu_ms = cpu_ms_since(start);
        }
        const auto near = render::compare_pictures(picture, wanted->picture, *mask);
        const auto whole = render::compare_pictures(picture, wanted->picture);
        if (!near.ok()) return near.status();
        if (!whole.ok()) return whole.status();
        judged.push_back({place, way.name, far.plan().points(), cpu_ms, *near, *whole});
        if (options.pictures.empty()) continue;
        const std::string file =
            absl::StrCat(options.pictures, "/larkin-", place, "-", budget, "-", way.file, ".png");
        if (auto status = write_png(file, picture); !status.ok()) return status;
      }
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status run_larkin(const Common& common, const LarkinOptions& options) {
  auto cloud = render::make_crowd_cloud(*common.cast);
  if (!cloud.ok()) return cloud.status();
  auto figures = render::make_far_figures(*common.cast);
  if (!figures.ok()) return figures.status();
  const FarCast cast{*std::move(cloud), *std::move(figures)};
  auto rasterizer = render::make_rasterizer(render::RasterKind::kVisibility, common.threads);
  if (!rasterizer.ok()) return rasterizer.status();
  if (auto status = (*rasterizer)->upload(common.cast); !status.ok()) return status;
  render::WorkPool pool(common.threads);

  nlohmann::ordered_json rows[2] = {nlohmann::ordered_json::array(),
                                    nlohmann::ordered_json::array()};
  std::vector<Plot> plots;
  Progress progress("larkin", 2 * options.counts.size());
  for (const bool ours : {false, true}) {
    Table table({"agents", "in view", "vertices", "points", "triangulate", "share", "generate",
                 "raster", "generate + raster"});
    Plot times{ours ? "By what is seen, own figures" : "Far crowd under a fixed budget of points",
               "agents",
               "CPU ms a frame",
               true,
               true,
               {}};
    times.series = {{"generate", {}, {}},
                    {"raster", {}, {}},
                    {"share", {}, {}},
                    {"triangulate (apart)", {}, {}}};
    for (const std::uint32_t agents : options.counts) {
      if (stop_requested) break;
      Stages stages;
      if (auto status = measure(common, options, cast, kWays[ours ? 3 : 0].rule, **rasterizer, pool,
                                agents, stages);
          !status.ok()) {
        return status;
      }
      table.add({grouped(agents), grouped(stages.visible), grouped(stages.vertices),
                 grouped(static_cast<double>(stages.points)), fixed(stages.triangulate.mean(), 1),
                 fixed(stages.share.mean(), 1), fixed(stages.generate.mean(), 1),
                 fixed(stages.raster.mean(), 1),
                 fixed(stages.generate.mean() + stages.raster.mean(), 1)});
      rows[ours ? 1 : 0].push_back(json_of(agents, stages));
      const double values[] = {stages.generate.mean(), stages.raster.mean(), stages.share.mean(),
                               stages.triangulate.mean()};
      for (std::size_t i = 0; i < std::size(values); ++i) {
        times.series[i].x.push_back(agents);
        times.series[i].y.push_back(values[i]);
      }
      progress.step(grouped(agents));
    }
    plots.push_back(times);
    if (ours) {
      std::printf("By what is seen, own figures (beyond the paper):\n%s\n", table.text().c_str());
      continue;
    }
    std::printf(
        "Larkin et al.: a crowd in view of an overview camera, %ux%u px, %s points in all; CPU ms "
        "of all threads.\ntriangulate runs in a thread of its own, at a bounded "
        "rate.\n%s\n\n%s\n",
        common.viewport.width_px, common.viewport.height_px,
        grouped(static_cast<double>(options.points)).c_str(), common.machine.line().c_str(),
        table.text().c_str());
  }

  std::vector<Judgement> judged;
  if (options.quality_agents > 0 && !stop_requested) {
    if (auto status = judge_shares(common, options, cast, **rasterizer, pool, judged);
        !status.ok()) {
      return status;
    }
    Table quality({"view", "points", "shared", "CPU ms", "SSIM", "PSNR dB", "frame SSIM"});
    for (const Judgement& each : judged) {
      quality.add({each.view, grouped(static_cast<double>(each.points)), each.name,
                   fixed(each.cpu_ms, 1), fixed(each.near.ssim, 4), fixed(each.near.psnr_db, 2),
                   fixed(each.whole.ssim, 4)});
    }
    std::printf(
        "%s agents, seen from low and from the street, against each at full detail (SSIM and PSNR "
        "within 8 px of one; CPU ms: share, generate and raster):\n%s\n",
        grouped(options.quality_agents).c_str(), quality.text().c_str());
  }
  if (common.json.empty()) return absl::OkStatus();
  nlohmann::ordered_json json = {{"experiment", "larkin"},
                                 {"machine", common.machine.json()},
                                 {"width_px", common.viewport.width_px},
                                 {"height_px", common.viewport.height_px},
                                 {"budget_points", options.points},
                                 {"cloud_points", cast.cloud.count()},
                                 {"rows", std::move(rows[0])},
                                 {"rows_by_what_is_seen_own_figures", std::move(rows[1])},
                                 {"quality_agents", options.quality_agents},
                                 {"quality", nlohmann::ordered_json::array()}};
  for (const char* place : {"low", "street"}) {
    Plot quality{absl::StrCat("Picture quality at the same number of points, ", place),
                 "points",
                 "SSIM against full detail",
                 true,
                 false,
                 {}};
    for (const Way& way : kWays) quality.series.push_back({way.name, {}, {}});
    for (const Judgement& each : judged) {
      if (each.view != place) continue;
      for (Series& series : quality.series) {
        if (series.name != each.name) continue;
        series.x.push_back(static_cast<double>(each.points));
        series.y.push_back(each.near.ssim);
      }
    }
    if (!judged.empty()) plots.push_back(quality);
  }
  for (const Judgement& each : judged) {
    json["quality"].push_back({{"view", each.view},
                               {"points", each.points},
                               {"shared", each.name},
                               {"cpu_ms", each.cpu_ms},
                               {"ssim", each.near.ssim},
                               {"psnr_db", each.near.psnr_db},
                               {"frame_ssim", each.whole.ssim}});
  }
  if (auto status = write_plots(plot_file(common.json), plots); !status.ok()) return status;
  return write_json(common.json, json);
}

}  // namespace throng::bench
