#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

namespace throng::simplify {

/// A tree of boxes over triangles, for the distance of points to a surface.
class TriangleTree {
 public:
  /// Both spans must outlive the tree.
  TriangleTree(std::span<const glm::vec3> position, std::span<const glm::uvec3> triangles);

  /// Squared distance from `point` to the nearest triangle, infinity where there is none. Stops as
  /// soon as a triangle within `enough2` is found and then tells that triangle's: for a maximum
  /// over points, what is nearer than the maximum so far need not be known (Taha & Hanbury 2015).
  float distance2(const glm::vec3& point, float enough2 = 0.0F) const;

 private:
  struct Node {
    glm::vec3 low, high;
    std::uint32_t first;  // leaf: into order_; else the left child, the right one follows
    std::uint32_t count;  // triangles of a leaf, 0 for others
  };
  void build(std::uint32_t node, std::uint32_t begin, std::uint32_t end);

  std::span<const glm::vec3> position_;
  std::span<const glm::uvec3> triangles_;
  std::vector<glm::vec3> centre_;
  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

/// Places on a surface, spread evenly by area in the pose they were chosen in: the corners of all
/// triangles and points between. The same places can be looked up in any pose.
class SurfaceSamples {
 public:
  /// @param between  places beside the corners
  /// @param with_corners  false: places by area alone, as a mean over the surface needs
  SurfaceSamples(std::span<const glm::vec3> position, std::span<const glm::uvec3> triangles,
                 std::uint32_t between, bool with_corners = true);
  std::size_t size() const { return samples_.size(); }
  glm::vec3 at(std::size_t i, std::span<const glm::vec3> position) const {
    const Sample& s = samples_[i];
    return position[s.corner.x] * s.share.x + position[s.corner.y] * s.share.y +
           position[s.corner.z] * s.share.z;
  }

 private:
  struct Sample {
    glm::uvec3 corner;
    glm::vec3 share;
  };
  std::vector<Sample> samples_;
};

/// The largest distance from a sample to the surface, if it is more than `largest2`; else
/// `largest2`. Squared.
float farthest2(const SurfaceSamples& samples, std::span<const glm::vec3> position,
                const TriangleTree& surface, float largest2);

}  // namespace throng::simplify
