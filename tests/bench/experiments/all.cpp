#include <absl/strings/str_cat.h>

#include <cstdio>

#include "bench/experiments/clock.hpp"
#include "bench/experiments/options.hpp"
#include "bench/experiments/report.hpp"

namespace throng::bench {

absl::Status run_all(const Common& common, const std::string& folder) {
  const Ticks start = Ticks::now();
  const auto run = [&](const char* name, render::Viewport viewport,
                       const auto& experiment) -> absl::Status {
    if (stop_requested) return absl::OkStatus();
    std::fprintf(stderr, "== %s, %.0f s so far\n", name, Ticks::now().since(start).wall_s);
    std::printf("## %s\n\n", name);
    Common own = common;
    own.viewport = viewport;
    own.json = absl::StrCat(folder, "/", name, ".json");
    const absl::Status status = experiment(own);
    std::printf("\n");
    std::fflush(stdout);
    return status;
  };
  absl::Status first;
  const auto keep = [&first](const absl::Status& status) { first.Update(status); };

  PaperOptions paper;
  paper.frames = 10;
  keep(run("paper", {1280, 720}, [&](const Common& own) {
    paper.quality_places = 2;
    return run_paper(own, paper);
  }));
  keep(run("paper-gl", {1280, 720}, [](const Common& own) {
    PaperOptions gl;
    gl.frames = 2;
    gl.raster = render::RasterKind::kGl;
    gl.equal_triangles = false;
    gl.forms = {kBatched};
    return run_paper(own, gl);
  }));
  keep(run("figure7", {1280, 720}, [](const Common& own) {
    PaperOptions figure;
    figure.frames = 3;
    figure.budgets_million = {5, 10};
    figure.counts = {1000, 2000, 5000, 10000};
    return run_figure7(own, figure);
  }));
  keep(run("peng2011", {1280, 720}, [](const Common& own) { return run_peng2011(own, {}); }));
  keep(run("quality", {1280, 720}, [](const Common& own) { return run_quality(own, {}); }));
  keep(run("raster", {1920, 1088}, [](const Common& own) { return run_raster(own, {}); }));
  return first;
}

}  // namespace throng::bench
