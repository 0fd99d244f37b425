#include "server/rpc/frame_assembler.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "server/scene/limits.hpp"
#include "throng/v1/ingest.pb.h"

namespace throng::server {
namespace {

// Columns are little-endian on the wire and copied whole.
static_assert(std::endian::native == std::endian::little);

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();

absl::Status wrong_length(const std::string& field, std::size_t bytes, std::uint64_t want) {
  return absl::InvalidArgumentError(
      absl::StrCat(field, ": it has ", bytes, " bytes, must have ", want));
}

}  // namespace

float heading_of_quaternion(float x, float y, float z, float w) {
  // First column of the rotation matrix, times the squared norm, which the angle does not need.
  const double east = double{w} * w + double{x} * x - double{y} * y - double{z} * z;
  const double north = 2.0 * (double{x} * y + double{w} * z);
  const double norm = double{x} * x + double{y} * y + double{z} * z + double{w} * w;
  if (!std::isfinite(norm) || norm < 1e-12) return kUnknown;
  if (east * east + north * north < 1e-8 * norm * norm) return kUnknown;
  return static_cast<float>(std::atan2(north, east));
}

absl::Status FrameAssembler::set_membership(const v1::Membership& membership) {
  const std::string& ids = membership.ids();
  const std::uint64_t agents = ids.size() / sizeof(std::uint64_t);
  if (membership.epoch() == 0 ||
      (membership_ != nullptr && membership.epoch() < membership_->epoch)) {
    return absl::InvalidArgumentError(
        absl::StrCat("membership.epoch: it is ", membership.epoch(), ", must be over ",
                     membership_ != nullptr ? membership_->epoch : 0));
  }
  if (ids.size() % sizeof(std::uint64_t) != 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("membership.ids: it has ", ids.size(), " bytes, must be a multiple of 8"));
  }
  if (agents > max_agents_) {
    return absl::ResourceExhaustedError(
        absl::StrCat("membership.ids: ", agents, " agents, at most ", max_agents_));
  }
  if (membership.names_size() != 0 &&
      static_cast<std::uint64_t>(membership.names_size()) != agents) {
    return absl::InvalidArgumentError(
        absl::StrCat("membership.names: ", membership.names_size(), ", must be 0 or ", agents));
  }
  const std::string& characters = membership.characters();
  if (!characters.empty() && characters.size() != agents * sizeof(std::int32_t)) {
    return wrong_length("membership.characters", characters.size(), agents * sizeof(std::int32_t));
  }

  auto made = std::make_shared<render::Membership>();
  made->epoch = membership.epoch();
  made->ids.resize(agents);
  if (agents > 0) std::memcpy(made->ids.data(), ids.data(), ids.size());
  std::vector<std::uint64_t> sorted = made->ids;
  std::sort(sorted.begin(), sorted.end());
  if (const auto twice = std::adjacent_find(sorted.begin(), sorted.end()); twice != sorted.end()) {
    return absl::InvalidArgumentError(absl::StrCat("membership.ids: ", *twice, " is there twice"));
  }
  made->names.assign(membership.names().begin(), membership.names().end());
  if (!characters.empty()) {
    made->characters.resize(agents);
    std::memcpy(made->characters.data(), characters.data(), characters.size());
  }
  membership_ = std::move(made);
  return absl::OkStatus();
}

absl::StatusOr<FrameAssembler::Result> FrameAssembler::add(const v1::AgentChunk& chunk) {
  Result result;
  result.frame_index = chunk.frame_index();
  if (chunk.frame_index() == 0) {
    return absl::InvalidArgumentError("chunk.frame_index: it is 0, must be over 0");
  }
  if (absl::Status status = check_scene_time("chunk.scene_time_us", chunk.scene_time_us());
      !status.ok()) {
    return status;
  }

  // An older frame is gone for good; one refused already is told once.
  if (chunk.frame_index() < newest_index_) {
    result.refused.push_back({chunk.frame_index(), Verdict::kLate});
    return result;
  }
  const bool begins = chunk.frame_index() > newest_index_;
  if (!begins && !open_) return result;
  if (begins) {
    if (open_) result.refused.push_back({newest_index_, Verdict::kIncomplete});
    newest_index_ = chunk.frame_index();
    open_ = false;
    covered_.clear();
    if (membership_ == nullptr || chunk.epoch() != membership_->epoch) {
      result.refused.push_back({chunk.frame_index(), Verdict::kUnknownEpoch});
      return result;
    }
    open_ = true;
    const std::size_t agents = membership_->ids.size();
    missing_ = static_cast<std::uint32_t>(agents);
    frame_ = render::AgentFrame();
    frame_.time_us = chunk.scene_time_us();
    frame_.membership = membership_;
    frame_.position_m.resize(agents);
  } else if (chunk.scene_time_us() != frame_.time_us) {
    return absl::InvalidArgumentError(absl::StrCat("chunk.scene_time_us: it is ",
                                                   chunk.scene_time_us(), ", frame ", newest_index_,
                                                   " began with ", frame_.time_us));
  } else if (chunk.epoch() != frame_.membership->epoch) {
    return absl::InvalidArgumentError(absl::StrCat("chunk.epoch: it is ", chunk.epoch(), ", frame ",
                                                   newest_index_, " began with ",
                                                   frame_.membership->epoch));
  }

  const std::uint64_t row_bytes = sizeof(glm::vec3);
  if (chunk.positions().size() % row_bytes != 0) {
    return absl::InvalidArgumentError(absl::StrCat(
        "chunk.positions: it has ", chunk.positions().size(), " bytes, must be a multiple of 12"));
  }
  const std::uint64_t rows = chunk.positions().size() / row_bytes;
  const std::uint64_t agents = frame_.membership->ids.size();
  if (std::uint64_t{chunk.first_agent()} + rows > agents) {
    return absl::InvalidArgumentError(absl::StrCat("chunk: rows ", chunk.first_agent(), " to ",
                                                   chunk.first_agent() + rows, ", epoch ",
                                                   frame_.membership->epoch, " has ", agents));
  }
  const auto count = static_cast<std::uint32_t>(rows);
  if (absl::Status status = cover(chunk.first_agent(), count); !status.ok()) return status;
  if (absl::Status status = copy_rows(chunk, chunk.first_agent(), count); !status.ok()) {
    return status;
  }
  missing_ -= count;
  if (missing_ == 0) {
    open_ = false;
    covered_.clear();
    result.complete = std::move(frame_);
    frame_ = render::AgentFrame();
  }
  return result;
}

