#include "server/rpc/convert.hpp"

#include <absl/strings/str_cat.h>
#include <absl/strings/str_join.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "throng/v1/crowd.pb.h"
#include "throng/v1/ingest.pb.h"
#include "throng/v1/view.pb.h"

namespace throng::server {
namespace {

constexpr double kFarthestM = 1e9;
constexpr const char* kAxes[] = {"x", "y", "z"};

absl::StatusOr<glm::dvec3> point_from(const char* field, const v1::Vec3& message) {
  const glm::dvec3 point(message.x(), message.y(), message.z());
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(point[axis]) || std::abs(point[axis]) > kFarthestM) {
      return absl::InvalidArgumentError(absl::StrCat("camera.", field, ".", kAxes[axis], ": it is ",
                                                     point[axis], ", must be within +-",
                                                     kFarthestM));
    }
  }
  return point;
}

void fill_point(const glm::dvec3& point, v1::Vec3& message) {
  message.set_x(point.x);
  message.set_y(point.y);
  message.set_z(point.z);
}

absl::Status out_of_range(const char* field, double value, double low, double high) {
  return absl::InvalidArgumentError(
      absl::StrCat("options.", field, ": it is ", value, ", must be ", low, " to ", high));
}

constexpr std::uint32_t kMostAgentColumns = 5000;  // 20 bytes each, in every frame

/// The time of the frame `steps` frames on from (or before) `time_us`, within the history.
std::int64_t stepped(const render::Crowd& crowd, std::int64_t time_us, std::int32_t steps) {
  for (; steps > 0; --steps) {
    const render::Bracket bracket = crowd.bracket(time_us);
    if (bracket.newer == nullptr || bracket.newer->time_us <= time_us) break;
    time_us = bracket.newer->time_us;
  }
  for (; steps < 0; ++steps) {
    const render::Bracket bracket = crowd.bracket(time_us - 1);
    if (bracket.older == nullptr || bracket.older->time_us >= time_us) break;
    time_us = bracket.older->time_us;
  }
  return time_us;
}

absl::Status apply_playback(const v1::Playback& playback, Clock::time_point now,
                            ViewRequest& request) {
  constexpr double kSlowest = 0.01, kFastest = 64.0;
  constexpr std::int32_t kMostSteps = 1000;
  const Moment moment = request.crowd->moment(now);
  Playhead& playhead = request.playhead;
  const std::int64_t here_us = playhead.at(now, moment.oldest_time_us, moment.scene_time_us);
  if (playback.has_speed()) {
    const double size = std::abs(playback.speed());
    if (!(size >= kSlowest && size <= kFastest)) {
      return absl::InvalidArgumentError(absl::StrCat("options.playback.speed: it is ",
                                                     playback.speed(), ", must be ", kSlowest,
                                                     " to ", kFastest, " or the same below 0"));
    }
    if (!playhead.live || playback.speed() != 1.0) playhead.go_to(here_us, now);
    playhead.speed = playback.speed();
  }
  if (playback.has_paused()) {
    if (!playhead.live || playback.paused()) playhead.go_to(here_us, now);
    playhead.paused = playback.paused();
  }
  switch (playback.move_case()) {
    case v1::Playback::kLive:
      if (playback.live()) {
        playhead = Playhead();
      } else {
        playhead.go_to(here_us, now);
      }
      break;
    case v1::Playback::kSceneTimeUs: {
      absl::Status status =
          check_scene_time("options.playback.scene_time_us", playback.scene_time_us());
      if (!status.ok()) return status;
      playhead.go_to(
          std::clamp(playback.scene_time_us(),
                     std::min(moment.oldest_time_us, moment.scene_time_us), moment.scene_time_us),
          now);
      break;
    }
    case v1::Playback::kStepFrames:
      if (std::abs(static_cast<std::int64_t>(playback.step_frames())) > kMostSteps) {
        return absl::InvalidArgumentError(absl::StrCat("options.playback.step_frames: it is ",
                                                       playback.step_frames(),
                                                       ", must be within +-", kMostSteps));
      }
      playhead.go_to(stepped(*moment.crowd, here_us, playback.step_frames()), now);
      playhead.paused = true;
      break;
    case v1::Playback::MOVE_NOT_SET:
      break;
  }
  return absl::OkStatus();
}

}  // namespace

grpc::Status to_grpc(const absl::Status& status) {
  return grpc::Status(static_cast<grpc::StatusCode>(status.code()), std::string(status.message()));
}

