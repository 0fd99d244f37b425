#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <deque>
#include <exception>
#include <new>
#include <utility>

#include "server/rpc/convert.hpp"
#include "server/rpc/frame_assembler.hpp"
#include "server/rpc/services.hpp"
#include "throng/v1/ingest.grpc.pb.h"

namespace throng::server {
namespace {

// A producer that does not read its acknowledgements loses the oldest of them.
constexpr std::size_t kMostAcks = 1024;

/// One producer's stream. Messages are handled on the worker, so that no gRPC thread waits for a
/// crowd of a million; the next message is read when this one is done with.
class PublishStream final : public BidiStream<v1::PublishAgentsRequest, v1::PublishAgentsResponse> {
 public:
  explicit PublishStream(Services& services) : BidiStream(services) {}

 private:
  void on_message() override {
    services().worker->post([this, keep = shared_from_this()] {
      if (absl::Status status = handle_all(request()); !status.ok()) {
        spdlog::debug("connection={} event=publish_refused crowd={} status=\"{}\"", connection(),
                      crowd_name(), status.ToString());
        // Before the producer hears of it: when it comes back, the crowd must be free.
        release();
        finish(std::move(status));
      }
      next_message();
    });
  }

  void on_half_close() override { release(); }

  void on_done() override { release(); }

  bool next_response(v1::PublishAgentsResponse& response) override {
    const std::lock_guard lock(acks_mutex_);
    if (acks_.empty()) return false;
    response = std::move(acks_.front());
    acks_.pop_front();
    return true;
  }

  bool flush_before_end() const override { return true; }

  std::string crowd_name() const { return publication_ ? publication_->crowd_name() : ""; }

  void release() {
    if (publication_ == nullptr) return;
    spdlog::info("connection={} event=producer_left crowd={}", connection(), crowd_name());
    publication_.reset();
  }

  void acknowledge(v1::PublishAgentsResponse ack) {
    {
      const std::lock_guard lock(acks_mutex_);
      if (acks_.size() >= kMostAcks) acks_.pop_front();
      acks_.push_back(std::move(ack));
    }
    pump();
  }

  void acknowledge_frame(std::uint64_t frame_index, v1::FrameAck::Outcome outcome) {
    v1::PublishAgentsResponse response;
    v1::FrameAck& ack = *response.mutable_frame();
    ack.set_frame_index(frame_index);
    ack.set_outcome(outcome);
    ack.set_viewers(publication_->viewers());
    acknowledge(std::move(response));
  }

  /// What a message makes us allocate ends its stream, never the process.
  absl::Status handle_all(const v1::PublishAgentsRequest& message) {
    try {
      return handle(message);
    } catch (const std::bad_alloc&) {
      return absl::ResourceExhaustedError("message: there is not enough memory for it");
    } catch (const std::exception& error) {
      return absl::InternalError(absl::StrCat("message: ", error.what()));
    }
  }

  absl::Status handle(const v1::PublishAgentsRequest& message) {
    if (publication_ == nullptr && !message.has_start()) {
      return absl::FailedPreconditionError("message: the first one must be start");
    }
    switch (message.message_case()) {
      case v1::PublishAgentsRequest::kStart:
        return start(message.start());
      case v1::PublishAgentsRequest::kMembership:
        return membership(message.membership());
      case v1::PublishAgentsRequest::kChunk:
        return chunk(message.chunk());
      case v1::PublishAgentsRequest::kEnvironment:
        return publication_->set_walkable_area(message.environment().walkable_area_wkt());
      case v1::PublishAgentsRequest::MESSAGE_NOT_SET:
        break;
    }
    return absl::InvalidArgumentError("message: it is none of those this server knows");
  }

  absl::Status start(const v1::StartPublishing& message) {
    if (publication_ != nullptr) {
      return absl::InvalidArgumentError("start: it came before on this stream");
    }
    StartRequest request = start_request_from(message);
    const std::size_t channels = request.channels.size();
    // The other producer's thread may call this after the stream is gone.
    std::weak_ptr<BidiStream> weak = weak_from_this();
    auto publication = services().registry->start(std::move(request), [weak] {
      if (const auto stream = weak.lock()) {
        stream->finish(absl::AbortedError("another producer has taken over this crowd"));
      }
    });
    if (!publication.ok()) return publication.status();
    publication_ = *std::move(publication);
    const Limits& limits = services().registry->limits();
    assembler_.emplace(limits.max_agents_per_crowd, channels);
    spdlog::info("connection={} event=producer_came crowd={} run={} producer=\"{}\"", connection(),
                 crowd_name(), message.run_id(), message.producer());

    v1::PublishAgentsResponse response;
    v1::StartAck& ack = *response.mutable_start();
    ack.set_server_run_id(services().server_run_id);
    ack.set_max_chunk_bytes(limits.max_message_bytes);
    ack.set_max_agents(limits.max_agents_per_crowd);
    acknowledge(std::move(response));
    return absl::OkStatus();
  }

  absl::Status membership(const v1::Membership& message) {
    if (absl::Status status = assembler_->set_membership(message); !status.ok()) return status;
    v1::PublishAgentsResponse response;
    response.mutable_membership()->set_epoch(message.epoch());
    acknowledge(std::move(response));
    return absl::OkStatus();
  }

  absl::Status chunk(const v1::AgentChunk& message) {
    absl::StatusOr<FrameAssembler::Result> result = assembler_->add(message);
    if (!result.ok()) return result.status();
    for (const FrameAssembler::Refused& refused : result->refused) {
      switch (refused.verdict) {
        case FrameAssembler::Verdict::kUnknownEpoch:
          acknowledge_frame(refused.frame_index, v1::FrameAck::OUTCOME_UNKNOWN_EPOCH);
          break;
        case FrameAssembler::Verdict::kIncomplete:
          publication_->count_incomplete();
          acknowledge_frame(refused.frame_index, v1::FrameAck::OUTCOME_INCOMPLETE);
          break;
        case FrameAssembler::Verdict::kLate:
          publication_->count_late();
          acknowledge_frame(refused.frame_index, v1::FrameAck::OUTCOME_LATE);
          break;
      }
    }
    if (!result->complete.has_value()) return absl::OkStatus();
    const auto pushed = publication_->push(*std::move(result->complete));
    if (!pushed.ok()) return pushed.status();
    acknowledge_frame(result->frame_index, *pushed == PushOutcome::kLate
                                               ? v1::FrameAck::OUTCOME_LATE
                                               : v1::FrameAck::OUTCOME_APPLIED);
    return absl::OkStatus();
  }

  std::unique_ptr<Publication> publication_;
  std::optional<FrameAssembler> assembler_;
  std::mutex acks_mutex_;
  std::deque<v1::PublishAgentsResponse> acks_;
};

class IngestService final : public v1::IngestService::CallbackService {
 public:
  explicit IngestService(Services& services) : services_(services) {}

  grpc::ServerBidiReactor<v1::PublishAgentsRequest, v1::PublishAgentsResponse>* PublishAgents(
      grpc::CallbackServerContext* context) override {
    return PublishStream::open(std::make_shared<PublishStream>(services_), *context);
  }

 private:
  Services& services_;
};

}  // namespace

std::unique_ptr<grpc::Service> make_ingest_service(Services& services) {
  return std::make_unique<IngestService>(services);
}

}  // namespace throng::server
