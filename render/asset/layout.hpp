#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>

#include "throng/render/asset.hpp"

/// How a baked character lies in its file.
///
///     FileHeader                     64 bytes
///     SectionEntry[section_count]    32 bytes each, checked by FileHeader::table_checksum
///     sections                       each at a multiple of 64 bytes, little-endian, no overlap
///
/// All checksums are XXH3 with 64 bits. A minor version only adds sections, which an older reader
/// skips; whatever else changes takes a new major version.
namespace throng::render::layout {

static_assert(std::endian::native == std::endian::little,
              "sections are mapped as they are, so this needs a little-endian machine");

inline constexpr std::array<char, 8> kMagic = {'T', 'H', 'R', 'O', 'N', 'G', 'C', 'H'};
inline constexpr std::uint16_t kMajor = 1;
inline constexpr std::uint16_t kMinor = 0;
inline constexpr std::uint64_t kAlignment = 64;

// What a reader takes at most. Far above any real character; they bound the time and memory that a
// hostile file can cost, and keep every product of two counts inside 64 bits.
inline constexpr std::uint32_t kMaxSections = 256;
inline constexpr std::uint32_t kMaxVertices = 1U << 24;
inline constexpr std::uint32_t kMaxTriangles = 1U << 25;
inline constexpr std::uint32_t kMaxJoints = 256;  // joint_index has 8 bits
inline constexpr std::uint32_t kMaxClips = 4096;
inline constexpr std::uint32_t kMaxFrames = 1U << 20;
inline constexpr std::uint32_t kMaxImageSize_px = 16384;
inline constexpr std::uint32_t kMaxNameSize = 1024;
inline constexpr std::uint32_t kMaxCollapseDepth = 4096;  // longest chain of collapse targets
inline constexpr std::uint32_t kMaxReliefBoxes = 256;     // one for each joint
inline constexpr std::uint32_t kMaxReliefTexels = 1U << 26;
inline constexpr std::uint32_t kMaxPoints = 1U << 16;
inline constexpr float kMaxCoordinate_m = 1.0e6F;

struct FileHeader {
  std::array<char, 8> magic;
  std::uint16_t major;
  std::uint16_t minor;
  std::uint32_t section_count;
  std::uint64_t size_bytes;      // of the whole file
  std::uint64_t table_checksum;  // of the section table
  std::uint64_t reserved[4];
};
static_assert(sizeof(FileHeader) == 64);

enum class Section : std::uint32_t {
  kInfo = 1,
  kStrings = 2,  // names, one after the other, no terminators
  kPosition = 3,
  kNormal = 4,
  kUv = 5,
  kJointIndex = 6,
  kJointWeight = 7,
  kCollapseTarget = 8,
  kTriangle = 9,
  kTriangleFlags = 10,
  kTriangleCountAt = 11,
  kLegalCount = 12,
  kCollapseError = 13,
  kJoint = 14,
  kClip = 15,
  kPalette = 16,
  kBaseColor = 17,
  kTintMask = 18,
  kImpostor = 19,  // ReliefHeader, ReliefBox[box_count], then three columns of texel_count words
  kPoint = 24,
  kPointRadius = 25,
  kPointTone = 26,
  kCornerTone = 27,  // CornerToneHeader, ToneBand[band_count], then the words
};

struct SectionEntry {
  std::uint32_t kind;
  std::uint32_t reserved;
  std::uint64_t offset;
  std::uint64_t size_bytes;
  std::uint64_t checksum;
};
static_assert(sizeof(SectionEntry) == 32);

/// A name: `size` bytes of section kStrings from `offset`.
struct StringRef {
  std::uint32_t offset;
  std::uint32_t size;
};

struct Info {
  StringRef name;
  std::uint32_t vertex_count;
  std::uint32_t triangle_count;
  std::uint32_t joint_count;
  std::uint32_t clip_count;
  std::uint32_t frame_count;
  std::uint32_t coarsest_count;
  std::uint32_t base_color_width_px, base_color_height_px, base_color_levels;
  std::uint32_t tint_mask_width_px, tint_mask_height_px, tint_mask_levels;
  float bounds[4];
  float height_m;
  float gait_bounds[4];  // radius 0: as bounds
  std::uint32_t reserved[8];
  std::uint32_t point_count;  // 0: no surface points
};
static_assert(sizeof(Info) == 128);

struct JointRecord {
  StringRef name;
  std::int32_t parent;
  std::uint32_t reserved;
  Affine joint_from_model;
};
static_assert(sizeof(JointRecord) == 64);

struct ClipRecord {
  StringRef name;
  std::uint32_t kind;
  std::uint32_t first_frame;
  std::uint32_t frame_count;
  float rate_hz;
  std::uint32_t loop;
  float stride_m;
  float speed_mps;
  std::uint32_t reserved[7];
};
static_assert(sizeof(ClipRecord) == 64);

struct ReliefHeader {
  std::uint32_t box_count;
  std::uint32_t texel_count;
  std::uint32_t capture_frame;
  float texel_m;
  std::uint32_t reserved[12];
};
static_assert(sizeof(ReliefHeader) == 64);

struct CornerToneHeader {
  std::uint32_t version;  // of what follows: kCornerToneVersion
  std::uint32_t band_count;
  std::uint32_t triangle_count;  // three words each
  std::uint32_t reserved[13];
};
static_assert(sizeof(CornerToneHeader) == 64);
inline constexpr std::uint32_t kCornerToneVersion = 1;

static_assert(sizeof(glm::vec3) == 12 && sizeof(glm::uvec3) == 12 && sizeof(glm::i16vec2) == 4 &&
              sizeof(glm::u16vec2) == 4 && sizeof(glm::u8vec4) == 4 && sizeof(Affine) == 48);

/// Name of a section for messages.
const char* name_of(Section section);

/// Texels over all levels of an image; levels halve, and none is smaller than 1.
constexpr std::uint64_t texel_count(std::uint32_t width_px, std::uint32_t height_px,
                                    std::uint32_t levels) {
  std::uint64_t count = 0;
  for (std::uint32_t level = 0; level < levels; ++level) {
    count += std::uint64_t{width_px} * height_px;
    width_px = width_px > 1 ? width_px / 2 : 1;
    height_px = height_px > 1 ? height_px / 2 : 1;
  }
  return count;
}

}  // namespace throng::render::layout
