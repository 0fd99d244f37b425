#include "server/batch/job.hpp"

#include <absl/strings/escaping.h>
#include <absl/strings/match.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>
#include <absl/strings/str_replace.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "server/batch/camera_path.hpp"
#include "server/batch/picture_sink.hpp"
#include "server/batch/synthetic.hpp"
#include "throng/render/asset.hpp"
#include "throng/render/crowd.hpp"
#include "throng/render/encode.hpp"

namespace throng::server {
namespace {

constexpr double kAgentHeightM = 1.9;
constexpr char kCamera[] = "{camera}", kPass[] = "{pass}";

absl::StatusOr<OutputKind> output_kind(const BatchJob& job) {
  const std::string& path = job.output;
  if (path == "-") return OutputKind::kStream;
  if (!job.passes.color) {
    if (absl::EndsWithIgnoreCase(path, ".exr")) return OutputKind::kExr;
    return absl::InvalidArgumentError(
        absl::StrCat("-o: '", path, "' must end with .exr, or --passes name color too"));
  }
  if (absl::EndsWithIgnoreCase(path, ".png")) return OutputKind::kPng;
  if (absl::EndsWithIgnoreCase(path, ".jpg") || absl::EndsWithIgnoreCase(path, ".jpeg")) {
    return OutputKind::kJpeg;
  }
  if (absl::EndsWithIgnoreCase(path, ".mp4")) return OutputKind::kVideo;
  return absl::InvalidArgumentError(
      absl::StrCat("-o: '", path, "' must end with .png, .jpg or .mp4, or be - for PPM pictures"));
}

/// What can't be had together. OK, or what to change.
absl::Status check_output(const BatchJob& job, OutputKind kind) {
  const bool one_file = kind == OutputKind::kVideo || kind == OutputKind::kStream;
  if (one_file && (job.shard.count > 1 || job.skip_existing)) {
    return absl::InvalidArgumentError(
        "-o: a video is one file; --shard and --skip-existing want numbered pictures");
  }
  if (one_file && job.passes.data()) {
    return absl::InvalidArgumentError(
        "--passes: depth and id want numbered pictures, such as -o out/{pass}/####.png");
  }
  if (kind == OutputKind::kStream && job.cameras.size() > 1) {
    return absl::InvalidArgumentError("-o: - is one stream, give one --camera");
  }
  if (job.passes.count() > 1 && !absl::StrContains(job.output, kPass)) {
    return absl::InvalidArgumentError(
        absl::StrCat("-o: '", job.output, "' must hold {pass} when there are several, such as ",
                     "out/{pass}/####.png"));
  }
  if (!job.boxes.empty() && job.cameras.size() > 1 && !absl::StrContains(job.boxes, kCamera)) {
    return absl::InvalidArgumentError(absl::StrCat(
        "--boxes: '", job.boxes, "' must hold {camera} when there are several cameras"));
  }
  if (job.far.enabled && (job.passes.data() || !job.boxes.empty() || !job.channel.empty())) {
    return absl::InvalidArgumentError(
        "--far: a crowd that is drawn as one has no depth and id passes, boxes or channel");
  }
  if ((job.passes.data() || !job.boxes.empty()) && job.pipeline.raster == render::RasterKind::kGl) {
    return absl::InvalidArgumentError(
        "--raster: gl draws colours only; depth, id and --boxes come from visibility");
  }
  return absl::OkStatus();
}

absl::StatusOr<std::unique_ptr<trajectory::Reader>> open_source(const BatchJob& job) {
  if (job.trajectory.empty()) {
    return make_synthetic(job.synthetic_agents, job.seed, job.synthetic_seconds);
  }
  return trajectory::open(job.trajectory, job.read);
}

/// What the whole trajectory spans; the overview camera and the number of pictures depend on it.
struct Span {
  glm::dvec3 low{std::numeric_limits<double>::infinity()};
  glm::dvec3 high{-std::numeric_limits<double>::infinity()};
  std::int64_t last_us = 0;
  std::uint64_t frames = 0;
  std::set<std::uint64_t> ids;  // empty: not asked for
};

absl::StatusOr<Span> measure(const BatchJob& job, bool wants_ids) {
  auto reader = open_source(job);
  if (!reader.ok()) return reader.status();
  Span span;
  trajectory::Frame frame;
  std::vector<std::uint64_t> ids_before;
  while (true) {
    const absl::StatusOr<bool> more = (*reader)->next(frame);
    if (!more.ok()) return more.status();
    if (!*more) break;
    ++span.frames;
    span.last_us = frame.time_us;
    if (wants_ids && frame.ids != ids_before) {
      span.ids.insert(frame.ids.begin(), frame.ids.end());
      ids_before = frame.ids;
    }
    for (std::size_t i = 0; i < frame.ids.size(); ++i) {
      const glm::dvec3 position(frame.x_m[i], frame.y_m[i], frame.z_m.empty() ? 0.0 : frame.z_m[i]);
      span.low = glm::min(span.low, position);
      span.high = glm::max(span.high, position);
    }
  }
  if (span.frames == 0) {
    return absl::InvalidArgumentError(absl::StrCat(job.trajectory, ": has no frame"));
  }
  if (!(span.low.x <= span.high.x)) span.low = span.high = glm::dvec3(0.0);
  return span;
}

/// Feeds a crowd from a reader, just far enough ahead of the picture's time.
class Feed {
 public:
  Feed(std::unique_ptr<trajectory::Reader> reader, render::Crowd& crowd)
      : reader_(std::move(reader)), crowd_(crowd) {}

