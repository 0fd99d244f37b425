#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "simplify/import/document.hpp"
#include "simplify/import/scene.hpp"

namespace throng::simplify::gltf {

/// A node that moves vertices, and how. A node that two skins bind in ways that can't be reconciled
/// has two of them.
struct Binding {
  std::uint32_t node = 0;
  glm::dmat4 joint_from_bind{1.0};
};

/// The one skeleton that all skins and rigid parts of a character are merged into.
///
/// All points are brought into one bind frame, which is the document's root frame with the
/// character in a pose near its rest pose. For a skin with inverse bind matrices B_j, any
/// invertible M gives the same picture: points M p and matrices B_j M^-1. M is chosen as that W_j
/// B_j (W: rest pose) which is closest to all others, so that where the rest pose is the bind pose
/// the points are just the rest pose. Where it isn't (the file was saved in the middle of a clip),
/// M is the mesh node's own transform, which exporters leave at the bind pose's.
class Bindings {
 public:
  /// @param tolerance_units  by how much two bind matrices of a joint may differ and still be one.
  Bindings(std::size_t node_count, double tolerance_units)
      : first_of_node_(node_count, kNone), tolerance_(tolerance_units) {}

  struct PlacedSkin {
    glm::dmat4 bind_from_mesh{1.0};
    std::vector<std::uint32_t> binding;  // [joints of the skin]
  };

  /// @param inverse_bind, weight  for each joint of the skin; weight is what all vertices give it.
  /// @param mesh_node  of a mesh that wears the skin.
  PlacedSkin place_skin(const Scene& scene, std::span<const glm::dmat4> rest_world,
                        const Skin& skin, std::span<const glm::dmat4> inverse_bind,
                        std::span<const double> weight, std::uint32_t mesh_node);

  struct PlacedPart {
    glm::dmat4 bind_from_mesh{1.0};
    std::uint32_t binding = 0;
  };

  /// A mesh without a skin at `node`: rigid to the nearest node at or above it that is bound or
  /// moves.
  PlacedPart place_part(const Scene& scene, std::span<const glm::dmat4> rest_world,
                        std::span<const char> moves, std::uint32_t node);

  const std::vector<Binding>& all() const { return all_; }

 private:
  std::uint32_t find_or_add(std::uint32_t node, const glm::dmat4& joint_from_bind);
  const Binding* find(std::uint32_t node) const;
  bool agrees(const glm::dmat4& a, const glm::dmat4& b) const;

  std::vector<Binding> all_;
  std::vector<std::int32_t> first_of_node_;  // [nodes], kNone
  double tolerance_;
};

}  // namespace throng::simplify::gltf
