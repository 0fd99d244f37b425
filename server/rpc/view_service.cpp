#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>
#include <spdlog/spdlog.h>

#include <utility>

#include "server/rpc/convert.hpp"
#include "server/rpc/services.hpp"
#include "server/rpc/view_session.hpp"
#include "throng/v1/view.grpc.pb.h"

namespace throng::server {
namespace {

/// One viewer's stream: requests change what its Viewer wants, and whatever waits in the Viewer's
/// slot is written as soon as the write before it is done.
class ViewStream final : public BidiStream<v1::StreamViewRequest, v1::StreamViewResponse> {
 public:
  explicit ViewStream(Services& services) : BidiStream(services) {}

 private:
  void on_message() override {
    if (session_ == nullptr) open_session();
    if (absl::Status status = session_->handle(request()); !status.ok()) {
      spdlog::debug("connection={} event=view_refused status=\"{}\"", connection(),
                    status.ToString());
      finish(std::move(status));
    }
    next_message();
  }

  void on_half_close() override { release(); }
  void on_done() override { release(); }

  void release() {
    if (session_ != nullptr) session_->close();
  }

  void open_session() {
    std::weak_ptr<BidiStream> weak = weak_from_this();
    auto session = std::make_shared<ViewSession>(
        services(), connection(),
        [weak] {
          if (const auto stream = weak.lock()) static_cast<ViewStream&>(*stream).pump();
        },
        [weak](absl::Status status) {
          if (const auto stream = weak.lock()) stream->finish(std::move(status));
        });
    const std::lock_guard lock(session_mutex_);
    session_ = std::move(session);
  }

  bool next_response(v1::StreamViewResponse& response) override {
    std::shared_ptr<ViewSession> session;
    {
      const std::lock_guard lock(session_mutex_);
      session = session_;
    }
    if (session == nullptr) return false;
    const std::optional<OutgoingFrame> outgoing = session->take();
    if (!outgoing.has_value()) return false;
    session->describe(*outgoing, response);
    response.set_image(outgoing->frame->image);
    return true;
  }

  std::mutex session_mutex_;  // session_ is set once, while the loop's threads may look
  std::shared_ptr<ViewSession> session_;
};

class ViewService final : public v1::ViewService::CallbackService {
 public:
  explicit ViewService(Services& services) : services_(services) {}

  grpc::ServerBidiReactor<v1::StreamViewRequest, v1::StreamViewResponse>* StreamView(
      grpc::CallbackServerContext* context) override {
    return ViewStream::open(std::make_shared<ViewStream>(services_), *context);
  }

  grpc::ServerUnaryReactor* GetPicture(grpc::CallbackServerContext* context,
                                       const v1::GetPictureRequest* request,
                                       v1::GetPictureResponse* response) override {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    absl::Status status = services_.authorize(*context);
    if (status.ok()) {
      status = ask(*request, [reactor, request, response](auto frame) {
        const std::uint64_t followed = request->options().follow_agent();
        if (frame.ok() && followed != 0 && (*frame)->followed_agent == 0) {
          frame = absl::NotFoundError(
              absl::StrFormat("options.follow_agent: there is no agent %d in crowd '%s' at %.2f s",
                              followed, request->options().crowd_name(),
                              1e-6 * static_cast<double>((*frame)->scene_time_us)));
        }
        if (frame.ok()) {
          response->set_image((*frame)->image);
          response->set_scene_time_us((*frame)->scene_time_us);
          fill_stats(**frame, *response->mutable_stats());
        }
        reactor->Finish(to_grpc(frame.status()));
      });
    }
    if (!status.ok()) reactor->Finish(to_grpc(status));
    return reactor;
  }

  grpc::ServerUnaryReactor* PickAgent(grpc::CallbackServerContext* context,
                                      const v1::PickAgentRequest* request,
                                      v1::PickAgentResponse* response) override {
    grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
    absl::Status status = services_.authorize(*context);
    if (status.ok()) status = pick_agent(services_, *request, *response);
    reactor->Finish(to_grpc(status));
    return reactor;
  }

 private:
  absl::Status ask(const v1::GetPictureRequest& request, PictureDone done) {
    PictureRequest picture;
    if (request.format() == v1::GetPictureRequest::FORMAT_PNG) {
      picture.format = ImageFormat::kPng;
    } else if (request.format() != v1::GetPictureRequest::FORMAT_JPEG) {
      return absl::InvalidArgumentError(absl::StrCat("format: it is ",
                                                     static_cast<int>(request.format()),
                                                     ", must be FORMAT_JPEG or FORMAT_PNG"));
    }
    absl::Status status =
        apply_options(request.options(), *services_.registry, services_.now(), picture.view);
    if (!status.ok()) return status;
    if (request.has_scene_time_us()) {
      status = check_scene_time("scene_time_us", request.scene_time_us());
      if (!status.ok()) return status;
      const Moment moment = picture.view.crowd->moment(services_.now());
      if (request.scene_time_us() < moment.oldest_time_us ||
          request.scene_time_us() > moment.newest_time_us) {
        return absl::OutOfRangeError(absl::StrFormat(
            "at %.2f s there is nothing of crowd '%s': its history goes from %.2f to %.2f s",
            1e-6 * static_cast<double>(request.scene_time_us()), picture.view.crowd->name(),
            1e-6 * static_cast<double>(moment.oldest_time_us),
            1e-6 * static_cast<double>(moment.newest_time_us)));
      }
      picture.scene_time_us = request.scene_time_us();
    }
    return services_.loop->picture(std::move(picture), std::move(done));
  }

  Services& services_;
};

}  // namespace

std::unique_ptr<grpc::Service> make_view_service(Services& services) {
  return std::make_unique<ViewService>(services);
}

}  // namespace throng::server
