#pragma once

#include <cstdint>
#include <functional>

#include "simplify/collapse/attribute_cost.hpp"
#include "simplify/collapse/pose_cost.hpp"
#include "simplify/collapse/views.hpp"
#include "simplify/collapse/wedges.hpp"

namespace throng::simplify {

/// Carries a mesh down to `coarsest_count` wedges by contracting pairs of points, where half-edge
/// collapse with planes and angles has no good choice left: edges, and points of pieces that lie
/// near each other (Garland & Heckbert 1997, section 3.1), so that separate pieces grow together.
/// What remains need not be a manifold. The pair that costs the pictures least goes first, pieces
/// may vanish as a whole; both are steps of the record. The last vertices are contracted in several
/// ways, of which the one whose levels differ least in the pictures is kept.
/// @param error_m      of the last step; never falls
/// @param on_progress  0 to 1; may be empty
void contract(std::uint32_t coarsest_count, float size_m, PoseCost& poses,
              const AttributeCost& attributes, Views& views, float& error_m, WedgeMesh& mesh,
              const std::function<void(float)>& on_progress);

}  // namespace throng::simplify
