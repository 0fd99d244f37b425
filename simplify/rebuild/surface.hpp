#pragma once

#include <absl/status/statusor.h>

#include <algorithm>
#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "simplify/source_character.hpp"

namespace throng::simplify {

/// An image with mip levels as render::MipImage lays them out: largest first, each half the one
/// before, rows from the top, r g b a. Empty when `level_count` is 0.
struct MipChain {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::uint32_t level_count = 0;
  std::vector<std::uint8_t> texels;
};

/// What rebuilding makes of a SourceCharacter: one welded surface whose points carry wedges.
///
/// A point is a place of the surface and what moves it. A wedge is a point as one side of a texture
/// seam or hard crease sees it; baked vertices are wedges. The points form an oriented 2-manifold
/// with border: each edge has one or two triangles, the triangles of a point one fan. Every point
/// and wedge is used.
struct Surface {
  std::vector<SourcePoint> points;           // [P]
  std::vector<std::uint32_t> wedge_point;    // [C]
  std::vector<glm::vec3> wedge_normal;       // [C] unit length
  std::vector<glm::vec2> wedge_uv;           // [C] in the atlas, 0 to 1
  std::vector<glm::uvec3> triangles;         // [T] wedges, counter-clockwise seen from outside
  std::vector<std::uint8_t> triangle_flags;  // [T] render::kTriangle...
  MipChain base_color;                       // sRGB, mips averaged in linear light
  MipChain tint_mask;
  std::vector<std::string> notes;

  std::uint32_t point_count() const { return static_cast<std::uint32_t>(points.size()); }
  std::uint32_t wedge_count() const { return static_cast<std::uint32_t>(wedge_point.size()); }
  /// Renderers show both sides of all triangles of a character where one of them wants it.
  bool is_two_sided() const {
    return std::any_of(triangle_flags.begin(), triangle_flags.end(), [](std::uint8_t flags) {
      return (flags & render::kTriangleDoubleSided) != 0;
    });
  }
};

struct RebuildOptions {
  float weld_distance = 2.0e-6F;        // of the character's size; nearer points are one
  float crease_angle_rad = 0.5235988F;  // normals that differ by more make two wedges (30 degrees)
  std::uint32_t max_texture_px = 2048;  // widest side of the atlas
  std::uint32_t max_tint_mask_px = 1024;
};

/// UV-guided rebuilding: welds by position, then makes one wedge per distinct (point, uv, material,
/// normal where the crease is hard). For a one-to-one UV map and no creases this gives the vertices
/// and triangles of algorithm 1 of Dong & Peng 2019, up to their order; unlike it, mirrored,
/// palette and missing UVs never merge vertices of different places.
///
/// Points at one position are welded only if they move together. Where more than two triangles meet
/// at an edge, or several fans at a point, the surface is opened there. Triangles that have lost a
/// corner and exact copies are left out with a note.
///
/// A closed piece without holes in its texture shows its back to nobody, so it is not double-sided
/// whatever its material says: exporters tend to say so of everything.
///
/// Several materials, colour factors and wrapped uvs are baked into one atlas with gutters.
///
/// InvalidArgument names the element, its value and the limit: an index out of range, a number that
/// isn't finite, no triangle with an area.
absl::StatusOr<Surface> rebuild(const SourceCharacter& source, const RebuildOptions& options = {});

}  // namespace throng::simplify
