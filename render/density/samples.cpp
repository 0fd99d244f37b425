#include "render/density/samples.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

#include "render/raster/element/color.hpp"

namespace throng::render {
namespace {

/// Discs are drawn in as many cells as a word has bits.
constexpr int kCells = 64;
constexpr float kSideM = 1.28F, kBelowM = 0.1F;  // of the picture, and its lower edge

}  // namespace

std::uint32_t standing_frame(const Character& character) {
  for (const Clip& clip : character.clips) {
    if (clip.kind == ClipKind::kIdle) return clip.first_frame;
  }
  return 0;
}

std::vector<Sample> surface_samples(const Character& character, std::uint32_t count,
                                    std::uint32_t frame) {
  const SurfacePoints& points = character.points;
  const Affine* palette = character.palette.data() + std::size_t{frame} * character.joint_count();
  std::uint32_t level = points.count(), first = 0;
  while (level / 2 >= count && level > 1) {
    first += level;
    level /= 2;
  }
  const auto used = std::min(count, points.count());
  const float scale = 1.0F / std::max(character.height_m, 0.05F);
  std::vector<Sample> samples;
  samples.reserve(used);
  for (std::uint32_t i = 0; i < used; ++i) {
    const SurfacePoint& point = points.point[i];
    const glm::vec4 p(point.position, 1.0F);
    const glm::vec4 n(decode_octahedral(point.normal), 0.0F);
    glm::vec3 position(0.0F), normal(0.0F);
    for (int k = 0; k < 4; ++k) {
      const float weight = static_cast<float>(point.joint_weight[k]) / 255.0F;
      if (weight == 0.0F) continue;
      const Affine& m = palette[point.joint_index[k]];
      for (int r = 0; r < 3; ++r) {
        position[r] += weight * glm::dot(m.row[r], p);
        normal[r] += weight * glm::dot(m.row[r], n);
      }
    }
    const PointTone& tone = points.tone[first + i];
    glm::vec4 regions;
    for (int k = 0; k < 4; ++k) {
      regions[k] = static_cast<float>(tone.regions >> (8 * k) & 255U) / 255.0F;
    }
    samples.push_back({position * scale, normal, element::unpack_color(tone.base), regions});
  }
  return samples;
}

float seen_area(std::span<const Disc> discs, float factor) {
  constexpr float kPerM = kCells / kSideM;
  constexpr float kSixth = 1.0471976F;
  constexpr float kLeastFacing = 0.25F;  // as the rasterizers draw it
  float area = 0.0F;
  for (int view = 0; view < 6; ++view) {
    const float cosine = std::cos(kSixth * static_cast<float>(view));
    const float sine = std::sin(kSixth * static_cast<float>(view));
    std::array<std::uint64_t, kCells> rows{};
    for (const Disc& disc : discs) {
      // i^2 + j^2 + (across i + up j)^2 <= r^2
      float across = 0.0F, up = 0.0F;
      if (disc.normal != glm::vec3(0.0F)) {
        const float facing = disc.normal.x * -sine + disc.normal.y * cosine;
        if (facing <= 0.0F) continue;
        const float steep = 1.0F / std::max(facing, kLeastFacing);
        across = (disc.normal.x * cosine + disc.normal.y * sine) * steep;
        up = disc.normal.z * steep;
      } else if (disc.squeeze < 1.0F) {
        across = std::sqrt(1.0F / (disc.squeeze * disc.squeeze) - 1.0F);
      }
      const float x = (disc.centre.x * cosine + disc.centre.y * sine + 0.5F * kSideM) * kPerM;
      const float y = (disc.centre.z + kBelowM) * kPerM;
      const float r = std::min(disc.radius * factor * kPerM, 2.0F * kCells);
      const int low = std::max(static_cast<int>(std::ceil(y - r - 0.5F)), 0);
      const int high = std::min(static_cast<int>(std::floor(y + r - 0.5F)), kCells - 1);
      const float a = 1.0F + across * across;
      for (int row = low; row <= high; ++row) {
        const float j = static_cast<float>(row) + 0.5F - y;
        const float b = across * up * j;
        const float square = b * b - a * (j * j * (1.0F + up * up) - r * r);
        if (!(square > 0.0F)) continue;
        const float half = std::sqrt(square) / a, middle = x - b / a;
        const int from = std::max(static_cast<int>(std::ceil(middle - half - 0.5F)), 0);
        const int to = std::min(static_cast<int>(std::floor(middle + half - 0.5F)), kCells - 1);
        if (from > to) continue;
        rows[static_cast<std::size_t>(row)] |= (~std::uint64_t{0} >> (kCells - 1 - (to - from)))
                                               << from;
      }
    }
    for (const std::uint64_t row : rows) area += static_cast<float>(std::popcount(row));
  }
  return area / (6.0F * kPerM * kPerM);
}

float surface_area(const Character& character) {
  double doubled = 0.0;
  for (const glm::uvec3& c : character.triangle) {
    const glm::vec3& p = character.position[c.x];
    doubled += static_cast<double>(
        glm::length(glm::cross(character.position[c.y] - p, character.position[c.z] - p)));
  }
  const float height_m = std::max(character.height_m, 0.05F);
  return 0.5F * static_cast<float>(doubled) / (height_m * height_m);
}

float seen_area_of(const Character& character) {
  const std::uint32_t count = character.points.count();
  if (count == 0) return 0.0F;
  // spheres that cover the surface stick out of it by less than their radius
  const float radius =
      0.6F * character.points.radius_m[count - 1] / std::max(character.height_m, 0.05F);
  std::vector<Disc> discs;
  for (const Sample& sample : surface_samples(character, count, standing_frame(character))) {
    discs.push_back({sample.position, std::max(radius, 0.5F * kSideM / kCells)});
  }
  return seen_area(discs, 1.0F);
}

float fitted_factor(std::span<const Disc> discs, float area) {
  float low = 1e-3F, high = 1.0F;
  while (high < 1e3F && seen_area(discs, high) < area) high *= 2.0F;
  for (int round = 0; round < 10; ++round) {
    const float middle = std::sqrt(low * high);
    (seen_area(discs, middle) < area ? low : high) = middle;
  }
  return high;
}

}  // namespace throng::render
