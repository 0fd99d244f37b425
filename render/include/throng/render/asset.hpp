#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "throng/render/tone.hpp"

namespace throng::render {

struct Relief;  // relief.hpp

enum class ClipKind : std::uint32_t {
  kOther = 0,
  kIdle = 1,
  kWalk = 2,
  kRun = 3,
  kSit = 4,
  kCheer = 5,
  kWave = 6,
  kTalk = 7,
  kPhone = 8,
};
inline constexpr std::uint32_t kClipKinds = 9;

/// "other", "idle", "walk" ...; null for a number that is no kind.
const char* name_of(ClipKind kind);

/// First three rows of an affine 4x4 matrix; multiplies column vectors. 48 bytes.
struct Affine {
  glm::vec4 row[3];
};

struct Clip {
  std::string name;
  ClipKind kind = ClipKind::kOther;
  std::uint32_t first_frame = 0;  // into Character::palette
  std::uint32_t frame_count = 0;  // a looping clip's last frame is followed by its first
  float rate_hz = 30.0F;
  bool loop = true;
  float stride_m = 0.0F;   // distance walked in one cycle; 0 for a clip on the spot
  float speed_mps = 0.0F;  // stride_m over the clip's duration
};

struct Joint {
  std::string name;
  std::int32_t parent = -1;
  Affine joint_from_model;  // inverse bind matrix
};

/// An image with its mip levels, largest first, each half the size of the one before (at least 1).
/// Rows from the top; texel = 4 bytes r g b a.
struct MipImage {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::uint32_t level_count = 0;
  std::span<const std::uint8_t> texels;  // all levels, one after the other
};

/// A sample of the surface, skinned like a vertex. 24 bytes.
struct SurfacePoint {
  glm::vec3 position{0.0F};  // bind pose
  glm::i16vec2 normal{0};    // octahedral snorm16
  glm::u8vec4 joint_index{0};
  glm::u8vec4 joint_weight{0};  // sums to 255, strongest first
};
static_assert(sizeof(SurfacePoint) == 24);

/// The textures' mean around a surface sample. 8 bytes.
struct PointTone {
  std::uint32_t base = 0;     // square roots of the linear colour, 10 bits each, r lowest
  std::uint32_t regions = 0;  // tint mask, 8 bits each, skin lowest
};
static_assert(sizeof(PointTone) == 8);

/// Samples of a character's surface, the most important first: any first n of them cover it with
/// spheres of radius_m[n - 1]. Empty where a character has none.
///
/// Tones are kept as mip levels are: level l is for the first P >> l points and holds the mean over
/// what is nearer to each than to any other of them. Levels follow one another.
struct SurfacePoints {
  std::span<const SurfacePoint> point;  // [P]
  std::span<const float> radius_m;      // [P] in the bind pose; never rises
  std::span<const PointTone> tone;      // [P + P/2 + P/4 + ... + 1]

  std::uint32_t count() const { return static_cast<std::uint32_t>(point.size()); }
};

/// Tones over all levels of `count` points.
constexpr std::uint32_t point_tone_count(std::uint32_t count) {
  std::uint32_t tones = 0;
  for (; count > 0; count >>= 1) tones += count;
  return tones;
}

/// Colours of coarse levels. Their triangles lie across several charts, so that texture coordinates
/// between their corners mean nothing: each has a colour at its corners instead, interpolated.
///
/// A triangle grows as vertices go, so there are bands of levels, the finest first; each has tones
/// of all triangles that its finest level draws. Levels finer than all bands have texture.
struct CornerTones {
  static constexpr std::uint32_t kMostBands = 64;

  std::span<const ToneBand> band;       // vertex counts fall; none: all levels have texture
  std::span<const std::uint32_t> tone;  // three of pack_corner_tone for each triangle