  /// Pushes frames until the newest is at or after `time_us` or the file ends.
  absl::Status advance_to(std::int64_t time_us) {
    while (!ended_ && pushed_us_ < time_us) {
      absl::StatusOr<bool> more = reader_->next(frame_);
      if (!more.ok()) return more.status();
      if (!*more) {
        ended_ = true;
        break;
      }
      if (absl::Status status = push(); !status.ok()) return status;
    }
    return absl::OkStatus();
  }

 private:
  absl::Status push() {
    if (membership_ == nullptr || membership_->ids != frame_.ids) {
      auto membership = std::make_shared<render::Membership>();
      membership->epoch = ++epoch_;
      membership->ids = frame_.ids;
      membership->characters =
          trajectory::chosen_characters(*reader_, frame_, crowd_.cast().members.size());
      membership_ = std::move(membership);
    }
    const glm::dvec3 origin = crowd_.settings().origin_world;
    render::AgentFrame agents;
    agents.time_us = frame_.time_us;
    agents.membership = membership_;
    agents.position_m.resize(frame_.ids.size());
    for (std::size_t i = 0; i < frame_.ids.size(); ++i) {
      const double z_m = frame_.z_m.empty() ? 0.0 : frame_.z_m[i];
      agents.position_m[i] = glm::vec3(glm::dvec3(frame_.x_m[i], frame_.y_m[i], z_m) - origin);
    }
    agents.heading_rad = frame_.heading_rad;
    agents.channels = frame_.channels;
    agents.motion = frame_.motion;
    if (!frame_.motion.empty()) agents.motion_names = reader_->info().motion_names;
    pushed_us_ = frame_.time_us;
    return crowd_.push(std::move(agents));
  }

