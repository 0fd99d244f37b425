#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/desktop/orbit_camera.hpp"
#include "throng/render/color_map.hpp"

namespace throng::client {

/// What the page's address holds behind '#': crowd, camera, time and what is shown.
///
///     crowd=station&cam=x,y,z,distance,yaw_deg,pitch_deg[,ortho]&follow=17&t=3.2&speed=2
///     &color=speed,0,2&map=plasma&show=grid,time
struct ViewText {
  std::string crowd;
  std::optional<OrbitCamera> camera;
  std::uint64_t follow = 0;
  std::optional<std::int64_t> time_us;  // none: live
  double speed = 1.0;
  std::string channel;
  std::optional<std::pair<double, double>> range;
  render::ColorMap color_map = render::ColorMap::kViridis;
  std::vector<std::string> show;
};

/// Takes an address with all that is before its '#', too. InvalidArgument names the part that makes
/// no sense: who types it wants to know, other than a page that was given a link.
absl::StatusOr<ViewText> parse_view_text(const std::string& text);
std::string format_view_text(const ViewText& view);

}  // namespace throng::client
