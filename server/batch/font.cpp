#include "server/batch/font.hpp"

#include <cmath>
#include <cstdint>
#include <vector>

#define STB_TRUETYPE_IMPLEMENTATION
#define STBTT_STATIC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_truetype.h>
#pragma GCC diagnostic pop

// The font's file, in the program's read-only data.
asm(".section .rodata\n"
    ".balign 16\n"
    "throng_font_begin: .incbin \"" THRONG_FONT_FILE
    "\"\n"
    ".byte 0\n"
    ".previous\n");
extern "C" const unsigned char throng_font_begin[];

namespace throng::server {
namespace {

const stbtt_fontinfo& font_info() {
  static const stbtt_fontinfo info = [] {
    stbtt_fontinfo made{};
    stbtt_InitFont(&made, throng_font_begin, 0);  // our own bytes: cannot fail
    return made;
  }();
  return info;
}

/// Code points of UTF-8; a byte that is none is taken for U+FFFD.
std::vector<int> code_points(std::string_view text) {
  std::vector<int> points;
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    const std::size_t length = lead < 0x80 ? 1 : lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
    int point = lead < 0x80 ? lead : lead & (0x7f >> length);
    bool valid = lead < 0x80 || (lead >= 0xc2 && lead < 0xf5 && i + length <= text.size());
    for (std::size_t k = 1; valid && k < length; ++k) {
      const auto next = static_cast<unsigned char>(text[i + k]);
      valid = (next & 0xc0) == 0x80;
      point = (point << 6) | (next & 0x3f);
    }
    points.push_back(valid ? point : 0xfffd);
    i += valid ? length : 1;
  }
  return points;
}

/// Calls `glyph` (code point, x of its origin in pixels); returns where the text ends.
template <typename Glyph>
double lay_out(std::string_view text, float scale, Glyph glyph) {
  const stbtt_fontinfo& info = font_info();
  double x = 0.0;
  int before = 0;
  for (const int point : code_points(text)) {
    if (before != 0) x += scale * stbtt_GetCodepointKernAdvance(&info, before, point);
    glyph(point, x);
    int advance = 0, bearing = 0;
    stbtt_GetCodepointHMetrics(&info, point, &advance, &bearing);
    x += scale * advance;
    before = point;
  }
  return x;
}

}  // namespace

int Font::width(std::string_view text) const {
  const float scale = stbtt_ScaleForPixelHeight(&font_info(), static_cast<float>(size_px_));
  return static_cast<int>(std::ceil(lay_out(text, scale, [](int, double) {})));
}

void Font::draw(std::string_view text, int x, int baseline,
                const std::function<void(int, int, double)>& put) const {
  const stbtt_fontinfo& info = font_info();
  const float scale = stbtt_ScaleForPixelHeight(&info, static_cast<float>(size_px_));
  std::vector<std::uint8_t> bitmap;
  lay_out(text, scale, [&](int point, double offset) {
    const double left = x + offset, whole = std::floor(left);
    const auto shift = static_cast<float>(left - whole);
    int x0 = 0, y0 = 0, x1 = 0, y1 = 0;
    stbtt_GetCodepointBitmapBoxSubpixel(&info, point, scale, scale, shift, 0, &x0, &y0, &x1, &y1);
    if (x1 <= x0 || y1 <= y0) return;
    bitmap.assign(static_cast<std::size_t>(x1 - x0) * static_cast<std::size_t>(y1 - y0), 0);
    stbtt_MakeCodepointBitmapSubpixel(&info, bitmap.data(), x1 - x0, y1 - y0, x1 - x0, scale, scale,
                                      shift, 0, point);
    for (int row = y0; row < y1; ++row) {
      for (int column = x0; column < x1; ++column) {
        const std::uint8_t coverage =
            bitmap[static_cast<std::size_t>((row - y0) * (x1 - x0) + column - x0)];
        if (coverage != 0) put(static_cast<int>(whole) + column, baseline + row, coverage / 255.0);
      }
    }
  });
}

}  // namespace throng::server