  std::unique_ptr<trajectory::Reader> reader_;
  render::Crowd& crowd_;
  trajectory::Frame frame_;
  std::shared_ptr<const render::Membership> membership_;
  std::uint64_t epoch_ = 0;
  std::int64_t pushed_us_ = std::numeric_limits<std::int64_t>::min();
  bool ended_ = false;
};

std::string stats_line(std::uint32_t number, const std::string& path,
                       const render::FrameStats& stats) {
  const render::StageTimes& t = stats.times;
  const nlohmann::ordered_json line = {{"frame", number},
                                       {"path", path},
                                       {"scene_time_us", stats.scene_time_us},
                                       {"agents", stats.counters.agents},
                                       {"visible", stats.counters.visible},
                                       {"vertices", stats.counters.vertices},
                                       {"triangles", stats.counters.triangles},
                                       {"effective_budget", stats.counters.effective_budget},
                                       {"drawn_as",
                                        {{"none", stats.counters.drawn_as[0]},
                                         {"mesh", stats.counters.drawn_as[1]},
                                         {"impostor", stats.counters.drawn_as[2]},
                                         {"points", stats.counters.drawn_as[3]}}},
                                       {"advance_ms", t.advance_ms},
                                       {"cull_ms", t.cull_ms},
                                       {"select_ms", t.select_ms},
                                       {"allocate_ms", t.allocate_ms},
                                       {"generate_ms", t.generate_ms},
                                       {"raster_ms", t.raster_ms},
                                       {"resolve_ms", t.resolve_ms},
                                       {"read_back_ms", t.read_back_ms}};
  // a path is bytes and need not be UTF-8
  return line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
}

BatchOutcome failure(ExitCode code, std::string error) {
  BatchOutcome outcome;
  outcome.code = code;
  outcome.error = std::move(error);
  return outcome;
}

ExitCode input_code(const absl::Status& status) {
  return absl::IsInternal(status) ? ExitCode::kInternal : ExitCode::kBadInput;
}

/// One camera's pictures.
struct Output {
  explicit Output(CameraPath with_camera) : camera(std::move(with_camera)) {}
  CameraPath camera;
  std::string path;                              // {camera} replaced: a video, or a stream
  std::optional<NumberedPath> color, depth, id;  // none: not written, or no pictures
  std::unique_ptr<render::VideoWriter> video;
  std::ofstream boxes;
  std::unique_ptr<PictureSink> sink;
  std::uint32_t written = 0;

  std::string color_of(std::uint32_t number) const { return color ? color->at(number) : path; }

  /// True where every picture of this number is a file already.
  bool exists(std::uint32_t number) const {
    for (const auto* pattern : {&color, &depth, &id}) {
      std::error_code ignored;
      if (*pattern && !std::filesystem::is_regular_file((*pattern)->at(number), ignored)) {
        return false;
      }
    }
    return true;
  }
};

/// A camera's name as a part of a file's: an agent may be called "a/b", and # % $ are the places of
/// frame numbers.
std::string file_name_of(std::string name) {
  for (char& c : name) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f || std::strchr("/\\#%$", c) != nullptr) c = '_';
  }
  if (!name.empty() && name[0] == '.') name[0] = '_';
  return name;
}

/// Null where there is none.
absl::StatusOr<std::shared_ptr<const render::Environment>> environment_of(
    const BatchJob& job, const trajectory::Info& info, const glm::dvec3& origin_world) {
  if (!job.walls) return nullptr;
  if (!job.environment.empty()) {
    return render::read_environment(job.environment, origin_world, job.environment_options);
  }
  std::string site = info.walkable_area_wkt;
  if (!job.net.empty()) {
    const absl::StatusOr<std::string> streets = trajectory::read_sumo_net(job.net);
    if (!streets.ok()) return streets.status();
    site = site.substr(0, site.find("\n;")) + *streets;
  }
  if (site.empty()) return nullptr;
  auto made = render::make_environment(site, origin_world, job.environment_options);
  if (made.ok()) return made;
  return absl::Status(made.status().code(), absl::StrCat(job.net.empty() ? job.trajectory : job.net,
                                                         ": ", made.status().message()));
}

