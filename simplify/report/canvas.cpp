#include "simplify/report/canvas.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace throng::simplify {
namespace {

/// A letter: strokes separated by spaces, each a list of points x y. x counts half units from 0 on;
/// y is a letter, 'a' two units below the baseline, 'e' on it, 'm' on the top of small letters, 'q'
/// on that of capitals. Strokes of three and more points are rounded at their inner points; one
/// that ends where it begins is round all over.
struct Glyph {
  char letter;
  std::uint8_t width;  // half units
  const char* strokes;
};

constexpr Glyph kGlyphs[] = {
    {'a', 6, "0e6e6m0m0e 6m6e"},
    {'b', 6, "0q0e 0e6e6m0m0e"},
    {'c', 6, "6l6m0m0e6e6f"},
    {'d', 6, "6q6e 0e6e6m0m0e"},
    {'e', 6, "0i6i 6i6m0m0e6e6f"},
    {'f', 4, "1e1n1q4q 0m4m"},
    {'g', 6, "0e6e6m0m0e 6m6d6a0a0b"},
    {'h', 6, "0q0e 0j0m6m6j6e"},
    {'i', 0, "0m0e 0o0p"},
    {'j', 2, "2m2c2a0a 2o2p"},
    {'k', 6, "0q0e 5m0h 2j6e"},
    {'l', 0, "0q0e"},
    {'m', 8, "0m0e 0j0m4m4j4e 4j4m8m8j8e"},
    {'n', 6, "0m0e 0j0m6m6j6e"},
    {'o', 6, "0e6e6m0m0e"},
    {'p', 6, "0m0a 0e6e6m0m0e"},
    {'q', 6, "6m6a 0e6e6m0m0e"},
    {'r', 4, "0m0e 0j0m4m"},
    {'s', 5, "5l5m0m0i5i5e0e0f"},
    {'t', 4, "1p1g1e4e 0m4m"},
    {'u', 6, "0m0h0e6e6h6m 6m6e"},
    {'v', 6, "0m3e 3e6m"},
    {'w', 8, "0m2e 2e4m 4m6e 6e8m"},
    {'x', 6, "0m6e 0e6m"},
    {'y', 6, "0m3e 6m1a"},
    {'z', 5, "0m5m 5m0e 0e5e"},
    {'A', 8, "0e4q 4q8e 1i7i"},
    {'B', 6, "0e0q 0q5q5k0k 0k6k6e0e"},
    {'C', 7, "7o7q0q0e7e7g"},
    {'D', 7, "0e0q 0q7q7e0e"},
    {'E', 6, "0e0q 0q6q 0k5k 0e6e"},
    {'F', 6, "0e0q 0q6q 0k5k"},
    {'G', 7, "7o7q0q0e7e7j 7j4j"},
    {'H', 7, "0e0q 7e7q 0k7k"},
    {'I', 0, "0e0q"},
    {'J', 4, "4q4h4e0e0g"},
    {'K', 6, "0e0q 6q0i 2k6e"},
    {'L', 5, "0q0e 0e5e"},
    {'M', 8, "0e0q 0q4h 4h8q 8q8e"},
    {'N', 7, "0e0q 0q7e 7e7q"},
    {'O', 8, "0e8e8q0q0e"},
    {'P', 6, "0e0q 0q6q6j0j"},
    {'Q', 8, "0e8e8q0q0e 5h8e"},
    {'R', 6, "0e0q 0q6q6j0j 3j6e"},
    {'S', 6, "6o6q0q0k6k6e0e0g"},
    {'T', 8, "4e4q 0q8q"},
    {'U', 7, "0q0h0e7e7h7q"},
    {'V', 8, "0q4e 4e8q"},
    {'W', 8, "0q2e 2e4q 4q6e 6e8q"},
    {'X', 7, "0q7e 0e7q"},
    {'Y', 8, "0q4k 8q4k 4k4e"},
    {'Z', 7, "0q7q 7q0e 0e7e"},
    {'0', 6, "0e6e6q0q0e"},
    {'1', 4, "0n3q 3q3e"},
    {'2', 6, "0n0q6q6l3h0e 0e6e"},
    {'3', 6, "0o0q6q6k2k 2k6k6e0e0g"},
    {'4', 7, "5e5q 5q0h 0h7h"},
    {'5', 6, "6q1q 1q0k 0k1m6m6e0e0f"},
    {'6', 6, "0e6e6l0l0e 5q0m0h"},
    {'7', 6, "0q6q 6q2e"},
    {'8', 6, "0k6k6q0q0k 0e6e6k0k0e"},
    {'9', 6, "0j6j6q0q0j 6n6i1e"},
    {'.', 1, "0e0f 1e1f"},
    {',', 1, "1e0c"},
    {':', 1, "0e0f 1e1f 0l0m 1l1m"},
    {'-', 4, "0i4i"},
    {'_', 6, "0d6d"},
    {'+', 6, "0i6i 3f3l"},
    {'=', 6, "0g6g 0k6k"},
    {'/', 4, "0d4q"},
    {'(', 2, "2q0m0g2d"},
    {')', 2, "0q2m2g0d"},
    {'%', 8, "0e7q 0m0q3q3m0m 5e8e8i5i5e"},
};
constexpr float kUnitsPerCap = 12.0F;
constexpr float kGap = 3.0F;    // between letters, half units
constexpr float kSpace = 5.0F;  // width of ' '

const Glyph* find(char letter) {
  for (const Glyph& glyph : kGlyphs) {
    if (glyph.letter == letter) return &glyph;
  }
  return nullptr;
}

/// Corner cutting (Chaikin 1974), ends stay.
std::vector<glm::vec2> rounded(std::vector<glm::vec2> points) {
  if (points.size() < 3) return points;
  const bool is_closed = points.front() == points.back();
  for (int round = 0; round < 3; ++round) {
    std::vector<glm::vec2> cut;
    if (!is_closed) cut.push_back(points.front());
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
      const bool keeps_begin = !is_closed && i == 0;
      const bool keeps_end = !is_closed && i + 2 == points.size();
      if (!keeps_begin) cut.push_back(glm::mix(points[i], points[i + 1], 0.25F));
      if (!keeps_end) cut.push_back(glm::mix(points[i], points[i + 1], 0.75F));
    }
    cut.push_back(is_closed ? cut.front() : points.back());
    points = std::move(cut);
  }
  return points;
}

}  // namespace

