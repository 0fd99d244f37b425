#pragma once

#include <absl/status/status.h>

#include <chrono>
#include <memory>
#include <optional>

#include "throng/client/connection.hpp"

namespace throng::v1 {
class StreamViewRequest;
class StreamViewResponse;
class ViewOptions;
}  // namespace throng::v1

namespace throng::client {

/// One call of StreamView. One thread reads, one (perhaps another) sends, any may cancel.
class ViewStream {
 public:
  /// Opens the stream; does not wait for the server, unless all of it must end by `deadline`.
  ViewStream(std::shared_ptr<const Connection> connection, const v1::ViewOptions& options,
             std::optional<std::chrono::system_clock::time_point> deadline = std::nullopt);
  ~ViewStream();
  ViewStream(const ViewStream&) = delete;
  ViewStream& operator=(const ViewStream&) = delete;

  /// Waits for a frame. False: the stream has ended, `finish` says why.
  bool read(v1::StreamViewResponse& frame);

  /// False: the stream has ended.
  bool send(const v1::StreamViewRequest& request);

  void cancel();

  /// How it ended; call once, when nobody sends any more. Reads what is left.
  absl::Status finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace throng::client
