#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "render/environment/pieces.hpp"

namespace throng::render {

/// A base colour texture, as far as a site shows it: small enough that a few samples are a mean.
class SiteTexture {
 public:
  /// From PNG or JPEG; null for anything else.
  static std::shared_ptr<const SiteTexture> decode(const std::string& bytes);

  /// What a triangle of these texture coordinates shows on average, linear. The texture repeats.
  glm::dvec3 mean(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c) const;

 private:
  static constexpr std::uint32_t kSide = 128;  // texels at most
  glm::dvec3 at(const glm::dvec2& uv) const;

  std::uint32_t width_ = 0, height_ = 0;
  std::vector<glm::vec3> texels_;  // linear, rows from the top
};

/// The colours of a site: 256 at most, later ones are the nearest of those.
class SitePalette {
 public:
  std::uint8_t index_of(const glm::dvec3& linear);
  const std::vector<Rgb>& colors() const { return colors_; }

 private:
  std::vector<Rgb> colors_;
  std::unordered_map<std::uint32_t, std::uint8_t> known_;  // by coarse colour
};

}  // namespace throng::render
