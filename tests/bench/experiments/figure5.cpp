// Figure 5 of Dong & Peng 2019: levels of detail chosen by one camera and drawn from another, so
// that one sees close what the first sees from far.
#include <absl/strings/str_cat.h>

#include <cstdio>
#include <cstring>

#include "bench/experiments/options.hpp"
#include "bench/experiments/report.hpp"
#include "bench/experiments/table.hpp"
#include "bench/experiments/walkthrough.hpp"

namespace throng::bench {
namespace {

using render::Picture;

/// The first camera of a file, moved to the size of the crowd.
absl::StatusOr<render::Camera> camera_of(const std::string& file, std::uint32_t agents,
                                         const render::Crowd& crowd) {
  auto path = server::CameraPath::parse(file, server::Site());
  if (!path.ok()) return path.status();
  return scale_camera(path->at(0.0, crowd), agents);
}

/// Batched geometry as seen from another eye: it is relative to the one that it was made for.
struct Moved {
  std::vector<render::VisibleInstance> instances;
  std::vector<render::BatchVertex> vertices;
  render::FrameGeometry geometry;

  Moved(const render::FrameGeometry& from, const glm::vec3& by)
      : instances(from.instances.begin(), from.instances.end()),
        vertices(from.vertices.begin(), from.vertices.end()),
        geometry(from) {
    for (render::VisibleInstance& instance : instances) instance.position_relative += by;
    for (render::BatchVertex& vertex : vertices) vertex.position_relative += by;
    geometry.instances = instances;
    geometry.vertices = vertices;
  }
};

void paste(const Picture& picture, std::size_t column, std::size_t row, Picture& sheet) {
  for (std::size_t y = 0; y < picture.height_px; ++y) {
    std::memcpy(&sheet.rgbx[4 * ((row * picture.height_px + y) * sheet.width_px +
                                 column * picture.width_px)],
                &picture.rgbx[4 * y * picture.width_px], std::size_t{4} * picture.width_px);
  }
}

}  // namespace

absl::Status run_figure5(const Common& common, const PaperOptions& options) {
  auto walkthrough = Walkthrough::make(common.cast, options.agents, options.camera_path);
  if (!walkthrough.ok()) return walkthrough.status();
  constexpr std::uint32_t kFrame = 200;  // of the walkthrough: above the crowd, looking across it
  if (auto status = walkthrough->advance_to(kFrame); !status.ok()) return status;
  const std::string defaults = absl::StrCat(THRONG_SOURCE_DIR, "/tests/bench/experiments/");
  absl::StatusOr<render::Camera> chooser = walkthrough->camera(kFrame);
  if (!options.selection_camera.empty()) {
    chooser = camera_of(options.selection_camera, options.agents, walkthrough->crowd());
  }
  if (!chooser.ok()) return chooser.status();
  const auto viewer = camera_of(
      options.reference_camera.empty() ? defaults + "far_away.json" : options.reference_camera,
      options.agents, walkthrough->crowd());
  if (!viewer.ok()) return viewer.status();

  auto backend = render::make_backend(render::BackendKind::kCpu, common.threads);
  if (!backend.ok()) return backend.status();
  if (auto status = (*backend)->upload(common.cast); !status.ok()) return status;
  auto rasterizer = render::make_rasterizer(options.raster, common.threads);
  if (!rasterizer.ok()) return rasterizer.status();
  if (auto status = (*rasterizer)->upload(common.cast); !status.ok()) return status;
  auto view = (*backend)->make_view();
  if (!view.ok()) return view.status();

  const render::Bracket bracket = walkthrough->crowd().bracket(Walkthrough::time_us(kFrame));
  auto older = (*backend)->upload(bracket.older);
  if (!older.ok()) return older.status();
  auto newer = (*backend)->upload(bracket.newer);
  if (!newer.ok()) return newer.status();
  const render::CrowdSettings& settings = walkthrough->crowd().settings();
  auto instances =
      (*backend)->advance(**older, **newer, Walkthrough::time_us(kFrame), settings, -1, {});
  if (!instances.ok()) return instances.status();
  if (auto status = (*backend)->cull(**view, *instances, *chooser, common.viewport); !status.ok()) {
    return status;
  }

  Picture sheet;
  sheet.width_px =
      common.viewport.width_px * static_cast<std::uint32_t>(options.budgets_million.size());
  sheet.height_px = 2 * common.viewport.height_px;
  sheet.rgbx.resize(std::size_t{4} * sheet.width_px * sheet.height_px, 255);
  Table table({"N (M)", "instances in view", "Mtri", "vertices, least", "most"});
  Progress progress("figure 5", options.budgets_million.size());
  for (std::size_t column = 0; column < options.budgets_million.size() && !stop_requested;
       ++column) {
    render::Selection selection;
    selection.vertex_budget = static_cast<std::uint64_t>(options.budgets_million[column] * 1e6);
    selection.rule = options.lod;
    if (auto status = (*backend)->select(**view, selection); !status.ok()) return status;
    if (auto status = (*backend)->allocate(**view); !status.ok()) return status;
    if (auto status = (*backend)->generate(**view); !status.ok()) return status;
    const render::FrameGeometry geometry = (*backend)->geometry(**view);
    const Moved moved(geometry, glm::vec3(chooser->eye_world - viewer->eye_world));
    Picture picture;
    for (const std::size_t row : {0U, 1U}) {
      const auto status =
          (*rasterizer)
              ->draw(row == 0 ? geometry : moved.geometry, row == 0 ? *chooser : *viewer,
                     common.viewport, settings.origin_world, render::Look{}, picture);
      if (!status.ok()) return status;
      paste(picture, column, row, sheet);
    }
    std::uint32_t least = ~0U, most = 0;
    for (const render::VisibleInstance& instance : geometry.instances) {
      least = std::min(least, instance.vertex_count);
      most = std::max(most, instance.vertex_count);
    }
    table.add({fixed(options.budgets_million[column], 2),
               grouped(static_cast<double>(geometry.instances.size())),
               fixed(static_cast<double>(geometry.indices.size()) / 3e6, 2), grouped(least),
               grouped(most)});
    progress.step("");
  }
  std::printf(
      "Levels chosen by the camera of the upper row, drawn from that of the lower one.\n\n%s\n",
      table.text().c_str());
  if (auto status = write_png(options.output, sheet); !status.ok()) return status;
  std::printf("%s: %ux%u px\n", options.output.c_str(), sheet.width_px, sheet.height_px);
  return absl::OkStatus();
}

}  // namespace throng::bench
