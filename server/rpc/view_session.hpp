#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>

#include "server/view/viewer.hpp"

namespace throng::v1 {
class PickAgentRequest;
class PickAgentResponse;
class StreamViewRequest;
class StreamViewResponse;
}  // namespace throng::v1

namespace throng::server {

struct Services;

/// One view and the talk about it, whatever carries the messages: a gRPC stream or a WebSocket.
class ViewSession {
 public:
  /// @param connection  number in the log.
  /// @param on_frame    called from any thread when `take` has something.
  /// @param on_end      called at most once, when nothing more can be shown (a deleted crowd).
  ViewSession(Services& services, std::uint64_t connection, std::function<void()> on_frame,
              std::function<void(absl::Status)> on_end);
  ~ViewSession();
  ViewSession(const ViewSession&) = delete;
  ViewSession& operator=(const ViewSession&) = delete;

  /// Errors as ViewService.StreamView; after one, what is shown stays as it was. One thread at a
  /// time.
  absl::Status handle(const v1::StreamViewRequest& message);
  /// The frame to send next. Any thread.
  std::optional<OutgoingFrame> take();
  /// All fields of a frame but its image, and what this viewer asked for beside it.
  void describe(const OutgoingFrame& outgoing, v1::StreamViewResponse& response) const;
  /// Frees its place. Nothing is taken or handled after.
  void close();

 private:
  absl::Status admit();

  Services& services_;
  const std::uint64_t connection_;
  const std::function<void()> on_frame_;
  const std::function<void(absl::Status)> on_end_;
  ViewRequest wanted_;
  bool admitted_ = false;
  mutable std::mutex viewer_mutex_;  // viewer_ is set once, while the loop's threads may look
  std::shared_ptr<Viewer> viewer_;
};

/// Answers ViewService.PickAgent.
absl::Status pick_agent(Services& services, const v1::PickAgentRequest& request,
                        v1::PickAgentResponse& response);

}  // namespace throng::server
