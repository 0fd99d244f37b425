#include "bench/experiments/quality.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <array>
#include <cmath>
#include <map>
#include <optional>

#include "bench/experiments/report.hpp"
#include "bench/experiments/walkthrough.hpp"
#include "throng/render/quality.hpp"
#include "throng/render/srgb.hpp"

namespace throng::bench {
namespace {

constexpr std::uint32_t kReferenceScale = 4;
constexpr std::uint32_t kNearPx = 8;
constexpr float kReferenceErrorPx = 1.0F / 32.0F;  // where full detail is more than memory holds

/// sRGB to linear for all 256 values.
const std::array<float, 256>& linear_table() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> made{};
    for (std::size_t i = 0; i < made.size(); ++i) {
      made[i] = static_cast<float>(render::srgb_to_linear(static_cast<double>(i) / 255.0));
    }
    return made;
  }();
  return table;
}

std::uint8_t encode(float linear) {
  const double value = render::linear_to_srgb(static_cast<double>(linear));
  return static_cast<std::uint8_t>(std::lround(255.0 * std::min(std::max(value, 0.0), 1.0)));
}

}  // namespace

nlohmann::ordered_json Quality::json() const {
  if (near_ssim.count == 0) return nullptr;
  return {{"frames", near_ssim.count},
          {"near_psnr_db", near_psnr_db.mean()},
          {"near_ssim", near_ssim.mean()},
          {"near_ssim_min", near_ssim.min},
          {"frame_psnr_db", frame_psnr_db.mean()},
          {"frame_ssim", frame_ssim.mean()},
          {"flicker", flicker.mean()}};
}

absl::StatusOr<render::Picture> quarter(const render::Picture& picture) {
  if (picture.width_px % kReferenceScale != 0 || picture.height_px % kReferenceScale != 0) {
    return absl::InvalidArgumentError(absl::StrCat("quarter: a picture of ", picture.width_px, "x",
                                                   picture.height_px,
                                                   " px, sides must be multiples of 4"));
  }
  const std::array<float, 256>& linear = linear_table();
  render::Picture result;
  result.width_px = picture.width_px / kReferenceScale;
  result.height_px = picture.height_px / kReferenceScale;
  result.rgbx.resize(std::size_t{4} * result.width_px * result.height_px, 255);
  for (std::size_t y = 0; y < result.height_px; ++y) {
    for (std::size_t x = 0; x < result.width_px; ++x) {
      float sum[3] = {0, 0, 0};
      for (std::size_t dy = 0; dy < kReferenceScale; ++dy) {
        const std::uint8_t* row =
            &picture
                 .rgbx[4 * ((y * kReferenceScale + dy) * picture.width_px + x * kReferenceScale)];
        for (std::size_t k = 0; k < kReferenceScale * 4; ++k) {
          if (k % 4 != 3) sum[k % 4] += linear[row[k]];
        }
      }
      for (std::size_t c = 0; c < 3; ++c) {
        result.rgbx[4 * (y * result.width_px + x) + c] =
            encode(sum[c] / (kReferenceScale * kReferenceScale));
      }
    }
  }
  return result;
}

absl::StatusOr<std::vector<std::uint8_t>> covered_pixels(render::FramePipeline& pipeline,
                                                         const render::Crowd& crowd,
                                                         std::int64_t time_us,
                                                         render::ViewSettings view) {
  render::Look& look = view.look;
  look.ground = look.shadows = look.color_by_channel = false;
  look.sky_color = look.ground_light = look.horizon_color = glm::vec3(0.0F);
  look.sun_color = glm::vec3(100.0F);
  std::vector<std::uint8_t> covered(std::size_t{view.viewport.width_px} * view.viewport.height_px);
  render::Picture picture;
  render::FrameStats stats;
  // light reaches past the edge of the shade, so that every normal is lit from one side or the
  // other
  for (const float side : {1.0F, -1.0F}) {
    look.sun_direction_world = side * glm::vec3(0.45F, -0.55F, 0.70F);
    if (auto status = pipeline.render(crowd, time_us, view, picture, stats); !status.ok()) {
      return status;
    }
    for (std::size_t i = 0; i < covered.size(); ++i) {
      const std::uint8_t* p = &picture.rgbx[4 * i];
      if ((p[0] | p[1] | p[2]) != 0) covered[i] = 1;
    }
  }
  return covered;
}

absl::StatusOr<Reference> Reference::make(std::shared_ptr<const render::Cast> cast,
                                          unsigned threads, render::RasterKind raster) {
  auto pipeline = render::FramePipeline::make(
      cast, {.raster = raster, .threads = threads, .geometry = render::GeometryKind::kBatched});
  if (!pipeline.ok()) return pipeline.status();
  Reference reference;
  reference.cast_ = std::move(cast);
  reference.pipeline_ = *std::move(pipeline);
  return reference;
}

