#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "simplify/source_character.hpp"

namespace throng::simplify {

struct ImportOptions {
  std::optional<float> height_m;        // scale everything so that the character is this tall
  std::vector<std::string> clip_files;  // more clips, matched by joint name
  float sample_rate_hz = 30.0F;         // of the clips, (0, 240]
  float turn_deg = 0.0F;  // counter-clockwise seen from above, for files that don't face +Z
};

/// Reads a glTF 2.0 file (.gltf with its buffers and images, or .glb) into one character.
///
/// All meshes, materials and skins of the default scene become one mesh over one skeleton. The
/// model frame is ours (glTF's +Z forward is +X, +Y up is +Z, +X left is +Y), feet on z = 0 and the
/// origin between them at the first frame of the idle clip (else walk, else the first, else the
/// rest pose). For every frame and every joint
///
///     position = sum of weight * model_from_joint * joint_from_model * point
///
/// is what glTF 2.0 section 3.7.3 prescribes for the node hierarchy at that time. What was left
/// out, repaired or guessed is in `notes`.
///
/// A skeleton without clips gets a walk and an idle when its joint names are those of a humanoid.
///
/// Errors: InvalidArgument naming the file and the element (`mesh 0 primitive 1 accessor 5`), the
/// value and the limit, for a missing, malformed or oversized file or one that needs an extension
/// that isn't there.
absl::StatusOr<SourceCharacter> import_gltf(const std::string& path,
                                            const ImportOptions& options = {});

/// As `import_gltf` for a file that is in memory already. `path` names it in messages and is what
/// the buffers and images outside it are relative to.
absl::StatusOr<SourceCharacter> import_gltf_bytes(std::span<const std::uint8_t> bytes,
                                                  const std::string& path,
                                                  const ImportOptions& options = {});

}  // namespace throng::simplify