Canvas::Canvas(std::uint32_t width_px, std::uint32_t height_px, const glm::u8vec3& color) {
  picture_.width_px = width_px;
  picture_.height_px = height_px;
  picture_.rgbx.assign(std::size_t{4} * width_px * height_px, 255);
  fill(0, 0, static_cast<int>(width_px), static_cast<int>(height_px), color);
}

void Canvas::fill(int x, int y, int width, int height, const glm::u8vec3& color) {
  const int x_end = std::min(x + width, static_cast<int>(picture_.width_px));
  const int y_end = std::min(y + height, static_cast<int>(picture_.height_px));
  for (int row = std::max(y, 0); row < y_end; ++row) {
    std::uint8_t* pixel = picture_.rgbx.data() + std::size_t{4} * row * picture_.width_px;
    for (int column = std::max(x, 0); column < x_end; ++column) {
      for (int c = 0; c < 3; ++c) pixel[4 * column + c] = color[c];
    }
  }
}

void Canvas::put(const render::Picture& picture, int x, int y, int zoom) {
  const int width = static_cast<int>(picture.width_px) * zoom;
  const int height = static_cast<int>(picture.height_px) * zoom;
  const int x_end = std::min(x + width, static_cast<int>(picture_.width_px));
  const int y_end = std::min(y + height, static_cast<int>(picture_.height_px));
  for (int row = std::max(y, 0); row < y_end; ++row) {
    const std::uint8_t* from =
        picture.rgbx.data() + std::size_t{4} * ((row - y) / zoom) * picture.width_px;
    std::uint8_t* to = picture_.rgbx.data() + std::size_t{4} * row * picture_.width_px;
    for (int column = std::max(x, 0); column < x_end; ++column)
      std::copy_n(from + 4 * ((column - x) / zoom), 3, to + 4 * column);
  }
}

void Canvas::lay(const Cutout& cutout, int x, int y) {
  for (std::size_t i = 0; i < cutout.pixels.size(); ++i) {
    const glm::vec4& over = cutout.pixels[i];
    const int column = x + static_cast<int>(i % cutout.width_px);
    const int row = y + static_cast<int>(i / cutout.width_px);
    if (over.a <= 0.0F || column < 0 || row < 0 || column >= static_cast<int>(picture_.width_px) ||
        row >= static_cast<int>(picture_.height_px)) {
      continue;
    }
    std::uint8_t* pixel =
        picture_.rgbx.data() + std::size_t{4} * (static_cast<std::size_t>(row) * picture_.width_px +
                                                 static_cast<std::size_t>(column));
    for (int c = 0; c < 3; ++c)
      pixel[c] = byte_from_linear(over[c] + (1.0F - over.a) * linear_from_byte(pixel[c]));
  }
}

