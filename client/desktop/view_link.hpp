#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "client/view/view_stream.hpp"
#include "throng/render/encode.hpp"
#include "throng/v1/crowd.pb.h"
#include "throng/v1/server.pb.h"
#include "throng/v1/view.pb.h"

namespace throng::client {

/// A frame with its picture decoded.
struct ReceivedFrame {
  v1::StreamViewResponse message;  // without the image
  std::shared_ptr<const render::DecodedImage> image;
};

/// kWaiting: the server is there, the crowd is not. kRefused: the token is missing or wrong.
enum class LinkState { kConnecting, kOpen, kWaiting, kLost, kRefused };
const char* name_of(LinkState state);

/// The talk with the server, on threads of its own; it comes back by itself after a loss. What it
/// brings is fetched by the window's thread, which is never made to wait.
class ViewLink {
 public:
  /// @param wake  called from other threads when there is something to fetch.
  static absl::StatusOr<std::unique_ptr<ViewLink>> open(const ConnectionOptions& options,
                                                        std::function<void()> wake);
  ~ViewLink();

  /// @param change  goes to the server soon; several become one message.
  /// @param whole  what a new stream begins with.
  void ask(const v1::ViewOptions& change, const v1::ViewOptions& whole);

  /// The newest frame that was not fetched yet; older ones are left out.
  std::optional<ReceivedFrame> take();

  /// Answers come through `deliver`. An answer that fails is none.
  void list_crowds(std::function<void(const v1::ListCrowdsResponse&)> then);
  void get_server_info(std::function<void(const v1::GetServerInfoResponse&)> then);
  void pick(v1::PickAgentRequest request, std::function<void(const v1::PickAgentResponse&)> then);

  /// Calls what is waiting for its answer, on the caller's thread.
  void deliver();

  struct Status {
    LinkState state = LinkState::kConnecting;
    std::string message;  // of what went wrong last
    std::uint64_t received_bytes = 0;
    std::uint64_t left_out = 0;  // frames that nobody fetched
  };
  Status status() const;
  void retry_now();
  const std::string& address() const { return connection_->address(); }

 private:
  ViewLink(std::shared_ptr<const Connection> connection, std::function<void()> wake);
  void run_stream();
  void run_writer(ViewStream& stream);
  void run_errands();
  void receive(v1::StreamViewResponse& message);
  void end_stream(const absl::Status& status);
  struct Call;  // one unary call

  const std::shared_ptr<const Connection> connection_;
  const std::function<void()> wake_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  bool stopping_ = false, retry_now_ = false, writer_ends_ = false;
  std::optional<v1::ViewOptions> whole_, change_;
  std::uint64_t ack_ = 0;
  ViewStream* stream_ = nullptr;
  std::optional<ReceivedFrame> newest_;
  std::shared_ptr<const render::DecodedImage> last_image_;  // of the stream's thread
  Status status_;
  std::deque<std::function<void()>> errands_, answers_;
  std::thread stream_thread_, errand_thread_;
};

/// Adds what `change` carries to `options`.
void merge_options(const v1::ViewOptions& change, v1::ViewOptions& options);

}  // namespace throng::client
