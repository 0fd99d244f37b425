#include "simplify/collapse/texture.hpp"

namespace throng::simplify {

namespace {

constexpr glm::vec3 kTop{0.90F, 0.42F, 0.36F};
constexpr glm::vec3 kBottom{0.36F, 0.48F, 0.85F};

/// The first level of at most `most_px`, or the last one.
TextureLevel level_within(const MipChain& image, std::uint32_t most_px) {
  std::uint32_t width_px = image.width_px, height_px = image.height_px;
  std::size_t offset = 0;
  for (std::uint32_t level = 0;; ++level) {
    const std::size_t size = std::size_t{4} * width_px * height_px;
    if (std::max(width_px, height_px) <= most_px || level + 1 >= image.level_count) {
      const auto begin = image.texels.begin() + static_cast<std::ptrdiff_t>(offset);
      return {{begin, begin + static_cast<std::ptrdiff_t>(size)}, width_px, height_px};
    }
    offset += size;
    width_px = std::max(1U, width_px / 2);
    height_px = std::max(1U, height_px / 2);
  }
}

void dye(const MipChain& tint_mask, TextureLevel& level) {
  const TextureLevel mask = level_within(tint_mask, std::max(level.width_px, level.height_px));
  for (std::uint32_t y = 0; y < level.height_px; ++y) {
    for (std::uint32_t x = 0; x < level.width_px; ++x) {
      const glm::vec2 uv{(static_cast<float>(x) + 0.5F) / static_cast<float>(level.width_px),
                         (static_cast<float>(y) + 0.5F) / static_cast<float>(level.height_px)};
      const std::uint8_t* weight = mask.at(uv);
      const glm::vec3 color =
          glm::mix(glm::vec3(1.0F), kTop, static_cast<float>(weight[2]) / 255.0F) *
          glm::mix(glm::vec3(1.0F), kBottom, static_cast<float>(weight[3]) / 255.0F);
      std::uint8_t* texel = &level.texels[4 * (std::size_t{y} * level.width_px + x)];
      for (int i = 0; i < 3; ++i)
        texel[i] = static_cast<std::uint8_t>(static_cast<float>(texel[i]) * color[i] + 0.5F);
    }
  }
}

}  // namespace

std::vector<TextureLevel> small_levels(const Surface& surface) {
  std::vector<TextureLevel> levels;
  if (surface.base_color.level_count == 0) return levels;
  std::uint32_t most_px = 128;
  do {
    levels.push_back(level_within(surface.base_color, most_px));
    most_px = std::max(levels.back().width_px, levels.back().height_px) / 2;
    if (surface.tint_mask.level_count > 0) dye(surface.tint_mask, levels.back());
  } while (most_px > 0 && levels.size() < surface.base_color.level_count);
  return levels;
}

}  // namespace throng::simplify
