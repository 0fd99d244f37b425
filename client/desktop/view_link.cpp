#include "client/desktop/view_link.hpp"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>

#include "throng/v1/crowd.grpc.pb.h"
#include "throng/v1/server.grpc.pb.h"
#include "throng/v1/view.grpc.pb.h"

namespace throng::client {
namespace {

constexpr std::chrono::milliseconds kFirstRetry{400}, kLongestRetry{4000};
constexpr std::chrono::seconds kAnswerWithin{5};
constexpr std::size_t kMostErrands = 8;

}  // namespace

const char* name_of(LinkState state) {
  switch (state) {
    case LinkState::kConnecting:
      return "connecting";
    case LinkState::kOpen:
      return "open";
    case LinkState::kWaiting:
      return "waiting";
    case LinkState::kLost:
      return "lost";
    case LinkState::kRefused:
      return "refused";
  }
  return "";
}

void merge_options(const v1::ViewOptions& change, v1::ViewOptions& options) {
  const std::int32_t steps = options.playback().step_frames();
  const bool camera_stays = !change.has_camera();
  if (change.overview()) options.clear_camera();
  // fields that are 0 would not replace what was there
  if (!camera_stays) {
    options.clear_camera();
    options.clear_overview();
  }
  options.MergeFrom(change);
  if (steps != 0 && change.playback().step_frames() != 0) {  // each step counts
    options.mutable_playback()->set_step_frames(steps + change.playback().step_frames());
  }
}

absl::StatusOr<std::unique_ptr<ViewLink>> ViewLink::open(const ConnectionOptions& options,
                                                         std::function<void()> wake) {
  auto connection = Connection::open(options);
  if (!connection.ok()) return connection.status();
  return std::unique_ptr<ViewLink>(new ViewLink(*std::move(connection), std::move(wake)));
}

ViewLink::ViewLink(std::shared_ptr<const Connection> connection, std::function<void()> wake)
    : connection_(std::move(connection)),
      wake_(std::move(wake)),
      stream_thread_([this] { run_stream(); }),
      errand_thread_([this] { run_errands(); }) {}

ViewLink::~ViewLink() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    if (stream_ != nullptr) stream_->cancel();
  }
  changed_.notify_all();
  stream_thread_.join();
  errand_thread_.join();
}

void ViewLink::ask(const v1::ViewOptions& change, const v1::ViewOptions& whole) {
  {
    const std::lock_guard lock(mutex_);
    whole_ = whole;
    if (!change_) change_.emplace();
    merge_options(change, *change_);
  }
  changed_.notify_all();
}

std::optional<ReceivedFrame> ViewLink::take() {
  const std::lock_guard lock(mutex_);
  std::optional<ReceivedFrame> frame = std::move(newest_);
  newest_.reset();
  return frame;
}

ViewLink::Status ViewLink::status() const {
  const std::lock_guard lock(mutex_);
  return status_;
}

void ViewLink::retry_now() {
  {
    const std::lock_guard lock(mutex_);
    retry_now_ = true;
  }
  changed_.notify_all();
}

void ViewLink::receive(v1::StreamViewResponse& message) {
  ReceivedFrame frame;
  const std::uint64_t size_bytes = message.image().size();
  if (!message.same_image()) {
    auto image = render::decode_jpeg(
        {reinterpret_cast<const std::uint8_t*>(message.image().data()), message.image().size()});
    // a picture that can't be decoded is left out; the one before stays
    if (image.ok()) {
      last_image_ = std::make_shared<const render::DecodedImage>(*std::move(image));
    }
  }
  message.clear_image();
  frame.image = last_image_;
  frame.message = std::move(message);
  {
    const std::lock_guard lock(mutex_);
    ack_ = frame.message.frame_index();
    status_.received_bytes += size_bytes;
    status_.state = LinkState::kOpen;
    if (newest_) ++status_.left_out;
    if (frame.image != nullptr) newest_ = std::move(frame);
  }
  changed_.notify_all();
  wake_();
}

