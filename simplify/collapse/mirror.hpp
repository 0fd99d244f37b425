#pragma once

#include <cstdint>
#include <vector>

#include "simplify/rebuild/surface.hpp"

namespace throng::simplify {

/// For each point [P] the one nearest to its mirror image in the bind pose, left for right (y in
/// the model frame, about the middle), kNoIndex where none is within 1 % of `size_m`. Empty for a
/// figure that isn't symmetric: where fewer than 60 % of the points have one.
std::vector<std::uint32_t> find_mirror(const Surface& surface, float size_m);

}  // namespace throng::simplify
