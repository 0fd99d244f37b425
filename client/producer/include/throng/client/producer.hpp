#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "throng/client/connection.hpp"

namespace throng::client {

struct ProducerOptions {
  ConnectionOptions connection;       // url is set by `connect`
  std::array<double, 3> origin_m{};   // positions are sent as float32 offsets from it
  std::vector<std::string> channels;  // names of the columns that frames carry
  std::vector<std::string> units;     // empty, or one for each channel
  std::uint64_t seed = 0;             // with the agent's id, decides character, tint and size
  std::string producer = "throng C++ producer";  // free text for the server's log
  std::string run_id;                            // empty: a new one
  double expected_rate_hz = 0.0;                 // frames per second; 0: unknown
  bool take_over = false;                        // end another producer's stream on this crowd
  std::size_t queue_frames = 8;                  // frames that wait at most; the oldest is dropped
  std::string walkable_area_wkt;                 // sent after each connect, unless empty
  // Name of an agent whose id is the hash of a string, or empty; asked when the membership changes.
  std::function<std::string(std::uint64_t)> agent_name;
  // The server's cast member for an agent, -1: its id decides; asked likewise.
  std::function<std::int32_t(std::uint64_t)> agent_character;
};

/// What agents do beside standing, walking and running by their speed.
struct MotionColumn {
  std::span<const std::uint8_t> motion;  // [A] or empty; 0: by speed; k: names[k - 1]
  std::span<const std::string> names;    // "sit", "cheer" ...; at most 64
};

/// Counters since `connect`.
struct ProducerStats {
  std::uint64_t published = 0;  // calls of publish
  std::uint64_t rejected = 0;   // of them, with columns that do not fit
  std::uint64_t dropped = 0;    // pushed out of the full queue, or lost with a connection
  std::uint64_t sent = 0;
  std::uint64_t applied = 0;  // acknowledged by the server
  std::uint64_t late = 0;
  std::uint64_t incomplete = 0;
  std::uint64_t unknown_epoch = 0;  // the membership was sent again
  std::uint64_t connects = 0;
  std::uint32_t viewers = 0;  // that look at the crowd now
  bool connected = false;
  bool ended = false;       // for good: another producer took the crowd over
  absl::Status last_error;  // why the last connection ended, OK at first
};

/// Publishes the agents of one crowd. It never blocks and never throws into the simulation: frames
/// go into a short queue whose oldest is dropped, and a thread of its own sends them, reconnects
/// with back-off, and says start and membership again on every new connection.
///
/// World frame: right-handed, +Z up, metres, seconds, headings in radians counter-clockwise from
/// +X. Used by one thread at a time.
class Producer {
 public:
  /// Does not wait for the server. Bad options are told by `stats().last_error` (and `ended`).
  static std::unique_ptr<Producer> connect(std::string url, std::string crowd,
                                           ProducerOptions options = {});
  /// Closes with a second to send what waits.
  ~Producer();

  /// Queues a frame. Copies everything before it returns.
  /// @param time_us    scene time, larger than in the frame before.
  /// @param ids        [A] unique; agents that are not there have left. The same order as last time
  ///                   costs least.
  /// @param positions  [A][3] or [A][2] (z = 0), metres, world frame.
  /// @param headings   [A] or empty; NaN: unknown.
  /// @param channels   [channel][A] as ProducerOptions::channels, or empty.
  /// @param motions    what agents do; a name that the server's cast has no clip for is as 0.
  /// False, with the reason in `stats().last_error`, if the columns do not fit each other.
  bool publish(std::int64_t time_us, std::span<const std::uint64_t> ids,
               std::span<const double> positions, std::span<const float> headings = {},
               std::span<const std::span<const float>> channels = {},
               const MotionColumn& motions = {}) noexcept;

  /// Waits until the server has acknowledged what was queued. DeadlineExceeded, or why it can't.
  absl::Status flush(std::chrono::milliseconds timeout);
  /// Waits until the server took the crowd. DeadlineExceeded, or why it refuses.
  absl::Status wait_connected(std::chrono::milliseconds timeout);
  /// Sends what waits for at most `timeout`, then ends the stream. The crowd stays as it is.
  void close(std::chrono::milliseconds timeout);

  ProducerStats stats() const;

 private:
  struct State;
  explicit Producer(std::shared_ptr<State> state);
  std::shared_ptr<State> state_;
};

}  // namespace throng::client
