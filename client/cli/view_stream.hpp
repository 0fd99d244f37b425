#pragma once

#include <absl/status/status.h>

#include <functional>

#include "client/cli/commands.hpp"

namespace throng::v1 {
class StreamViewResponse;
class ViewOptions;
}  // namespace throng::v1

namespace throng::client {

/// What a viewer asks the server for.
v1::ViewOptions options_of(const ViewCommand& command);

/// What is to be done after a frame.
enum class Next { kMore, kEnough };

/// Shows a crowd as `command` says: opens the stream (waiting `wait_s` for server and crowd),
/// acknowledges every frame after `on_frame` has seen it, and ends when that says enough, when the
/// program is interrupted (OK) or when the stream breaks (its status).
absl::Status stream_view(const ViewCommand& command,
                         const std::function<Next(const v1::StreamViewResponse&)>& on_frame);

}  // namespace throng::client
