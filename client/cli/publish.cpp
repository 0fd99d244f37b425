#include <absl/strings/str_cat.h>
#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <mutex>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "client/cli/commands.hpp"
#include "client/cli/interrupt.hpp"
#include "client/cli/output.hpp"
#include "throng/client/producer.hpp"

namespace throng::client {
namespace {

using SteadyClock = std::chrono::steady_clock;

/// Waits for a moment or an interrupt.
class Pacer {
 public:
  Pacer()
      : on_interrupt_([this] {
          const std::lock_guard lock(mutex_);
          stop_ = true;
          changed_.notify_all();
        }) {}

  /// False: interrupted.
  bool wait_until(SteadyClock::time_point when) {
    std::unique_lock lock(mutex_);
    return !changed_.wait_until(lock, when, [this] { return stop_; });
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool stop_ = false;
  OnInterrupt on_interrupt_;  // last: its action uses what is above
};

/// Origin for coordinates that a float32 would blur (UTM): a round number near the first agents.
std::array<double, 3> origin_of(const trajectory::Frame& frame) {
  constexpr double kFarM = 10'000.0, kRoundM = 1'000.0;
  std::array<double, 3> origin{};
  const std::vector<double>* columns[] = {&frame.x_m, &frame.y_m};
  for (std::size_t axis = 0; axis < 2; ++axis) {
    if (columns[axis]->empty()) continue;
    const double first = columns[axis]->front();
    if (std::abs(first) > kFarM) origin[axis] = std::round(first / kRoundM) * kRoundM;
  }
  return origin;
}

void fill_positions(const trajectory::Frame& frame, double origin_z,
                    std::vector<double>& positions) {
  const std::size_t agents = frame.ids.size();
  positions.resize(3 * agents);
  for (std::size_t i = 0; i < agents; ++i) {
    positions[3 * i] = frame.x_m[i];
    positions[3 * i + 1] = frame.y_m[i];
    positions[3 * i + 2] = frame.z_m.empty() ? origin_z : frame.z_m[i];
  }
}

}  // namespace

int run_publish(const PublishCommand& command) {
  const char* const kName = "publish";
  Progress progress(command.common.quiet);
  trajectory::ReadOptions read = command.read;
  read.streams = true;
  read.goes_on = [&](double share) {
    progress.show(absl::StrFormat("%s: looking through it before the first frame, %.0f %% read",
                                  command.file, 100.0 * share));
    return interrupted() == 0;
  };
  auto reader = trajectory::open(command.file, read);
  if (interrupted() != 0) return 128 + interrupted();
  progress.end();
  if (!reader.ok()) {
    report(kName, reader.status());
    return kBadInput;
  }
  if (!command.common.quiet) {
    for (const std::string& note : (*reader)->info().notes) {
      std::fprintf(stderr, "throng publish: note: %s\n", note.c_str());
    }
  }
  trajectory::Frame frame;
  auto more = (*reader)->next(frame);
  if (!more.ok() || !*more) {
    report(kName, more.ok()
                      ? absl::InvalidArgumentError(absl::StrCat(command.file, ": it has no frame"))
                      : more.status());
    return kBadInput;
  }

  trajectory::Info info = (*reader)->info();
  if (!command.environment.empty()) {
    std::ifstream file(command.environment, std::ios::binary);
    info.walkable_area_wkt.assign(std::istreambuf_iterator<char>(file), {});
    if (!file || info.walkable_area_wkt.empty()) {
      report(kName, absl::InvalidArgumentError(
                        absl::StrCat(command.environment, ": cannot be read or is empty")));
      return kBadInput;
    }
  }
  if (!command.net.empty()) {
    const absl::StatusOr<std::string> streets = trajectory::read_sumo_net(command.net);
    if (!streets.ok()) {
      report(kName, streets.status());
      return kBadInput;
    }
    info.walkable_area_wkt.resize(
        std::min(info.walkable_area_wkt.size(), info.walkable_area_wkt.find("\n;")));
    info.walkable_area_wkt += *streets;
  }
  ProducerOptions options;
  options.connection = command.common.connection;
  options.channels = info.channel_names;
  options.seed = command.seed.value_or(info.seed.value_or(0));
  options.take_over = command.take_over;
  options.producer =
      absl::StrCat("throng publish ", std::filesystem::path(command.file).filename().string());
  options.expected_rate_hz = std::min(1000.0, info.fps * command.rate);
  options.walkable_area_wkt = info.walkable_area_wkt;
  options.origin_m = origin_of(frame);
  options.queue_frames = 64;
  options.agent_name = [&reader](std::uint64_t id) { return (*reader)->agent_name(id); };
  options.agent_character = [&reader](std::uint64_t id) { return (*reader)->agent_character(id); };
  const auto wait = std::chrono::milliseconds(static_cast<std::int64_t>(1000 * command.wait_s));
  auto producer =
      Producer::connect(command.common.connection.url, command.crowd, std::move(options));
  if (absl::Status status = producer->wait_connected(wait); !status.ok())
    return report(kName, status);

  Pacer pacer;
  const SteadyClock::time_point began = SteadyClock::now();
  std::int64_t lap_us = 0;  // scene time of the file's first frame in this lap
  std::uint64_t laps = 1;
  std::vector<double> positions;
  std::vector<std::span<const float>> channels;
  for (;;) {
    // The file's last spacing stands between one lap and the next.
    std::int64_t spacing_us = info.fps > 0 ? std::llround(1e6 / info.fps) : 100'000;
    std::int64_t last_us = 0;
    while (more.ok() && *more) {
      if (last_us != 0 && frame.time_us > last_us) spacing_us = frame.time_us - last_us;
      last_us = frame.time_us;
      const std::int64_t time_us = lap_us + frame.time_us;
      const auto due = began + std::chrono::microseconds(static_cast<std::int64_t>(
                                   static_cast<double>(time_us) / command.rate));
      if (!pacer.wait_until(due)) break;
      fill_positions(frame, 0.0, positions);
      channels.assign(frame.channels.begin(), frame.channels.end());
      producer->publish(time_us, frame.ids, positions, frame.heading_rad, channels,
                        {frame.motion, (*reader)->info().motion_names});
      const ProducerStats stats = producer->stats();
      if (stats.ended) return report(kName, stats.last_error);
      progress.show(absl::StrFormat(
          "%s %.1f s, %d agents, %d frames sent, %d dropped, %d viewers%s%s", command.crowd,
          static_cast<double>(time_us) * 1e-6, frame.ids.size(), stats.sent, stats.dropped,
          stats.viewers, stats.connected ? "" : ", reconnecting",
          command.loop ? absl::StrCat(", lap ", laps) : std::string()));
      more = (*reader)->next(frame);
      if (!absl::IsOutOfRange(more.status())) continue;
      // It looked as if it were in order: from the beginning again, sorted, to where it was left.
      progress.end();
      if (!command.common.quiet) {
        absl::FPrintF(stderr, "throng publish: note: %s; it is sorted now\n",
                      std::string(more.status().message()));
      }
      read.streams = false;
      reader = trajectory::open(command.file, read);
      if (!reader.ok()) break;
      do {
        more = (*reader)->next(frame);
      } while (more.ok() && *more && frame.time_us <= last_us);
    }
    if (!reader.ok()) more = reader.status();
    if (interrupted() != 0 || !more.ok() || !command.loop) break;
    lap_us += last_us + spacing_us;
    ++laps;
    reader = trajectory::open(command.file, read);
    if (!reader.ok()) {
      more = reader.status();
      break;
    }
    more = (*reader)->next(frame);
  }
  progress.end();
  if (!more.ok()) {
    report(kName, more.status());
    return kBadInput;
  }

  const absl::Status flushed = producer->flush(std::chrono::seconds(5));
  producer->close(std::chrono::seconds(2));
  const ProducerStats stats = producer->stats();
  if (!command.common.quiet) {
    std::fprintf(stderr, "throng publish: %llu frames published, %llu applied, %llu dropped\n",
                 static_cast<unsigned long long>(stats.published),
                 static_cast<unsigned long long>(stats.applied),
                 static_cast<unsigned long long>(stats.dropped));
  }
  if (interrupted() != 0) return 128 + interrupted();
  if (!flushed.ok()) return report(kName, flushed);
  if (stats.applied == 0) return report(kName, stats.last_error);
  return kOk;
}

}  // namespace throng::client
