#include <algorithm>
#include <limits>

#include "simplify/collapse/collapse.hpp"

namespace throng::simplify {
namespace {

PoseSet make_poses(const Surface& surface, std::span<const render::Affine> palette,
                   std::uint32_t joint_count, std::span<const std::uint32_t> frames) {
  PoseSet poses;
  poses.count = static_cast<std::uint32_t>(frames.size()) + 1;
  poses.frame.assign(frames.begin(), frames.end());
  const std::size_t points = surface.points.size();
  poses.position.resize(poses.count * points);
  for (std::size_t i = 0; i < points; ++i) poses.position[i] = surface.points[i].position;
  for (std::size_t f = 0; f < frames.size(); ++f) {
    skin(surface.points, palette.subspan(std::size_t{frames[f]} * joint_count, joint_count),
         std::span(poses.position).subspan((f + 1) * points, points));
  }
  return poses;
}

std::uint32_t frame_count(std::span<const render::Affine> palette, std::uint32_t joint_count) {
  return joint_count == 0 ? 0 : static_cast<std::uint32_t>(palette.size() / joint_count);
}

}  // namespace

void skin(std::span<const SourcePoint> points, std::span<const render::Affine> palette,
          std::span<glm::vec3> position) {
  for (std::size_t i = 0; i < points.size(); ++i) {
    const glm::vec4 bind(points[i].position, 1.0F);
    glm::vec3 sum(0.0F);
    for (int k = 0; k < 4; ++k) {
      if (points[i].weight[k] == 0.0F) continue;
      const render::Affine& matrix = palette[points[i].joint[k]];
      sum += points[i].weight[k] * glm::vec3(glm::dot(matrix.row[0], bind),
                                             glm::dot(matrix.row[1], bind),
                                             glm::dot(matrix.row[2], bind));
    }
    position[i] = sum;
  }
}

PoseSet sample_poses(const Surface& surface, std::span<const render::Affine> palette,
                     std::uint32_t joint_count, std::uint32_t max_count) {
  constexpr std::size_t kMarkers = 256;
  constexpr float kSamePose_m = 0.001F;
  const std::uint32_t frames = frame_count(palette, joint_count);

  // evenly spaced points stand for the body
  std::vector<SourcePoint> markers;
  const std::size_t stride = std::max<std::size_t>(1, surface.points.size() / kMarkers);
  for (std::size_t i = 0; i < surface.points.size(); i += stride)
    markers.push_back(surface.points[i]);
  const std::size_t count = markers.size();
  std::vector<glm::vec3> position((frames + 1) * count);
  for (std::size_t i = 0; i < count; ++i) position[i] = markers[i].position;
  for (std::uint32_t f = 0; f < frames; ++f) {
    skin(markers, palette.subspan(std::size_t{f} * joint_count, joint_count),
         std::span(position).subspan((f + 1) * count, count));
  }

  std::vector<float> nearest_m(frames + 1, std::numeric_limits<float>::max());
  std::vector<std::uint32_t> chosen;
  std::uint32_t newest = 0;  // the bind pose
  for (;;) {
    for (std::uint32_t f = 0; f <= frames; ++f) {
      float sum_m = 0.0F;
      for (std::size_t i = 0; i < count; ++i) {
        sum_m += glm::distance(position[f * count + i], position[newest * count + i]);
      }
      nearest_m[f] = std::min(nearest_m[f], sum_m / static_cast<float>(count));
    }
    newest = static_cast<std::uint32_t>(std::max_element(nearest_m.begin(), nearest_m.end()) -
                                        nearest_m.begin());
    if (nearest_m[newest] < kSamePose_m || chosen.size() + 1 >= max_count) break;
    chosen.push_back(newest - 1);
  }
  PoseSet poses = make_poses(surface, palette, joint_count, chosen);
  const float share = 1.0F / (static_cast<float>(chosen.size()) + (chosen.empty() ? 1.0F : 0.5F));
  poses.weight.assign(poses.count, share);
  if (!chosen.empty()) poses.weight[0] = 0.5F * share;
  return poses;
}

PoseSet all_poses(const Surface& surface, std::span<const render::Affine> palette,
                  std::uint32_t joint_count, std::uint64_t max_bytes) {
  const std::uint32_t frames = frame_count(palette, joint_count);
  const std::uint64_t bytes_each =
      surface.points.size() * 13 * sizeof(float);  // quadric and position
  const auto limit = static_cast<std::uint32_t>(
      std::clamp<std::uint64_t>(max_bytes / std::max<std::uint64_t>(1, bytes_each), 8, 1U << 20U));
  std::vector<std::uint32_t> chosen;
  const std::uint32_t count = std::min(frames, limit);
  for (std::uint32_t i = 0; i < count; ++i) {
    chosen.push_back(static_cast<std::uint32_t>(std::uint64_t{i} * frames / count));
  }
  PoseSet poses = make_poses(surface, palette, joint_count, chosen);
  poses.weight.assign(poses.count,
                      chosen.empty() ? 1.0F : 1.0F / static_cast<float>(chosen.size()));
  if (!chosen.empty()) poses.weight[0] = 0.0F;
  return poses;
}

}  // namespace throng::simplify
