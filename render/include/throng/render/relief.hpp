#pragma once

#include <absl/status/status.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>
#include <vector>

#include "throng/render/asset.hpp"
#include "throng/render/relief_box.hpp"

namespace throng::render {

/// Levels of a face.
inline std::uint32_t relief_levels(const ReliefFace& face) {
  return static_cast<std::uint32_t>(
      std::bit_width(std::max<unsigned>(face.width_px, face.height_px)));
}

/// Texels of a face, over all its levels.
inline std::uint64_t relief_texels(const ReliefFace& face) {
  std::uint64_t sum = 0;
  for (std::uint32_t level = 0; level < relief_levels(face); ++level) {
    sum += std::uint64_t{std::max(1U, unsigned{face.width_px} >> level)} *
           std::max(1U, unsigned{face.height_px} >> level);
  }
  return sum;
}

/// Relief impostor of a character (Beacco 2010): an oriented box for each joint with six
/// orthographic captures of colour, normal, front and back depth. Depths count from the face, 0 to
/// 255 over the box; a texel that shows nothing has front 255 and back 0, any other front < back.
struct Relief {
  std::uint32_t capture_frame = 0;  // of the palette: the pose it was captured in
  float texel_m = 0.0F;             // of most faces; 0: uniform
  std::span<const ReliefBox> boxes;
  std::span<const std::uint32_t>
      shape;  // front, back, then the normal as an octahedral snorm8 pair
  std::span<const std::uint32_t> color;  // sRGB r g b
  std::span<const std::uint32_t> tint;   // as Character::tint_mask
  std::shared_ptr<const void> storage;
};

/// Owned columns of a Relief.
struct ReliefData {
  std::uint32_t capture_frame = 0;
  float texel_m = 0.0F;
  std::vector<ReliefBox> boxes;
  std::vector<std::uint32_t> shape, color, tint;
};
std::shared_ptr<const Relief> make_relief(ReliefData data);

/// InvalidArgument names the box, the value and the limit.
absl::Status validate_relief(const Relief& relief, std::size_t joint_count, std::size_t frames);

inline std::uint32_t pack_relief_normal(const glm::vec3& unit) {
  const float sum = std::abs(unit.x) + std::abs(unit.y) + std::abs(unit.z);
  glm::vec2 p = glm::vec2(unit) / std::max(sum, 1e-20F);
  if (unit.z < 0.0F) {
    p = (1.0F - glm::abs(glm::vec2(p.y, p.x))) *
        glm::vec2(p.x < 0.0F ? -1.0F : 1.0F, p.y < 0.0F ? -1.0F : 1.0F);
  }
  const auto code = [](float v) {
    const float scaled = std::clamp(v, -1.0F, 1.0F) * 127.0F;
    return static_cast<std::uint32_t>(
               static_cast<std::int32_t>(scaled < 0.0F ? scaled - 0.5F : scaled + 0.5F)) &
           255U;
  };
  return code(p.x) | code(p.y) << 8;
}

}  // namespace throng::render
