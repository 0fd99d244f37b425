#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::simplify {

/// What it costs a character that its levels were made in some frames only: how far they are from
/// the full mesh over those frames, over the usual ones (of idle, walk and run, where a character
/// has one of them), and over all frames of all clips, which they were picked from. Metres.
struct SamplingCost {
  /// Between surfaces, both ways, over a set of frames.
  struct Distance {
    float rms_m = 0.0F, max_m = 0.0F;
  };
  struct Level {
    std::uint32_t level = 0;       // into kLevelSpecs, from 1 on
    Distance sampled, usual, all;  // over sampled frames, idle, walk and run, all frames
    std::string worst_left_out;    // frame of largest rms that was not sampled; empty: none
    float worst_left_out_rms_m = 0.0F;
    /// How much larger the rms is over other frames than the sampled ones, relative.
    float excess(const Distance& over) const {
      return sampled.rms_m > 0.0F ? over.rms_m / sampled.rms_m - 1.0F : 0.0F;
    }
  };
  std::uint32_t frames = 0, usual = 0, sampled = 0;
  // the frame that is least like any sampled one and the bind pose; empty: none left out
  std::string farthest;
  float farthest_m = 0.0F;  // mean distance of points to where the most like pose has them
  std::vector<Level> levels;
};

/// Poses the character in each frame of its clips, one at a time, and measures the levels there.
/// What it holds does not grow with frames, but for 256 points of each sampled one.
/// @param pose_frames  the sampled frames, into the palette. Without any (bind pose only) `sampled`
///                     distances are those of the bind pose.
/// InvalidArgument for a frame that the character doesn't have.
absl::StatusOr<SamplingCost> measure_sampling(const render::Character& character,
                                              std::span<const std::uint32_t> pose_frames);

}  // namespace throng::simplify
