#pragma once

#include <cstdint>
#include <glm/glm.hpp>

// What is written on the device and read by the rasterizers. GLM only: .cu files include it.
namespace throng::render {

/// One vertex of the single batched buffer, skinned. 24 bytes.
struct BatchVertex {
  glm::vec3 position_relative;  // metres, world axes, relative to the camera's eye
  glm::i16vec2 normal;          // octahedral snorm16, world axes
  glm::u16vec2 uv;              // unorm16
  std::uint32_t visible;        // index into the visible list
};
static_assert(sizeof(BatchVertex) == 24);

/// A point of an agent's surface: a disc that faces along its normal. 32 bytes.
struct Splat {
  glm::vec3 position_relative;  // metres, world axes, relative to the camera's eye
  float radius_m;               // negative: a disc without a side, which always faces the eye
  glm::i16vec2 normal;          // octahedral snorm16, world axes
  std::uint32_t base;           // colour: square roots of linear components, 10 bits, r lowest
  std::uint32_t regions;  // tint mask, 8 bits each; of nobody: 0 or the disc's width, of 255 of its
                          // height on the picture (without a side only)
  std::uint32_t visible;  // index into the visible list; kNobody: one colour, no channel
};
static_assert(sizeof(Splat) == 32);
inline constexpr std::uint32_t kNobody = 0xffffffffU;
inline constexpr std::uint64_t kMostSplats = (1U << 30) - 1;  // of a frame: their number in a word

/// An agent of a few pixels (Representation::kSpeck). 32 bytes.
struct Speck {
  glm::vec3 position_relative;  // of the feet: metres, world axes, relative to the camera's eye
  float height_m;               // of the character as it is scaled, more where it stands for others
  std::uint32_t image;          // of SpeckTable
  std::uint32_t seed;           // tints
  float channel;                // value of the channel shown, NaN: none
  std::uint32_t reserved;
};
static_assert(sizeof(Speck) == 32);

/// Specks [first, first + count) of a frame.
struct SpeckRun {
  std::uint32_t first, count;
};

/// What shading needs of a visible instance. 48 bytes.
struct VisibleInstance {
  glm::vec3 position_relative;  // of the feet
  float heading_rad;
  std::uint32_t slot;
  std::uint32_t character;
  std::uint32_t seed;  // tints
  float scale;
  float channel;                 // value of the channel shown, NaN: none
  float radius_m;                // of the bounding sphere
  std::uint32_t vertex_count;    // n_i
  std::uint32_t triangle_count;  // t_i
};
static_assert(sizeof(VisibleInstance) == 48);

}  // namespace throng::render
