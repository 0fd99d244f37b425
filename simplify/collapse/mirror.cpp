#include "simplify/collapse/mirror.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

#include "simplify/collapse/wedges.hpp"

namespace throng::simplify {
namespace {

constexpr float kTolerance = 0.01F;  // of the size
constexpr float kLeastShare = 0.6F;

std::uint64_t cell_of(const glm::vec3& position, float size_m, const glm::ivec3& step) {
  std::uint64_t key = 0;
  for (int i = 0; i < 3; ++i) {
    const auto cell = static_cast<std::int64_t>(std::floor(position[i] / size_m)) + step[i];
    key = key << 21U | (static_cast<std::uint64_t>(cell) & 0x1FFFFFU);
  }
  return key;
}

}  // namespace

std::vector<std::uint32_t> find_mirror(const Surface& surface, float size_m) {
  const float tolerance_m = kTolerance * size_m;
  if (!(tolerance_m > 0.0F)) return {};
  const auto points = static_cast<std::uint32_t>(surface.points.size());
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells;
  float low = std::numeric_limits<float>::max(), high = -low;
  for (std::uint32_t p = 0; p < points; ++p) {
    const glm::vec3& at = surface.points[p].position;
    cells[cell_of(at, tolerance_m, glm::ivec3(0))].push_back(p);
    low = std::min(low, at.y);
    high = std::max(high, at.y);
  }
  // artists model about the origin; what is carried in one hand moves the middle of the extents
  for (const float middle : {0.0F, 0.5F * (low + high)}) {
    std::vector<std::uint32_t> mirror(points, kNoIndex);
    std::uint32_t found = 0;
    for (std::uint32_t p = 0; p < points; ++p) {
      glm::vec3 image = surface.points[p].position;
      image.y = 2.0F * middle - image.y;
      float least = tolerance_m * tolerance_m;
      for (int step = 0; step < 27; ++step) {
        const auto cell = cells.find(cell_of(
            image, tolerance_m, glm::ivec3(step % 3, step / 3 % 3, step / 9) - glm::ivec3(1)));
        if (cell == cells.end()) continue;
        for (const std::uint32_t other : cell->second) {
          const glm::vec3 away = surface.points[other].position - image;
          if (glm::dot(away, away) >= least) continue;
          least = glm::dot(away, away);
          mirror[p] = other;
        }
      }
      found += mirror[p] != kNoIndex ? 1 : 0;
    }
    if (static_cast<float>(found) >= kLeastShare * static_cast<float>(points)) return mirror;
  }
  return {};
}

}  // namespace throng::simplify
