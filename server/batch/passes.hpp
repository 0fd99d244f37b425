#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <vector>

#include "throng/render/frame.hpp"

namespace throng::server {

/// What is written of each picture. `any` of the last two asks the rasterizer for more than
/// colours.
struct PassSet {
  bool color = true, depth = false, id = false;
  bool data() const { return depth || id; }
  int count() const { return int{color} + int{depth} + int{id}; }
};

/// "color,depth,id". InvalidArgument names what is not known, or that there is none.
absl::StatusOr<PassSet> parse_passes(const std::string& text);

/// EXR with the channel Z: metres along the viewing axis, infinity where only the sky is.
absl::StatusOr<std::vector<std::uint8_t>> encode_depth(const render::FramePasses& passes);

/// EXR with three channels of unsigned integers: `class` (0 sky or ground, 1 agent, 2 what stands
/// around), and where it is 1 the agent's 64-bit id as `id` + 2^32 * `id_high`.
absl::StatusOr<std::vector<std::uint8_t>> encode_ids(const render::FramePasses& passes);

/// Which box of an agent `--boxes` tells.
enum class BoxExtent { kVisible, kWhole };

/// Lines of the MOTChallenge text format, by agent id: frame, id, left, top, width, height, 1, -1,
/// -1, -1. Pixels, the picture's left top one is (1, 1). Agents that no pixel shows are left out.
/// kVisible: around the pixels that show the agent. kWhole: also around what others hide, up to the
/// picture's edges; it may be some pixels too large.
std::string box_lines(std::uint32_t frame, const render::FramePasses& passes, BoxExtent extent);

}  // namespace throng::server
