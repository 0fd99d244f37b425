#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <functional>
#include <memory>
#include <optional>

#include "client/cli/commands.hpp"

namespace throng::v1 {
class StreamViewResponse;
class ViewOptions;
}  // namespace throng::v1

namespace throng::client {

/// What a viewer asks the server for; its camera as far as it knows it without the site.
v1::ViewOptions options_of(const ViewCommand& command);

/// What there is to see at a time of a crowd (none: now), told by `deadline`.
struct Sight {
  std::int64_t time_us = 0;
  ScriptedSite site;
};
absl::StatusOr<Sight> sight_of(const std::shared_ptr<const Connection>& connection,
                               v1::ViewOptions options, std::optional<std::int64_t> time_us,
                               std::chrono::system_clock::time_point deadline);

/// Sets the camera of a script, whose picture has the size of `options`.
void aim(const CameraScript& script, std::int64_t time_us, ScriptedSite site,
         v1::ViewOptions& options);

/// Whether the crowd, or the server, that was not there may still come by `deadline`; waits a
/// moment if so.
bool may_come(const absl::Status& status, std::chrono::system_clock::time_point deadline);

/// What is to be done after a frame.
enum class Next { kMore, kEnough };

/// Shows a crowd as `command` says: opens the stream (waiting `wait_s` for server and crowd),
/// acknowledges every frame after `on_frame` has seen it, and ends when that says enough, when the
/// program is interrupted (OK) or when the stream breaks (its status).
absl::Status stream_view(const ViewCommand& command,
                         const std::function<Next(const v1::StreamViewResponse&)>& on_frame);

}  // namespace throng::client
