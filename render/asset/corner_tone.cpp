#include "throng/render/asset.hpp"

namespace throng::render {

std::uint32_t pack_corner_tone(const glm::vec3& linear, const glm::vec4& regions) {
  const glm::vec3 root = glm::sqrt(glm::clamp(linear, 0.0F, 1.0F));
  const auto code = [](float share, float most) {
    return static_cast<std::uint32_t>(share * most + 0.5F);
  };
  std::uint32_t tone = code(root.r, 127.0F) | code(root.g, 127.0F) << 7 | code(root.b, 63.0F) << 14;
  for (int k = 0; k < 4; ++k) {
    tone |= code(glm::clamp(regions[k], 0.0F, 1.0F), 7.0F) << (20 + 3 * k);
  }
  return tone;
}

}  // namespace throng::render