absl::StatusOr<render::Camera> camera_from(const v1::Camera& message) {
  render::Camera camera;
  const auto eye = point_from("eye", message.eye());
  if (!eye.ok()) return eye.status();
  const auto target = point_from("target", message.target());
  if (!target.ok()) return target.status();
  camera.eye_world = *eye;
  camera.target_world = *target;
  if (glm::length(*target - *eye) < 1e-6) {
    return absl::InvalidArgumentError("camera.target: it is where camera.eye is");
  }
  if (message.has_up()) {
    const auto up = point_from("up", message.up());
    if (!up.ok()) return up.status();
    if (glm::length(*up) < 1e-6) return absl::InvalidArgumentError("camera.up: it is zero");
    camera.up_world = glm::normalize(*up);
  }
  if (message.projection_case() == v1::Camera::kFovYDeg) {
    const double degrees = message.fov_y_deg();
    if (!(degrees > 0.0 && degrees < 170.0)) {
      return absl::InvalidArgumentError(
          absl::StrCat("camera.fov_y_deg: it is ", degrees, ", must be over 0 and under 170"));
    }
    camera.fov_y_rad = degrees * std::numbers::pi / 180.0;
  } else if (message.projection_case() == v1::Camera::kOrthoHeightM) {
    const double height_m = message.ortho_height_m();
    if (!(height_m > 0.0 && height_m <= kFarthestM)) {
      return absl::InvalidArgumentError(absl::StrCat("camera.ortho_height_m: it is ", height_m,
                                                     ", must be over 0 and up to ", kFarthestM));
    }
    camera.ortho_height_m = height_m;
  }
  return camera;
}

void fill_camera(const render::Camera& camera, v1::Camera& message) {
  fill_point(camera.eye_world, *message.mutable_eye());
  fill_point(camera.target_world, *message.mutable_target());
  fill_point(camera.up_world, *message.mutable_up());
  if (camera.ortho_height_m > 0.0) {
    message.set_ortho_height_m(camera.ortho_height_m);
  } else {
    message.set_fov_y_deg(camera.fov_y_rad * 180.0 / std::numbers::pi);
  }
}

absl::Status apply_options(const v1::ViewOptions& options, const Registry& registry,
                           Clock::time_point now, ViewRequest& request) {
  const Limits& limits = registry.limits();
  ViewRequest next = request;
  if (options.has_crowd_name()) {
    auto crowd = registry.find(options.crowd_name());
    if (!crowd.ok()) return crowd.status();
    if (next.crowd != *crowd) {
      // Times and agents are the crowd's own.
      next.playhead = Playhead();
      next.follow_agent = 0;
    }
    next.crowd = *std::move(crowd);
  }
  if (next.crowd == nullptr) {
    return absl::InvalidArgumentError("options.crowd_name: the first message must name a crowd");
  }
  if (options.overview() && options.has_camera()) {
    return absl::InvalidArgumentError("options: both camera and overview are set");
  }
  if (options.overview()) next.camera.reset();
  if (options.has_camera()) {
    const auto camera = camera_from(options.camera());
    if (!camera.ok()) return camera.status();
    next.camera = *camera;
  }
  constexpr std::uint32_t kSmallestPx = 16;
  // The defaults, too, keep to a limit that was set below them.
  next.viewport.width_px = std::min(next.viewport.width_px, limits.max_width_px);
  next.viewport.height_px = std::min(next.viewport.height_px, limits.max_height_px);
  if (options.has_width_px()) {
    if (options.width_px() < kSmallestPx || options.width_px() > limits.max_width_px) {
      return out_of_range("width_px", options.width_px(), kSmallestPx, limits.max_width_px);
    }
    next.viewport.width_px = options.width_px();
  }
  if (options.has_height_px()) {
    if (options.height_px() < kSmallestPx || options.height_px() > limits.max_height_px) {
      return out_of_range("height_px", options.height_px(), kSmallestPx, limits.max_height_px);
    }
    next.viewport.height_px = options.height_px();
  }
  if (options.has_jpeg_quality()) {
    if (options.jpeg_quality() < 1 || options.jpeg_quality() > 100) {
      return out_of_range("jpeg_quality", options.jpeg_quality(), 1, 100);
    }
    next.jpeg_quality = static_cast<int>(options.jpeg_quality());
  }
  if (options.has_max_rate_hz()) {
    constexpr double kLowestHz = 0.01, kHighestHz = 1000.0;
    if (!(options.max_rate_hz() >= kLowestHz && options.max_rate_hz() <= kHighestHz)) {
      return out_of_range("max_rate_hz", options.max_rate_hz(), kLowestHz, kHighestHz);
    }
    next.max_rate_hz = options.max_rate_hz();
  }
  next.max_rate_hz = std::min(next.max_rate_hz, limits.max_rate_hz);
  if (options.has_vertex_budget()) {
    if (options.vertex_budget() > limits.max_vertex_budget) {
      return out_of_range("vertex_budget", static_cast<double>(options.vertex_budget()), 0,
                          static_cast<double>(limits.max_vertex_budget));
    }
    next.vertex_budget = options.vertex_budget();
  }
  if (options.has_channel()) {
    if (!options.channel().empty() && next.crowd->channel_index(options.channel()) < 0) {
      std::vector<std::string> names;
      for (const ChannelInfo& channel : next.crowd->channels()) names.push_back(channel.name);
      return absl::InvalidArgumentError(
          absl::StrCat("options.channel: crowd '", next.crowd->name(), "' has no channel '",
                       options.channel().substr(0, 64), "'; it has ",
                       names.empty() ? "only speed" : absl::StrJoin(names, ", ")));
    }
    next.channel = options.channel();
  }
  if (options.has_channel_low()) next.channel_low = static_cast<float>(options.channel_low());
  if (options.has_channel_high()) next.channel_high = static_cast<float>(options.channel_high());
  if (!std::isfinite(next.channel_low) || !std::isfinite(next.channel_high) ||
      !(next.channel_low < next.channel_high)) {
    return absl::InvalidArgumentError(absl::StrCat("options.channel_low: it is ", next.channel_low,
                                                   ", must be under channel_high, ",
                                                   next.channel_high));
  }
  if (options.has_color_map()) {
    if (!v1::ColorMap_IsValid(options.color_map()) ||
        options.color_map() == v1::COLOR_MAP_UNSPECIFIED) {
      return absl::InvalidArgumentError(
          absl::StrCat("options.color_map: ", static_cast<int>(options.color_map()),
                       " is no map; there are ", absl::StrJoin(render::kColorMapNames, ", ")));
    }
    next.color_map = static_cast<render::ColorMap>(options.color_map() - 1);
  }
  if (options.has_shadows()) next.shadows = options.shadows();
  if (options.has_follow_agent()) next.follow_agent = options.follow_agent();
  if (options.has_max_agent_columns()) {
    if (options.max_agent_columns() > kMostAgentColumns) {
      return out_of_range("max_agent_columns", options.max_agent_columns(), 0, kMostAgentColumns);
    }
    next.max_agent_columns = options.max_agent_columns();
  }
  if (options.has_density()) next.density = options.density();
  if (options.has_stamp()) next.stamp = options.stamp();
  if (options.has_playback()) {
    absl::Status status = apply_playback(options.playback(), now, next);
    if (!status.ok()) return status;
  }
  request = std::move(next);
  return absl::OkStatus();
}

