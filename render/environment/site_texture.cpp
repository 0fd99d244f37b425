#include "render/environment/site_texture.hpp"

#include <algorithm>
#include <cmath>

#include "throng/render/encode.hpp"
#include "throng/render/srgb.hpp"

namespace throng::render {

std::shared_ptr<const SiteTexture> SiteTexture::decode(const std::string& bytes) {
  const std::span<const std::uint8_t> data(reinterpret_cast<const std::uint8_t*>(bytes.data()),
                                           bytes.size());
  absl::StatusOr<DecodedImage> image = decode_png(data);
  if (!image.ok()) image = decode_jpeg(data);
  if (!image.ok() || image->width_px == 0 || image->height_px == 0) return nullptr;
  auto texture = std::make_shared<SiteTexture>();
  texture->width_ = std::min(kSide, image->width_px);
  texture->height_ = std::min(kSide, image->height_px);
  std::array<float, 256> linear;
  for (std::size_t i = 0; i < 256; ++i) {
    linear[i] = srgb_to_linear(static_cast<float>(i) / 255.0F);
  }
  // Means of the pixels that fall together.
  texture->texels_.assign(std::size_t{texture->width_} * texture->height_, glm::vec3(0.0F));
  std::vector<float> count(texture->texels_.size(), 0.0F);
  for (std::uint32_t y = 0; y < image->height_px; ++y) {
    const std::size_t row = std::size_t{y} * texture->height_ / image->height_px * texture->width_;
    for (std::uint32_t x = 0; x < image->width_px; ++x) {
      const std::size_t to = row + std::size_t{x} * texture->width_ / image->width_px;
      const std::uint8_t* from = image->rgbx.data() + 4 * (std::size_t{y} * image->width_px + x);
      texture->texels_[to] += glm::vec3(linear[from[0]], linear[from[1]], linear[from[2]]);
      count[to] += 1.0F;
    }
  }
  for (std::size_t i = 0; i < count.size(); ++i) texture->texels_[i] /= std::max(1.0F, count[i]);
  return texture;
}

glm::dvec3 SiteTexture::at(const glm::dvec2& uv) const {
  const auto texel = [](double t, std::uint32_t side) {
    const double inside = t - std::floor(t);  // NaN and infinity: the first
    return std::isfinite(inside) ? std::min(side - 1, static_cast<std::uint32_t>(inside * side))
                                 : 0U;
  };
  return texels_[std::size_t{texel(uv.y, height_)} * width_ + texel(uv.x, width_)];
}

glm::dvec3 SiteTexture::mean(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c) const {
  constexpr int kSteps = 8;
  glm::dvec3 sum(0.0);
  int samples = 0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; i + j < kSteps; ++j) {
      const double u = (i + 1.0 / 3.0) / kSteps, v = (j + 1.0 / 3.0) / kSteps;
      sum += at(a + u * (b - a) + v * (c - a));
      ++samples;
    }
  }
  return sum / static_cast<double>(samples);
}

std::uint8_t SitePalette::index_of(const glm::dvec3& linear) {
  Rgb color{};
  for (int c = 0; c < 3; ++c) {
    const double srgb = linear_to_srgb(std::clamp(linear[c], 0.0, 1.0));
    color[static_cast<std::size_t>(c)] = static_cast<std::uint8_t>(std::lround(255.0 * srgb));
  }
  // While there is room a colour is kept as it is, then to a sixteenth of each channel's range.
  const bool is_full = colors_.size() == 256;
  const int shift = colors_.size() < 64 ? 0 : 4;
  const auto key = static_cast<std::uint32_t>(shift << 24 | color[0] >> shift << 16 |
                                              color[1] >> shift << 8 | color[2] >> shift);
  if (const auto found = known_.find(key); found != known_.end()) return found->second;
  std::size_t index = colors_.size();
  if (is_full) {
    int least = 1 << 30;
    for (std::size_t i = 0; i < colors_.size(); ++i) {
      int distance = 0;
      for (std::size_t c = 0; c < 3; ++c) {
        const int d = int{colors_[i][c]} - int{color[c]};
        distance += d * d;
      }
      if (distance < least) {
        least = distance;
        index = i;
      }
    }
  } else {
    colors_.push_back(color);
  }
  known_.emplace(key, static_cast<std::uint8_t>(index));
  return static_cast<std::uint8_t>(index);
}

}  // namespace throng::render
