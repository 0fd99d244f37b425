#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <chrono>
#include <cstdio>

#include "client/cli/commands.hpp"
#include "client/cli/interrupt.hpp"
#include "client/cli/output.hpp"
#include "client/cli/view_stream.hpp"
#include "throng/v1/view.pb.h"

namespace throng::client {
namespace {

/// Times of recorded pictures. Arrival jitters and scene time may run at any pace or stand still,
/// so a step of scene time counts where it is near that of the wall clock, and the wall clock
/// elsewhere.
class RecordClock {
 public:
  std::int64_t next(std::int64_t scene_us, std::chrono::steady_clock::time_point now) {
    if (!first_) {
      const auto wall_us = static_cast<double>(
          std::chrono::duration_cast<std::chrono::microseconds>(now - last_now_).count());
      const auto step_us = static_cast<double>(scene_us - last_scene_us_);
      // What was taken from the scene's clock must not run away from the wall's.
      wall_total_us_ += wall_us;
      const bool near = step_us > 0.5 * wall_us && step_us < 2.0 * wall_us;
      total_us_ += near ? step_us : wall_us;
      const double ahead_us = total_us_ - wall_total_us_;
      if (ahead_us > 100'000.0 || ahead_us < -100'000.0) total_us_ = wall_total_us_;
      if (total_us_ < last_us_) total_us_ = last_us_;
    }
    first_ = false;
    last_scene_us_ = scene_us;
    last_now_ = now;
    last_us_ = total_us_;
    return static_cast<std::int64_t>(total_us_);
  }

 private:
  bool first_ = true;
  double total_us_ = 0, wall_total_us_ = 0, last_us_ = 0;
  std::int64_t last_scene_us_ = 0;
  std::chrono::steady_clock::time_point last_now_{};
};

}  // namespace

int run_record(const RecordCommand& command) {
  const char* const kName = "record";
  const ViewCommand& view = command.view;
  auto output = open_output(command.output, view.width_px, view.height_px, view.fps);
  if (!output.ok()) {
    report(kName, output.status());
    return output.status().code() == absl::StatusCode::kInvalidArgument ? kUsage : kFailure;
  }

  Progress progress(view.common.quiet);
  RecordClock clock;
  absl::Status written;
  std::uint64_t frames = 0, skipped = 0;
  double seconds = 0.0;
  std::int64_t resting_since_us = -1;
  bool was_live = false, complete = false;
  const absl::Status streamed = stream_view(view, [&](const v1::StreamViewResponse& frame) {
    // A crowd that nobody has fed yet shows empty ground; the film begins with the first frame.
    if (frame.stats().agents() == 0 && frames == 0 && frame.capture_time_us() == 0 && !was_live &&
        !frame.live()) {
      return Next::kMore;
    }
    const std::int64_t time_us =
        clock.next(frame.scene_time_us(), std::chrono::steady_clock::now());
    seconds = static_cast<double>(time_us) * 1e-6;
    if (command.seconds.has_value() && seconds >= *command.seconds) {
      complete = true;
      return Next::kEnough;
    }
    written = (*output)->add(frame.image(), time_us);
    if (!written.ok()) return Next::kEnough;
    ++frames;
    skipped = frame.skipped_frames();
    progress.show(absl::StrFormat("%s %.1f s, %d frames, %d skipped, %d agents, server %.0f ms",
                                  view.crowd, seconds, frames, skipped, frame.stats().agents(),
                                  frame.server_ms()));
    if ((*output)->single() || (command.frames.has_value() && frames >= *command.frames)) {
      complete = true;
      return Next::kEnough;
    }
    // Without a length, the film ends a second after everything has come to rest.
    was_live = was_live || frame.live();
    const bool resting = !frame.live() && frame.scene_time_us() >= frame.capture_time_us();
    if (!resting) {
      resting_since_us = -1;
    } else if (resting_since_us < 0) {
      resting_since_us = time_us;
    }
    if (!command.seconds.has_value() && !command.frames.has_value() && resting &&
        time_us - resting_since_us > 1'000'000) {
      complete = true;
      return Next::kEnough;
    }
    return Next::kMore;
  });
  progress.end();
  if (!written.ok()) return report(kName, written);
  if (!streamed.ok() && frames == 0) return report(kName, streamed);

  // What came is kept whatever ended it.
  const auto where = (*output)->finish();
  if (!where.ok()) return report(kName, where.status());
  if (!view.common.quiet) {
    std::fprintf(stderr, "throng record: %llu frames, %.1f s, %llu skipped\n",
                 static_cast<unsigned long long>(frames), seconds,
                 static_cast<unsigned long long>(skipped));
  }
  std::printf("%s\n", where->c_str());
  if (!streamed.ok()) return report(kName, streamed);
  const bool asked = command.seconds.has_value() || command.frames.has_value();
  if (interrupted() != 0 && asked && !complete) return 128 + interrupted();
  return kOk;
}

}  // namespace throng::client
