#include "server/rpc/view_session.hpp"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <cmath>
#include <string>
#include <utility>

#include "server/rpc/convert.hpp"
#include "server/rpc/services.hpp"
#include "throng/v1/view.pb.h"

namespace throng::server {

ViewSession::ViewSession(Services& services, std::uint64_t connection,
                         std::function<void()> on_frame, std::function<void(absl::Status)> on_end)
    : services_(services),
      connection_(connection),
      on_frame_(std::move(on_frame)),
      on_end_(std::move(on_end)) {}

ViewSession::~ViewSession() { close(); }

void ViewSession::close() {
  if (!admitted_) return;
  services_.loop->remove(viewer_.get());
  wanted_.crowd->remove_viewer();
  --services_.viewers;
  admitted_ = false;
  spdlog::debug("connection={} event=viewer_left crowd={}", connection_, wanted_.crowd->name());
}

std::optional<OutgoingFrame> ViewSession::take() {
  std::shared_ptr<Viewer> viewer;
  {
    const std::lock_guard lock(viewer_mutex_);
    viewer = viewer_;
  }
  return viewer != nullptr ? viewer->take() : std::nullopt;
}

void ViewSession::describe(const OutgoingFrame& outgoing, v1::StreamViewResponse& response) const {
  const EncodedFrame& frame = *outgoing.frame;
  response.Clear();
  fill_frame(outgoing, response);
  std::shared_ptr<Viewer> viewer;
  {
    const std::lock_guard lock(viewer_mutex_);
    viewer = viewer_;
  }
  const ViewRequest request = viewer->request();
  fill_playback(request.playhead, frame.scene_time_us, *response.mutable_playback());
  if (request.max_agent_columns > 0) {
    const int channel =
        request.channel.empty() ? -1 : request.crowd->channel_index(request.channel);
    fill_agents(
        list_agents(frame.agents, frame.camera, frame.viewport, request.max_agent_columns, channel),
        frame.agents.origin_world, *response.mutable_agents());
  }
  if (request.density) fill_density(density_map(frame.agents), *response.mutable_density());
}

absl::Status ViewSession::handle(const v1::StreamViewRequest& message) {
  if (message.has_options() || viewer_ == nullptr) {
    const std::shared_ptr<NamedCrowd> before = wanted_.crowd;
    absl::Status status =
        apply_options(message.options(), *services_.registry, services_.now(), wanted_);
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
  services_.loop->wake();
  return absl::OkStatus();
}

absl::Status ViewSession::admit() {
  const Limits& limits = services_.registry->limits();
  if (++services_.viewers > limits.max_viewers) {
    --services_.viewers;
    return absl::ResourceExhaustedError(
        absl::StrCat("StreamView: there are ", limits.max_viewers, " viewers, which is the limit"));
  }
  auto viewer = std::make_shared<Viewer>(wanted_, limits.max_frames_in_flight, services_.now,
                                         on_frame_, on_end_);
  {
    const std::lock_guard lock(viewer_mutex_);
    viewer_ = viewer;
  }
  wanted_.crowd->add_viewer();
  admitted_ = true;
  services_.loop->add(std::move(viewer));
  spdlog::debug("connection={} event=viewer_came crowd={} size={}x{}", connection_,
                wanted_.crowd->name(), wanted_.viewport.width_px, wanted_.viewport.height_px);
  return absl::OkStatus();
}

absl::Status pick_agent(Services& services, const v1::PickAgentRequest& request,
                        v1::PickAgentResponse& response) {
  ViewRequest view;
  const Clock::time_point now = services.now();
  absl::Status status = apply_options(request.options(), *services.registry, now, view);
  if (!status.ok()) return status;
  if (status = check_scene_time("scene_time_us", request.scene_time_us()); !status.ok()) {
    return status;
  }
  if (!std::isfinite(request.x_px()) || !std::isfinite(request.y_px())) {
    return absl::InvalidArgumentError("x_px, y_px: not a number");
  }
  const Moment moment = view.crowd->moment(now);
  const AgentsAt agents = agents_at(moment, request.scene_time_us());
  const WorldBox overview = overview_of(moment, agents);
  const render::Camera camera =
      view.camera.value_or(render::overview_camera(overview.low, overview.high, view.viewport));
  const auto agent =
      request.id() != 0 ? find_agent(agents, request.id())
                        : pick_agent(agents, camera, view.viewport, request.x_px(), request.y_px());
  if (agent.has_value()) fill_agent(*agent, agents, *view.crowd, *moment.crowd, response);
  return absl::OkStatus();
}

}  // namespace throng::server