/// @param scripts  of job.cameras
absl::StatusOr<std::vector<Output>> make_outputs(const BatchJob& job, OutputKind kind,
                                                 const Span& span, const Site& site,
                                                 std::vector<client::CameraScript> scripts) {
  if (job.cameras.size() > 1 && !absl::StrContains(job.output, kCamera)) {
    return absl::FailedPreconditionError(
        absl::StrCat("-o: '", job.output, "' must hold {camera} when there are several, such as ",
                     "out/{camera}/####.png or {camera}.mp4"));
  }
  std::vector<Output> outputs;
  client::number_cameras(scripts);
  for (std::size_t i = 0; i < scripts.size(); ++i) {
    if (const auto* follow = scripts[i].follow(); follow && !span.ids.contains(follow->agent)) {
      return absl::NotFoundError(absl::StrCat(
          "--camera ", job.cameras[i], ": ",
          job.trajectory.empty() ? "the synthetic crowd" : job.trajectory,
          " has no such agent among its ", span.ids.size(),
          span.ids.empty() ? "" : absl::StrCat("; the first of them is ", *span.ids.begin())));
    }
    CameraPath camera(std::move(scripts[i]), site);
    for (const Output& other : outputs) {
      if (file_name_of(other.camera.name()) != file_name_of(camera.name())) continue;
      return absl::FailedPreconditionError(
          absl::StrCat("--camera: two are called '", camera.name(), "'"));
    }
    Output& output = outputs.emplace_back(std::move(camera));
    output.path = absl::StrReplaceAll(job.output, {{kCamera, file_name_of(output.camera.name())}});
    if (kind == OutputKind::kVideo || kind == OutputKind::kStream) continue;
    const auto add = [&](bool wanted, const char* pass, std::optional<NumberedPath>& to) {
      if (!wanted) return absl::OkStatus();
      std::string path = absl::StrReplaceAll(output.path, {{kPass, pass}});
      if (&to != &output.color) path = std::filesystem::path(path).replace_extension(".exr");
      absl::StatusOr<NumberedPath> pattern = NumberedPath::parse(path);
      if (!pattern.ok()) return absl::FailedPreconditionError(pattern.status().message());
      to = *std::move(pattern);
      return absl::OkStatus();
    };
    for (const absl::Status& status :
         {add(job.passes.color, "color", output.color),
          add(job.passes.depth, "depth", output.depth), add(job.passes.id, "id", output.id)}) {
      if (!status.ok()) return status;
    }
  }
  return outputs;
}

}  // namespace

