#include "client/cli/view_stream.hpp"

#include <absl/strings/numbers.h>
#include <absl/strings/str_cat.h>
#include <absl/strings/str_split.h>

#include <chrono>
#include <cmath>
#include <condition_variable>
#include <mutex>
#include <string>
#include <vector>

#include "client/cli/interrupt.hpp"
#include "client/view/view_stream.hpp"
#include "throng/v1/view.pb.h"

namespace throng::client {
namespace {

void fill(const double (&from)[3], v1::Vec3& to) {
  to.set_x(from[0]);
  to.set_y(from[1]);
  to.set_z(from[2]);
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
  if (const auto camera = parse_camera(command.camera)) {
    fill(camera->eye, *options.mutable_camera()->mutable_eye());
    fill(camera->target, *options.mutable_camera()->mutable_target());
  }
  return options;
}

std::optional<CameraText> parse_camera(const std::string& text) {
  const std::vector<std::string> numbers = absl::StrSplit(text, absl::ByAnyChar(",:"));
  const std::size_t colon = text.find(':');
  if (numbers.size() != 6 || colon == std::string::npos || colon != text.rfind(':')) {
    return std::nullopt;
  }
  CameraText camera{};
  for (std::size_t i = 0; i < 6; ++i) {
    double& value = i < 3 ? camera.eye[i] : camera.target[i - 3];
    if (!absl::SimpleAtod(numbers[i], &value) || !std::isfinite(value)) return std::nullopt;
  }
  return camera;
}

absl::Status stream_view(const ViewCommand& command,
                         const std::function<Next(const v1::StreamViewResponse&)>& on_frame) {
  using Clock = std::chrono::steady_clock;
  const auto connection = Connection::open(command.common.connection);
  if (!connection.ok()) return connection.status();
  const auto give_up =
      Clock::now() + std::chrono::milliseconds(static_cast<std::int64_t>(1000 * command.wait_s));
  for (;;) {
    ViewStream stream(*connection, options_of(command));
    const OnInterrupt cancel([&stream] { stream.cancel(); });
    v1::StreamViewRequest request;
    v1::StreamViewResponse frame;
    bool open = true, enough = false, any = false;
    while (open && !enough && stream.read(frame)) {
      any = true;
      enough = on_frame(frame) == Next::kEnough;
      request.set_acked_frame_index(frame.frame_index());
      open = enough || stream.send(request);
    }
    if (enough || interrupted() != 0) return absl::OkStatus();
    const absl::Status status = stream.finish();

    // The crowd, or the server, may still come.
    const bool may_come = absl::IsNotFound(status) || absl::IsUnavailable(status);
    if (any || !may_come || Clock::now() >= give_up) {
      return status.ok() ? absl::UnavailableError("the server ended the stream") : status;
    }
    std::mutex mutex;
    std::condition_variable never;
    std::unique_lock lock(mutex);
    never.wait_for(lock, std::chrono::milliseconds(200), [] { return interrupted() != 0; });
  }
}

}  // namespace throng::client
