#include "server/batch/synthetic.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace throng::server {
namespace {

constexpr double kFramesPerSecond = 10.0;
constexpr double kAgentsPerSquareMetre = 0.35;
constexpr double kLaneWidthM = 1.1;
constexpr double kStandingShare = 0.12;

/// splitmix64 (Steele et al. 2014): a well mixed 64-bit hash of a counter.
std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}
double unit(std::uint64_t hash) { return static_cast<double>(hash >> 11) * 0x1.0p-53; }

class SyntheticReader final : public trajectory::Reader {
 public:
  SyntheticReader(std::uint32_t agents, std::uint64_t seed, double seconds)
      : agents_(agents),
        seed_(seed),
        frames_(static_cast<std::uint64_t>(seconds * kFramesPerSecond) + 1) {
    side_m_ = std::max(12.0, std::sqrt(agents / kAgentsPerSquareMetre));
    lanes_ = std::max(1U, static_cast<std::uint32_t>(side_m_ / kLaneWidthM));
    info_.format = "synthetic";
    info_.fps = kFramesPerSecond;
  }

  const trajectory::Info& info() const override { return info_; }

  absl::StatusOr<bool> next(trajectory::Frame& frame) override {
    if (frame_ == frames_) return false;
    const double time_s = static_cast<double>(frame_) / kFramesPerSecond;
    frame = {};
    frame.time_us = std::llround(time_s * 1e6);
    frame.ids.resize(agents_);
    frame.x_m.resize(agents_);
    frame.y_m.resize(agents_);
    frame.heading_rad.resize(agents_);
    for (std::uint32_t i = 0; i < agents_; ++i) place(i, time_s, frame);
    ++frame_;
    return true;
  }

 private:
  void place(std::uint32_t i, double time_s, trajectory::Frame& frame) const {
    const std::uint64_t hash = mix(seed_ ^ mix(i));
    const std::uint32_t lane = i % lanes_;
    const std::uint64_t lane_hash = mix(seed_ * 31 + lane);
    const double lane_y = (lane + 0.5) * side_m_ / lanes_ - side_m_ / 2;
    if (unit(mix(hash + 1)) < kStandingShare) {
      // groups of up to four on a grid of meeting points, facing each other
      const std::uint32_t group = i / (lanes_ * 4);
      const std::uint64_t group_hash = mix(seed_ ^ mix(group * 977ULL + lane));
      const double angle = unit(hash) * 2.0 * std::numbers::pi;
      frame.ids[i] = i + 1;
      frame.x_m[i] = (unit(group_hash) - 0.5) * side_m_ + 0.55 * std::cos(angle);
      frame.y_m[i] = lane_y + 0.55 * std::sin(angle);
      frame.heading_rad[i] = static_cast<float>(angle + std::numbers::pi);
      return;
    }
    // everybody in a lane keeps the same pace, so nobody walks through the one in front
    const bool joggers = unit(mix(lane_hash + 1)) < 0.06;
    const double speed = joggers ? 2.6 + 0.6 * unit(lane_hash) : 0.95 + 0.6 * unit(lane_hash);
    const double direction = unit(mix(lane_hash + 2)) < 0.5 ? -1.0 : 1.0;
    const std::uint32_t row = i / lanes_;
    const double rows = std::max(1.0, std::ceil(static_cast<double>(agents_) / lanes_));
    const double start = (row + 0.25 + 0.5 * unit(hash)) / rows * side_m_;
    const double walked = start + speed * time_s;
    const double turns = std::floor(walked / side_m_);
    const double along = walked - turns * side_m_ - side_m_ / 2;
    // who walks out at one end is somebody else who comes in at the other
    frame.ids[i] = mix(static_cast<std::uint64_t>(turns) * 0x10001ULL) ^ mix(i + 1);
    const double wave = 2.0 * std::numbers::pi / (9.0 + 6.0 * unit(mix(hash + 2)));
    const double shift = unit(mix(hash + 3)) * 2.0 * std::numbers::pi;
    const double sway_m = 0.16;
    frame.x_m[i] = direction * along;
    frame.y_m[i] =
        lane_y + sway_m * std::sin(wave * walked + shift) + 0.2 * (unit(mix(hash + 4)) - 0.5);
    frame.heading_rad[i] =
        static_cast<float>(std::atan2(sway_m * wave * std::cos(wave * walked + shift), direction));
  }

  std::uint32_t agents_;
  std::uint64_t seed_;
  std::uint64_t frames_;
  std::uint64_t frame_ = 0;
  double side_m_;
  std::uint32_t lanes_;
  trajectory::Info info_;
};

}  // namespace

std::unique_ptr<trajectory::Reader> make_synthetic(std::uint32_t agents, std::uint64_t seed,
                                                   double seconds) {
  return std::make_unique<SyntheticReader>(agents, seed, seconds);
}

}  // namespace throng::server
