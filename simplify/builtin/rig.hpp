#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "simplify/builtin/body.hpp"

namespace throng::builtin {

struct RigJoint {
  std::string name;
  int parent = -1;
  glm::vec3 position{0.0F};  // model frame, bind pose; bind rotations are identity
};

struct Rig {
  std::vector<RigJoint> joints;  // parents first

  /// Index of a joint, or -1.
  int find(std::string_view name) const;
};

/// Strongest four joints of a vertex, weights sum to 1.
struct Skin {
  std::array<int, 4> joint{0, 0, 0, 0};
  std::array<float, 4> weight{1.0F, 0.0F, 0.0F, 0.0F};
};

/// True where cloth below the hips hangs on joints of its own.
bool has_skirt_joints(const Figure& figure);

/// A skeleton of figure.joint_count joints: the walking ones first, then cloth, hair and bag, then
/// fingers, face and limb twists until the count is met.
Rig make_rig(const Figure& figure, const Mesh& mesh);

/// Weights from the position along each limb, spread over neighbouring vertices.
std::vector<Skin> make_skin(const Figure& figure, const Mesh& mesh, const Rig& rig);

}  // namespace throng::builtin
