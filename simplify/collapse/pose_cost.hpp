#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "simplify/collapse/collapse.hpp"
#include "simplify/collapse/wedges.hpp"

namespace throng::simplify {

/// What moving a surface's points costs, in all poses at once.
///
/// Quadric error (Garland & Heckbert 1997) in each pose: the squared distance to the planes of the
/// triangles around a point, each weighted by a third of its area, so a cost is in m^4. Quadrics
/// are kept relative to their own point, which leaves single precision enough digits: a point costs
/// only what it took over from others. Values of one kind lie side by side for all poses (lanes),
/// for vector instructions.
class PoseCost {
 public:
  /// @param visible  [T] how much of each triangle is ever seen, 0 to 1; empty for all of all
  PoseCost(const PoseSet& poses, const WedgeMesh& mesh, float size_m,
           std::span<const float> visible = {});

  struct Cost {
    float mean;     // m^4, over poses by their weight
    float largest;  // m^4, over poses that count
  };
  /// Of moving point a, with all it took over, to where b is.
  Cost move_cost(std::uint32_t a, std::uint32_t b) const;

  /// Mean over poses in m^4 of what the extents lose, if a is one of the outermost points along an
  /// axis and b lies farther inside. Quadrics shrink a shape to its trunk when few points are left;
  /// from afar the height of a person is what is seen.
  float extent_cost(std::uint32_t a, std::uint32_t b, bool is_coarse) const;
  /// Square metres that the lost extent of a piece counts for.
  float extent_weight() const;

  /// True if in some pose the triangle (a, x, y), a moved to b, turns by more than the angle whose
  /// cosine is given, or becomes a sliver that it was not. Quality is 1 for an equilateral
  /// triangle.
  bool breaks(std::uint32_t a, std::uint32_t b, std::uint32_t x, std::uint32_t y,
              float least_cosine, float least_quality, bool bind_pose_only) const;

  /// b takes over what a stands for.
  void merge(std::uint32_t a, std::uint32_t b);

  /// Third of the area of the triangles that a point stands for, mean over poses.
  float area_m2(std::uint32_t point) const { return area_[point]; }
  float initial_area_m2(std::uint32_t triangle) const { return triangle_area_[triangle]; }

 private:
  static constexpr std::uint32_t kTerms = 9;  // xx xy xz yy yz zz, x y z; then the constant
  float* quadric(std::uint32_t point) {
    return &quadric_[std::size_t{point} * (kTerms + 1) * lanes_];
  }
  const float* quadric(std::uint32_t point) const {
    return &quadric_[std::size_t{point} * (kTerms + 1) * lanes_];
  }
  const float* position(std::uint32_t point) const {
    return &position_[std::size_t{point} * 3 * lanes_];
  }
  void add_plane(std::uint32_t point, std::uint32_t lane, const glm::vec3& normal, float weight);

  std::uint32_t lanes_;
  std::vector<float> weight_;    // [lanes]
  std::vector<float> counts_;    // [lanes] 1 for a pose that counts in the maximum
  std::vector<float> position_;  // [P][3][lanes]
  std::vector<float> quadric_;   // [P][10][lanes]
  std::vector<float> extent_;    // [6][lanes] least and greatest x, y, z
  float size_m_;
  std::vector<float> area_;           // [P]
  std::vector<float> triangle_area_;  // [T]
};

}  // namespace throng::simplify
