#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <string>

#include "throng/render/asset.hpp"

namespace throng::simplify {

/// Text of a Wavefront OBJ of the level with the largest legal count up to `vertices`, at least the
/// coarsest one: bind pose, with uv (origin at the bottom left, as OBJ has it) and normals. Faces
/// are v/vt/vn with equal indices; vertices come in collapse order.
std::string obj_of_level(const render::Character& character, std::uint32_t vertices);

/// Writes `obj_of_level` atomically. Unavailable when it can't be written.
absl::Status export_obj(const render::Character& character, std::uint32_t vertices,
                        const std::string& path);

}  // namespace throng::simplify
