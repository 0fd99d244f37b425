#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>

#include "server/batch/camera_path.hpp"
#include "throng/render/crowd.hpp"
#include "throng/trajectory/trajectory.hpp"

namespace throng::bench {

/// The crowd and the camera path of table 2 (Dong & Peng 2019): 30,000 agents that walk on a square
/// of 293 m, seen through 1,000 frames of walkthrough.json.
///
/// With another number of agents the square keeps its density, and the path grows or shrinks with
/// it (heights above a person's eyes too), so that about the same share is in view.
class Walkthrough {
 public:
  static constexpr std::uint32_t kFrames = 1000;
  static constexpr std::uint32_t kAgents = 30000;
  static constexpr double kFramesPerSecond = 25.0;

  /// @param camera_file  a path for 30,000 agents; empty: the one that comes with the bench.
  static absl::StatusOr<Walkthrough> make(std::shared_ptr<const render::Cast> cast,
                                          std::uint32_t agents,
                                          const std::string& camera_file = "");

  /// A trajectory file's crowd, seen from over it; its time begins at 0.
  static absl::StatusOr<Walkthrough> of_file(std::shared_ptr<const render::Cast> cast,
                                             const std::string& file);

  /// Scene time of a frame, from 0 on.
  static std::int64_t time_us(std::uint32_t frame) {
    return static_cast<std::int64_t>(frame) * 40'000;
  }
  /// Feeds the crowd so far that `crowd()` has the snapshots around this frame's time. Frames go
  /// up only.
  absl::Status advance_to(std::uint32_t frame);

  const render::Crowd& crowd() const { return *crowd_; }
  render::Camera camera(std::uint32_t frame) const;

 private:
  Walkthrough() = default;
  absl::Status push();

  std::uint32_t agents_ = 0;  // 0: those of a file
  std::unique_ptr<trajectory::Reader> reader_;
  trajectory::Frame frame_;
  std::shared_ptr<const render::Membership> membership_;
  std::unique_ptr<render::Crowd> crowd_;
  std::shared_ptr<const server::CameraPath> path_;
  std::int64_t pushed_us_ = -1;
  std::int64_t begins_us_ = 0;
};

/// A camera of the path moved to a crowd of `agents` (see Walkthrough).
render::Camera scale_camera(render::Camera camera, std::uint32_t agents);

}  // namespace throng::bench
