#pragma once

#include <cstdint>

#include "render/compute/element/host_device.hpp"

namespace throng::render::element {

/// The visibility buffer keeps one 64-bit word per sample and takes the maximum, so the picture
/// does not depend on the order in which triangles arrive:
///
///     63..32  reversed depth, the bits of a float in (0, 1]; 0: nothing is here
///     31..30  class (mesh, impostor, point, static)
///     29..7   triangle block: at most 128 consecutive triangles of one instance
///      6..0   triangle in the block
///
/// The CPU keeps the two halves in planes of their own; comparing them in turn is the same maximum.
enum class SampleClass : std::uint32_t { kMesh = 0, kImpostor = 1, kPoint = 2, kStatic = 3 };

inline constexpr std::uint32_t kBlockTriangles = 128;
inline constexpr std::uint32_t kMaxBlocks = 1U << 23;

THRONG_HOST_DEVICE inline std::uint32_t sample_id(SampleClass kind, std::uint32_t block,
                                                  std::uint32_t triangle) {
  return (static_cast<std::uint32_t>(kind) << 30) | (block << 7) | triangle;
}
THRONG_HOST_DEVICE inline SampleClass class_of(std::uint32_t id) {
  return static_cast<SampleClass>(id >> 30);
}
THRONG_HOST_DEVICE inline std::uint32_t block_of(std::uint32_t id) {
  return (id >> 7) & (kMaxBlocks - 1);
}
THRONG_HOST_DEVICE inline std::uint32_t triangle_of(std::uint32_t id) {
  return id & (kBlockTriangles - 1);
}

}  // namespace throng::render::element
