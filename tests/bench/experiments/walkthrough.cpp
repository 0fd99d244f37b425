#include "bench/experiments/walkthrough.hpp"

#include <cmath>
#include <utility>

#include "server/batch/synthetic.hpp"

namespace throng::bench {

render::Camera scale_camera(render::Camera camera, std::uint32_t agents) {
  constexpr double kEyeHeightM = 1.7;
  const double scale = std::sqrt(static_cast<double>(agents) / Walkthrough::kAgents);
  for (glm::dvec3* point : {&camera.eye_world, &camera.target_world}) {
    point->x *= scale;
    point->y *= scale;
    if (point->z > kEyeHeightM) point->z = kEyeHeightM + (point->z - kEyeHeightM) * scale;
  }
  return camera;
}

absl::StatusOr<Walkthrough> Walkthrough::make(std::shared_ptr<const render::Cast> cast,
                                              std::uint32_t agents,
                                              const std::string& camera_file) {
  auto path = server::CameraPath::parse(
      camera_file.empty()
          ? std::string(THRONG_SOURCE_DIR) + "/tests/bench/experiments/walkthrough.json"
          : camera_file,
      server::Site());
  if (!path.ok()) return path.status();
  Walkthrough walkthrough;
  walkthrough.agents_ = agents;
  walkthrough.path_ = std::make_shared<const server::CameraPath>(*std::move(path));
  constexpr std::uint64_t kSeed = 2019;
  walkthrough.reader_ = server::make_synthetic(agents, kSeed, kFrames / kFramesPerSecond + 1.0);
  render::CrowdSettings settings;
  settings.seed = kSeed;
  settings.history_limit_bytes = 1;  // two snapshots are enough: time goes up only
  walkthrough.crowd_ = std::make_unique<render::Crowd>(std::move(cast), settings);
  return walkthrough;
}

absl::StatusOr<Walkthrough> Walkthrough::of_file(std::shared_ptr<const render::Cast> cast,
                                                 const std::string& file) {
  auto reader = trajectory::open(file);
  if (!reader.ok()) return reader.status();
  Walkthrough walkthrough;
  walkthrough.reader_ = *std::move(reader);
  walkthrough.begins_us_ = -1;
  render::CrowdSettings settings;
  settings.history_limit_bytes = 1;
  walkthrough.crowd_ = std::make_unique<render::Crowd>(std::move(cast), settings);
  return walkthrough;
}

absl::Status Walkthrough::push() {
  if (begins_us_ < 0) begins_us_ = frame_.time_us;
  // who walks out at one end is somebody else who comes in at the other
  if (membership_ == nullptr || membership_->ids != frame_.ids) {
    auto membership = std::make_shared<render::Membership>();
    membership->epoch = membership_ == nullptr ? 1 : membership_->epoch + 1;
    membership->ids = frame_.ids;
    membership_ = std::move(membership);
  }
  render::AgentFrame agents;
  agents.time_us = frame_.time_us - begins_us_;
  agents.membership = membership_;
  agents.position_m.reserve(frame_.ids.size());
  for (std::size_t i = 0; i < frame_.ids.size(); ++i) {
    agents.position_m.emplace_back(frame_.x_m[i], frame_.y_m[i], 0.0);
  }
  agents.heading_rad = frame_.heading_rad;
  pushed_us_ = agents.time_us;
  return crowd_->push(std::move(agents));
}

absl::Status Walkthrough::advance_to(std::uint32_t frame) {
  while (pushed_us_ <= time_us(frame)) {
    const absl::StatusOr<bool> more = reader_->next(frame_);
    if (!more.ok()) return more.status();
    if (!*more) break;
    if (absl::Status status = push(); !status.ok()) return status;
  }
  return absl::OkStatus();
}

render::Camera Walkthrough::camera(std::uint32_t frame) const {
  if (agents_ == 0) {
    const auto newest = crowd_->newest();
    return render::overview_camera(newest->low_m,
                                   glm::dvec3(newest->high_m) + glm::dvec3(0.0, 0.0, 1.9), {});
  }
  return scale_camera(path_->at(static_cast<double>(frame) / kFramesPerSecond, *crowd_), agents_);
}

}  // namespace throng::bench
