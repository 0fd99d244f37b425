#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <utility>

#include "server/scene/playhead.hpp"
#include "server/scene/registry.hpp"
#include "server/view/agents.hpp"
#include "throng/render/camera.hpp"
#include "throng/render/frame.hpp"

namespace throng::server {

/// What a viewer wants to see; checked before it gets here.
struct ViewRequest {
  std::shared_ptr<NamedCrowd> crowd;
  std::optional<render::Camera> camera;  // none: an overview that follows the crowd
  render::Viewport viewport;
  int jpeg_quality = 80;
  double max_rate_hz = 30.0;
  std::uint64_t vertex_budget = 0;  // 0: the server decides
  std::string channel;              // colours the agents; empty: textures
  float channel_low = 0.0F;
  float channel_high = 1.0F;
  render::ColorMap color_map = render::ColorMap::kViridis;
  bool shadows = true;
  Playhead playhead;
  std::uint64_t follow_agent = 0;  // the camera is moved along with it; 0: with nobody
  // What the connection adds to each picture.
  std::uint32_t max_agent_columns = 0;  // agents to list
  bool density = false;
  std::uint64_t stamp = 0;  // the client's own
};

/// True if both ask for the same picture of the same moment (rates, and what is sent beside it, do
/// not matter).
bool same_picture(const ViewRequest& a, const ViewRequest& b);

/// A picture that is ready to be sent; shared by all viewers who see the same.
struct EncodedFrame {
  std::string image;
  render::Viewport viewport;
  render::Camera camera;
  WorldBox overview;  // what an overview of this moment shows
  render::FrameStats stats;
  std::uint64_t vertex_budget = 0;
  double target_ms = 0.0;          // 0: it was not kept to any
  bool in_full = false;            // drawn without hurry, since nothing moved or nobody waited
  std::uint32_t oversampling = 1;  // as ViewSettings
  std::int64_t scene_time_us = 0;
  std::uint64_t followed_agent = 0;  // 0: nobody, or it is not there
  AgentsAt agents;                   // who is in the picture
  double server_ms = 0.0;
};

/// How a crowd's history stood when a frame was taken up; the picture may be an older one.
struct HistoryNow {
  std::int64_t oldest_time_us = 0;
  std::int64_t newest_time_us = 0;
  bool live = false;  // a producer is connected
};

/// A frame on its way to one viewer.
struct OutgoingFrame {
  std::uint64_t frame_index = 0;
  std::uint64_t skipped_frames = 0;
  std::uint64_t stamp = 0;  // of the request it was drawn for
  HistoryNow history;
  std::shared_ptr<const EncodedFrame> frame;
};

/// One viewer between the render loop and its connection: pace, credits and a one-deep slot in
/// which the newest frame wins. Frames are only made for a viewer that has room, so a slow one
/// costs nothing and, once it has room again, gets the present and not the past. Thread safe.
class Viewer {
 public:
  /// @param max_in_flight  frames beyond the last acknowledged one.
  /// @param on_frame       called without locks when a frame waits in the slot: `take` it.
  /// @param on_end         called at most once, when the loop can show this viewer nothing more.
  Viewer(ViewRequest request, std::uint32_t max_in_flight, Now now, std::function<void()> on_frame,
         std::function<void(absl::Status)> on_end);

  // The connection's side.
  void set_request(ViewRequest request);
  ViewRequest request() const;
  /// InvalidArgument for a frame that was never sent.
  absl::Status ack(std::uint64_t frame_index);
  /// The frame to write next; empty if there is none.
  std::optional<OutgoingFrame> take();

  // The render loop's side.
  /// When the next frame is due; none while there is no room for one.
  std::optional<Clock::time_point> due() const;
  /// Promises one `deliver` or `abandon`; returns its frame index.
  /// @param stamp  of the request that is being drawn.
  std::uint64_t begin_frame(Clock::time_point now, std::uint64_t stamp = 0);
  void deliver(std::uint64_t frame_index, std::shared_ptr<const EncodedFrame> frame,
               HistoryNow history = {});
  /// The box that an overview of the past shows: it follows the agents smoothly, and anew after a
  /// leap. Of the loop's thread alone.
  WorldBox overview_of_past(const WorldBox& agents, std::int64_t scene_time_us,
                            Clock::time_point now);
  void end(absl::Status status);

 private:
  static constexpr std::int64_t kLeapUs = 5'000'000;

  bool has_room() const;
  void room_changed(bool had_room);
  Clock::duration period() const;

  const std::uint32_t max_in_flight_;
  const Now now_;
  const std::function<void()> on_frame_;
  const std::function<void(absl::Status)> on_end_;

  OverviewBox past_;
  std::int64_t past_time_us_ = 0;

  mutable std::mutex mutex_;
  ViewRequest request_;
  Clock::time_point next_due_;
  Clock::time_point room_since_;
  std::uint32_t pending_ = 0;  // being rendered or encoded
  OutgoingFrame slot_;         // frame is null: empty
  Clock::time_point slot_since_{};
  std::deque<std::uint64_t> in_flight_;                         // sent, not acknowledged
  std::deque<std::pair<std::uint64_t, std::uint64_t>> stamps_;  // of pending frames, by index
  std::uint64_t newest_index_ = 0;
  std::uint64_t newest_delivered_ = 0;
  std::uint64_t newest_sent_ = 0;
  std::uint64_t newest_acked_ = 0;
  std::uint64_t skipped_ = 0;
  bool ended_ = false;
};

}  // namespace throng::server
