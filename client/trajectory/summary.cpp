#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_set>

#include "throng/trajectory/trajectory.hpp"

namespace throng::trajectory {

absl::StatusOr<Summary> summarize(const std::string& path, const ReadOptions& options) {
  absl::StatusOr<std::unique_ptr<Reader>> reader = open(path, options);
  if (!reader.ok()) return reader.status();
  constexpr double kFar = std::numeric_limits<double>::infinity();
  double low[3] = {kFar, kFar, kFar}, high[3] = {-kFar, -kFar, -kFar};
  const auto widen = [&](int axis, const std::vector<double>& values) {
    for (const double value : values) {
      low[axis] = std::min(low[axis], value);
      high[axis] = std::max(high[axis], value);
    }
  };
  Summary summary;
  std::unordered_set<std::uint64_t> ids;
  Frame frame;
  std::int64_t first_us = 0, last_us = 0;
  std::uint64_t given = 0;
  while (true) {
    absl::StatusOr<bool> more = (*reader)->next(frame);
    if (!more.ok()) return more.status();
    if (!*more) break;
    if (given++ == 0) first_us = frame.time_us;
    last_us = frame.time_us;
    summary.most_at_once = std::max<std::uint64_t>(summary.most_at_once, frame.ids.size());
    for (const std::uint64_t id : frame.ids) {
      if (ids.insert(id).second) {
        summary.has_characters = summary.has_characters || (*reader)->agent_character(id) >= 0;
      }
      summary.largest_id = std::max(summary.largest_id, id);
    }
    widen(0, frame.x_m);
    widen(1, frame.y_m);
    widen(2, frame.z_m);
    summary.has_motion =
        summary.has_motion || std::any_of(frame.motion.begin(), frame.motion.end(),
                                          [](std::uint8_t code) { return code != 0; });
    summary.has_z = summary.has_z || !frame.z_m.empty();
    if (!summary.has_heading) {
      summary.has_heading = std::any_of(frame.heading_rad.begin(), frame.heading_rad.end(),
                                        [](float angle) { return std::isfinite(angle); });
    }
  }
  summary.info = (*reader)->info();
  summary.agents = ids.size();
  summary.frames_inserted = static_cast<std::uint64_t>((*reader)->frames_inserted());
  summary.frames = given - summary.frames_inserted;
  summary.duration_s = 1e-6 * static_cast<double>(last_us - first_us);
  summary.has_positions = summary.agents > 0;
  if (summary.has_positions) {
    summary.min_x_m = low[0];
    summary.max_x_m = high[0];
    summary.min_y_m = low[1];
    summary.max_y_m = high[1];
  }
  if (summary.has_z) {
    summary.min_z_m = low[2];
    summary.max_z_m = high[2];
  }
  return summary;
}

}  // namespace throng::trajectory
