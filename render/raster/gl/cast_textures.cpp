#include "render/raster/gl/cast_textures.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <span>

#include "throng/render/srgb.hpp"

namespace throng::render::gl {
namespace {

constexpr std::size_t kLimitBytes = 256u << 20;

std::size_t level_bytes(std::uint32_t width, std::uint32_t height) {
  return std::size_t{4} * width * height;
}

/// Decodes and encodes texels to linear floats.
struct Coding {
  std::array<float, 256> decode{};
  bool srgb;
  explicit Coding(bool is_srgb) : srgb(is_srgb) {
    for (int i = 0; i < 256; ++i) {
      const double value = i / 255.0;
      decode[static_cast<std::size_t>(i)] =
          static_cast<float>(srgb ? srgb_to_linear(value) : value);
    }
  }
  std::uint8_t encode(float linear, int component) const {
    const float value = srgb && component < 3 ? linear_to_srgb(linear) : linear;
    return static_cast<std::uint8_t>(std::clamp(value, 0.0F, 1.0F) * 255.0F + 0.5F);
  }
  float value(std::uint8_t texel, int component) const {
    return component < 3 ? decode[texel] : static_cast<float>(texel) / 255.0F;
  }
};

struct Level {
  std::span<const std::uint8_t> texels;
  std::uint32_t width, height;
};

void resample(const Level& from, std::span<std::uint8_t> to, std::uint32_t width,
              std::uint32_t height, const Coding& coding) {
  for (std::uint32_t y = 0; y < height; ++y) {
    const float v = std::clamp((static_cast<float>(y) + 0.5F) * static_cast<float>(from.height) /
                                       static_cast<float>(height) -
                                   0.5F,
                               0.0F, static_cast<float>(from.height - 1));
    const auto y0 = static_cast<std::uint32_t>(v), y1 = std::min(y0 + 1, from.height - 1);
    const float fy = v - static_cast<float>(y0);
    for (std::uint32_t x = 0; x < width; ++x) {
      const float u = std::clamp((static_cast<float>(x) + 0.5F) * static_cast<float>(from.width) /
                                         static_cast<float>(width) -
                                     0.5F,
                                 0.0F, static_cast<float>(from.width - 1));
      const auto x0 = static_cast<std::uint32_t>(u), x1 = std::min(x0 + 1, from.width - 1);
      const float fx = u - static_cast<float>(x0);
      const auto texel = [&](std::uint32_t tx, std::uint32_t ty) {
        return &from.texels[4 * (std::size_t{ty} * from.width + tx)];
      };
      const std::uint8_t *a = texel(x0, y0), *b = texel(x1, y0), *c = texel(x0, y1),
                         *d = texel(x1, y1);
      for (int i = 0; i < 4; ++i) {
        const float top = coding.value(a[i], i) * (1.0F - fx) + coding.value(b[i], i) * fx;
        const float bottom = coding.value(c[i], i) * (1.0F - fx) + coding.value(d[i], i) * fx;
        to[4 * (std::size_t{y} * width + x) + static_cast<std::size_t>(i)] =
            coding.encode(top * (1.0F - fy) + bottom * fy, i);
      }
    }
  }
}

/// Mean of 2x2 texels; a side of 1 stays.
void halve(const Level& from, std::span<std::uint8_t> to, const Coding& coding) {
  const std::uint32_t width = std::max(1u, from.width / 2), height = std::max(1u, from.height / 2);
  for (std::uint32_t y = 0; y < height; ++y) {
    for (std::uint32_t x = 0; x < width; ++x) {
      for (int i = 0; i < 4; ++i) {
        float sum = 0.0F;
        for (std::uint32_t k = 0; k < 4; ++k) {
          const std::uint32_t sx = std::min(2 * x + (k & 1u), from.width - 1);
          const std::uint32_t sy = std::min(2 * y + (k >> 1), from.height - 1);
          sum += coding.value(
              from.texels[4 * (std::size_t{sy} * from.width + sx) + static_cast<std::size_t>(i)],
              i);
        }
        to[4 * (std::size_t{y} * width + x) + static_cast<std::size_t>(i)] =
            coding.encode(0.25F * sum, i);
      }
    }
  }
}

}  // namespace

absl::StatusOr<TextureLayers> make_texture_layers(const std::vector<const MipImage*>& images,
                                                  bool srgb, std::uint32_t missing,
                                                  std::uint32_t limit_px) {
  TextureLayers result;
  result.layer_count = static_cast<std::uint32_t>(images.size());
  std::uint32_t width = 1, height = 1;
  for (const MipImage* image : images) {
    width = std::max(width, image->width_px);
    height = std::max(height, image->height_px);
  }
  width = std::min(std::bit_ceil(width), std::bit_floor(limit_px));
  height = std::min(std::bit_ceil(height), std::bit_floor(limit_px));
  while (level_bytes(width, height) * std::max<std::size_t>(images.size(), 1) > kLimitBytes &&
         width * height > 1) {
    (width >= height ? width : height) /= 2;
  }
  result.width_px = width;
  result.height_px = height;
  result.level_count = static_cast<std::uint32_t>(std::bit_width(std::max(width, height)));
  for (std::uint32_t level = 0; level < result.level_count; ++level) {
    result.levels.emplace_back(
        level_bytes(std::max(1u, width >> level), std::max(1u, height >> level)) * images.size());
  }

  const Coding coding(srgb);
  for (std::size_t layer = 0; layer < images.size(); ++layer) {
    const MipImage& image = *images[layer];
    // The levels the image brings.
    std::vector<Level> baked;
    std::size_t offset = 0;
    for (std::uint32_t i = 0; i < image.level_count && image.width_px > 0 && image.height_px > 0;
         ++i) {
      const std::uint32_t w = std::max(1u, image.width_px >> i),
                          h = std::max(1u, image.height_px >> i);
      if (offset + level_bytes(w, h) > image.texels.size()) {
        return absl::InvalidArgumentError(absl::StrCat(
            "upload: image ", layer, " of ", image.width_px, "x", image.height_px, " px with ",
            image.level_count, " levels has only ", image.texels.size(), " bytes"));
      }
      baked.push_back({image.texels.subspan(offset, level_bytes(w, h)), w, h});
      offset += level_bytes(w, h);
      if (w == 1 && h == 1) break;
    }
    const auto target = [&](std::uint32_t level) {
      const std::size_t size =
          level_bytes(std::max(1u, width >> level), std::max(1u, height >> level));
      return std::span<std::uint8_t>(result.levels[level]).subspan(size * layer, size);
    };
    if (baked.empty()) {
      for (std::uint32_t level = 0; level < result.level_count; ++level) {
        const std::span<std::uint8_t> texels = target(level);
        for (std::size_t i = 0; i < texels.size(); i += 4) {
          for (std::size_t k = 0; k < 4; ++k)
            texels[i + k] = static_cast<std::uint8_t>(missing >> (24 - 8 * k));
        }
      }
      continue;
    }
    // Level 0 from the smallest baked level that is no smaller than it.
    std::size_t source = 0;
    while (source + 1 < baked.size() && baked[source + 1].width >= width &&
           baked[source + 1].height >= height) {
      ++source;
    }
    const bool same = baked[source].width == width && baked[source].height == height;
    if (same) {
      std::memcpy(target(0).data(), baked[source].texels.data(), baked[source].texels.size());
    } else {
      resample(baked[source], target(0), width, height, coding);
    }
    for (std::uint32_t level = 1; level < result.level_count; ++level) {
      if (same && source + level < baked.size()) {
        std::memcpy(target(level).data(), baked[source + level].texels.data(),
                    baked[source + level].texels.size());
      } else {
        const Level above{target(level - 1), std::max(1u, width >> (level - 1)),
                          std::max(1u, height >> (level - 1))};
        halve(above, target(level), coding);
      }
    }
  }
  return result;
}

}  // namespace throng::render::gl