absl::StatusOr<Reference::Frame> Reference::draw(const render::Crowd& crowd, std::int64_t time_us,
                                                 const render::ViewSettings& view) {
  render::ViewSettings full = view;
  full.selection.rule = render::LodRule::kBudget;
  full.selection.form = render::FormRule::kMesh;
  full.pose_mode = render::PoseMode::kExact;
  full.selection.vertex_budget = 0;
  render::Picture large;
  render::FrameStats stats;

  // first the coarsest level at small size: how many are in view, so what the full detail would
  // need
  full.viewport = {16 * view.viewport.width_px / std::max(view.viewport.height_px, 1U), 16};
  if (auto status = pipeline_->render(crowd, time_us, full, large, stats); !status.ok()) {
    return status;
  }
  double mean_vertices = 0;
  for (const render::CastMember& member : cast_->members) {
    mean_vertices += member.character.vertex_count() / static_cast<double>(cast_->members.size());
  }
  // a vertex as it is stored and as it is projected, and two triangles of three indices
  constexpr double kVertexBytes = 24 + 24 + 2 * 12;
  constexpr double kLimitBytes = 8.0 * (1ULL << 30);
  const double bytes = stats.counters.visible * mean_vertices * kVertexBytes;
  full.selection.vertex_budget = ~std::uint64_t{0} >> 16;
  if (bytes > kLimitBytes) {
    full.selection.form = render::FormRule::kMixed;
    full.selection.mixed.specks = false;
    full.selection.mixed.error_px = kReferenceScale * kReferenceErrorPx;
    full.selection.mixed.least_px = 1e-6F;  // nobody stands for others
    full.selection.mixed.impostor_error = 1e6F;
    full.selection.vertex_budget = static_cast<std::uint64_t>(kLimitBytes / kVertexBytes);
  }
  full.viewport = {kReferenceScale * view.viewport.width_px,
                   kReferenceScale * view.viewport.height_px};
  if (auto status = pipeline_->render(crowd, time_us, full, large, stats); !status.ok()) {
    return status;
  }
  auto small = quarter(large);
  if (!small.ok()) return small.status();
  // a budget at which the outlines are those of full detail, to a fraction of the 8 px around them
  full.selection.vertex_budget = 20'000'000;
  full.viewport = view.viewport;
  auto covered = covered_pixels(*pipeline_, crowd, time_us, full);
  if (!covered.ok()) return covered.status();
  return Frame{*std::move(small), *std::move(covered)};
}

absl::Status judge(const std::array<Reference::Frame, 2>& frames,
                   const std::array<Reference::Frame, 2>& references, Quality& quality) {
  const std::uint32_t width_px = frames[0].picture.width_px;
  const std::uint32_t height_px = frames[0].picture.height_px;
  std::vector<std::uint8_t> both;  // near an agent in either frame
  for (int i : {0, 1}) {
    auto near =
        render::pixels_near(frames[i].covered, references[i].covered, width_px, height_px, kNearPx);
    if (!near.ok()) return near.status();
    const auto around = render::compare_pictures(frames[i].picture, references[i].picture, *near);
    if (!around.ok()) return around.status();
    const auto whole = render::compare_pictures(frames[i].picture, references[i].picture);
    if (!whole.ok()) return whole.status();
    quality.near_psnr_db.add(around->psnr_db);
    quality.near_ssim.add(around->ssim);
    quality.frame_psnr_db.add(whole->psnr_db);
    quality.frame_ssim.add(whole->ssim);
    if (both.empty()) {
      both = *std::move(near);
    } else {
      for (std::size_t p = 0; p < both.size(); ++p) both[p] |= (*near)[p];
    }
  }
  const auto flicker = render::flicker(frames[0].picture, frames[1].picture, references[0].picture,
                                       references[1].picture, both);
  if (!flicker.ok()) return flicker.status();
  quality.flicker.add(*flicker);
  return absl::OkStatus();
}

render::Camera camera_at(Place place, const render::Crowd& crowd,
                         const render::Viewport& viewport) {
  const auto newest = crowd.newest();
  const glm::dvec3 low(newest->low_m), high(newest->high_m);
  if (place == Place::kAbove) return render::overview_camera(low, high, viewport);
  render::Camera camera;
  camera.eye_world = {0.5 * (low.x + high.x), low.y + 0.125 * (high.y - low.y), 1.7};
  camera.target_world = camera.eye_world + glm::dvec3(0.0, 10.0, -0.05);
  return camera;
}

