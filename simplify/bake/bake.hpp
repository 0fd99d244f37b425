#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "simplify/collapse/collapse.hpp"
#include "simplify/rebuild/surface.hpp"
#include "simplify/source_character.hpp"

namespace throng::simplify {

struct BakeOptions {
  Criterion criterion = Criterion::kThrong;
  RebuildOptions rebuild;
  std::uint32_t max_poses = 24;            // sampled for the default criterion
  std::uint32_t coarsest_count = 28;       // vertices of the coarsest level
  float height_m = 0.0F;                   // scales the character to this height; 0 keeps its own
  bool bind_pose_only = false;             // as published work before Peng et al. 2011, to compare
  std::uint32_t threads = 1;               // that one character may keep busy
  std::function<void(float)> on_progress;  // 0 to 1, from the calling thread
};

struct BakeResult {
  render::CharacterData character;
  std::uint32_t point_count = 0;           // welded points; vertices are their wedges
  std::uint32_t pose_count = 0;            // poses that the collapse was judged in
  std::vector<std::uint32_t> pose_frames;  // those but the bind pose, into the palette
  double seconds = 0.0;
  std::vector<std::string> notes;  // for the user: what was left out, changed or guessed
};

/// Makes a baked character: prepares the clips, rebuilds the surface, collapses it and puts all in
/// collapse order. The result keeps every promise of render::Character and is whole at every level.
/// InvalidArgument names what is wrong with the source.
absl::StatusOr<BakeResult> bake(const SourceCharacter& source, const BakeOptions& options = {});

}  // namespace throng::simplify
