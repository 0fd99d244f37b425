#include "render/frame/faster_rasterizer.hpp"

#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <mutex>
#include <numeric>
#include <utility>

#include "throng/render/gpu.hpp"

namespace throng::render {
namespace {

constexpr std::size_t kAgents = 2'000;
constexpr double kSpacingM = 1.5;
constexpr int kFrames = 2;  // buffers grow in the first

/// Milliseconds of the last frame.
absl::StatusOr<double> time_of(const std::shared_ptr<const Cast>& cast, const Crowd& crowd,
                               FramePipelineOptions options, RasterKind kind) {
  options.raster = kind;
  auto pipeline = FramePipeline::make(cast, options);
  if (!pipeline.ok()) return pipeline.status();
  const RasterInfo info = (*pipeline)->raster_info();
  if (kind == RasterKind::kGl && options.backend == BackendKind::kCuda &&
      absl::StrContains(absl::StrCat(info.name, info.detail), "llvmpipe")) {
    return absl::UnavailableError("OpenGL draws on the processor here");
  }
  ViewSettings settings;
  const double side_m = kSpacingM * std::sqrt(static_cast<double>(kAgents));
  settings.camera.eye_world = {0.0, -0.8 * side_m, 0.3 * side_m};
  settings.camera.target_world = {0.0, 0.0, 0.0};
  settings.viewport = {1280, 720};
  Picture picture;
  FrameStats stats;
  double last_ms = 0.0;
  for (int frame = 0; frame < kFrames; ++frame) {
    const auto began = std::chrono::steady_clock::now();
    if (absl::Status status = (*pipeline)->render(crowd, 40'000 * frame, settings, picture, stats);
        !status.ok()) {
      return status;
    }
    const auto took = std::chrono::steady_clock::now() - began;
    last_ms = std::chrono::duration<double, std::milli>(took).count();
  }
  return last_ms;
}

absl::Status fill(Crowd& crowd) {
  std::vector<std::uint64_t> ids(kAgents);
  std::iota(ids.begin(), ids.end(), 1);
  const auto columns = static_cast<std::size_t>(std::sqrt(static_cast<double>(kAgents)));
  AgentFrame frame;
  for (std::size_t i = 0; i < kAgents; ++i) {
    const auto place = [&](std::size_t k) {
      return static_cast<float>(kSpacingM * (static_cast<double>(k) - 0.5 * double(columns)));
    };
    frame.position_m.emplace_back(place(i % columns), place(i / columns), 0.0F);
  }
  auto membership = std::make_shared<Membership>();
  membership->epoch = 1;
  membership->ids = std::move(ids);
  frame.membership = std::move(membership);
  return crowd.push(frame);
}

struct Choice {
  RasterKind kind;
  std::string why;
};

Choice choose(const std::shared_ptr<const Cast>& cast, const FramePipelineOptions& options) {
  Crowd crowd(cast, CrowdSettings());
  if (absl::Status status = fill(crowd); !status.ok()) {
    return {RasterKind::kVisibility, std::string(status.message())};
  }
  const auto visibility = time_of(cast, crowd, options, RasterKind::kVisibility);
  const auto gl = time_of(cast, crowd, options, RasterKind::kGl);
  const auto text = [](const char* name, const absl::StatusOr<double>& ms) {
    return ms.ok() ? absl::StrFormat("%s %.2f ms", name, *ms)
                   : absl::StrCat("no ", name, " (", ms.status().message(), ")");
  };
  const bool gl_wins = gl.ok() && (!visibility.ok() || *gl < *visibility);
  return {gl_wins ? RasterKind::kGl : RasterKind::kVisibility,
          absl::StrCat("a frame of ", kAgents, " agents takes ", text("visibility", visibility),
                       ", ", text("gl", gl))};
}

/// What makes a cast's frames take the time they take: who is in it, not where it lies.
std::string identity_of(const Cast& cast) {
  std::string identity;
  for (const CastMember& member : cast.members) {
    const Character& character = member.character;
    absl::StrAppend(&identity, character.name, " ", character.vertex_count(), " ",
                    character.triangle.size(), " ", character.joint_count(), " ",
                    character.palette.size(), " ", member.weight, "; ");
  }
  return identity;
}

}  // namespace

RasterKind faster_rasterizer(const std::shared_ptr<const Cast>& cast,
                             const FramePipelineOptions& options, std::string& why) {
  static std::mutex mutex;
  static std::map<std::string, Choice> known;
  const std::string key =
      absl::StrCat(gpu_key(), "; ", static_cast<int>(options.backend), "; ", identity_of(*cast));
  const std::lock_guard lock(mutex);
  auto at = known.find(key);
  if (at == known.end()) at = known.emplace(key, choose(cast, options)).first;
  why = at->second.why;
  return at->second.kind;
}

}  // namespace throng::render
