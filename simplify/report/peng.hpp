#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <string>

#include "throng/render/picture.hpp"

namespace throng::simplify {

/// Figures 2 (c, d) and 3 of Peng et al. 2011 with a character of the built-in cast.
struct PengFigures {
  render::Picture poses;   // 300 triangles: bind pose only, all frames
  render::Picture levels;  // 2620 to 190 triangles
  std::string html;        // what they show, with figures; names the pictures as given
};

/// Bakes the character twice by the published criterion, once judged in the bind pose only and once
/// in every frame of all clips. Where the rule gets stuck above a triangle count, shows where.
/// InvalidArgument: no such character.
absl::StatusOr<PengFigures> paint_peng2011(const std::string& builtin_name,
                                           const std::string& poses_png,
                                           const std::string& levels_png);

}  // namespace throng::simplify