BatchOutcome run_batch(const BatchJob& job, const BatchProgress& progress,
                       const std::atomic<bool>& stop) {
  // everything that can be refused is refused before the first picture
  const absl::StatusOr<OutputKind> kind = output_kind(job);
  if (!kind.ok()) return failure(ExitCode::kUsage, std::string(kind.status().message()));
  if (const absl::Status status = check_output(job, *kind); !status.ok()) {
    return failure(ExitCode::kUsage, std::string(status.message()));
  }
  const bool wants_passes = job.passes.data() || !job.boxes.empty();
  std::vector<client::CameraScript> scripts;
  for (const std::string& text : job.cameras) {
    absl::StatusOr<client::CameraScript> script = client::CameraScript::parse(text);
    if (!script.ok()) return failure(ExitCode::kBadInput, std::string(script.status().message()));
    scripts.push_back(*std::move(script));
  }
  const bool follows = std::any_of(scripts.begin(), scripts.end(),
                                   [](const auto& script) { return script.follow() != nullptr; });
  const absl::StatusOr<Span> span = measure(job, follows);
  if (!span.ok()) return failure(input_code(span.status()), std::string(span.status().message()));
  auto reader = open_source(job);
  if (!reader.ok()) {
    return failure(input_code(reader.status()), std::string(reader.status().message()));
  }
  const trajectory::Info info = (*reader)->info();
  render::CrowdSettings crowd_settings;
  // near the agents, so that float32 offsets are fine anywhere in the world
  crowd_settings.origin_world = glm::dvec3(glm::round((span->low.x + span->high.x) / 2),
                                           glm::round((span->low.y + span->high.y) / 2), 0.0);
  crowd_settings.seed = job.seed;
  crowd_settings.channel_names = info.channel_names;

  const auto environment = environment_of(job, info, crowd_settings.origin_world);
  if (!environment.ok()) {
    return failure(ExitCode::kBadInput, std::string(environment.status().message()));
  }
  Site site{span->low, span->high, job.viewport};
  render::include_environment(environment->get(), crowd_settings.origin_world, site.low_world,
                              site.high_world);
  site.high_world.z += kAgentHeightM;
  absl::StatusOr<std::vector<Output>> outputs =
      make_outputs(job, *kind, *span, site, std::move(scripts));
  if (!outputs.ok()) {
    return failure(
        absl::IsFailedPrecondition(outputs.status()) ? ExitCode::kUsage : ExitCode::kBadInput,
        std::string(outputs.status().message()));
  }
  const auto last = static_cast<std::uint32_t>(
      std::min(1e8, std::floor(static_cast<double>(span->last_us) * 1e-6 * job.fps + 1e-6) + 1));
  absl::StatusOr<std::vector<std::uint32_t>> numbers = parse_frame_numbers(job.frames, last);
  if (!numbers.ok()) return failure(ExitCode::kUsage, std::string(numbers.status().message()));
  const Output& first = outputs->front();
  const std::optional<NumberedPath>& pattern = first.color   ? first.color
                                               : first.depth ? first.depth
                                                             : first.id;
  if (pattern && !pattern->numbered() && (numbers->size() != 1 || job.shard.count > 1)) {
    return failure(ExitCode::kUsage,
                   absl::StrCat("-o: '", job.output, "' names one picture and ", numbers->size(),
                                " are to be rendered: add a place for the frame number, such as ",
                                "out/####.png, out/%04d.png or out/$F4.png, or --frames 1"));
  }
  if (numbers->empty()) {
    return failure(ExitCode::kUsage,
                   absl::StrCat("--frames: '", job.frames, "' is beyond the last ", "picture, ",
                                last, " at ", job.fps, " fps"));
  }
  const std::vector<std::uint32_t> mine = shard_of(*numbers, job.shard.index, job.shard.count);

  absl::StatusOr<render::Cast> cast = render::read_cast(job.cast);
  if (!cast.ok()) return failure(ExitCode::kBadInput, std::string(cast.status().message()));
  const auto shared_cast = std::make_shared<const render::Cast>(*std::move(cast));

  render::ViewSettings view;
  view.viewport = job.viewport;
  view.selection = job.selection;
  view.look = job.look;
  view.far = job.far;
  if (!job.channel.empty()) {
    const auto found = std::find(info.channel_names.begin(), info.channel_names.end(), job.channel);
    if (found != info.channel_names.end()) {
      view.channel = static_cast<int>(found - info.channel_names.begin());
    } else if (job.channel == render::kSpeedChannelName) {
      view.channel = render::kSpeedChannel;
    } else {
      std::vector<std::string> known = info.channel_names;
      known.push_back("speed (derived from the motion)");
      return failure(ExitCode::kUsage, absl::StrCat("--channel: '", job.channel, "' is none of ",
                                                    absl::StrJoin(known, ", ")));
    }
    view.look.color_by_channel = true;
    view.look.channel_low = static_cast<float>(job.channel_low);
    view.look.channel_high = static_cast<float>(job.channel_high);
    view.look.color_map = job.color_map;
  }

  render::FramePipelineOptions pipeline_options = job.pipeline;
  if (wants_passes) {  // by the processor only
    pipeline_options.raster = render::RasterKind::kVisibility;
    pipeline_options.backend = render::BackendKind::kCpu;
  }
  auto pipeline = render::FramePipeline::make(shared_cast, pipeline_options);
  if (!pipeline.ok()) {
    return failure(ExitCode::kNoRenderer, std::string(pipeline.status().message()));
  }

  BatchOutcome outcome;
  outcome.notes = info.notes;
  if (*kind == OutputKind::kVideo) {
    for (Output& output : *outputs) {
      auto opened =
          render::open_video(output.path, job.viewport.width_px, job.viewport.height_px, job.fps);
      if (!opened.ok()) return failure(ExitCode::kOutput, std::string(opened.status().message()));
      output.video = *std::move(opened);
    }
  }
  for (Output& output : *outputs) {
    if (job.boxes.empty()) break;
    const std::string path =
        absl::StrReplaceAll(job.boxes, {{kCamera, file_name_of(output.camera.name())}});
    output.boxes.open(path, std::ios::binary | std::ios::trunc);
    if (!output.boxes) return failure(ExitCode::kOutput, absl::StrCat(path, ": can't be written"));
  }
  std::ofstream stats_file;
  if (!job.stats.empty()) {
    stats_file.open(job.stats, std::ios::binary | std::ios::trunc);
    if (!stats_file)
      return failure(ExitCode::kOutput, absl::StrCat(job.stats, ": can't be written"));
  }

  render::Crowd crowd(shared_cast, crowd_settings);
  crowd.set_environment(*environment);
  Feed feed(*std::move(reader), crowd);
  for (Output& output : *outputs) {
    output.sink =
        std::make_unique<PictureSink>(*kind, job.jpeg_quality, output.video.get(), STDOUT_FILENO);
  }
  const auto total = static_cast<std::uint32_t>(mine.size() * outputs->size());
  std::uint32_t done = 0;
  std::vector<std::string> failed;
  for (std::uint32_t i = 0; i < mine.size() && !stop && outcome.code == ExitCode::kOk; ++i) {
    const std::uint32_t number = mine[i];
    const double time_s = (number - 1) / job.fps;
    const std::int64_t time_us = std::llround(time_s * 1e6);
    for (Output& output : *outputs) {
      if (stop) break;
      const std::string path = output.color_of(number);
      if (job.skip_existing && output.exists(number)) {
        ++outcome.skipped;
        if (progress) progress(++done, total, path);
        continue;
      }
      if (absl::Status status = feed.advance_to(time_us); !status.ok()) {
        outcome.code = ExitCode::kBadInput;
        outcome.error = std::string(status.message());
        break;
      }
      view.camera = output.camera.at(time_s, crowd);
      FinishedPicture finished;
      render::Picture& picture = finished.picture;
      render::FrameStats stats;
      if (absl::Status status = (*pipeline)->render(crowd, time_us, view, picture, stats,
                                                    wants_passes ? &finished.passes : nullptr);
          !status.ok()) {
        failed.push_back(absl::StrCat(path, ": ", status.message()));
        continue;
      }
      if (job.overlay.any()) {
        draw_overlay(job.overlay,
                     {.scene_time_us = time_us,
                      .agents = stats.counters.agents,
                      .camera = view.camera,
                      .channel = job.channel,
                      .channel_low = job.channel_low,
                      .channel_high = job.channel_high,
                      .color_map = job.color_map},
                     picture);
      }
      if (stats_file.is_open()) stats_file << stats_line(number, path, stats);
      if (output.boxes.is_open()) {
        output.boxes << box_lines(number, finished.passes, job.box_extent);
      }
      if (job.passes.color) finished.color_path = path;
      if (output.depth) finished.depth_path = output.depth->at(number);
      if (output.id) finished.id_path = output.id->at(number);
      finished.time_us = std::llround(i / job.fps * 1e6);
      output.sink->add(std::move(finished));
      ++output.written;
      if (progress) progress(++done, total, path);
      // nobody reads the rest of a stream that has broken
      if (*kind == OutputKind::kStream && output.sink->failed()) outcome.code = ExitCode::kOutput;
    }
  }
  for (Output& output : *outputs) {
    for (const auto& [path, status] : output.sink->drain()) {
      failed.push_back(std::string(status.message()));
      --output.written;
    }
    outcome.written += output.written;
    if (output.boxes.is_open() && !output.boxes.flush()) {
      failed.push_back(absl::StrCat(job.boxes, ": can't be written"));
    }
    if (output.video == nullptr || output.written == 0) continue;
    if (absl::Status status = output.video->finish(); !status.ok()) {
      failed.push_back(std::string(status.message()));
    }
  }
  if (stats_file.is_open() && !stats_file.flush()) {
    failed.push_back(absl::StrCat(job.stats, ": can't be written"));
  }
  if (!failed.empty() && outcome.error.empty()) {
    outcome.code = outcome.written == 0 ? ExitCode::kOutput : ExitCode::kSomeFramesFailed;
    outcome.error = failed.size() == 1
                        ? failed[0]
                        : absl::StrCat(failed[0], " (and ", failed.size() - 1, " more)");
  }
  for (const std::string& name : crowd.take_unknown_motions()) {
    outcome.notes.push_back(absl::StrCat("nobody in the cast has a clip for motion '",
                                         absl::CEscape(name), "'; such agents go by their speed"));
  }
  return outcome;
}

}  // namespace throng::server