void fill_stats(const EncodedFrame& frame, v1::FrameStats& message) {
  const render::StageTimes& from = frame.stats.times;
  v1::StageTimes& times = *message.mutable_times();
  times.set_advance_ms(from.advance_ms);
  times.set_cull_ms(from.cull_ms);
  times.set_select_ms(from.select_ms);
  times.set_allocate_ms(from.allocate_ms);
  times.set_generate_ms(from.generate_ms);
  times.set_raster_ms(from.raster_ms);
  times.set_resolve_ms(from.resolve_ms);
  times.set_read_back_ms(from.read_back_ms);
  times.set_encode_ms(from.encode_ms);
  const render::ComputeCounters& counters = frame.stats.counters;
  message.set_agents(counters.agents);
  message.set_visible(counters.visible);
  message.set_vertices(counters.vertices);
  message.set_triangles(counters.triangles);
  message.set_vertex_budget(frame.vertex_budget);
  message.set_effective_budget(counters.effective_budget);
  const auto drawn_as = [&counters](render::Representation form) {
    return counters.drawn_as[static_cast<std::size_t>(form)];
  };
  message.set_as_meshes(drawn_as(render::Representation::kMesh));
  message.set_as_impostors(drawn_as(render::Representation::kImpostor));
  message.set_as_points(drawn_as(render::Representation::kPoints));
  message.set_left_out(drawn_as(render::Representation::kNone));
  message.set_as_specks(drawn_as(render::Representation::kSpeck));
  message.set_target_ms(frame.target_ms);
  message.set_error_px(counters.error_px);
  message.set_oversampling(frame.oversampling);
  message.set_in_full(frame.in_full);
}

void fill_frame(const OutgoingFrame& outgoing, v1::StreamViewResponse& message) {
  const EncodedFrame& frame = *outgoing.frame;
  message.set_frame_index(outgoing.frame_index);
  message.set_skipped_frames(outgoing.skipped_frames);
  message.set_stamp(outgoing.stamp);
  message.set_scene_time_us(frame.scene_time_us);
  message.set_capture_time_us(outgoing.history.newest_time_us);
  message.set_oldest_time_us(outgoing.history.oldest_time_us);
  message.set_width_px(frame.viewport.width_px);
  message.set_height_px(frame.viewport.height_px);
  message.set_server_ms(frame.server_ms);
  message.set_live(outgoing.history.live);
  message.set_followed_agent(frame.followed_agent);
  fill_stats(frame, *message.mutable_stats());
  fill_camera(frame.camera, *message.mutable_camera());
  fill_point(frame.overview.low, *message.mutable_overview_low());
  fill_point(frame.overview.high, *message.mutable_overview_high());
}

