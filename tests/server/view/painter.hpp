#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

#include "server/view/frame_renderer.hpp"
#include "throng/render/device_picture.hpp"

namespace throng::test {

/// What a painter does and did; shared with the test.
struct PainterLog {
  std::atomic<int> rendered{0};
  std::atomic<bool> fails{false};
  std::atomic<double> raster_ms{0.0};       // what it says a picture took,
  std::atomic<double> ms_per_million{0.0};  // and beside that for the vertices of its budget
  std::atomic<bool> on_device{false};       // where the picture stays; what it took is told late
  std::atomic<bool> fails_in_full{false};   // to draw without a time
  std::string compute = "none";             // what it says it computes with
  std::mutex mutex;
  std::condition_variable changed;
  bool held = false;  // while set, render does not return

  void hold(bool on) {
    {
      const std::lock_guard lock(mutex);
      held = on;
    }
    changed.notify_all();
  }
};

/// Draws without GL: the whole picture has the colour of the camera's eye, (x, y, z) as r g b, and
/// more blue where it is drawn with 16 samples a pixel.
class Painter final : public server::FrameRenderer {
 public:
  explicit Painter(std::shared_ptr<PainterLog> log) : log_(std::move(log)) {}

  absl::Status render(const render::Crowd& crowd, std::int64_t scene_time_us,
                      const render::ViewSettings& settings, render::Picture& picture,
                      render::FrameStats& stats) override {
    {
      std::unique_lock lock(log_->mutex);
      log_->changed.wait(lock, [this] { return !log_->held; });
    }
    ++log_->rendered;
    if (log_->fails.load()) return absl::InternalError("the painter is out of paint");
    const bool in_full = settings.selection.form == render::FormRule::kMixed &&
                         settings.selection.mixed.budget_ms == 0.0;
    if (in_full && log_->fails_in_full.load()) {
      return absl::ResourceExhaustedError("the canvas is too small");
    }
    picture.width_px = settings.viewport.width_px;
    picture.height_px = settings.viewport.height_px;
    picture.rgbx.resize(std::size_t{4} * picture.width_px * picture.height_px);
    for (std::size_t i = 0; i < picture.rgbx.size(); ++i) {
      const std::size_t channel = i % 4;
      double value = channel < 3 ? settings.camera.eye_world[static_cast<int>(channel)] : 255.0;
      if (channel == 2) value += 50.0 * (settings.oversampling - 1);
      picture.rgbx[i] = static_cast<std::uint8_t>(std::clamp(value, 0.0, 255.0));
    }
    stats = render::FrameStats();
    stats.scene_time_us = scene_time_us;
    stats.times.raster_ms =
        log_->raster_ms.load() +
        log_->ms_per_million.load() * 1e-6 * static_cast<double>(settings.selection.vertex_budget);
    if (log_->on_device.load()) {
      picture.on_device = std::make_shared<LeftThere>(std::move(picture.rgbx));
      stats.device_before_ms = std::exchange(before_ms_, stats.times.raster_ms);
      stats.times.raster_ms = 0.5;
    }
    stats.counters.vertices = settings.selection.vertex_budget;
    if (const auto newest = crowd.newest()) stats.counters.agents = newest->present_count;
    return absl::OkStatus();
  }
  std::string compute_name() const override { return log_->compute; }
  std::string raster_name() const override { return "painter"; }

 private:
  /// A picture on a device that does not encode.
  struct LeftThere final : render::DevicePicture {
    explicit LeftThere(std::vector<std::uint8_t> rgbx) : pixels(std::move(rgbx)) {}
    absl::Status fetch(std::vector<std::uint8_t>& rgbx) override {
      rgbx = pixels;
      return absl::OkStatus();
    }
    absl::Status encode_jpeg(int, std::vector<std::uint8_t>&) override {
      return absl::UnimplementedError("no encoder");
    }
    const std::vector<std::uint8_t> pixels;
  };

  std::shared_ptr<PainterLog> log_;
  double before_ms_ = 0.0;
};

inline server::MakeRenderer painter(std::shared_ptr<PainterLog> log) {
  return [log]() -> absl::StatusOr<std::unique_ptr<server::FrameRenderer>> {
    return std::make_unique<Painter>(log);
  };
}

/// A cast of one character without any geometry.
inline std::shared_ptr<const render::Cast> nobody_cast() {
  auto cast = std::make_shared<render::Cast>();
  cast->members.resize(1);
  cast->members[0].character.name = "nobody";
  cast->members[0].character.clips = {
      {"idle", render::ClipKind::kIdle, 0, 1, 1.0F, true, 0.0F, 0.0F}};
  return cast;
}

}  // namespace throng::test
