#include "client/cli/view_stream.hpp"

#include <absl/strings/str_cat.h>

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <string>

#include "client/cli/interrupt.hpp"
#include "client/view/color_map.hpp"
#include "client/view/view_stream.hpp"
#include "throng/v1/view.pb.h"

namespace throng::client {
namespace {

void fill(const glm::dvec3& from, v1::Vec3& to) {
  to.set_x(from.x);
  to.set_y(from.y);
  to.set_z(from.z);
}

glm::dvec3 point_of(const v1::Vec3& from) { return {from.x(), from.y(), from.z()}; }

ScriptedSite box_of(const v1::StreamViewResponse& frame) {
  return {point_of(frame.overview_low()), point_of(frame.overview_high())};
}

}  // namespace

v1::ViewOptions options_of(const ViewCommand& command) {
  v1::ViewOptions options;
  options.set_crowd_name(command.crowd);
  options.set_width_px(command.width_px);
  options.set_height_px(command.height_px);
  options.set_max_rate_hz(command.fps);
  options.set_jpeg_quality(command.quality);
  if (command.vertex_budget != 0) options.set_vertex_budget(command.vertex_budget);
  if (!command.channel.empty()) options.set_channel(command.channel);
  if (command.channel_low.has_value()) options.set_channel_low(*command.channel_low);
  if (command.channel_high.has_value()) options.set_channel_high(*command.channel_high);
  if (const auto map = render::color_map_of(command.color_map))
    options.set_color_map(wire_of(*map));
  if (!command.camera.has_value() || command.camera->is_overview()) return options;
  if (const CameraScript::Follow* follow = command.camera->follow()) {
    // The server takes the camera along as it stands about this point.
    options.set_follow_agent(follow->agent);
    v1::Camera& camera = *options.mutable_camera();
    fill({0.0, -follow->behind_m, follow->height_m}, *camera.mutable_eye());
    fill({0.0, 0.0, 1.0}, *camera.mutable_target());
    camera.set_fov_y_deg(follow->fov_y_deg);
  } else if (!command.camera->needs_site()) {
    aim(*command.camera, 0, {}, options);
  }
  return options;
}

absl::StatusOr<Sight> sight_of(const std::shared_ptr<const Connection>& connection,
                               v1::ViewOptions options, std::optional<std::int64_t> time_us,
                               std::chrono::system_clock::time_point deadline) {
  options.set_overview(true);
  options.clear_camera();
  options.set_width_px(64);
  options.set_height_px(64);
  if (time_us.has_value()) {
    options.mutable_playback()->set_scene_time_us(*time_us);
    options.mutable_playback()->set_paused(true);
  }
  ViewStream stream(connection, options, deadline);
  const OnInterrupt cancel([&stream] { stream.cancel(); });
  v1::StreamViewResponse frame;
  if (!stream.read(frame)) {
    const absl::Status status = stream.finish();
    return status.ok() ? absl::UnavailableError("the server ended the stream") : status;
  }
  stream.cancel();
  (void)stream.finish();
  return Sight{frame.scene_time_us(), box_of(frame)};
}

void aim(const CameraScript& script, std::int64_t time_us, ScriptedSite site,
         v1::ViewOptions& options) {
  site.aspect = static_cast<double>(options.width_px()) / options.height_px();
  const ScriptedCamera camera = script.at(1e-6 * static_cast<double>(time_us), site);
  v1::Camera& message = *options.mutable_camera();
  fill(camera.eye_world, *message.mutable_eye());
  fill(camera.target_world, *message.mutable_target());
  fill(camera.up_world, *message.mutable_up());
  if (camera.ortho_height_m > 0.0) {
    message.set_ortho_height_m(camera.ortho_height_m);
  } else {
    message.set_fov_y_deg(camera.fov_y_deg);
  }
}

bool may_come(const absl::Status& status, std::chrono::system_clock::time_point deadline) {
  if (!absl::IsNotFound(status) && !absl::IsUnavailable(status)) return false;
  if (std::chrono::system_clock::now() >= deadline) return false;
  std::mutex mutex;
  std::condition_variable never;
  std::unique_lock lock(mutex);
  never.wait_for(lock, std::chrono::milliseconds(200), [] { return interrupted() != 0; });
  return true;
}

absl::Status stream_view(const ViewCommand& command,
                         const std::function<Next(const v1::StreamViewResponse&)>& on_frame) {
  using Clock = std::chrono::system_clock;
  const auto connection = Connection::open(command.common.connection);
  if (!connection.ok()) return connection.status();
  const auto give_up =
      Clock::now() + std::chrono::milliseconds(static_cast<std::int64_t>(1000 * command.wait_s));
  for (;;) {
    const v1::ViewOptions options = options_of(command);
    ViewStream stream(*connection, options);
    const OnInterrupt cancel([&stream] { stream.cancel(); });
    v1::StreamViewRequest request;
    v1::StreamViewResponse frame;
    bool open = true, enough = false, any = false;
    std::uint64_t stamp = 0;
    bool was_there = false;  // whom the camera follows
    const bool aims = command.camera && (command.camera->moves() || command.camera->needs_site());
    while (open && !enough && stream.read(frame)) {
      any = true;
      if (options.follow_agent() != 0 && !was_there && frame.stats().agents() > 0) {
        was_there = frame.followed_agent() != 0;
        if (!was_there) {
          return absl::FailedPreconditionError(absl::StrCat("--camera: there is no agent ",
                                                            options.follow_agent(), " in '",
                                                            command.crowd, "' now"));
        }
      }
      // What was drawn before the camera knew of the crowd is not meant.
      if (!aims || frame.stamp() > 0) enough = on_frame(frame) == Next::kEnough;
      if (aims && (stamp == 0 || command.camera->moves())) {
        v1::ViewOptions& changed = *request.mutable_options();
        changed.set_width_px(options.width_px());
        changed.set_height_px(options.height_px());
        changed.set_stamp(++stamp);
        aim(*command.camera, frame.scene_time_us(), box_of(frame), changed);
      } else {
        request.clear_options();
      }
      request.set_acked_frame_index(frame.frame_index());
      open = enough || stream.send(request);
    }
    if (enough || interrupted() != 0) return absl::OkStatus();
    const absl::Status status = stream.finish();
    if (any || !may_come(status, give_up)) {
      return status.ok() ? absl::UnavailableError("the server ended the stream") : status;
    }
  }
}

}  // namespace throng::client
