#include "server/rpc/convert.hpp"

#include <absl/strings/str_cat.h>

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
                           ViewRequest& request) {
  const Limits& limits = registry.limits();
  ViewRequest next = request;
  if (options.has_crowd_name()) {
    auto crowd = registry.find(options.crowd_name());
    if (!crowd.ok()) return crowd.status();
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
      return absl::InvalidArgumentError(absl::StrCat("options.channel: crowd '", next.crowd->name(),
                                                     "' has no channel of the name given"));
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
  if (options.has_shadows()) next.shadows = options.shadows();
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
