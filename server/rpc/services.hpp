#pragma once

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <unordered_map>
#include <utility>

#include "server/rpc/token_gate.hpp"
#include "server/rpc/worker.hpp"
#include "server/scene/registry.hpp"
#include "server/view/render_loop.hpp"

namespace throng::v1 {
class GetServerInfoResponse;
}

namespace throng::server {

/// A call that lasts, as far as draining the server has to know it.
class Stream {
 public:
  virtual ~Stream() = default;
  /// Ends the call as soon as nothing is in flight. Any thread; the first status counts.
  virtual void finish(absl::Status status) = 0;
};

/// The streams that are open. Thread safe.
class StreamSet {
 public:
  /// False while the server drains: the stream must end with Unavailable.
  bool add(const std::shared_ptr<Stream>& stream) {
    const std::lock_guard lock(mutex_);
    if (draining_) return false;
    streams_[stream.get()] = stream;
    return true;
  }
  void remove(const Stream* stream) {
    const std::lock_guard lock(mutex_);
    streams_.erase(stream);
  }
  /// Ends all streams, and all that come later.
  void drain() {
    std::unordered_map<const Stream*, std::weak_ptr<Stream>> streams;
    {
      const std::lock_guard lock(mutex_);
      draining_ = true;
      streams = streams_;
    }
    for (const auto& [key, weak] : streams) {
      if (const std::shared_ptr<Stream> stream = weak.lock()) {
        stream->finish(absl::UnavailableError("the server is draining"));
      }
    }
  }

 private:
  std::mutex mutex_;
  bool draining_ = false;
  std::unordered_map<const Stream*, std::weak_ptr<Stream>> streams_;
};

/// What all handlers share.
struct Services {
  Registry* registry = nullptr;
  RenderLoop* loop = nullptr;
  Worker* worker = nullptr;
  std::shared_ptr<const TokenGate> gate;
  std::string server_run_id;
  std::shared_ptr<const v1::GetServerInfoResponse> info;  // but for its uptime
  Clock::time_point began = Clock::now();
  Now now;
  StreamSet streams;
  std::atomic<std::uint32_t> viewers{0};
  std::atomic<std::uint64_t> connections{0};  // numbers streams in the log

  absl::Status authorize(const grpc::CallbackServerContext& context) const {
    const auto found = context.client_metadata().find("authorization");
    if (found == context.client_metadata().end()) return gate->check(nullptr);
    const std::string_view value(found->second.data(), found->second.size());
    return gate->check(&value);
  }
};

/// What the two streaming handlers have in common: one read and one write in flight, `Finish`
/// exactly once and not while a write is in flight or a message is being handled, deletion in
/// `OnDone`.
///
/// A handler that works on another thread keeps a `Hold`. Any thread may call `finish` and `pump`.
template <typename Request, typename Response>
class BidiStream : public grpc::ServerBidiReactor<Request, Response>,
                   public Stream,
                   public std::enable_shared_from_this<BidiStream<Request, Response>> {
 public:
  /// Hands the stream over to gRPC, which deletes it.
  static grpc::ServerBidiReactor<Request, Response>* open(
      std::shared_ptr<BidiStream> stream, const grpc::CallbackServerContext& context) {
    BidiStream* raw = stream.get();
    raw->self_ = std::move(stream);
    if (absl::Status status = raw->services_.authorize(context); !status.ok()) {
      raw->finish(std::move(status));
    } else if (!raw->services_.streams.add(raw->self_)) {
      raw->finish(absl::UnavailableError("the server is draining"));
    } else {
      raw->StartRead(&raw->request_);
    }
    return raw;
  }

  void finish(absl::Status status) final {
    {
      const std::lock_guard lock(mutex_);
      if (!finish_status_.has_value()) finish_status_ = std::move(status);
    }
    pump();
  }

  void OnReadDone(bool ok) final {
    if (!ok) {
      on_half_close();
      finish(absl::OkStatus());
      return;
    }
    {
      const std::lock_guard lock(mutex_);
      ++holds_;
    }
    on_message();
  }

  void OnWriteDone(bool ok) final {
    {
      const std::lock_guard lock(mutex_);
      writing_ = false;
      broken_ = broken_ || !ok;
    }
    pump();
  }

  void OnCancel() final {
    {
      const std::lock_guard lock(mutex_);
      broken_ = true;
    }
    finish(absl::CancelledError("the call was cancelled"));
  }

  void OnDone() final {
    services_.streams.remove(this);
    on_done();
    // Whoever still holds the stream (a task, a frame on its way) may only find that it has ended.
    const auto last = std::move(self_);
  }

 protected:
  explicit BidiStream(Services& services)
      : services_(services), connection_(++services.connections) {}

  /// A message lies in `request()`. The handler calls `next_message` when it is done with it, from
  /// any thread.
  virtual void on_message() = 0;
  /// No more messages come; nothing is being handled.
  virtual void on_half_close() {}
  virtual void on_done() = 0;
  /// Puts what is to be written next into `response`; false: nothing. Called by one thread at a
  /// time, under the stream's lock.
  virtual bool next_response(Response& response) = 0;
  /// True if what `next_response` has must be written before an orderly end.
  virtual bool flush_before_end() const { return false; }

  const Request& request() const { return request_; }
  Services& services() { return services_; }
  std::uint64_t connection() const { return connection_; }

  void next_message() {
    bool read = false;
    {
      const std::lock_guard lock(mutex_);
      read = !finish_status_.has_value();
    }
    // The hold is let go of after StartRead, so that no Finish comes before it.
    if (read) this->StartRead(&request_);
    {
      const std::lock_guard lock(mutex_);
      --holds_;
    }
    pump();
  }

  /// Writes or finishes if it is time to.
  void pump() {
    bool write = false;
    grpc::Status end;
    {
      const std::lock_guard lock(mutex_);
      if (finished_ || writing_) return;
      const bool ending = finish_status_.has_value();
      const bool may_write = !broken_ && (!ending || (finish_status_->ok() && flush_before_end()));
      if (may_write && next_response(response_)) {
        write = writing_ = true;
      } else if (ending && holds_ == 0) {
        finished_ = true;
        end = grpc::Status(static_cast<grpc::StatusCode>(finish_status_->code()),
                           std::string(finish_status_->message()));
      } else {
        return;
      }
    }
    // Last of all: after Finish, OnDone may come at any moment.
    if (write) {
      this->StartWrite(&response_);
    } else {
      this->Finish(end);
    }
  }

 private:
  Services& services_;
  const std::uint64_t connection_;
  std::shared_ptr<BidiStream> self_;
  std::mutex mutex_;
  std::optional<absl::Status> finish_status_;
  int holds_ = 0;  // messages being handled
  bool writing_ = false;
  bool broken_ = false;  // nothing can be written any more
  bool finished_ = false;
  Request request_;
  Response response_;
};

/// Answers ServerService.GetServerInfo.
void fill_server_info(const Services& services, v1::GetServerInfoResponse& response);

std::unique_ptr<grpc::Service> make_ingest_service(Services& services);
std::unique_ptr<grpc::Service> make_view_service(Services& services);

}  // namespace throng::server
