#pragma once

#include <algorithm>
#include <cmath>
#include <glm/glm.hpp>

namespace throng::simplify {

/// Calls `visit(x, y, w0, w1)` for the pixels in [x0, x1) x [y0, y1) whose centres are in the
/// triangle, with the weights of a and b.
template <typename Visit>
void for_pixels(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c, int x0, int y0, int x1,
                int y1, Visit visit) {
  x0 = std::max(x0, static_cast<int>(std::ceil(std::min({a.x, b.x, c.x}) - 0.5F)));
  y0 = std::max(y0, static_cast<int>(std::ceil(std::min({a.y, b.y, c.y}) - 0.5F)));
  x1 = std::min(x1, static_cast<int>(std::floor(std::max({a.x, b.x, c.x}) - 0.5F)) + 1);
  y1 = std::min(y1, static_cast<int>(std::floor(std::max({a.y, b.y, c.y}) - 0.5F)) + 1);
  if (x0 >= x1 || y0 >= y1) return;
  const float inverse = 1.0F / ((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
  const float step0 = (b.y - c.y) * inverse, step1 = (c.y - a.y) * inverse;
  for (int y = y0; y < y1; ++y) {
    const float px = static_cast<float>(x0) + 0.5F, py = static_cast<float>(y) + 0.5F;
    float w0 = ((b.x - px) * (c.y - py) - (b.y - py) * (c.x - px)) * inverse;
    float w1 = ((c.x - px) * (a.y - py) - (c.y - py) * (a.x - px)) * inverse;
    for (int x = x0; x < x1; ++x, w0 += step0, w1 += step1) {
      if (w0 >= 0.0F && w1 >= 0.0F && w0 + w1 <= 1.0F) visit(x, y, w0, w1);
    }
  }
}

/// Twice the area in px, negative for a triangle that is turned to the viewer (rows count down).
inline float doubled_area(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

}  // namespace throng::simplify
