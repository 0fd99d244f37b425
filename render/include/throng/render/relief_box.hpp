#pragma once

#include <cstdint>
#include <glm/glm.hpp>

// Plain data: .cu files include it.
namespace throng::render {

/// What is captured of a box through one of its faces: `first` is the first texel of the largest
/// level, rows from v = 0; each level follows the one before and has half its size, at least 1,
/// down to 1 x 1. 8 bytes.
struct ReliefFace {
  std::uint32_t first = 0;
  std::uint16_t width_px = 0, height_px = 0;
};

/// The part of a figure that one joint carries. A place in the box is
/// origin + side[0] * e.x + side[1] * e.y + side[2] * e.z with e in [0, 1], in the frame that the
/// joint's palette matrix (T * B^-1 of equation 2) moves.
///
/// Face 2 a looks along side[a] from e[a] = 0, face 2 a + 1 against it from e[a] = 1; both have
/// u = e[(a + 1) % 3] and v = e[(a + 2) % 3]. 128 bytes.
struct ReliefBox {
  std::uint32_t joint = 0;
  glm::vec3 origin{0.0F};
  glm::vec3 side[3]{};  // at right angles
  ReliefFace face[6];
  std::uint32_t reserved[7] = {};
};
static_assert(sizeof(ReliefBox) == 128);

/// How far a ray looks into the boxes of relief impostors. Adaptive: at most so many steps, fewer
/// where a box covers few pixels, and what lies between two steps is found where the ray passes
/// through it; else always as many, as published (Beacco 2010: 16 and 7).
struct ReliefSearch {
  std::uint32_t linear_steps = 16, binary_steps = 7;  // at least 1 and 0
  bool adaptive = true;
};

}  // namespace throng::render
