#include "simplify/rebuild/image.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "throng/render/srgb.hpp"

namespace throng::simplify {
namespace {

constexpr int kInverseSteps = 1 << 14;

const std::array<float, 256>& linear_table() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> values{};
    for (int i = 0; i < 256; ++i) {
      values[i] = static_cast<float>(render::srgb_to_linear(i / 255.0));
    }
    return values;
  }();
  return table;
}

/// sRGB by the square root of linear light, which the curve is nearly straight in.
const std::vector<std::uint8_t>& srgb_table() {
  static const std::vector<std::uint8_t> table = [] {
    std::vector<std::uint8_t> values(kInverseSteps + 1);
    for (int i = 0; i <= kInverseSteps; ++i) {
      const double root = static_cast<double>(i) / kInverseSteps;
      const double s = render::linear_to_srgb(root * root);
      values[i] = static_cast<std::uint8_t>(std::clamp(s, 0.0, 1.0) * 255.0 + 0.5);
    }
    return values;
  }();
  return table;
}

glm::vec4 decode(const std::uint8_t* texel, bool is_srgb) {
  const float alpha = static_cast<float>(texel[3]) / 255.0F;
  if (!is_srgb) return {texel[0] / 255.0F, texel[1] / 255.0F, texel[2] / 255.0F, alpha};
  const auto& table = linear_table();
  return {table[texel[0]], table[texel[1]], table[texel[2]], alpha};
}

void encode(const glm::vec4& value, bool is_srgb, std::uint8_t* texel) {
  for (int i = 0; i < 4; ++i) {
    texel[i] = is_srgb && i < 3
                   ? srgb_from_linear(value[i])
                   : static_cast<std::uint8_t>(std::clamp(value[i], 0.0F, 1.0F) * 255.0F + 0.5F);
  }
}

std::int64_t wrap(std::int64_t i, std::int64_t size, Wrap mode) {
  switch (mode) {
    case Wrap::kClamp:
      return std::clamp<std::int64_t>(i, 0, size - 1);
    case Wrap::kRepeat:
      return ((i % size) + size) % size;
    case Wrap::kMirror: {
      const std::int64_t period = ((i % (2 * size)) + 2 * size) % (2 * size);
      return period < size ? period : 2 * size - 1 - period;
    }
  }
  return 0;
}

/// A level while it is built: colour times coverage, and coverage, 0 or 1 on the finest level.
struct Level {
  std::uint32_t width_px, height_px;
  std::vector<glm::vec4> color;
  std::vector<float> coverage;
};

/// Marks the texels whose square a triangle touches, and one more all around, because filtering
/// between texels reads the neighbours.
void mark_covered(std::span<const glm::vec2> triangle_uv, Level& level) {
  const glm::vec2 size(level.width_px, level.height_px);
  for (std::size_t t = 0; t + 2 < triangle_uv.size(); t += 3) {
    std::array<glm::vec2, 3> p = {triangle_uv[t] * size, triangle_uv[t + 1] * size,
                                  triangle_uv[t + 2] * size};
    const float doubled_area =
        (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x);
    if (doubled_area < 0.0F) std::swap(p[1], p[2]);
    const glm::vec2 low = glm::min(p[0], glm::min(p[1], p[2])) - 1.5F;
    const glm::vec2 high = glm::max(p[0], glm::max(p[1], p[2])) + 1.5F;
    const int x0 = std::max(0, static_cast<int>(low.x)), y0 = std::max(0, static_cast<int>(low.y));
    const int x1 = std::min(static_cast<int>(level.width_px) - 1, static_cast<int>(high.x));
    const int y1 = std::min(static_cast<int>(level.height_px) - 1, static_cast<int>(high.y));
    // signed distances from the edges, each moved out by 1.5 texels
    std::array<glm::vec3, 3> edge;
    for (int i = 0; i < 3; ++i) {
      const glm::vec2 along = p[(i + 1) % 3] - p[i];
      const float length = glm::length(along);
      const glm::vec2 inward =
          length > 0.0F ? glm::vec2(-along.y, along.x) / length : glm::vec2(0.0F);
      edge[i] = {inward, 1.5F - glm::dot(inward, p[i])};
    }
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) {
        const glm::vec3 centre(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F, 1.0F);
        if (glm::dot(edge[0], centre) < 0 || glm::dot(edge[1], centre) < 0 ||
            glm::dot(edge[2], centre) < 0)
          continue;
        level.coverage[static_cast<std::size_t>(y) * level.width_px + x] = 1.0F;
      }
    }
  }
}