void ViewLink::run_writer(ViewStream& stream) {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return writer_ends_ || change_ || ack_ != 0; });
    if (writer_ends_) return;
    v1::StreamViewRequest request;
    if (change_) *request.mutable_options() = *std::move(change_);
    change_.reset();
    request.set_acked_frame_index(ack_);
    ack_ = 0;
    lock.unlock();
    const bool is_open = stream.send(request);
    lock.lock();
    if (!is_open) return;
  }
}

void ViewLink::end_stream(const absl::Status& status) {
  status_.message = std::string(status.message());
  status_.state = absl::IsNotFound(status)          ? LinkState::kWaiting
                  : absl::IsUnauthenticated(status) ? LinkState::kRefused
                                                    : LinkState::kLost;
}

void ViewLink::run_stream() {
  std::chrono::milliseconds retry = kFirstRetry;
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || whole_; });
    if (stopping_) return;
    const v1::ViewOptions options = *whole_;
    change_.reset();
    ack_ = 0;
    writer_ends_ = false;
    last_image_.reset();
    lock.unlock();
    ViewStream stream(connection_, options);
    lock.lock();
    stream_ = &stream;
    if (stopping_) stream.cancel();
    lock.unlock();
    std::thread writer([this, &stream] { run_writer(stream); });
    for (v1::StreamViewResponse message; stream.read(message);) {
      receive(message);
      retry = kFirstRetry;
    }
    lock.lock();
    writer_ends_ = true;
    lock.unlock();
    changed_.notify_all();
    writer.join();
    const absl::Status status = stream.finish();
    lock.lock();
    stream_ = nullptr;
    if (stopping_) return;
    end_stream(status);
    wake_();
    const auto done = [this] { return stopping_ || retry_now_; };
    if (status_.state == LinkState::kRefused) {
      changed_.wait(lock, done);
    } else {
      changed_.wait_for(lock, retry, done);
    }
    retry_now_ = false;
    retry = std::min(kLongestRetry, retry * 8 / 5);
  }
}

void ViewLink::run_errands() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || !errands_.empty(); });
    if (stopping_) return;
    const std::function<void()> errand = std::move(errands_.front());
    errands_.pop_front();
    lock.unlock();
    errand();
    lock.lock();
  }
}

struct ViewLink::Call {
  /// Asks on the thread of errands; `then` is called by `deliver`.
  template <typename Service, typename Request, typename Response>
  static void ask(ViewLink& link,
                  grpc::Status (Service::Stub::*method)(grpc::ClientContext*, const Request&,
                                                        Response*),
                  Request request, std::function<void(const Response&)> then) {
    {
      const std::lock_guard lock(link.mutex_);
      if (link.errands_.size() >= kMostErrands) return;  // the server is slow: asked again later
      link.errands_.push_back(
          [&link, method, request = std::move(request), then = std::move(then)] {
            grpc::ClientContext context;
            context.set_deadline(std::chrono::system_clock::now() + kAnswerWithin);
            link.connection_->prepare(context);
            typename Service::Stub stub(link.connection_->channel());
            Response response;
            if (!(stub.*method)(&context, request, &response).ok()) return;
            {
              const std::lock_guard answer_lock(link.mutex_);
              link.answers_.push_back([then, response = std::move(response)] { then(response); });
            }
            link.wake_();
          });
    }
    link.changed_.notify_all();
  }
};

void ViewLink::list_crowds(std::function<void(const v1::ListCrowdsResponse&)> then) {
  Call::ask<v1::CrowdService>(*this, &v1::CrowdService::Stub::ListCrowds, v1::ListCrowdsRequest(),
                              std::move(then));
}

void ViewLink::get_server_info(std::function<void(const v1::GetServerInfoResponse&)> then) {
  Call::ask<v1::ServerService>(*this, &v1::ServerService::Stub::GetServerInfo,
                               v1::GetServerInfoRequest(), std::move(then));
}

void ViewLink::pick(v1::PickAgentRequest request,
                    std::function<void(const v1::PickAgentResponse&)> then) {
  Call::ask<v1::ViewService>(*this, &v1::ViewService::Stub::PickAgent, std::move(request),
                             std::move(then));
}

void ViewLink::deliver() {
  std::deque<std::function<void()>> answers;
  {
    const std::lock_guard lock(mutex_);
    answers.swap(answers_);
  }
  for (const auto& answer : answers) answer();
}

}  // namespace throng::client
