#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <span>
#include <string>
#include <vector>

#include "simplify/rebuild/surface.hpp"

namespace throng::simplify {

enum class Criterion : std::uint8_t {
  /// Ours: any wedge collapses, at a cost that tells what is seen of it. See wedges.hpp,
  /// decimate.cpp.
  kThrong,
  /// Peng et al. 2011, section 4.2: fixed, companioned and regular vertices.
  kPeng2011,
};

/// Where the points of a surface are in a number of poses; pose 0 is the bind pose.
struct PoseSet {
  std::uint32_t count = 0;
  std::vector<glm::vec3> position;   // [count][P], metres, model frame
  std::vector<float> weight;         // [count] share of the mean cost, sums to 1
  std::vector<std::uint32_t> frame;  // [count - 1] of the palette, for pose 1 and up
};

/// Linear blend skinning of all points with one frame of a palette [J].
void skin(std::span<const SourcePoint> points, std::span<const render::Affine> palette,
          std::span<glm::vec3> position);

/// Farthest-point sampling: the bind pose, then again and again the frame that is least like those
/// chosen, by the mean distance of points, until `max_count` or until all is covered within 1 mm.
/// The bind pose has half the weight of another one, or all of it where there is no frame.
/// @param palette  [F][J]
PoseSet sample_poses(const Surface& surface, std::span<const render::Affine> palette,
                     std::uint32_t joint_count, std::uint32_t max_count);

/// Every frame with the same weight and the bind pose with none, as Peng et al. 2011 average. Takes
/// evenly spaced frames where all would need more than `max_bytes` of quadrics.
PoseSet all_poses(const Surface& surface, std::span<const render::Affine> palette,
                  std::uint32_t joint_count, std::uint64_t max_bytes = std::uint64_t{1} << 30U);

struct CollapseOptions {
  Criterion criterion = Criterion::kThrong;
  std::uint32_t coarsest_count = 28;       // stop at so many vertices, seam copies counted
  std::function<void(float)> on_progress;  // 0 to 1, from the calling thread
  /// Asked on the way, with the levels made so far: is the coarsest of them shown better with
  /// colours of its own (render::CornerTones) than with the texture, or so little worse that
  /// coarser ones gain by freer choices? None: it is.
  std::function<bool(const struct CollapseOrder&)> prefers_tones;
  std::uint32_t threads = 1;
};

/// A collapse order of a surface's wedges. New indices count in collapse order: 0 is the last left.
struct CollapseOrder {
  std::vector<std::uint32_t> wedge;              // [C] old index of each vertex
  std::vector<std::uint32_t> target;             // [C] new index, target[i] < i
  std::vector<std::uint32_t> triangle;           // [T] old index of each triangle, in removal order
  std::vector<std::uint32_t> triangle_count_at;  // [C+1]
  std::vector<std::uint32_t> legal_count;        // [C+1]
  std::vector<float> error_m;                    // [C]
  std::uint32_t coarsest_count = 0;
  std::uint32_t toned_count = 0;  // levels up to it were chosen as if they had corner tones
  std::vector<std::string> notes;
};

/// Collapses half-edges from fine to coarse, cheapest first, until `coarsest_count` vertices are
/// left or nothing more can go. All wedges of a point go together, and those that this leaves
/// without a triangle go with them; counts between are not legal.
///
/// InvalidArgument where the surface isn't the manifold that `rebuild` makes or shapes disagree.
absl::StatusOr<CollapseOrder> collapse(const Surface& surface, const PoseSet& poses,
                                       const CollapseOptions& options = {});

/// Checks at every legal vertex count n that each triangle drawn has three distinct corners and
/// that each vertex below n is one of them. Internal names the vertex or triangle and the count.
absl::Status check_levels(const render::Character& character);

}  // namespace throng::simplify
