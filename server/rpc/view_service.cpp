#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <utility>

#include "server/rpc/convert.hpp"
#include "server/rpc/services.hpp"
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
    if (absl::Status status = handle(request()); !status.ok()) {
      spdlog::debug("connection={} event=view_refused status=\"{}\"", connection(),
                    status.ToString());
      finish(std::move(status));
    }
    next_message();
  }

  void on_half_close() override { release(); }
  void on_done() override { release(); }

  void release() {
    if (!admitted_) return;
    services().loop->remove(viewer_.get());
    wanted_.crowd->remove_viewer();
    --services().viewers;
    admitted_ = false;
    spdlog::debug("connection={} event=viewer_left crowd={}", connection(), wanted_.crowd->name());
  }

  bool next_response(v1::StreamViewResponse& response) override {
    std::shared_ptr<Viewer> viewer;
    {
      const std::lock_guard lock(viewer_mutex_);
      viewer = viewer_;
    }
    if (viewer == nullptr) return false;
    const std::optional<OutgoingFrame> outgoing = viewer->take();
    if (!outgoing.has_value()) return false;
    const EncodedFrame& frame = *outgoing->frame;
    response.set_frame_index(outgoing->frame_index);
    response.set_skipped_frames(outgoing->skipped_frames);
    response.set_image(frame.image);
    response.set_scene_time_us(frame.scene_time_us);
    response.set_capture_time_us(frame.newest_time_us);
    response.set_width_px(frame.viewport.width_px);
    response.set_height_px(frame.viewport.height_px);
    response.set_server_ms(frame.server_ms);
    response.set_live(frame.live);
    fill_stats(frame, *response.mutable_stats());
    fill_camera(frame.camera, *response.mutable_camera());
    return true;
  }

  absl::Status handle(const v1::StreamViewRequest& message) {
    if (message.has_options() || viewer_ == nullptr) {
      const std::shared_ptr<NamedCrowd> before = wanted_.crowd;
      absl::Status status = apply_options(message.options(), *services().registry, wanted_);
      if (!status.ok()) return status;
      if (viewer_ == nullptr) {
        if (status = admit(); !status.ok()) return status;
      } else {
        if (wanted_.crowd != before) {
          before->remove_viewer();
          wanted_.crowd->add_viewer();
        }
        viewer_->set_request(wanted_);
      }
    }
    if (message.acked_frame_index() != 0) {
      absl::Status status = viewer_->ack(message.acked_frame_index());
      if (!status.ok()) return status;
    }
    services().loop->wake();
    return absl::OkStatus();
  }

  absl::Status admit() {
    const Limits& limits = services().registry->limits();
    if (++services().viewers > limits.max_viewers) {
      --services().viewers;
      return absl::ResourceExhaustedError(absl::StrCat("StreamView: there are ", limits.max_viewers,
                                                       " viewers, which is the limit"));
    }
    std::weak_ptr<BidiStream> weak = weak_from_this();
    auto viewer = std::make_shared<Viewer>(
        wanted_, limits.max_frames_in_flight, services().now,
        [weak] {
          if (const auto stream = weak.lock()) static_cast<ViewStream&>(*stream).pump();
        },
        [weak](absl::Status status) {
          if (const auto stream = weak.lock()) stream->finish(std::move(status));
        });
    {
      const std::lock_guard lock(viewer_mutex_);
      viewer_ = viewer;
    }
    wanted_.crowd->add_viewer();
    admitted_ = true;
    services().loop->add(std::move(viewer));
    spdlog::debug("connection={} event=viewer_came crowd={} size={}x{}", connection(),
                  wanted_.crowd->name(), wanted_.viewport.width_px, wanted_.viewport.height_px);
    return absl::OkStatus();
  }

  ViewRequest wanted_;
  bool admitted_ = false;
  std::mutex viewer_mutex_;  // viewer_ is set once, while the loop's threads may look
  std::shared_ptr<Viewer> viewer_;
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
      status = ask(*request, [reactor, response](auto frame) {
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
    absl::Status status = apply_options(request.options(), *services_.registry, picture.view);
    if (!status.ok()) return status;
    if (request.has_scene_time_us()) {
      status = check_scene_time("scene_time_us", request.scene_time_us());
      if (!status.ok()) return status;
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