void fill_playback(const Playhead& playhead, std::int64_t scene_time_us, v1::Playback& message) {
  if (playhead.live) {
    message.set_live(true);
  } else {
    message.set_scene_time_us(scene_time_us);
  }
  message.set_paused(playhead.paused);
  message.set_speed(playhead.speed);
}

namespace {

template <typename T>
void set_bytes(const std::vector<T>& column, std::string& bytes) {
  bytes.assign(reinterpret_cast<const char*>(column.data()), column.size() * sizeof(T));
}

}  // namespace

void fill_agents(const AgentList& agents, const glm::dvec3& origin_world,
                 v1::AgentColumns& message) {
  set_bytes(agents.ids, *message.mutable_ids());
  set_bytes(agents.position_m, *message.mutable_positions());
  set_bytes(agents.values, *message.mutable_values());
  fill_point(origin_world, *message.mutable_origin());
  message.set_left_out(agents.left_out);
}

void fill_density(const DensityMap& map, v1::DensityGrid& message) {
  message.set_low_x(map.low_world.x);
  message.set_low_y(map.low_world.y);
  message.set_ground_z(map.low_world.z);
  message.set_cell_m(map.cell_m);
  message.set_columns(map.columns);
  message.set_highest(map.highest);
  std::string& levels = *message.mutable_levels();
  levels.reserve(map.density.size());
  for (const float density : map.density) {
    const float level = map.highest > 0.0F ? 255.0F * density / map.highest : 0.0F;
    levels.push_back(static_cast<char>(static_cast<unsigned char>(level + 0.5F)));
  }
}

void fill_agent(const ShownAgent& agent, const AgentsAt& agents, const NamedCrowd& named,
                const render::Crowd& crowd, v1::PickAgentResponse& message) {
  message.set_found(true);
  message.set_id(agent.id);
  fill_point(agent.position_world, *message.mutable_position());
  message.set_speed_mps(agent.speed_mps);
  message.set_heading_rad(agent.heading_rad);
  const render::Snapshot& snapshot = *agents.bracket.older;
  if (agent.slot < snapshot.roster->id.size() && snapshot.roster->id[agent.slot] == agent.id) {
    const std::size_t character = snapshot.roster->character[agent.slot];
    if (character < crowd.cast().members.size()) {
      message.set_character(crowd.cast().members[character].character.name);
    }
    const std::vector<ChannelInfo> channels = named.channels();
    for (std::size_t i = 0; i < channels.size() && i < snapshot.channels.size(); ++i) {
      v1::NamedValue& value = *message.add_values();
      value.mutable_channel()->set_name(channels[i].name);
      value.mutable_channel()->set_unit(channels[i].unit);
      value.set_value(snapshot.channels[i][agent.slot]);
    }
  }
}

void fill_crowd(const CrowdReport& report, v1::CrowdInfo& message) {
  message.set_name(report.name);
  message.set_agents(report.agents);
  message.set_live(report.live);
  message.set_producer(report.producer);
  message.set_viewers(report.viewers);
  message.set_oldest_time_us(report.oldest_time_us);
  message.set_newest_time_us(report.newest_time_us);
  message.set_frames(report.frames);
  message.set_late_frames(report.late_frames);
  message.set_incomplete_frames(report.incomplete_frames);
  fill_point(report.box.low, *message.mutable_low());
  fill_point(report.box.high, *message.mutable_high());
  for (const ChannelInfo& channel : report.channels) {
    v1::Channel& added = *message.add_channels();
    added.set_name(channel.name);
    added.set_unit(channel.unit);
  }
  message.set_history_bytes(report.history_bytes);
  message.set_run_id(report.run_id);
  message.set_walkable_area_wkt(report.walkable_area_wkt);
  message.set_recorded_frames(report.recorded.written_frames);
  message.set_unrecorded_frames(report.recorded.lost_frames);
}

StartRequest start_request_from(const v1::StartPublishing& start) {
  StartRequest request;
  request.crowd_name = start.crowd_name();
  request.run_id = start.run_id();
  request.origin_world = {start.origin().x(), start.origin().y(), start.origin().z()};
  for (const v1::Channel& channel : start.channels()) {
    request.channels.push_back({channel.name(), channel.unit()});
  }
  request.seed = start.seed();
  request.take_over = start.take_over();
  request.producer = start.producer();
  request.expected_rate_hz = start.expected_rate_hz();
  return request;
}

}  // namespace throng::server
