// The visibility rasterizer against OpenGL on llvmpipe, on identical batched buffers.
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "bench/experiments/clock.hpp"
#include "bench/experiments/numbers.hpp"
#include "bench/experiments/options.hpp"
#include "bench/experiments/raster_case.hpp"
#include "bench/experiments/report.hpp"
#include "bench/experiments/table.hpp"
#include "support/image_compare.hpp"
#include "throng/render/raster.hpp"
#include "throng/render/srgb.hpp"

namespace throng::bench {
namespace {

using render::Look;
using render::Picture;
using render::Rasterizer;
using render::RasterKind;

// What a case must keep to. Coverage in points (hundredths of the picture); differences of 8-bit
// components, against gl with four samples a pixel. Where thousands of figures overlap, what a
// pixel shows depends on where its samples lie: gl with one sample differs by up to 7.4 from gl
// with four.
constexpr double kCoverageLimit = 0.05;
constexpr double kMeanLimit = 8.0;

/// Agents black on a plain bright ground: what is missing of the light is what they cover.
Look silhouette_look() {
  Look look;
  look.ground = look.shadows = false;
  look.sun_color = look.sky_color = look.ground_light = glm::vec3(0.0F);
  look.horizon_color = glm::vec3(1.0F);
  return look;
}

Look plain_look() {
  Look look;
  look.ground = look.shadows = false;
  return look;
}

double linear(std::uint8_t srgb) { return render::srgb_to_linear(srgb / 255.0); }

/// Share of the picture that is covered, in points.
double coverage(const Picture& silhouettes) {
  std::array<std::uint64_t, 256> count{};
  for (std::size_t i = 0; i < silhouettes.rgbx.size(); i += 4) ++count[silhouettes.rgbx[i]];
  const auto brightest = static_cast<double>(linear(static_cast<std::uint8_t>(
      std::find_if(count.rbegin(), count.rend(), [](std::uint64_t n) { return n > 0; }).base() -
      count.begin() - 1)));
  double light = 0;
  for (std::size_t value = 0; value < count.size(); ++value) {
    light += static_cast<double>(count[value]) * linear(static_cast<std::uint8_t>(value));
  }
  const auto pixels = static_cast<double>(silhouettes.rgbx.size() / 4);
  return 100.0 * (1.0 - light / (brightest * pixels));
}

absl::StatusOr<std::unique_ptr<Rasterizer>> make(RasterKind kind, unsigned threads) {
  auto rasterizer = render::make_rasterizer(kind, threads);
  if (!rasterizer.ok()) return rasterizer.status();
  if (absl::Status status = (*rasterizer)->upload(test::mannequin_cast()); !status.ok()) {
    return status;
  }
  return rasterizer;
}

absl::StatusOr<std::unique_ptr<Rasterizer>> make_gl(unsigned samples, unsigned threads) {
  setenv("THRONG_GL_SAMPLES", samples == 4 ? "4" : "1", 1);
  auto gl = make(RasterKind::kGl, threads);
  unsetenv("THRONG_GL_SAMPLES");
  return gl;
}

struct Result {
  RasterCase about;
  double mtri = 0;
  std::vector<double> ratio, gl_rate, visibility_rate, wall_ratio;  // by pair; Mtri per CPU second
  double gl_coverage = 0, visibility_coverage = 0;
  test::ImageDifference difference;
  double gl_difference = 0;  // mean, of gl as it is timed from gl with four samples
};

/// Pictures of both, gl with four samples a pixel as the other has.
absl::Status compare(const Common& common, const RasterOptions& options, const RasterScene& scene,
                     const render::Camera& camera, Rasterizer& visibility, Picture& theirs,
                     Result& result) {
  auto gl = make_gl(4, common.threads);
  if (!gl.ok()) return gl.status();
  Picture ours;
  for (const bool silhouettes : {true, false}) {
    const Look look = silhouettes ? silhouette_look() : plain_look();
    for (auto [rasterizer, picture] : {std::pair{gl->get(), &theirs}, {&visibility, &ours}}) {
      if (absl::Status status = rasterizer->draw(scene.geometry(), camera, common.viewport,
                                                 glm::dvec3(0.0), look, *picture);
          !status.ok()) {
        return status;
      }
    }
    if (silhouettes) {
      result.gl_coverage = coverage(theirs);
      result.visibility_coverage = coverage(ours);
    } else {
      result.difference = test::compare_images(theirs.rgbx, ours.rgbx);
    }
  }
  if (options.pictures.empty()) return absl::OkStatus();
  const std::string name =
      absl::StrFormat("%s/raster-%ux%u-%.0fpx-", options.pictures, result.about.instances,
                      result.about.triangles(), result.about.height_px);
  if (absl::Status status = write_png(name + "gl.png", theirs); !status.ok()) return status;
  return write_png(name + "visibility.png", ours);
}

absl::Status measure(const Common& common, const RasterOptions& options, Result& result,
                     Progress& progress) {
  const render::Camera camera = raster_camera(common.viewport);
  const RasterScene scene = raster_scene(result.about, camera, common.viewport);
  result.mtri = static_cast<double>(scene.indices.size() / 3) * 1e-6;
  auto visibility = make(RasterKind::kVisibility, common.threads);
  if (!visibility.ok()) return visibility.status();
  Picture four_samples;
  if (absl::Status status =
          compare(common, options, scene, camera, **visibility, four_samples, result);
      !status.ok()) {
    return status;
  }
  auto gl = make_gl(options.gl_samples, common.threads);
  if (!gl.ok()) return gl.status();

  Picture picture;
  const auto draw = [&](Rasterizer& rasterizer) -> absl::StatusOr<Ticks> {
    const Ticks start = Ticks::now();
    absl::Status status = rasterizer.draw(scene.geometry(), camera, common.viewport,
                                          glm::dvec3(0.0), plain_look(), picture);
    if (!status.ok()) return status;
    return Ticks::now().since(start);
  };
  // buffers grow once
  if (auto ticks = draw(**visibility); !ticks.ok()) return ticks.status();
  if (auto ticks = draw(**gl); !ticks.ok()) return ticks.status();
  result.gl_difference = test::compare_images(four_samples.rgbx, picture.rgbx).mean;
  for (std::uint32_t pair = 0; pair < options.pairs && !stop_requested; ++pair) {
    Ticks by_gl, by_visibility;
    for (const bool first : {true, false}) {
      const bool gl_turn = first == (pair % 2 == 0);  // who goes first takes turns
      const absl::StatusOr<Ticks> ticks = draw(gl_turn ? **gl : **visibility);
      if (!ticks.ok()) return ticks.status();
      (gl_turn ? by_gl : by_visibility) = *ticks;
    }
    result.ratio.push_back(by_gl.cpu_s / by_visibility.cpu_s);
    result.wall_ratio.push_back(by_gl.wall_s / by_visibility.wall_s);
    result.gl_rate.push_back(result.mtri / by_gl.cpu_s);
    result.visibility_rate.push_back(result.mtri / by_visibility.cpu_s);
    progress.step(absl::StrFormat("%s: %.1f times", result.about.name(), result.ratio.back()));
  }
  return absl::OkStatus();
}

double least(const std::vector<double>& values) {
  return *std::min_element(values.begin(), values.end());
}
double most(const std::vector<double>& values) {
  return *std::max_element(values.begin(), values.end());
}

}  // namespace

absl::Status run_raster(const Common& common, const RasterOptions& options) {
  std::vector<Result> results;
  Progress progress("raster", std::size(kRasterCases) * options.pairs);
  for (const RasterCase& one : kRasterCases) {
    if (stop_requested) break;
    Result result;
    result.about = one;
    result.about.instances =
        std::max(1U, static_cast<std::uint32_t>(one.instances * options.scale));
    if (absl::Status status = measure(common, options, result, progress); !status.ok())
      return status;
    if (!result.ratio.empty()) results.push_back(std::move(result));
  }
  if (results.empty()) return absl::CancelledError("raster: stopped before the first pair");

  std::vector<double> all;
  Table table({"instances x triangles, height", "ratio min", "median", "max", "wall ratio, median",
               "visibility Mtri/CPU s", "llvmpipe", "coverage %", "off by", "mean difference",
               "gl's own", "PSNR dB"});
  bool within = true;
  for (const Result& r : results) {
    all.insert(all.end(), r.ratio.begin(), r.ratio.end());
    const double off = r.visibility_coverage - r.gl_coverage;
    within = within && std::abs(off) <= kCoverageLimit && r.difference.mean <= kMeanLimit;
    table.add({r.about.name(), fixed(least(r.ratio), 1), fixed(median(r.ratio), 1),
               fixed(most(r.ratio), 1), fixed(median(r.wall_ratio), 1),
               fixed(median(r.visibility_rate), 1), fixed(median(r.gl_rate), 2),
               fixed(r.gl_coverage, 2), fixed(off, 3), fixed(r.difference.mean, 2),
               fixed(r.gl_difference, 2), fixed(r.difference.psnr_db, 1)});
  }
  std::printf(
      "Visibility rasterizer against OpenGL on the same batched buffers, %ux%u px, %u pairs a "
      "case, "
      "by CPU time of all threads.\n%s\n\n%s\n"
      "All pairs: min %.1f, median %.1f, max %.1f times.\n"
      "The whole draw is timed, from arrays to picture; visibility takes four samples a pixel, gl "
      "takes %s.\nPictures are compared with gl at four samples; limits: "
      "coverage %.2f points, mean difference %.1f of 255: %s.\n",
      common.viewport.width_px, common.viewport.height_px, options.pairs,
      common.machine.line().c_str(), table.text().c_str(), least(all), median(all), most(all),
      options.gl_samples == 4 ? "four too" : "one and smooths edges", kCoverageLimit, kMeanLimit,
      within ? "kept" : "NOT KEPT");

  if (!common.json.empty()) {
    nlohmann::ordered_json json = {
        {"experiment", "raster"},
        {"machine", common.machine.json()},
        {"width_px", common.viewport.width_px},
        {"height_px", common.viewport.height_px},
        {"pairs", options.pairs},
        {"gl_samples", options.gl_samples},
        {"visibility_samples", 4},
        {"ratio", {{"min", least(all)}, {"median", median(all)}, {"max", most(all)}}},
        {"limits", {{"coverage_points", kCoverageLimit}, {"mean_difference", kMeanLimit}}},
        {"limits_kept", within},
        {"rows", nlohmann::ordered_json::array()}};
    for (const Result& r : results) {
      json["rows"].push_back(
          {{"case", r.about.name()},
           {"instances", r.about.instances},
           {"triangles", r.about.triangles()},
           {"height_px", r.about.height_px},
           {"ratio",
            {{"min", least(r.ratio)}, {"median", median(r.ratio)}, {"max", most(r.ratio)}}},
           {"wall_ratio_median", median(r.wall_ratio)},
           {"visibility_mtri_per_cpu_s", median(r.visibility_rate)},
           {"gl_mtri_per_cpu_s", median(r.gl_rate)},
           {"coverage_gl", r.gl_coverage},
           {"coverage_visibility", r.visibility_coverage},
           {"difference_mean", r.difference.mean},
           {"difference_share_over_8", r.difference.share_over_8},
           {"psnr_db", r.difference.psnr_db}});
    }
    if (absl::Status status = write_json(common.json, json); !status.ok()) return status;
  }
  if (!within) return absl::DataLossError("raster: a case is beyond its limits, see the table");
  return absl::OkStatus();
}

}  // namespace throng::bench
