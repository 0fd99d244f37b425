#pragma once

#include <absl/status/statusor.h>

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "simplify/report/pose.hpp"
#include "simplify/report/rivals.hpp"
#include "simplify/report/sampling.hpp"
#include "throng/render/asset.hpp"
#include "throng/render/picture.hpp"

namespace throng::simplify {

/// The last two: throng at the triangle count that a rival got stuck at, where it is above
/// throng's.
enum class Method : std::uint8_t { kThrong, kAttributes, kPlain, kAtAttributes, kAtPlain };
inline constexpr std::array<Method, 3> kMethods{Method::kThrong, Method::kAttributes,
                                                Method::kPlain};
/// "throng", "meshoptimizer attributes", ...
const char* method_name(Method method);

/// One direction: the figure's turn to the viewer and how far the viewer looks down.
struct ViewAngle {
  float turn_rad = 0.0F;
  float elevation_rad = 0.0F;
};

/// A quantity over all pictures of one level, views x poses.
struct Spread {
  double median = 0.0;      // of all pictures
  double worst_pose = 0.0;  // mean over the views, in the pose where that is worst
  std::uint32_t pose = 0;   // that pose, into CharacterReport::poses
};

/// How one method does at one level, against the full mesh. The full level is the full mesh itself.
struct LevelReport {
  Method method = Method::kThrong;
  std::uint32_t level = 0;  // into kLevelSpecs
  std::uint32_t vertices = 0, triangles = 0;
  Spread overlap;  // silhouettes: common area over joint area
  Spread psnr_db;  // infinite where nothing differs
  Spread ssim;
  float hausdorff_m = 0.0F;  // two-sided, the largest over all poses
  std::uint32_t hausdorff_pose = 0;
  std::uint32_t worst_picture = 0;  // view + views * pose, of least ssim
};

struct CharacterReport {
  std::string name;
  std::uint32_t vertices = 0, triangles = 0, joints = 0, coarsest_vertices = 0;
  float height_m = 0.0F;
  std::uint64_t file_bytes = 0;
  double bake_s = -1.0;  // negative: not known
  double report_s = 0.0;
  std::vector<std::string> poses;  // names
  std::vector<ViewAngle> views;
  std::vector<LevelReport> levels;       // by method, then level
  std::string levels_png, worst_png;     // file names in the report's folder
  std::optional<SamplingCost> sampling;  // none: not known which poses were sampled
};

/// True where a rival couldn't come down to throng's triangle count (5 % more are the same).
inline bool is_stuck(const LevelReport& ours, const LevelReport& rival) {
  return rival.triangles > 1.05 * std::max(1U, ours.triangles);
}

struct MeasureOptions {
  std::uint32_t views = 8;  // around, half of them from a little above, half from higher up
  std::uint32_t poses = 8;
  std::string python;                      // with the package meshoptimizer; empty: not compared
  std::uint32_t hausdorff_samples = 3000;  // beside all corners
  AttributeWeights attribute_weights;
};

struct Measured {
  CharacterReport report;
  render::Picture levels;  // all levels by all methods, side by side
  render::Picture worst;   // the worst picture of each level beside the full mesh
};

/// Measures every level of a character, and what meshoptimizer makes of its full mesh at the same
/// triangle counts, in the same way. A method that can't run here is left out.
absl::StatusOr<Measured> measure(const render::Character& character, const MeasureOptions& options);

}  // namespace throng::simplify
