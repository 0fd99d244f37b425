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
