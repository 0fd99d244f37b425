#pragma once

#include <cstdint>
#include <functional>
#include <span>

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
///
/// Where corners will have colours of their own, pictures are compared as if they had, and torn
/// texture costs nothing. `prefers_tones` is asked about `mesh` as it is, a few times from 256
/// vertices on; from 112 on, or a quarter of a small mesh, it is not asked: texture is torn there.
/// @param threads      that try ways at once; the result does not depend on them
/// @param mirror       [P] of find_mirror, or empty
/// @param error_m      of the last step; never falls
/// @param on_progress  0 to 1; may be empty
/// @return vertices from which on levels are chosen for such colours
std::uint32_t contract(std::uint32_t coarsest_count, float size_m, std::uint32_t threads,
                       const std::function<bool()>& prefers_tones, PoseCost& poses,
                       const AttributeCost& attributes, std::span<const std::uint32_t> mirror,
                       Views& views, float& error_m, WedgeMesh& mesh,
                       const std::function<void(float)>& on_progress);

}  // namespace throng::simplify
