// Beacco 2010 (relief impostors): figures 4.1 and 4.2, agents against frames per second; 4.7, the
// difference to the mesh; 4.8 and 4.9, resolution of the textures and steps of the search.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "bench/experiments/measure.hpp"
#include "bench/experiments/options.hpp"
#include "bench/experiments/report.hpp"
#include "bench/experiments/table.hpp"
#include "simplify/impostor/relief.hpp"
#include "throng/render/quality.hpp"
#include "throng/render/relief.hpp"

namespace throng::bench {
namespace {

using render::FormRule;
using render::ReliefSearch;

constexpr ReliefSearch kPublished{.linear_steps = 16, .binary_steps = 7, .adaptive = false};
constexpr std::uint32_t kUniformPx = 128;  // of the thesis
constexpr double kLongFrameS = 4.0;

std::shared_ptr<const render::Cast> cast_of(const render::Cast& all, std::size_t members,
                                            const simplify::ReliefOptions* relief,
                                            std::uint64_t* bytes = nullptr) {
  auto cast = std::make_shared<render::Cast>();
  for (const render::CastMember& member : all.members) {
    if (member.environment || cast->members.size() == members) continue;
    render::CastMember own{member.character, 1.0F, false};
    if (relief != nullptr) {
      auto baked = simplify::bake_relief(own.character, *relief);
      if (baked.ok()) own.character.relief = render::make_relief(*std::move(baked));
    }
    if (bytes != nullptr && own.character.relief != nullptr)
      *bytes = 12 * own.character.relief->shape.size();
    cast->members.push_back(std::move(own));
  }
  return cast;
}

/// People who walk, 0.9 m from each other in a square around the origin, as two snapshots.
absl::StatusOr<std::unique_ptr<render::Crowd>> square(std::shared_ptr<const render::Cast> cast,
                                                      std::uint32_t agents) {
  auto crowd = std::make_unique<render::Crowd>(std::move(cast), render::CrowdSettings{});
  auto membership = std::make_shared<render::Membership>();
  membership->epoch = 1;
  for (std::uint32_t i = 0; i < agents; ++i) membership->ids.push_back(i + 1);
  const auto side = static_cast<std::uint32_t>(std::ceil(std::sqrt(agents)));
  for (int f = 0; f < 2; ++f) {
    render::AgentFrame frame;
    frame.time_us = 1'000'000 * f;
    frame.membership = membership;
    for (std::uint32_t i = 0; i < agents; ++i) {
      const double heading = 2.399963 * i;  // the golden angle: all directions alike
      const double speed_mps = 1.1 + 0.4 * std::fmod(0.618034 * i, 1.0);
      const double x = 0.9 * (i % side - 0.5 * (side - 1)), y = 0.9 * (i / side - 0.5 * (side - 1));
      frame.position_m.emplace_back(x + speed_mps * (f - 0.5) * std::cos(heading),
                                    y + speed_mps * (f - 0.5) * std::sin(heading), 0.0);
    }
    if (auto status = crowd->push(frame); !status.ok()) return status;
  }
  return crowd;
}
constexpr std::int64_t kTimeUs = 500'000;

render::Camera looking(double distance_m, double height_share, double target_m = 0.9) {
  render::Camera camera;
  camera.eye_world = {0.0, -distance_m, target_m + height_share * distance_m};
  camera.target_world = {0.0, 0.0, target_m};
  camera.fov_y_rad = 0.6;
  return camera;
}

/// Share of the pixels that show an agent.
absl::StatusOr<double> coverage(render::FramePipeline& pipeline, const render::Crowd& crowd,
                                render::ViewSettings view) {
  view.viewport = {view.viewport.width_px / 4, view.viewport.height_px / 4};
  view.selection.form = FormRule::kMesh;
  view.selection.vertex_budget = 300'000;
  view.pose_mode = render::PoseMode::kShared;
  render::Picture picture;
  render::FrameStats stats;
  render::FramePasses passes;
  if (auto status = pipeline.render(crowd, kTimeUs, view, picture, stats, &passes); !status.ok())
    return status;
  std::size_t covered = 0;
  for (const std::uint32_t instance : passes.instance) {
    covered += instance != render::FramePasses::kNothing ? 1 : 0;
  }
  return static_cast<double>(covered) /
         static_cast<double>(std::max<std::size_t>(passes.instance.size(), 1));
}

/// A camera from which the agents cover this share of the picture, or as near as one comes.
absl::StatusOr<render::Camera> camera_for(render::FramePipeline& pipeline,
                                          const render::Crowd& crowd, render::ViewSettings view,
                                          std::uint32_t agents, double wanted, double* got) {
  const double side_m = 0.9 * std::sqrt(agents);
  // low over the heads where much is to be covered
  const double height_share = wanted > 0.5 ? 0.18 : 0.5;
  double near_m = 1.5, far_m = 12.0 * side_m + 30.0;
  for (int round = 0; round < 12; ++round) {
    const double middle_m = std::sqrt(near_m * far_m);
    view.camera = looking(middle_m, height_share);
    const auto share = coverage(pipeline, crowd, view);
    if (!share.ok()) return share.status();
    *got = *share;
    (*share > wanted ? near_m : far_m) = middle_m;
    if (std::abs(*share - wanted) < 0.01) break;
  }
  return view.camera;
}

struct Way {
  const char* name;
  FormRule form;
  ReliefSearch search;
  std::uint64_t budget;
  render::PoseMode pose;
  bool fused;
};
constexpr std::uint64_t kAll = 4'000'000'000;
constexpr Way kWays[] = {
    {"mesh, full detail", FormRule::kMesh, {}, kAll, render::PoseMode::kExact, false},
    {"impostor, 16 + 7 steps", FormRule::kImpostor, kPublished, kAll, render::PoseMode::kExact,
     false},
    {"impostor, adaptive steps", FormRule::kImpostor, {}, kAll, render::PoseMode::kShared, true},
    {"mesh, N = 1 M, shared", FormRule::kMesh, {}, 1'000'000, render::PoseMode::kShared, true},
};

struct Row {
  std::uint32_t agents, characters;
  double wanted, covered;
  Measured measured[std::size(kWays)];
};

absl::Status measure_row(const Common& common, const std::shared_ptr<const render::Cast>& cast,
                         const BeaccoOptions& options, Row& row) {
  auto crowd = square(cast, row.agents);
  if (!crowd.ok()) return crowd.status();
  std::unique_ptr<render::FramePipeline> pipelines[2];
  for (const bool fused : {false, true}) {
    auto pipeline = render::FramePipeline::make(
        cast, {.raster = render::RasterKind::kVisibility,
               .threads = common.threads,
               .measure_cpu_times = true,
               .geometry = fused ? render::GeometryKind::kFused : render::GeometryKind::kBatched});
    if (!pipeline.ok()) return pipeline.status();
    pipelines[fused ? 1 : 0] = *std::move(pipeline);
  }
  render::ViewSettings view;
  view.viewport = common.viewport;
  auto camera = camera_for(*pipelines[1], **crowd, view, row.agents, row.wanted, &row.covered);
  if (!camera.ok()) return camera.status();
  view.camera = *camera;
  render::JpegEncoder jpeg;
  render::Picture picture;
  for (std::uint32_t frame = 0; frame <= options.frames && !stop_requested; ++frame) {
    for (std::size_t w = 0; w < std::size(kWays); ++w) {
      const Way& way = kWays[w];
      Measured warm_up;
      Measured& measured = frame == 0 ? warm_up : row.measured[w];
      view.selection.form = way.form;
      view.selection.vertex_budget = way.budget;
      view.pose_mode = way.pose;
      view.look.relief_search = way.search;
      // a little later each time, so that no instances are kept
      if (auto status = measure_frame(*pipelines[way.fused ? 1 : 0], **crowd,
                                      kTimeUs + 4 * frame + static_cast<std::int64_t>(w), view,
                                      jpeg, picture, measured);
          !status.ok()) {
        return status;
      }
      if (frame == 0 && !options.pictures.empty() && row.agents == options.counts.back()) {
        const std::string file =
            absl::StrFormat("%s/beacco2010-%u-%u-%.0f-%u.png", options.pictures, row.characters,
                            row.agents, 100.0 * row.wanted, w);
        if (auto status = write_png(file, picture); !status.ok()) return status;
      }
    }
  }
  return absl::OkStatus();
}

/// The published picture's colours: dark blue for no difference, red for the largest.
render::Picture pseudocolor(const render::Picture& a, const render::Picture& b, double* mean,
                            double* share_over) {
  render::Picture result = a;
  double sum = 0;
  std::size_t over = 0;
  const std::size_t pixels = a.rgbx.size() / 4;
  for (std::size_t i = 0; i < pixels; ++i) {
    int difference = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      difference = std::max(difference, std::abs(int{a.rgbx[4 * i + c]} - int{b.rgbx[4 * i + c]}));
    }
    sum += difference;
    over += difference > 32 ? 1 : 0;
    const float t = std::min(static_cast<float>(difference) / 128.0F, 1.0F) * 4.0F;
    const auto ramp = [t](float center) {
      return static_cast<std::uint8_t>(255.0F *
                                       std::clamp(1.5F - std::abs(t - center), 0.0F, 1.0F));
    };
    result.rgbx[4 * i] = ramp(3.5F);
    result.rgbx[4 * i + 1] = ramp(2.0F);
    result.rgbx[4 * i + 2] = ramp(0.5F);
  }
  *mean = sum / static_cast<double>(pixels);
  *share_over = static_cast<double>(over) / static_cast<double>(pixels);
  return result;
}

struct Shot {
  render::Picture picture;
  std::vector<std::uint8_t> covered;
};

absl::StatusOr<Shot> shoot(render::FramePipeline& pipeline, const render::Crowd& crowd,
                           const render::ViewSettings& view) {
  Shot shot;
  render::FrameStats stats;
  render::FramePasses passes;
  if (auto status = pipeline.render(crowd, kTimeUs, view, shot.picture, stats, &passes);
      !status.ok()) {
    return status;
  }
  for (const std::uint32_t instance : passes.instance) {
    shot.covered.push_back(instance != render::FramePasses::kNothing ? 1 : 0);
  }
  return shot;
}

/// SSIM of impostors against meshes near the figures.
absl::StatusOr<double> ssim_of(const Shot& impostor, const Shot& mesh) {
  const auto near = render::pixels_near(impostor.covered, mesh.covered, mesh.picture.width_px,
                                        mesh.picture.height_px, 8);
  if (!near.ok()) return near.status();
  const auto error = render::compare_pictures(impostor.picture, mesh.picture, *near);
  if (!error.ok()) return error.status();
  return error->ssim;
}

absl::Status figure_47(const Common& common, const BeaccoOptions& options,
                       nlohmann::ordered_json& json) {
  const simplify::ReliefOptions by_relevance;
  const auto cast = cast_of(*common.cast, 10, &by_relevance);
  auto crowd = square(cast, 400);
  if (!crowd.ok()) return crowd.status();
  auto pipeline = render::FramePipeline::make(
      cast, {.raster = render::RasterKind::kVisibility, .threads = common.threads});
  if (!pipeline.ok()) return pipeline.status();
  render::ViewSettings view;
  view.viewport = common.viewport;
  view.selection.vertex_budget = kAll;
  view.pose_mode = render::PoseMode::kExact;
  json["figure_4_7"] = nlohmann::ordered_json::array();
  Table table({"figure 4.7, nearest agent", "height px", "SSIM near agents", "mean difference",
               "pixels over 32 of 255, %"});
  for (const double distance_m : {14.0, 30.0, 70.0}) {
    view.camera = looking(distance_m, 0.35);
    view.selection.form = FormRule::kMesh;
    auto mesh = shoot(**pipeline, **crowd, view);
    if (!mesh.ok()) return mesh.status();
    view.selection.form = FormRule::kImpostor;
    auto impostor = shoot(**pipeline, **crowd, view);
    if (!impostor.ok()) return impostor.status();
    double mean = 0, over = 0;
    const render::Picture difference = pseudocolor(impostor->picture, mesh->picture, &mean, &over);
    const auto ssim = ssim_of(*impostor, *mesh);
    if (!ssim.ok()) return ssim.status();
    const double nearest_m = std::max(distance_m - 9.0, 1.0);
    const double height_px = 1.7 / nearest_m * 0.5 * common.viewport.height_px / std::tan(0.3);
    table.add({absl::StrFormat("%.0f m", nearest_m), fixed(height_px, 0), fixed(*ssim, 3),
               fixed(mean, 2), fixed(100 * over, 2)});
    json["figure_4_7"].push_back({{"nearest_m", nearest_m},
                                  {"height_px", height_px},
                                  {"ssim", *ssim},
                                  {"mean_difference", mean},
                                  {"share_over_32", over}});
    if (options.pictures.empty()) continue;
    const std::string name = absl::StrFormat("%s/figure47-%.0fm-", options.pictures, nearest_m);
    for (const auto& [what, picture] :
         {std::pair<const char*, const render::Picture*>{"mesh", &mesh->picture},
          {"impostor", &impostor->picture},
          {"difference", &difference}}) {
      if (auto status = write_png(absl::StrCat(name, what, ".png"), *picture); !status.ok())
        return status;
    }
  }
  std::printf("%s\n", table.text().c_str());
  return absl::OkStatus();
}

/// Pastes `from` at a place of `to`.
void paste(const render::Picture& from, std::uint32_t x, std::uint32_t y, render::Picture& to) {
  for (std::uint32_t row = 0; row < from.height_px && y + row < to.height_px; ++row) {
    std::copy_n(&from.rgbx[std::size_t{4} * row * from.width_px],
                std::size_t{4} * std::min(from.width_px, to.width_px - x),
                &to.rgbx[4 * (std::size_t{y + row} * to.width_px + x)]);
  }
}

/// One figure in the middle, seen from 3, 10 and 30 m at the thesis's size.
absl::Status figures_48_49(const Common& common, const BeaccoOptions& options,
                           nlohmann::ordered_json& json) {
  struct Texture {
    std::string name;
    simplify::ReliefOptions relief;
  };
  const Texture textures[] = {{"128 x 128", {.uniform_px = 128}},
                              {"64 x 64", {.uniform_px = 64}},
                              {"32 x 32", {.uniform_px = 32}},
                              {"by relevance", {}}};
  struct Steps {
    std::string name;
    ReliefSearch search;
  };
  const Steps steps[] = {{"16 + 7", kPublished},
                         {"8 + 5", {8, 5, false}},
                         {"4 + 3", {4, 3, false}},
                         {"2 + 1", {2, 1, false}},
                         {"adaptive", {}}};
  const double distances_m[] = {3.0, 10.0, 30.0};
  render::ViewSettings view;
  view.viewport = {320, 400};
  view.selection.vertex_budget = kAll;
  view.pose_mode = render::PoseMode::kExact;
  json["figure_4_8"] = nlohmann::ordered_json::array();
  json["figure_4_9"] = nlohmann::ordered_json::array();
  Table resolution({"figure 4.8, faces", "MB", "SSIM 3 m", "10 m", "30 m"});
  Table sampling({"figure 4.9, steps", "SSIM 3 m", "10 m", "30 m"});
  render::Picture sheet{320 * (std::size(textures) + 1), 400, {}};
  sheet.rgbx.assign(std::size_t{4} * sheet.width_px * sheet.height_px, 255);
  render::Picture grid{320 * (std::size(steps) + 1), 1200, {}};
  grid.rgbx.assign(std::size_t{4} * grid.width_px * grid.height_px, 255);
  for (std::size_t t = 0; t < std::size(textures); ++t) {
    std::uint64_t bytes = 0;
    const auto cast = cast_of(*common.cast, 1, &textures[t].relief, &bytes);
    auto crowd = square(cast, 1);
    if (!crowd.ok()) return crowd.status();
    auto pipeline = render::FramePipeline::make(
        cast, {.raster = render::RasterKind::kVisibility, .threads = common.threads});
    if (!pipeline.ok()) return pipeline.status();
    std::vector<std::string> row{textures[t].name, fixed(1e-6 * static_cast<double>(bytes), 2)};
    nlohmann::ordered_json entry = {{"faces", textures[t].name}, {"bytes", bytes}};
    std::vector<std::vector<std::string>> step_rows;
    for (const Steps& step : steps) step_rows.push_back({step.name});
    for (std::size_t d = 0; d < std::size(distances_m); ++d) {
      view.camera = looking(distances_m[d], 0.1);
      // figures as large as at the published height of 1,024 px
      view.camera.fov_y_rad = 2.0 * std::atan(std::tan(0.3) * view.viewport.height_px / 1024.0);
      view.selection.form = FormRule::kMesh;
      const auto mesh = shoot(**pipeline, **crowd, view);
      if (!mesh.ok()) return mesh.status();
      view.selection.form = FormRule::kImpostor;
      const bool is_last = t + 1 == std::size(textures);
      for (std::size_t s = 0; s < (is_last ? std::size(steps) : 1); ++s) {
        view.look.relief_search = is_last || t == 0 ? steps[s].search : ReliefSearch{};
        if (!is_last) view.look.relief_search = kPublished;
        const auto impostor = shoot(**pipeline, **crowd, view);
        if (!impostor.ok()) return impostor.status();
        const auto ssim = ssim_of(*impostor, *mesh);
        if (!ssim.ok()) return ssim.status();
        if (s == 0) {
          row.push_back(fixed(*ssim, 3));
          entry[absl::StrFormat("ssim_%.0f_m", distances_m[d])] = *ssim;
          if (d == 0) paste(impostor->picture, static_cast<std::uint32_t>(320 * (t + 1)), 0, sheet);
        }
        if (!is_last) continue;
        step_rows[s].push_back(fixed(*ssim, 3));
        json["figure_4_9"].push_back(
            {{"steps", steps[s].name}, {"distance_m", distances_m[d]}, {"ssim", *ssim}});
        paste(impostor->picture, static_cast<std::uint32_t>(320 * (s + 1)),
              static_cast<std::uint32_t>(400 * d), grid);
      }
      if (t == 0 && d == 0) paste(mesh->picture, 0, 0, sheet);
      if (is_last) paste(mesh->picture, 0, static_cast<std::uint32_t>(400 * d), grid);
      view.look.relief_search = {};
    }
    resolution.add(std::move(row));
    json["figure_4_8"].push_back(std::move(entry));
    if (t + 1 < std::size(textures)) continue;
    for (std::vector<std::string>& each : step_rows) sampling.add(std::move(each));
  }
  std::printf("%s\n%s\n", resolution.text().c_str(), sampling.text().c_str());
  if (options.pictures.empty()) return absl::OkStatus();
  if (auto status = write_png(options.pictures + "/figure48.png", sheet); !status.ok())
    return status;
  return write_png(options.pictures + "/figure49.png", grid);
}

}  // namespace

