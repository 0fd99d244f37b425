#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "simplify/import/document.hpp"
#include "simplify/import/scene.hpp"

namespace throng::simplify::gltf {

/// Something that moves the nodes of a scene over time: a clip of the file, of another file, or a
/// made one.
struct Motion {
  std::string name;
  double duration_s = 0.0;
  std::vector<std::uint32_t> moved;  // nodes whose local transform it sets

  /// Sets the local transforms of `moved` at a time in [0, duration_s]; the others keep their rest.
  std::function<void(double time_s, std::vector<Local>& locals)> pose;
};

/// The animations of a document. Nameless ones that each move other nodes are one motion.
/// InvalidArgument names animation, sampler and accessor.
absl::StatusOr<std::vector<Motion>> read_motions(const Document& document,
                                                 std::vector<std::string>& notes);

/// The animations of another file on this scene, matched by node name. Where both rest poses agree
/// the keys are taken as they are, else rotations are carried over relative to each rest pose.
absl::StatusOr<std::vector<Motion>> borrow_motions(const Document& document, const Scene& scene,
                                                   const std::string& clip_file,
                                                   std::vector<std::string>& notes);

}  // namespace throng::simplify::gltf
