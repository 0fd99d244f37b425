#pragma once

#include <cstdint>

// What a picture of a few slabs is made of. Plain data: .cu files include it.
namespace throng::render {

/// A slice of a figure across its height: a box of an even colour. Lengths are in heights of the
/// figure. 32 bytes.
struct SpeckSlab {
  static constexpr float kPerHeight = 8192.0F;
  std::int16_t low, high;  // left and right end, from the feet, in 1 / kPerHeight
  std::uint8_t fill;       // share of the box that the figure covers
  std::uint8_t facing[6];  // shares that face right, left, the eye, away, up and down; sum 255
  std::uint8_t open;       // share of the sky's light that reaches so high
  std::uint8_t reserved[4];
  std::uint8_t tone[16];  // square roots of the linear colour: r g b of what no tint dyes, then
                          // of each region
};
static_assert(sizeof(SpeckSlab) == 32);

/// Where a picture lies around the feet, in heights of the figure: x right, y up.
struct SpeckImage {
  float x_low, x_high, y_low, y_high;
};

/// Level l of a picture has 2^l rows of slabs, from the lowest up, behind those of the levels
/// before; a row has one slab, or from level 3 on two and from level 4 on four of about equal area,
/// from the left to the right.
struct SpeckLevels {
  static constexpr std::uint32_t kLevels = 6;
  /// A row has 2^shift slabs.
  static constexpr std::uint32_t column_shift(std::uint32_t level) {
    return level < 3 ? 0U : (level < 4 ? 1U : 2U);
  }
  static constexpr std::uint32_t slabs(std::uint32_t level) {
    return 1U << (level + column_shift(level));
  }
  static constexpr std::uint32_t first_slab(std::uint32_t level) {
    std::uint32_t first = 0;
    for (std::uint32_t l = 0; l < level; ++l) first += slabs(l);
    return first;
  }
  static constexpr std::uint32_t kSlabs = 1 + 2 + 4 + 16 + 64 + 128;
  static constexpr std::uint32_t kMostSlabs = 128;  // of a level
};
static_assert(SpeckLevels::first_slab(SpeckLevels::kLevels) == SpeckLevels::kSlabs);

}  // namespace throng::render