absl::Status judge_places(const Common& common, const Places& places, std::vector<Judged>& ways) {
  auto walkthrough = Walkthrough::make(common.cast, places.agents, places.camera_path);
  if (!walkthrough.ok()) return walkthrough.status();
  const std::uint32_t count = places.place == Place::kWalkthrough ? places.count : 1;
  auto reference = Reference::make(common.cast, common.threads);
  if (!reference.ok()) return reference.status();

  std::map<render::GeometryKind, std::unique_ptr<render::FramePipeline>> pipelines;
  for (const Judged& way : ways) {
    if (pipelines.contains(way.form.geometry)) continue;
    auto pipeline = render::FramePipeline::make(common.cast, {.raster = places.raster,
                                                              .threads = common.threads,
                                                              .measure_cpu_times = true,
                                                              .geometry = way.form.geometry});
    if (!pipeline.ok()) return pipeline.status();
    pipelines[way.form.geometry] = *std::move(pipeline);
  }

  render::ViewSettings view;
  view.viewport = common.viewport;
  view.look = places.look;
  view.selection.rule = places.lod;
  render::JpegEncoder jpeg;
  Progress progress("quality", std::size_t{count} * (ways.size() + 1));
  for (std::uint32_t place = 0; place < count && !stop_requested; ++place) {
    const auto first = static_cast<std::uint32_t>((2 * std::uint64_t{place} + 1) *
                                                  (Walkthrough::kFrames - 2) / (2 * count));
    std::array<Reference::Frame, 2> references;
    std::vector<std::array<Reference::Frame, 2>> frames(ways.size());
    for (const std::uint32_t i : {0U, 1U}) {
      const std::uint32_t frame = first + i;
      if (auto status = walkthrough->advance_to(frame); !status.ok()) return status;
      const render::Crowd& crowd = walkthrough->crowd();
      view.camera = places.place == Place::kWalkthrough
                        ? walkthrough->camera(frame)
                        : camera_at(places.place, crowd, common.viewport);
      const std::int64_t time_us = Walkthrough::time_us(frame);
      auto drawn = reference->draw(crowd, time_us, view);
      if (!drawn.ok()) return drawn.status();
      references[i] = *std::move(drawn);
      const std::string name =
          absl::StrCat(places.pictures, "/quality-", absl::Dec(frame, absl::kZeroPad4), "-");
      if (!places.pictures.empty()) {
        const auto status = write_png(name + "reference.png", references[i].picture);
        if (!status.ok()) return status;
      }
      for (std::size_t w = 0; w < ways.size(); ++w) {
        view.selection.vertex_budget = ways[w].budget;
        view.pose_mode = ways[w].form.pose;
        view.selection.form = ways[w].form.rule;
        view.selection.mixed.error_px = ways[w].form.error_px;
        view.selection.point_size_px = ways[w].form.point_px;
        view.oversampling = ways[w].form.oversampling;
        render::FramePipeline& pipeline = *pipelines[ways[w].form.geometry];
        std::optional<Measured> least;
        for (std::uint32_t k = std::max(places.repeats, 1U); k-- > 0;) {
          Measured measured;
          // a millisecond apart: what one frame has advanced the next does not find done
          if (auto status = measure_frame(pipeline, crowd, time_us - 1000 * k, view, jpeg,
                                          frames[w][i].picture, measured);
              !status.ok()) {
            return status;
          }
          if (!least || measured.cpu_ms.mean() < least->cpu_ms.mean()) least = measured;
        }
        ways[w].measured.add(*least);
        auto covered = covered_pixels(pipeline, crowd, time_us, view);
        if (!covered.ok()) return covered.status();
        frames[w][i].covered = *std::move(covered);
        if (places.pictures.empty()) continue;
        const auto status =
            write_png(absl::StrCat(name, ways[w].name, "-", w, ".png"), frames[w][i].picture);
        if (!status.ok()) return status;
      }
    }
    progress.step("reference");
    for (std::size_t w = 0; w < ways.size(); ++w) {
      if (auto status = judge(frames[w], references, ways[w].quality); !status.ok()) return status;
      progress.step(absl::StrFormat("%s, %s: SSIM %.3f", ways[w].form.name, ways[w].name,
                                    ways[w].quality.near_ssim.mean()));
    }
  }
  return ways.empty() || ways.front().measured.frames == 0
             ? absl::CancelledError("quality: stopped before the first place was judged")
             : absl::OkStatus();
}

Table quality_table(const std::vector<Judged>& ways) {
  Table table({"geometry", "N (M)", "SSIM", "PSNR dB", "flicker", "SSIM, whole frame",
               "PSNR dB, whole", "Mtri", "frame CPU ms", "frame ms"});
  for (const Judged& way : ways) {
    const Quality& q = way.quality;
    table.add({way.form.name, way.name, fixed(q.near_ssim.mean(), 3),
               fixed(q.near_psnr_db.mean(), 1), fixed(q.flicker.mean(), 2),
               fixed(q.frame_ssim.mean(), 3), fixed(q.frame_psnr_db.mean(), 1),
               fixed(way.measured.triangles.mean() * 1e-6, 2), fixed(way.measured.cpu_ms.mean(), 1),
               fixed(way.measured.wall_ms.mean(), 1)});
  }
  return table;
}

}  // namespace throng::bench
