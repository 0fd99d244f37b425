#include <chrono>
#include <cstdio>

#include "client/cli/commands.hpp"
#include "client/cli/interrupt.hpp"
#include "client/cli/output.hpp"
#include "client/cli/view_stream.hpp"
#include "throng/v1/view.pb.h"

namespace throng::client {

int run_watch(const ViewCommand& command, std::optional<double> seconds) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point began = Clock::now();
  Clock::time_point line_began = began;
  std::uint64_t frames = 0, bytes = 0;
  const absl::Status status = stream_view(command, [&](const v1::StreamViewResponse& frame) {
    const Clock::time_point now = Clock::now();
    ++frames;
    bytes += frame.image().size();
    const double elapsed_s = std::chrono::duration<double>(now - line_began).count();
    if (elapsed_s >= 1.0) {
      std::printf(
          "t=%.1f s fps=%.1f agents=%u visible=%u vertices=%llu server=%.1f ms behind=%.0f ms "
          "skipped=%llu rate=%.1f Mbit/s %s\n",
          static_cast<double>(frame.scene_time_us()) * 1e-6,
          static_cast<double>(frames) / elapsed_s, frame.stats().agents(), frame.stats().visible(),
          static_cast<unsigned long long>(frame.stats().vertices()), frame.server_ms(),
          static_cast<double>(frame.capture_time_us() - frame.scene_time_us()) * 1e-3,
          static_cast<unsigned long long>(frame.skipped_frames()),
          static_cast<double>(bytes) * 8e-6 / elapsed_s, frame.live() ? "live" : "at rest");
      std::fflush(stdout);
      line_began = now;
      frames = bytes = 0;
    }
    const bool over =
        seconds.has_value() && std::chrono::duration<double>(now - began).count() >= *seconds;
    return over ? Next::kEnough : Next::kMore;
  });
  if (!status.ok()) return report("watch", status);
  return interrupted() != 0 ? 128 + interrupted() : kOk;
}

}  // namespace throng::client
