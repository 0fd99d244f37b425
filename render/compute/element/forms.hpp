#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#include "render/compute/element/hash.hpp"
#include "render/compute/element/selection.hpp"
#include "throng/render/representation.hpp"

// What an agent of the mixed frame is drawn as, and with how many vertices.
namespace throng::render::element {

/// Errors from 2^-16 m to 2^4 m in steps of an eighth of an octave (of the float's bits, so
/// nearly): for each a character's ErrorTable has the fewest vertices that keep to it.
inline constexpr std::uint32_t kErrorSteps = 20 * 8;
inline constexpr std::uint32_t kFirstErrorBits = (127 - 16) << 3;  // exponent, 3 bits of fraction

/// The step of the largest error in the table that is not over `error_m`; step 0 below it.
THRONG_HOST_DEVICE inline std::uint32_t error_step(float error_m) {
  std::uint32_t bits = 0;
  memcpy(&bits, &error_m, sizeof bits);
  bits >>= 20;
  if (!(error_m > 0.0F) || bits < kFirstErrorBits) return 0;
  const std::uint32_t step = bits - kFirstErrorBits;
  return step < kErrorSteps ? step : kErrorSteps - 1;
}

/// Vertices at a step for a figure that may share its mesh, of at most `most` vertices: no more
/// than those where they are off by at most an octave more. One of its own takes several times as
/// long.
/// @param vertex_count  [kErrorSteps] of the character.
THRONG_HOST_DEVICE inline std::uint32_t shared_step_count(const std::uint32_t* vertex_count,
                                                          std::uint32_t step, std::uint32_t most) {
  constexpr std::uint32_t kOctave = 8;
  const std::uint32_t wanted = vertex_count[step];
  const std::uint32_t coarser = step + kOctave < kErrorSteps ? step + kOctave : kErrorSteps - 1;
  return wanted > most && vertex_count[coarser] <= most ? most : wanted;
}

/// Each agent's limits lie up to a fifth apart, so that a row of them does not change at once.
THRONG_HOST_DEVICE inline float form_px_per_m(const Projection& projection, float distance_m,
                                              float radius_m, float own) {
  const bool nearer = distance_m < radius_m;
  const float d = projection.perspective != 0 ? (nearer ? radius_m : distance_m) : 1.0F;
  return projection.focal_px / d * (0.9F + 0.2F * own);
}

/// What a figure may be off by where MixedForms::budget_ms chose the error: who is as high as a
/// tenth of the picture's mean side or more by at most `near_error_px`, whatever the time; less
/// high ones by more, as the square, so that nothing changes at a line. OURS, by what it costs:
/// such figures are few, and take the more of a frame for their pixels the higher they are, which
/// their vertices do not change. So a budget that only they could pay is refused.
THRONG_HOST_DEVICE inline float near_error_of(const MixedForms& mixed, const Projection& projection,
                                              float height_px) {
  if (!(mixed.budget_ms > 0.0)) return mixed.error_px;
  const float ratio = 0.1F * std::sqrt(projection.viewport_px2) / height_px;
  const float most_px = mixed.near_error_px * (ratio > 1.0F ? ratio * ratio : 1.0F);
  return mixed.error_px < most_px ? mixed.error_px : most_px;
}

/// A mesh, an impostor, or where it is under a pixel one that stands for all or nothing: then
/// `scale` grows as they are fewer.
/// @param own  the agent's hash. @param vertices  of its mesh.
THRONG_HOST_DEVICE inline Representation mixed_form(const MixedForms& mixed, float own,
                                                    float height_px, bool has_relief,
                                                    std::uint32_t vertices, float& scale) {
  if (height_px < 1.0F) {
    const float kept = height_px * height_px;
    if (own >= kept) return Representation::kNone;
    scale /= height_px;
    return Representation::kMesh;
  }
  const float mesh_us = mixed.mesh_us + mixed.mesh_vertex_us * static_cast<float>(vertices);
  const float figure_px2 = 0.25F * height_px * height_px;
  const float impostor_us = mixed.impostor_us + mixed.impostor_px2_us * figure_px2;
  const bool is_right = has_relief && mixed.impostor_error * height_px <= mixed.error_px;
  return is_right && impostor_us < mesh_us ? Representation::kImpostor : Representation::kMesh;
}

/// The fewest steps coarser for all that keep to a budget of vertices.
struct ErrorSearch {
  std::uint32_t low = 0, high = kErrorSteps - 1;
  std::uint32_t coarser = 0;  // looked at now
  bool begun = false, done = false;
  static constexpr int kRounds = 9;
};
/// @param vertices  of all meshes at `search.coarser`.
THRONG_HOST_DEVICE inline void search_on(ErrorSearch& search, std::uint64_t vertices,
                                         std::uint64_t budget) {
  if (search.done) return;
  if (!search.begun) {
    search.begun = true;
    if (vertices <= budget) {
      search.done = true;
      return;
    }
  } else {
    (vertices > budget ? search.low : search.high) = search.coarser;
  }
  if (search.low + 1 < search.high) {
    search.coarser = (search.low + search.high) / 2;
    return;
  }
  search.coarser = search.high;
  search.done = true;
}

/// How many of a character's points are drawn so that none is larger than `size_px`. Radii never
/// rise: the first one that is small enough, at last the smallest there is.
/// @param radius_m  [count]
THRONG_HOST_DEVICE inline std::uint32_t points_for(const Projection& projection, float distance_m,
                                                   float sphere_m, float scale, float size_px,
                                                   const float* radius_m, std::uint32_t count) {
  const bool nearer = distance_m < sphere_m;
  const float d = projection.perspective != 0 ? (nearer ? sphere_m : distance_m) : 1.0F;
  const float px_per_m = projection.focal_px / d * scale;
  const float most_m = 0.5F * size_px / px_per_m;
  std::uint32_t low = 0, high = count;
  while (low < high) {
    const std::uint32_t middle = (low + high) / 2;
    if (radius_m[middle] > most_m) {
      low = middle + 1;
    } else {
      high = middle;
    }
  }
  return low < count ? low + 1 : count;
}

/// Where the tones of the finest level begin that has no more points than needed: the level's
/// points reach to the next one's at least.
THRONG_HOST_DEVICE inline std::uint32_t first_point_tone(std::uint32_t points, std::uint32_t n) {
  std::uint32_t first = 0;
  while ((points >> 1) >= n && points > 1) {
    first += points;
    points >>= 1;
  }
  return first;
}

}  // namespace throng::render::element