Level halve(const Level& fine) {
  Level level{std::max(1U, fine.width_px / 2), std::max(1U, fine.height_px / 2), {}, {}};
  level.color.resize(std::size_t{level.width_px} * level.height_px);
  level.coverage.resize(level.color.size());
  for (std::uint32_t y = 0; y < level.height_px; ++y) {
    // an odd last row or column goes to the last texel
    const std::uint32_t y_end = y + 1 == level.height_px ? fine.height_px : 2 * y + 2;
    for (std::uint32_t x = 0; x < level.width_px; ++x) {
      const std::uint32_t x_end = x + 1 == level.width_px ? fine.width_px : 2 * x + 2;
      glm::vec4 color(0.0F);
      float coverage = 0.0F;
      for (std::uint32_t sy = 2 * y; sy < y_end; ++sy) {
        for (std::uint32_t sx = 2 * x; sx < x_end; ++sx) {
          const std::size_t from = std::size_t{sy} * fine.width_px + sx;
          color += fine.color[from];
          coverage += fine.coverage[from];
        }
      }
      const std::size_t to = std::size_t{y} * level.width_px + x;
      const float count = static_cast<float>((y_end - 2 * y) * (x_end - 2 * x));
      level.color[to] = color / count;
      level.coverage[to] = coverage / count;
    }
  }
  return level;
}

}  // namespace

float linear_from_srgb(std::uint8_t value) { return linear_table()[value]; }

std::uint8_t srgb_from_linear(float value) {
  const float root = std::sqrt(std::clamp(value, 0.0F, 1.0F));
  return srgb_table()[static_cast<std::size_t>(root * kInverseSteps + 0.5F)];
}

glm::u8vec4 wrapped_texel(const SourceImage& image, Wrap wrap_u, Wrap wrap_v, std::int64_t x,
                          std::int64_t y) {
  const auto column = static_cast<std::size_t>(wrap(x, image.width_px, wrap_u));
  const auto row = static_cast<std::size_t>(wrap(y, image.height_px, wrap_v));
  const std::uint8_t* texel = &image.rgba[4 * (row * image.width_px + column)];
  return {texel[0], texel[1], texel[2], texel[3]};
}

SourceImage resize(const SourceImage& image, std::uint32_t width_px, std::uint32_t height_px,
                   bool is_srgb) {
  SourceImage result{width_px, height_px, {}};
  result.rgba.resize(std::size_t{4} * width_px * height_px);
  for (std::uint32_t y = 0; y < height_px; ++y) {
    const std::uint64_t y0 = std::uint64_t{y} * image.height_px / height_px;
    const std::uint64_t y1 = std::max(y0 + 1, (std::uint64_t{y} + 1) * image.height_px / height_px);
    for (std::uint32_t x = 0; x < width_px; ++x) {
      const std::uint64_t x0 = std::uint64_t{x} * image.width_px / width_px;
      const std::uint64_t x1 = std::max(x0 + 1, (std::uint64_t{x} + 1) * image.width_px / width_px);
      glm::vec4 sum(0.0F);
      for (std::uint64_t sy = y0; sy < y1; ++sy) {
        for (std::uint64_t sx = x0; sx < x1; ++sx) {
          sum += decode(&image.rgba[4 * (sy * image.width_px + sx)], is_srgb);
        }
      }
      encode(sum / static_cast<float>((y1 - y0) * (x1 - x0)), is_srgb,
             &result.rgba[4 * (std::size_t{y} * width_px + x)]);
    }
  }
  return result;
}

MipChain make_mips(const SourceImage& image, std::span<const glm::vec2> triangle_uv, bool is_srgb) {
  std::vector<Level> levels(1);
  levels[0] = {image.width_px, image.height_px, {}, {}};
  const std::size_t texels = std::size_t{image.width_px} * image.height_px;
  levels[0].coverage.assign(texels, 0.0F);
  mark_covered(triangle_uv, levels[0]);
  levels[0].color.assign(texels, glm::vec4(0.0F));
  for (std::size_t i = 0; i < texels; ++i) {
    if (levels[0].coverage[i] > 0.0F) levels[0].color[i] = decode(&image.rgba[4 * i], is_srgb);
  }
  while (levels.back().width_px > 1 || levels.back().height_px > 1)
    levels.push_back(halve(levels.back()));

  // From the coarsest down: what no triangle covers takes the colour of the level above.
  for (std::size_t l = levels.size(); l-- > 0;) {
    Level& level = levels[l];
    for (std::uint32_t y = 0; y < level.height_px; ++y) {
      for (std::uint32_t x = 0; x < level.width_px; ++x) {
        const std::size_t i = std::size_t{y} * level.width_px + x;
        if (level.coverage[i] > 0.0F) {
          level.color[i] /= level.coverage[i];
        } else if (l + 1 < levels.size()) {
          const Level& coarse = levels[l + 1];
          level.color[i] =
              coarse.color[std::size_t{std::min(y / 2, coarse.height_px - 1)} * coarse.width_px +
                           std::min(x / 2, coarse.width_px - 1)];
        }
      }
    }
  }

  MipChain mips{image.width_px, image.height_px, static_cast<std::uint32_t>(levels.size()), {}};
  for (const Level& level : levels) {
    const std::size_t begin = mips.texels.size();
    mips.texels.resize(begin + 4 * level.color.size());
    for (std::size_t i = 0; i < level.color.size(); ++i) {
      std::uint8_t* texel = &mips.texels[begin + 4 * i];
      if (&level == &levels[0] && level.coverage[i] > 0.0F) {
        std::copy_n(&image.rgba[4 * i], 4, texel);  // what is used stays as it came
      } else {
        encode(level.color[i], is_srgb, texel);
      }
    }
  }
  return mips;
}

}  // namespace throng::simplify