void Canvas::mix(int x, int y, const glm::vec3& color, float share) {
  if (x < 0 || y < 0 || x >= static_cast<int>(picture_.width_px) ||
      y >= static_cast<int>(picture_.height_px)) {
    return;
  }
  std::uint8_t* pixel =
      picture_.rgbx.data() + std::size_t{4} * (std::size_t(y) * picture_.width_px + x);
  for (int c = 0; c < 3; ++c)
    pixel[c] =
        static_cast<std::uint8_t>(glm::mix(static_cast<float>(pixel[c]), color[c], share) + 0.5F);
}

void Canvas::stroke(const glm::vec2& from, const glm::vec2& to, float width_px,
                    const glm::u8vec3& color) {
  const float radius = 0.5F * width_px;
  const glm::ivec2 low(glm::floor(glm::min(from, to) - radius - 1.0F));
  const glm::ivec2 high(glm::ceil(glm::max(from, to) + radius + 1.0F));
  const glm::vec2 along = to - from;
  const float length2 = glm::dot(along, along);
  for (int y = low.y; y <= high.y; ++y) {
    for (int x = low.x; x <= high.x; ++x) {
      const glm::vec2 p(static_cast<float>(x) + 0.5F, static_cast<float>(y) + 0.5F);
      const float t =
          length2 > 0.0F ? glm::clamp(glm::dot(p - from, along) / length2, 0.0F, 1.0F) : 0.0F;
      const float share =
          glm::clamp(radius + 0.5F - glm::distance(p, from + t * along), 0.0F, 1.0F);
      if (share > 0.0F) mix(x, y, color, share * std::min(width_px, 1.0F));
    }
  }
}

void Canvas::write(std::string_view words, const glm::vec2& baseline, float cap_px,
                   const glm::u8vec3& color) {
  const float unit = cap_px / kUnitsPerCap;
  const float width_px = std::max(1.0F, cap_px * 0.115F);
  // one mask for all strokes, so that they don't darken each other where they meet
  const int mask_width = static_cast<int>(width_of(words, cap_px) + cap_px) + 4;
  const int mask_height = static_cast<int>(2.0F * cap_px) + 4;
  const glm::ivec2 corner(glm::floor(baseline - glm::vec2(0.5F * cap_px, 1.5F * cap_px)));
  Canvas mask(static_cast<std::uint32_t>(mask_width), static_cast<std::uint32_t>(mask_height),
              glm::u8vec3(0));
  glm::vec2 pen = baseline - glm::vec2(corner);
  for (const char letter : words) {
    const Glyph* glyph = find(letter);
    if (letter == ' ' || glyph == nullptr) {
      pen.x += (kSpace + kGap) * unit;
      continue;
    }
    std::vector<glm::vec2> points;
    for (const char* c = glyph->strokes;; ++c) {
      if (*c != ' ' && *c != '\0') {
        const float x = static_cast<float>(c[0] - '0');
        const float y = static_cast<float>(c[1] - 'e');
        points.emplace_back(x, -y);
        ++c;
        continue;
      }
      points = rounded(std::move(points));
      for (std::size_t i = 0; i + 1 < points.size(); ++i) {
        mask.stroke(pen + unit * points[i], pen + unit * points[i + 1], width_px, glm::u8vec3(255));
      }
      points.clear();
      if (*c == '\0') break;
    }
    pen.x += (static_cast<float>(glyph->width) + kGap) * unit;
  }
  for (int y = 0; y < mask_height; ++y) {
    for (int x = 0; x < mask_width; ++x) {
      const std::uint8_t share =
          mask.picture_.rgbx[std::size_t{4} * (std::size_t(y) * mask_width + x)];
      if (share > 0) mix(corner.x + x, corner.y + y, color, static_cast<float>(share) / 255.0F);
    }
  }
}

float Canvas::width_of(std::string_view words, float cap_px) {
  float width = -kGap;
  for (const char letter : words) {
    const Glyph* glyph = find(letter);
    width += (letter == ' ' || glyph == nullptr ? kSpace : static_cast<float>(glyph->width)) + kGap;
  }
  return std::max(width, 0.0F) * cap_px / kUnitsPerCap;
}

}  // namespace throng::simplify