  /// Levels with at most so many vertices have tones.
  std::uint32_t most_vertices() const { return band.empty() ? 0 : band[0].vertex_count; }
};

/// Bits of Character::triangle_flags.
inline constexpr std::uint8_t kTriangleDoubleSided = 1;
inline constexpr std::uint8_t kTriangleAlphaCutout = 2;  // texels with alpha under 128 are holes

/// A baked character: mesh in collapse order, skeleton, clips, textures. The spans look into
/// `storage` (a mapped file or owned memory), so copies are cheap and share it.
///
/// Model frame: right-handed, +Z up, facing +X, metres, feet on z = 0.
/// Shapes: C vertices (wedges), T triangles, J joints, F palette frames over all clips.
///
/// Runtime LOD with n vertices: vertices [0, n), triangles [0, triangle_count_at[n]), every corner
/// replaced by following collapse_target until it is below n (Peng 2011, Dong & Peng 2019).
struct Character {
  std::string name;
  std::span<const glm::vec3> position;               // [C] bind pose
  std::span<const glm::i16vec2> normal;              // [C] octahedral snorm16
  std::span<const glm::u16vec2> uv;                  // [C] unorm16, (0, 0) is the top left
  std::span<const glm::u8vec4> joint_index;          // [C]
  std::span<const glm::u8vec4> joint_weight;         // [C] sums to 255, strongest first
  std::span<const std::uint32_t> collapse_target;    // [C] target[i] < i, target[0] = 0
  std::span<const glm::uvec3> triangle;              // [T] full-detail corners, in removal order
  std::span<const std::uint8_t> triangle_flags;      // [T]
  std::span<const std::uint32_t> triangle_count_at;  // [C+1]
  std::span<const std::uint32_t> legal_count;  // [C+1] largest legal n' <= n, 0 below the coarsest
  std::span<const float> collapse_error_m;     // [C] error when vertex i has gone; 0 if unknown
  std::uint32_t coarsest_count = 0;            // fewest vertices the collapse reached (legal)
  std::vector<Joint> joints;                   // [J] parents first
  std::vector<Clip> clips;
  std::span<const Affine> palette;       // [F][J] T * B^-1 of equation 2, model frame
  glm::vec4 bounds{0.0F};                // sphere over all frames of all clips: centre, radius
  glm::vec4 gait_bounds{0.0F};           // the same over idle, walk and run; `bounds` if unknown
  float height_m = 0.0F;                 // top of the bind pose
  MipImage base_color;                   // sRGB
  MipImage tint_mask;                    // weights r skin, g hair, b top, a bottom; may be empty
  std::shared_ptr<const Relief> relief;  // impostor; null: none was baked
  SurfacePoints points;
  CornerTones corner_tones;
  std::shared_ptr<const void> storage;

  std::uint32_t vertex_count() const { return static_cast<std::uint32_t>(position.size()); }
  std::uint32_t triangle_count() const { return static_cast<std::uint32_t>(triangle.size()); }
  std::uint32_t joint_count() const { return static_cast<std::uint32_t>(joints.size()); }
};

/// A character and how it is used in a crowd.
struct CastMember {
  Character character;
  float weight = 1.0F;  // share of agents, relative to the other members
  // A piece of a site (environment.hpp), which nobody walks as. Such members come after all others
  // and have the texture of the first of them.
  bool environment = false;
};

/// The characters a crowd is drawn with, from a folder with `cast.json`.
struct Cast {
  std::vector<CastMember> members;
  std::string folder;
};

/// Owned columns of a character, as baking produces them; `view()` makes a Character of them.
struct CharacterData {
  std::string name;
  std::vector<glm::vec3> position;
  std::vector<glm::i16vec2> normal;
  std::vector<glm::u16vec2> uv;
  std::vector<glm::u8vec4> joint_index, joint_weight;
  std::vector<std::uint32_t> collapse_target;
  std::vector<glm::uvec3> triangle;
  std::vector<std::uint8_t> triangle_flags;
  std::vector<std::uint32_t> triangle_count_at, legal_count;
  std::vector<float> collapse_error_m;
  std::uint32_t coarsest_count = 0;
  std::vector<Joint> joints;
  std::vector<Clip> clips;
  std::vector<Affine> palette;
  glm::vec4 bounds{0.0F};
  glm::vec4 gait_bounds{0.0F};  // radius 0: as `bounds`
  float height_m = 0.0F;
  std::uint32_t base_color_width_px = 0, base_color_height_px = 0, base_color_levels = 0;
  std::vector<std::uint8_t> base_color;
  std::uint32_t tint_mask_width_px = 0, tint_mask_height_px = 0, tint_mask_levels = 0;
  std::vector<std::uint8_t> tint_mask;
  std::vector<SurfacePoint> point;
  std::vector<float> point_radius_m;
  std::vector<PointTone> point_tone;
  std::vector<ToneBand> tone_band;
  std::vector<std::uint32_t> corner_tone;
};

/// Checks every promise of `Character` (shapes, index ranges, finite numbers, weight sums,
/// nesting). InvalidArgument names the section, the element, the value and the limit.
absl::Status validate(const Character& character);

/// A Character that owns `data`. InvalidArgument as `validate`.
absl::StatusOr<Character> make_character(CharacterData data);

/// Writes `NAME.throng` atomically (temporary file, then rename). Unavailable when it can't be
/// written.
absl::Status write_character(const Character& character, const std::string& path);

/// Maps a baked character and checks all of it. NotFound, or InvalidArgument naming file, section,
/// value and limit; FailedPrecondition for a major format version this program doesn't know.
absl::StatusOr<Character> read_character(const std::string& path);

/// Reads `folder/cast.json` and its characters. Errors as `read_character`.
absl::StatusOr<Cast> read_cast(const std::string& folder);

/// What textures show at a triangle's corner, in four bytes: square roots of the linear components
/// in 7, 7 and 6 bits, r lowest, then the tint mask's weights in 3 bits each, skin lowest. All are
/// clamped to 0 to 1.
std::uint32_t pack_corner_tone(const glm::vec3& linear, const glm::vec4& regions);

/// Octahedral unit vector coding (Meyer et al. 2010), snorm16.
glm::i16vec2 encode_octahedral(const glm::vec3& unit);
glm::vec3 decode_octahedral(const glm::i16vec2& packed);

}  // namespace throng::render