absl::Status run_beacco2010(const Common& common, const BeaccoOptions& options) {
  std::vector<Row> rows;
  const simplify::ReliefOptions uniform{.uniform_px = kUniformPx};
  Progress progress("beacco2010", 4 * options.counts.size());
  for (const std::uint32_t characters : {1U, 10U}) {
    std::uint64_t bytes = 0;
    const auto cast = cast_of(*common.cast, characters, &uniform, &bytes);
    for (const double wanted : {0.15, 0.90}) {
      for (const std::uint32_t agents : options.counts) {
        if (stop_requested) break;
        Row row{agents, characters, wanted, 0.0, {}};
        if (auto status = measure_row(common, cast, options, row); !status.ok()) return status;
        progress.step(absl::StrFormat("%u agents, %u characters", agents, characters));
        rows.push_back(std::move(row));
      }
    }
  }
  if (rows.empty()) return absl::CancelledError("beacco2010: stopped before the first row");
  std::printf(
      "Beacco 2010, figures 4.1 (1 character) and 4.2 (10), %ux%u px, faces of %u x %u.\n%s\n\n",
      common.viewport.width_px, common.viewport.height_px, kUniformPx, kUniformPx,
      common.machine.line().c_str());
  std::vector<std::string> head{"characters", "view %", "agents"};
  for (const Way& way : kWays) head.push_back(std::string(way.name) + ", CPU ms");
  for (const Way& way : kWays) head.push_back(std::string(way.name) + ", fps");
  Table table(head);
  nlohmann::ordered_json json = {{"experiment", "beacco2010"},
                                 {"machine", common.machine.json()},
                                 {"width_px", common.viewport.width_px},
                                 {"height_px", common.viewport.height_px},
                                 {"uniform_px", kUniformPx},
                                 {"rows", nlohmann::ordered_json::array()}};
  for (const Row& row : rows) {
    std::vector<std::string> cells{std::to_string(row.characters), fixed(100 * row.covered, 0),
                                   grouped(row.agents)};
    nlohmann::ordered_json entry = {{"characters", row.characters},
                                    {"wanted_coverage", row.wanted},
                                    {"coverage", row.covered},
                                    {"agents", row.agents}};
    for (const Measured& each : row.measured) cells.push_back(fixed(each.cpu_ms.mean(), 1));
    for (const Measured& each : row.measured) cells.push_back(fixed(each.fps(), 1));
    for (std::size_t w = 0; w < std::size(kWays); ++w) {
      entry[kWays[w].name] = row.measured[w].json();
    }
    table.add(std::move(cells));
    json["rows"].push_back(std::move(entry));
  }
  std::printf("%s\n", table.text().c_str());
  if (auto status = figure_47(common, options, json); !status.ok()) return status;
  if (auto status = figures_48_49(common, options, json); !status.ok()) return status;
  return common.json.empty() ? absl::OkStatus() : write_json(common.json, json);
}

}  // namespace throng::bench
