#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <utility>

#include "client/camera/camera_script.hpp"
#include "throng/render/camera.hpp"
#include "throng/render/crowd.hpp"

namespace throng::server {

/// What there is to see: the box that the crowd walks in (world, metres) and the picture's shape.
struct Site {
  glm::dvec3 low_world{0.0}, high_world{0.0};
  render::Viewport viewport;
};

/// A camera over scene time: one that stands still, key frames, an orbit, or one that follows an
/// agent. It depends on the scene time and the crowd alone, so every shard sees the same.
class CameraPath {
 public:
  /// As client::CameraScript spells it. Who follows an agent that is not there sees the overview.
  /// NotFound; InvalidArgument with file, key, value and limit.
  static absl::StatusOr<CameraPath> parse(const std::string& text, const Site& site);
  CameraPath(client::CameraScript script, const Site& site)
      : script_(std::move(script)), site_(site) {}

  /// That of the script.
  const std::string& name() const { return script_.name(); }

  render::Camera at(double time_s, const render::Crowd& crowd) const;

 private:
  render::Camera following(const client::CameraScript::Follow& follow, double time_s,
                           const render::Crowd& crowd) const;
  render::Camera overview() const;

  client::CameraScript script_;
  Site site_;
};

}  // namespace throng::server
