#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "simplify/bake/levels.hpp"

namespace throng::simplify {

/// meshopt_simplify of the version that this program was built with ("0.18"), empty: without.
std::string plain_meshoptimizer_version();

/// Simplifies the full-detail mesh by positions alone to at most `triangles` each, with
/// meshopt_simplify. Where it gets stuck above a target, its coarsest. Unimplemented without the
/// library.
absl::StatusOr<std::vector<LevelMesh>> simplify_plain(const render::Character& character,
                                                      std::span<const std::uint32_t> triangles);

/// What attributes weigh beside positions (which the library scales to the unit cube). Of (0.2, 1),
/// (0.5, 1), (0.5, 3), (1, 1) and (1, 10) the first gave the best pictures on six characters.
struct AttributeWeights {
  float normal = 0.2F;
  float uv = 1.0F;
};

/// The same with meshopt_simplifyWithAttributes, normals and uv as attributes, through the PyPI
/// package `meshoptimizer` (Debian's library lacks the function; the package's can be loaded by
/// Python only). Where it gets stuck, its option to leave out small pieces is used if that leaves
/// at least half the triangles wanted. Unavailable with the reason where `python` can't be run or
/// hasn't the package.
/// @param python  interpreter, as a path or a name on PATH
absl::StatusOr<std::vector<LevelMesh>> simplify_with_attributes(
    const render::Character& character, std::span<const std::uint32_t> triangles,
    const std::string& python, const AttributeWeights& weights = {});

/// Version of the package as Python tells it. Unavailable as above.
absl::StatusOr<std::string> attribute_meshoptimizer_version(const std::string& python);

}  // namespace throng::simplify
