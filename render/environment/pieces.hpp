#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <map>
#include <memory>
#include <span>
#include <utility>
#include <vector>

#include "throng/render/environment.hpp"

namespace throng::render {

inline constexpr double kPieceM = 16.0;  // a side of a piece: about what a view culls by

/// One piece on its way: corners of its triangles, three by three.
struct Corners {
  std::vector<glm::vec3> position;
  std::vector<glm::vec3> normal;
  std::vector<std::uint16_t> u;

  void add(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c, const glm::vec3& n,
           std::uint16_t column) {
    for (const glm::vec3& corner : {a, b, c}) {
      position.push_back(corner);
      normal.push_back(n);
      u.push_back(column);
    }
  }
};

using Pieces = std::map<std::pair<int, int>, Corners>;

/// @param layer  what lies in another one is a piece of its own: edges are smooth between pieces.
inline Corners& piece_at(Pieces& pieces, const glm::dvec2& point, double piece_m = kPieceM,
                         int layer = 0) {
  constexpr int kLayer = 1 << 24;  // more than lie side by side
  return pieces[{static_cast<int>(std::floor(point.x / piece_m)) + layer * kLayer,
                 static_cast<int>(std::floor(point.y / piece_m))}];
}

using Rgb = std::array<std::uint8_t, 3>;

/// Texture column at which a piece shows color `index` of `count`.
inline std::uint16_t color_u(std::size_t index, std::size_t count) {
  return static_cast<std::uint16_t>((static_cast<double>(index) + 0.5) * 65536.0 /
                                    static_cast<double>(count));
}

/// The pieces of an environment. `what` begins an error's message.
/// @param colors          of the texture's columns, sRGB
/// @param triangle_flags  of every triangle
absl::StatusOr<std::shared_ptr<Environment>> finish(const Pieces& pieces,
                                                    std::span<const Rgb> colors,
                                                    std::uint8_t triangle_flags, const char* what);

}  // namespace throng::render
