#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "throng/render/crowd.hpp"

namespace throng::v1 {
class AgentChunk;
class Membership;
}  // namespace throng::v1

namespace throng::server {

/// Puts the agent frames of one stream together from memberships and chunks. It trusts nothing:
/// every length, index and number is checked before it is used, and what it holds is bounded by
/// `max_agents`. Not thread safe.
class FrameAssembler {
 public:
  enum class Verdict { kUnknownEpoch, kIncomplete, kLate };
  struct Refused {
    std::uint64_t frame_index;
    Verdict verdict;
  };
  /// What a chunk led to: frames that came to nothing, and the frame that it completed.
  struct Result {
    std::vector<Refused> refused;  // at most two
    std::uint64_t frame_index = 0;
    std::optional<render::AgentFrame> complete;
  };

  FrameAssembler(std::uint32_t max_agents, std::size_t channel_count)
      : max_agents_(max_agents), channel_count_(channel_count) {}

  /// Replaces the membership. The same epoch again is taken (a producer that is not sure resends).
  /// A frame that is half there keeps the membership it began with.
  /// InvalidArgument: an epoch that is 0 or falls, a length that does not fit, an id twice.
  /// ResourceExhausted: too many agents.
  absl::Status set_membership(const v1::Membership& membership);

  /// Adds a chunk; chunks of one frame may come in any order. InvalidArgument names the field, the
  /// value and the limit: a wrong length, rows beyond the epoch's agents or sent before, a frame
  /// index of 0, another scene time or epoch than the chunks before.
  absl::StatusOr<Result> add(const v1::AgentChunk& chunk);

 private:
  absl::Status copy_rows(const v1::AgentChunk& chunk, std::uint32_t first, std::uint32_t count);
  absl::Status copy_motions(const v1::AgentChunk& chunk, std::uint32_t first, std::uint32_t count);
  absl::Status cover(std::uint32_t first, std::uint32_t count);

  const std::uint32_t max_agents_;
  const std::size_t channel_count_;
  std::shared_ptr<const render::Membership> membership_;
  std::uint64_t newest_index_ = 0;  // newest frame seen, done or not
  bool open_ = false;               // frame newest_index_ still lacks rows
  std::uint32_t missing_ = 0;
  render::AgentFrame frame_;
  std::map<std::uint32_t, std::uint32_t> covered_;  // first row -> end of the rows that are there
};

/// Heading of a unit or nearly unit quaternion x y z w: where it turns +X to, seen from above.
/// NaN for the zero quaternion, numbers that are not finite, and a body that points straight up.
float heading_of_quaternion(float x, float y, float z, float w);

}  // namespace throng::server
