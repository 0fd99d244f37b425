#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "simplify/rebuild/surface.hpp"

namespace throng::simplify {

inline constexpr std::uint32_t kNoIndex = 0xFFFFFFFFU;

/// One wedge of the point that goes, and the wedge of the other point that takes its place.
struct WedgeMove {
  std::uint32_t from = kNoIndex;
  std::uint32_t to = kNoIndex;
  bool is_exact = false;  // `to` continues `from` in the same chart, so nothing tears
  // exact on both sides of the edge, but with different wedges (end of a dart)
  bool is_ambiguous = false;
};

/// The wedges of a surface while it is collapsed, and the record of what went.
///
/// Rule for a collapse of point a into b (after Peng et al. 2011, section 4.2, and wedges as in
/// Hoppe 1996): the triangles at edge ab die, on a manifold one left and one right of it, and in
/// each of them a wedge of a lies next to a wedge of b in the same chart. A wedge of a that lives
/// on in other triangles and lies in one of the two moves to that neighbour: exactly, with no tear.
/// A wedge in neither of them is cut off from b by a seam (or b lies in another piece); it can only
/// move to the wedge of b with the nearest uv, which stretches texture over the seam. Whether that
/// is allowed, and at what cost, is the caller's.
class WedgeMesh {
 public:
  /// A step of the record: wedges that went together and the triangles that went with them.
  struct Step {
    std::uint32_t first_removal = 0;  // into `removals`, up to the next step's
    std::uint32_t alive_wedges = 0;   // after the step
    float error_m = 0.0F;
  };
  struct Removal {
    std::uint32_t wedge;
    std::uint32_t target;  // alive after the step
  };

  explicit WedgeMesh(const Surface& surface);

  const Surface& surface() const { return *surface_; }
  const glm::uvec3& points(std::uint32_t triangle) const { return points_[triangle]; }
  const glm::uvec3& wedges(std::uint32_t triangle) const { return wedges_[triangle]; }
  bool is_alive(std::uint32_t triangle) const { return death_[triangle] == kNoIndex; }
  bool has(std::uint32_t triangle, std::uint32_t point) const {
    const glm::uvec3& corner = points_[triangle];
    return corner.x == point || corner.y == point || corner.z == point;
  }
  std::uint32_t alive_wedges() const { return alive_wedges_; }
  /// Of one point.
  std::uint32_t alive_wedges(std::uint32_t point) const {
    return static_cast<std::uint32_t>(point_wedges_[point].size());
  }
  std::span<const std::uint32_t> point_wedges(std::uint32_t point) const {
    return point_wedges_[point];
  }
  std::uint32_t initial_wedges(std::uint32_t point) const { return initial_wedges_[point]; }
  const std::vector<Step>& steps() const { return steps_; }
  const std::vector<Removal>& removals() const { return removals_; }
  /// Step at which each triangle goes, kNoIndex for those that stay.
  const std::vector<std::uint32_t>& death() const { return death_; }

  /// Fills `moves` for the collapse of a into b.
  /// @param around  alive triangles of a
  void find_moves(std::uint32_t a, std::uint32_t b, std::span<const std::uint32_t> around,
                  std::vector<WedgeMove>& moves) const;

  /// Does the collapse and records it as one step.
  /// @param twins  of `around`: those that would lie on another triangle, and go too
  void collapse(std::uint32_t a, std::uint32_t b, std::span<const std::uint32_t> around,
                std::span<const WedgeMove> moves, float error_m,
                std::span<const std::uint32_t> twins = {});

  /// Removes whole triangles, whose points keep no other, as one step. Their wedges go to `target`,
  /// which stays.
  void remove(std::span<const std::uint32_t> triangles, std::uint32_t target, float error_m);

 private:
  void kill(std::uint32_t triangle);
  std::uint32_t nearest_alive_wedge(std::uint32_t point, std::uint32_t wedge) const;

  const Surface* surface_;
  std::vector<glm::uvec3> points_, wedges_;               // [T]
  std::vector<std::uint32_t> death_;                      // [T]
  std::vector<std::uint32_t> users_;                      // [C] alive triangles of a wedge
  std::vector<std::vector<std::uint32_t>> point_wedges_;  // [P] alive ones
  std::vector<std::uint32_t> initial_wedges_;             // [P]
  std::uint32_t alive_wedges_ = 0;
  std::vector<Step> steps_;
  std::vector<Removal> removals_;
};

}  // namespace throng::simplify
