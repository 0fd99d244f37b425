#include "render/frame/shrink.hpp"

#include <array>
#include <cmath>

#include "throng/render/srgb.hpp"

namespace throng::render {
namespace {

constexpr std::uint32_t kOne = 16383;  // linear 1, so that four fit the encoding table's steps

struct Tables {
  std::array<std::uint16_t, 256> linear;    // of sRGB
  std::array<std::uint8_t, kOne + 1> srgb;  // of linear
};

const Tables& tables() {
  static const Tables made = [] {
    Tables t{};
    for (std::size_t i = 0; i < t.linear.size(); ++i) {
      const double v = static_cast<double>(i) / 255.0;
      t.linear[i] = static_cast<std::uint16_t>(std::lround(srgb_to_linear(v) * kOne));
    }
    for (std::size_t i = 0; i < t.srgb.size(); ++i) {
      const double v = static_cast<double>(i) / kOne;
      t.srgb[i] = static_cast<std::uint8_t>(std::lround(255.0 * linear_to_srgb(v)));
    }
    return t;
  }();
  return made;
}

}  // namespace

void shrink(const Picture& large, WorkPool& pool, Picture& small) {
  const Tables& t = tables();
  small.width_px = large.width_px / 2;
  small.height_px = large.height_px / 2;
  small.rgbx.resize(std::size_t{4} * small.width_px * small.height_px);
  constexpr std::size_t kRows = 16;
  pool.for_chunks(small.height_px, kRows, [&](std::size_t begin, std::size_t end) {
    const std::size_t stride = std::size_t{4} * large.width_px;
    for (std::size_t y = begin; y < end; ++y) {
      const std::uint8_t* above = large.rgbx.data() + 2 * y * stride;
      const std::uint8_t* below = above + stride;
      std::uint8_t* out = small.rgbx.data() + 4 * y * small.width_px;
      for (std::size_t x = 0; x < small.width_px; ++x, above += 8, below += 8, out += 4) {
        for (int c = 0; c < 3; ++c) {
          const std::uint32_t sum = std::uint32_t{t.linear[above[c]]} + t.linear[above[c + 4]] +
                                    t.linear[below[c]] + t.linear[below[c + 4]];
          out[c] = t.srgb[(sum + 2) >> 2];
        }
        out[3] = 255;
      }
    }
  });
}

}  // namespace throng::render
