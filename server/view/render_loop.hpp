#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "server/view/frame_renderer.hpp"
#include "server/view/viewer.hpp"
#include "throng/render/control.hpp"

namespace throng::server {

struct RenderLoopOptions {
  std::uint64_t default_vertex_budget = 1'000'000;  // of a view that does not say
  // Over 0: such views get the budget that a frame of this length allows, without its encoding. All
  // views of the loop share it: with two at full rate each frame has half as long.
  double target_ms = 0.0;
  render::ControllerKind controller =
      render::ControllerKind::kPredictive;  // how they are kept to it
  std::optional<render::FormRule> form;     // none: as the controller wants
  render::FarSettings far;                  // of all views
  std::uint32_t max_pending_pictures = 16;
  Now now = [] { return Clock::now(); };
};

struct RenderLoopCounters {
  std::uint64_t rendered_frames = 0;
  std::uint64_t oversampled_frames = 0;  // of those rendered, with 16 samples a pixel
  std::uint64_t shared_frames = 0;       // deliveries that cost no rendering
  std::uint64_t failed_frames = 0;
  std::uint64_t encoded_bytes = 0;
};

enum class ImageFormat { kJpeg, kPng };

/// One picture, out of turn.
struct PictureRequest {
  ViewRequest view;
  ImageFormat format = ImageFormat::kJpeg;
  std::optional<std::int64_t> scene_time_us;  // none: now
};
using PictureDone = std::function<void(absl::StatusOr<std::shared_ptr<const EncodedFrame>>)>;

/// The one loop that draws for all viewers of a device.
///
/// It takes the view that is due first, renders it with all threads, and leaves the picture to an
/// encoder thread while it renders the next. Views of the same picture (crowd, camera, size,
/// quality, budget, colours) that are due at about the same time share one frame. A frame that
/// would be the same as one just sent (nothing moves) is not drawn again, except once: after a
/// moment's rest in full detail, where the first one was kept to a time. That teaches no
/// controller. Pictures out of turn, for which no hand waits, are drawn so at once.
class RenderLoop {
 public:
  /// Makes the renderer on the loop's thread; its error when that fails.
  static absl::StatusOr<std::unique_ptr<RenderLoop>> start(MakeRenderer make_renderer,
                                                           RenderLoopOptions options);
  /// Ends the threads; pictures that wait are answered Unavailable.
  ~RenderLoop();

  void add(std::shared_ptr<Viewer> viewer);
  /// No frame is begun for it after this; one may still be delivered.
  void remove(const Viewer* viewer);
  /// A viewer has room again, wants something else, or a crowd was deleted.
  void wake();

  /// Renders one picture and calls `done` from one of the loop's threads.
  /// ResourceExhausted at once (`done` is not called) when too many wait.
  absl::Status picture(PictureRequest request, PictureDone done);

  std::string compute_name() const;
  std::string raster_name() const;
  std::string raster_detail() const;
  RenderLoopCounters counters() const;

 private:
  struct State;
  explicit RenderLoop(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace throng::server
