#include <algorithm>
#include <cmath>

#include "throng/render/asset.hpp"

namespace throng::render {
namespace {

constexpr float kScale = 32767.0F;

float sign_not_zero(float value) { return value < 0.0F ? -1.0F : 1.0F; }

}  // namespace

glm::i16vec2 encode_octahedral(const glm::vec3& unit) {
  const float sum = std::fabs(unit.x) + std::fabs(unit.y) + std::fabs(unit.z);
  if (!(sum > 0.0F) || !std::isfinite(sum)) return {0, 0};  // decodes to +Z
  glm::vec2 folded(unit.x / sum, unit.y / sum);
  if (unit.z < 0.0F) {
    folded = {(1.0F - std::fabs(folded.y)) * sign_not_zero(folded.x),
              (1.0F - std::fabs(folded.x)) * sign_not_zero(folded.y)};
  }
  // Of the four neighbours on the grid the one nearest in angle, not the nearest in the square:
  // the fold stretches angles unevenly.
  const glm::vec2 low = glm::floor(folded * kScale);
  glm::i16vec2 best(0);
  float best_cosine = -2.0F;
  for (int corner = 0; corner < 4; ++corner) {
    const glm::vec2 grid =
        low + glm::vec2(static_cast<float>(corner & 1), static_cast<float>(corner >> 1));
    const glm::i16vec2 packed(static_cast<std::int16_t>(std::clamp(grid.x, -kScale, kScale)),
                              static_cast<std::int16_t>(std::clamp(grid.y, -kScale, kScale)));
    const float cosine = glm::dot(decode_octahedral(packed), unit);
    if (cosine > best_cosine) {
      best_cosine = cosine;
      best = packed;
    }
  }
  return best;
}

glm::vec3 decode_octahedral(const glm::i16vec2& packed) {
  const glm::vec2 folded = glm::max(glm::vec2(packed) / kScale, glm::vec2(-1.0F));
  glm::vec3 unit(folded.x, folded.y, 1.0F - std::fabs(folded.x) - std::fabs(folded.y));
  if (unit.z < 0.0F) {
    const glm::vec2 upper(unit.x, unit.y);
    unit.x = (1.0F - std::fabs(upper.y)) * sign_not_zero(upper.x);
    unit.y = (1.0F - std::fabs(upper.x)) * sign_not_zero(upper.y);
  }
  return glm::normalize(unit);
}

}  // namespace throng::render