absl::Status FrameAssembler::cover(std::uint32_t first, std::uint32_t count) {
  if (count == 0) return absl::OkStatus();
  const std::uint32_t end = first + count;
  auto after = covered_.upper_bound(first);
  const bool overlaps_before = after != covered_.begin() && std::prev(after)->second > first;
  if (overlaps_before || (after != covered_.end() && after->first < end)) {
    return absl::InvalidArgumentError(absl::StrCat("chunk: rows ", first, " to ", end, " of frame ",
                                                   newest_index_, " were sent before, in part"));
  }
  // Neighbours grow together, so chunks in order keep this map at one entry.
  auto entry = covered_.end();
  if (after != covered_.begin() && std::prev(after)->second == first) {
    entry = std::prev(after);
    entry->second = end;
  } else {
    entry = covered_.emplace(first, end).first;
  }
  if (after != covered_.end() && after->first == end) {
    entry->second = after->second;
    covered_.erase(after);
  }
  return absl::OkStatus();
}

absl::Status FrameAssembler::copy_rows(const v1::AgentChunk& chunk, std::uint32_t first,
                                       std::uint32_t count) {
  const std::size_t agents = frame_.membership->ids.size();
  const std::size_t column_bytes = std::size_t{count} * sizeof(float);
  if (count > 0) {
    std::memcpy(frame_.position_m.data() + first, chunk.positions().data(),
                chunk.positions().size());
  }

  // Chunks without an orientation, in a frame where others have one, leave it unknown.
  if (chunk.orientation_case() != v1::AgentChunk::ORIENTATION_NOT_SET &&
      frame_.heading_rad.empty()) {
    frame_.heading_rad.assign(agents, kUnknown);
  }
  if (chunk.orientation_case() == v1::AgentChunk::kHeadings) {
    if (chunk.headings().size() != column_bytes) {
      return wrong_length("chunk.headings", chunk.headings().size(), column_bytes);
    }
    if (count > 0) {
      std::memcpy(frame_.heading_rad.data() + first, chunk.headings().data(), column_bytes);
    }
    for (std::uint32_t row = first; row < first + count; ++row) {
      if (!std::isfinite(frame_.heading_rad[row])) frame_.heading_rad[row] = kUnknown;
    }
  } else if (chunk.orientation_case() == v1::AgentChunk::kQuaternions) {
    if (chunk.quaternions().size() != 4 * column_bytes) {
      return wrong_length("chunk.quaternions", chunk.quaternions().size(), 4 * column_bytes);
    }
    const char* source = chunk.quaternions().data();
    for (std::uint32_t row = first; row < first + count; ++row, source += 4 * sizeof(float)) {
      float q[4];
      std::memcpy(q, source, sizeof q);
      frame_.heading_rad[row] = heading_of_quaternion(q[0], q[1], q[2], q[3]);
    }
  }

  const auto channels = static_cast<std::size_t>(chunk.channels_size());
  if (channels != 0 && channels != channel_count_) {
    return absl::InvalidArgumentError(
        absl::StrCat("chunk.channels: ", channels, ", must be 0 or ", channel_count_));
  }
  if (channels != 0 && frame_.channels.empty()) {
    frame_.channels.assign(channel_count_, std::vector<float>(agents, kUnknown));
  }
  for (std::size_t i = 0; i < channels; ++i) {
    const std::string& column = chunk.channels(static_cast<int>(i));
    if (column.size() != column_bytes) {
      return wrong_length(absl::StrCat("chunk.channels[", i, "]"), column.size(), column_bytes);
    }
    if (count > 0) std::memcpy(frame_.channels[i].data() + first, column.data(), column_bytes);
  }
  return copy_motions(chunk, first, count);
}

absl::Status FrameAssembler::copy_motions(const v1::AgentChunk& chunk, std::uint32_t first,
                                          std::uint32_t count) {
  if (chunk.motions().empty()) return absl::OkStatus();
  if (chunk.motions().size() != count) {
    return wrong_length("chunk.motions", chunk.motions().size(), count);
  }
  if (static_cast<std::size_t>(chunk.motion_names_size()) > render::kMostMotionNames) {
    return absl::InvalidArgumentError(absl::StrCat(
        "chunk.motion_names: ", chunk.motion_names_size(), ", at most ", render::kMostMotionNames));
  }
  if (frame_.motion.empty()) {
    frame_.motion.assign(frame_.membership->ids.size(), 0);
    frame_.motion_names.assign(chunk.motion_names().begin(), chunk.motion_names().end());
  } else if (!std::equal(frame_.motion_names.begin(), frame_.motion_names.end(),
                         chunk.motion_names().begin(), chunk.motion_names().end())) {
    return absl::InvalidArgumentError(absl::StrCat(
        "chunk.motion_names: not those of the chunks before of frame ", newest_index_));
  }
  std::memcpy(frame_.motion.data() + first, chunk.motions().data(), count);
  return absl::OkStatus();
}

}  // namespace throng::server
