#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <string_view>

#include "simplify/report/studio.hpp"
#include "throng/render/picture.hpp"

namespace throng::simplify {

/// A picture to put other pictures, lines and words on. Coordinates are pixels from the top left;
/// what lies outside is cut off. Colours are sRGB.
class Canvas {
 public:
  Canvas(std::uint32_t width_px, std::uint32_t height_px, const glm::u8vec3& color);

  const render::Picture& picture() const { return picture_; }
  std::uint32_t width_px() const { return picture_.width_px; }
  std::uint32_t height_px() const { return picture_.height_px; }

  void fill(int x, int y, int width, int height, const glm::u8vec3& color);
  /// Every pixel of `picture` becomes a square of `zoom` pixels.
  void put(const render::Picture& picture, int x, int y, int zoom = 1);
  /// Laid over what is there, in linear light.
  void lay(const Cutout& cutout, int x, int y);
  /// A straight stroke with round ends.
  void stroke(const glm::vec2& from, const glm::vec2& to, float width_px, const glm::u8vec3& color);
  /// Words in a plain letter made of strokes; `baseline` is where they begin.
  /// @param cap_px  height of a capital
  void write(std::string_view words, const glm::vec2& baseline, float cap_px,
             const glm::u8vec3& color);
  static float width_of(std::string_view words, float cap_px);
  /// Mixes a colour into a pixel.
  void mix(int x, int y, const glm::vec3& color, float share);

 private:
  render::Picture picture_;
};

}  // namespace throng::simplify
