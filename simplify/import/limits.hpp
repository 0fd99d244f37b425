#pragma once

#include <cstdint>

/// What a file may ask for. Everything above is refused by name instead of running out of memory.
namespace throng::simplify::gltf {

inline constexpr std::uint64_t kMaxFileBytes = std::uint64_t{1} << 30;
inline constexpr std::uint64_t kMaxJsonBytes = std::uint64_t{1} << 27;
inline constexpr int kMaxJsonDepth = 64;
inline constexpr std::uint64_t kMaxElements = 1 << 16;  // nodes, meshes, accessors ... of one kind
inline constexpr int kMaxNodeDepth = 1024;
inline constexpr std::uint64_t kMaxInstances = 4096;    // primitives that are drawn
inline constexpr std::uint64_t kMaxSkinJoints = 4096;   // most of them unused in such a skin
inline constexpr std::uint64_t kMaxBoundJoints = 8192;  // of all skins that are worn
inline constexpr std::uint64_t kMaxVertices = 1 << 22;
inline constexpr std::uint64_t kMaxTriangles = 1 << 22;
inline constexpr std::uint32_t kMaxJoints = 256;  // baked joint indices have 8 bits
inline constexpr std::uint32_t kMaxInfluenceSets = 8;
inline constexpr std::uint32_t kMaxImageSidePx = 16384;
inline constexpr std::uint64_t kMaxTexels = std::uint64_t{1} << 27;  // all images of a character
inline constexpr std::uint32_t kMaxUvSets = 8;
inline constexpr std::uint64_t kMaxClips = 1024;
inline constexpr std::uint64_t kMaxKeyValues = 1 << 26;  // of all clips of a file
inline constexpr double kMaxClipSeconds = 600.0;
inline constexpr std::uint64_t kMaxClipMatrices = 1 << 23;  // frames times joints, over all clips

}  // namespace throng::simplify::gltf
