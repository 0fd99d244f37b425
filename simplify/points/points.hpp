#pragma once

#include <cstdint>

#include "throng/render/asset.hpp"

namespace throng::simplify {

struct PointOptions {
  std::uint32_t count = 4096;       // P
  std::uint32_t candidates_of = 6;  // random samples of the surface for each point that is kept
};

/// Samples the surface of a baked mesh in its bind pose and fills `point`, `point_radius_m` and
/// `point_tone` (render::SurfacePoints) from its other columns.
///
/// Order: each next point is the candidate farthest from all before it (farthest point sampling,
/// Eldar et al. 1997), so every prefix is spread evenly and the order is one of importance.
/// Distance counts the normals' difference too, so that the two sides of thin parts both get
/// points. Lyu et al. leave their order open; Larkin et al. remove nearest neighbours, which is
/// this order backwards.
///
/// Texels with alpha under 128 on cut-out triangles give no point. Leaves no points where the
/// surface has no area.
void sample_points(render::CharacterData& data, const PointOptions& options = {});

}  // namespace throng::simplify
