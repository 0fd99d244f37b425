#include "simplify/collapse/pose_cost.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>

namespace throng::simplify {
namespace {

constexpr std::uint32_t kLaneGroup = 8;

// Holds points in place inside flat regions, where planes alone cost nothing and triangles would
// degenerate. A share of a plane's weight; Hoppe's spring energy has the same purpose.
constexpr float kSpring = 2.0e-3F;
// An open border has no triangle on the other side that would hold it.
constexpr float kBorder = 4.0F;
constexpr float kSeam = 0.05F;
// Points so near to the outermost one, as a share of the size, stand for it.
constexpr float kOutermost = 0.04F;
// How much a lost extent counts against the same distance in position. By the area of the point:
// a fixed one would hold all of the many points there at fine levels (it cost up to 10 dB).
constexpr float kExtent = 1.0F;
constexpr float kCoarseExtent = 3.0F;
// What hidden surface counts: other poses and views may bare it.
constexpr float kHidden = 0.25F;
// The area that the extent of a whole piece counts for, as a share of the size squared.
constexpr float kPieceExtent = 0.01F;

}  // namespace

PoseCost::PoseCost(const PoseSet& poses, const WedgeMesh& mesh, float size_m,
                   std::span<const float> visible)
    : lanes_((poses.count + kLaneGroup - 1) / kLaneGroup * kLaneGroup),
      weight_(lanes_, 0.0F),
      counts_(lanes_, 0.0F),
      extent_(6 * lanes_),
      size_m_(size_m) {
  const std::size_t points = mesh.surface().points.size();
  const std::size_t triangles = mesh.surface().triangles.size();
  position_.resize(points * 3 * lanes_);
  quadric_.assign(points * (kTerms + 1) * lanes_, 0.0F);
  area_.assign(points, 0.0F);
  triangle_area_.assign(triangles, 0.0F);
  for (std::uint32_t lane = 0; lane < lanes_; ++lane) {
    const std::uint32_t pose =
        std::min(lane, poses.count - 1);  // what is left over repeats the last pose
    if (lane < poses.count) {
      weight_[lane] = poses.weight[lane];
      counts_[lane] = poses.weight[lane] > 0.0F ? 1.0F : 0.0F;
    }
    for (std::size_t p = 0; p < points; ++p) {
      for (int c = 0; c < 3; ++c)
        position_[(p * 3 + c) * lanes_ + lane] = poses.position[pose * points + p][c];
    }
  }

  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    for (std::uint32_t lane = 0; lane < lanes_; ++lane) {
      float low = position_[axis * lanes_ + lane], high = low;
      for (std::size_t p = 0; p < points; ++p) {
        const float at = position_[(p * 3 + axis) * lanes_ + lane];
        low = std::min(low, at);
        high = std::max(high, at);
      }
      extent_[2 * axis * lanes_ + lane] = low;
      extent_[(2 * axis + 1) * lanes_ + lane] = high;
    }
  }

  // edges with one triangle are borders, edges with different wedges on their sides are seams
  struct EdgeUse {
    std::uint32_t triangle, wedge_a, wedge_b, count;
    bool is_seam;
  };
  std::unordered_map<std::uint64_t, EdgeUse> edges;
  edges.reserve(triangles * 3 / 2);
  for (std::uint32_t t = 0; t < triangles; ++t) {
    for (int i = 0; i < 3; ++i) {
      std::uint32_t a = mesh.points(t)[i], b = mesh.points(t)[(i + 1) % 3];
      std::uint32_t wa = mesh.wedges(t)[i], wb = mesh.wedges(t)[(i + 1) % 3];
      if (a > b) {
        std::swap(a, b);
        std::swap(wa, wb);
      }
      const auto [found, is_new] =
          edges.emplace((std::uint64_t{a} << 32U) | b, EdgeUse{t, wa, wb, 1, false});
      if (is_new) continue;
      ++found->second.count;
      found->second.is_seam = found->second.wedge_a != wa || found->second.wedge_b != wb;
    }
  }

  for (std::uint32_t lane = 0; lane < poses.count; ++lane) {
    const glm::vec3* at = &poses.position[lane * points];
    std::vector<glm::vec3> normal(triangles);
    for (std::uint32_t t = 0; t < triangles; ++t) {
      const glm::uvec3& corner = mesh.points(t);
      const glm::vec3 cross = glm::cross(at[corner.y] - at[corner.x], at[corner.z] - at[corner.x]);
      const float length = glm::length(cross);
      normal[t] = length > 0.0F ? cross / length : glm::vec3(0.0F);
      const float area =
          0.5F * length * (visible.empty() ? 1.0F : kHidden + (1.0F - kHidden) * visible[t]);
      triangle_area_[t] += weight_[lane] * area;
      for (int i = 0; i < 3; ++i) {
        add_plane(corner[i], lane, normal[t], area / 3.0F);
        // the same weight for all directions
        float* q = quadric(corner[i]);
        for (const int diagonal : {0, 3, 5}) q[diagonal * lanes_ + lane] += kSpring * area / 3.0F;
        area_[corner[i]] += weight_[lane] * area / 3.0F;
      }
    }
    for (const auto& [edge, use] : edges) {
      if (use.count > 1 && !use.is_seam) continue;
      const auto a = static_cast<std::uint32_t>(edge >> 32U),
                 b = static_cast<std::uint32_t>(edge & 0xFFFFFFFFU);
      const glm::vec3 along = at[b] - at[a];
      const glm::vec3 across = glm::cross(along, normal[use.triangle]);
      const float length = glm::length(across);
      if (!(length > 0.0F)) continue;
      const float weight = (use.count == 1 ? kBorder : kSeam) * glm::dot(along, along) / 3.0F;
      add_plane(a, lane, across / length, weight);
      add_plane(b, lane, across / length, weight);
    }
  }
}

void PoseCost::add_plane(std::uint32_t point, std::uint32_t lane, const glm::vec3& n,
                         float weight) {
  float* q = quadric(point) + lane;
  q[0 * lanes_] += weight * n.x * n.x;
  q[1 * lanes_] += weight * n.x * n.y;
  q[2 * lanes_] += weight * n.x * n.z;
  q[3 * lanes_] += weight * n.y * n.y;
  q[4 * lanes_] += weight * n.y * n.z;
  q[5 * lanes_] += weight * n.z * n.z;
}

PoseCost::Cost PoseCost::move_cost(std::uint32_t a, std::uint32_t b) const {
  const std::uint32_t lanes = lanes_;
  const float* __restrict q = quadric(a);
  const float* __restrict pa = position(a);
  const float* __restrict pb = position(b);
  float mean = 0.0F, largest = 0.0F;
  for (std::uint32_t group = 0; group < lanes; group += kLaneGroup) {
    float value[kLaneGroup];
    for (std::uint32_t k = 0; k < kLaneGroup; ++k) {
      const std::uint32_t l = group + k;
      const float x = pb[l] - pa[l], y = pb[lanes + l] - pa[lanes + l],
                  z = pb[2 * lanes + l] - pa[2 * lanes + l];
      const float ax = q[l] * x + q[lanes + l] * y + q[2 * lanes + l] * z;
      const float ay = q[lanes + l] * x + q[3 * lanes + l] * y + q[4 * lanes + l] * z;
      const float az = q[2 * lanes + l] * x + q[4 * lanes + l] * y + q[5 * lanes + l] * z;
      value[k] = x * (ax + 2.0F * q[6 * lanes + l]) + y * (ay + 2.0F * q[7 * lanes + l]) +
                 z * (az + 2.0F * q[8 * lanes + l]) + q[9 * lanes + l];
    }
    for (std::uint32_t k = 0; k < kLaneGroup; ++k) {
      const float positive = value[k] > 0.0F ? value[k] : 0.0F;
      mean += weight_[group + k] * positive;
      largest = std::max(largest, counts_[group + k] * positive);
    }
  }
  return {mean, largest};
}

float PoseCost::extent_cost(std::uint32_t a, std::uint32_t b, bool is_coarse) const {
  const std::uint32_t lanes = lanes_;
  const float outermost_m = kOutermost * size_m_;
  float sum = 0.0F;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    const float* __restrict pa = position(a) + axis * lanes;
    const float* __restrict pb = position(b) + axis * lanes;
    const float* __restrict low = &extent_[2 * axis * lanes];
    const float* __restrict high = low + lanes;
    for (std::uint32_t l = 0; l < lanes; ++l) {
      const float below_a = pa[l] - low[l], below_b = pb[l] - low[l];
      const float above_a = high[l] - pa[l], above_b = high[l] - pb[l];
      const float lost_below =
          below_a < outermost_m ? std::max(0.0F, below_b * below_b - below_a * below_a) : 0.0F;
      const float lost_above =
          above_a < outermost_m ? std::max(0.0F, above_b * above_b - above_a * above_a) : 0.0F;
      sum += weight_[l] * (lost_below + lost_above);
    }
  }
  return (is_coarse ? kCoarseExtent : kExtent) * area_[a] * sum;
}

float PoseCost::extent_weight() const { return kPieceExtent * size_m_ * size_m_; }

bool PoseCost::breaks(std::uint32_t a, std::uint32_t b, std::uint32_t x, std::uint32_t y,
                      float least_cosine, float least_quality, bool bind_pose_only) const {
  const std::uint32_t lanes = lanes_;
  const float* __restrict pa = position(a);
  const float* __restrict pb = position(b);
  const float* __restrict px = position(x);
  const float* __restrict py = position(y);
  const float signed_square = least_cosine * std::fabs(least_cosine);
  const float square_quality = least_quality * least_quality;
  const std::uint32_t end = bind_pose_only ? kLaneGroup : lanes;
  for (std::uint32_t group = 0; group < end; group += kLaneGroup) {
    float broken[kLaneGroup];
    for (std::uint32_t k = 0; k < kLaneGroup; ++k) {
      const std::uint32_t l = group + k;
      const float xx = px[l], xy = px[lanes + l], xz = px[2 * lanes + l];
      const float yx = py[l], yy = py[lanes + l], yz = py[2 * lanes + l];
      const auto normal = [&](const float* __restrict p, float& nx, float& ny, float& nz,
                              float& squares) {
        const float ex = xx - p[l], ey = xy - p[lanes + l], ez = xz - p[2 * lanes + l];
        const float fx = yx - p[l], fy = yy - p[lanes + l], fz = yz - p[2 * lanes + l];
        nx = ey * fz - ez * fy;
        ny = ez * fx - ex * fz;
        nz = ex * fy - ey * fx;
        const float gx = fx - ex, gy = fy - ey, gz = fz - ez;
        squares =
            ex * ex + ey * ey + ez * ez + fx * fx + fy * fy + fz * fz + gx * gx + gy * gy + gz * gz;
      };
      float ox, oy, oz, old_squares, nx, ny, nz, new_squares;
      normal(pa, ox, oy, oz, old_squares);
      normal(pb, nx, ny, nz, new_squares);
      const float old_area = ox * ox + oy * oy + oz * oz, new_area = nx * nx + ny * ny + nz * nz;
      const float dot = ox * nx + oy * ny + oz * nz;
      // a triangle that had no area has no side to turn from
      const float turned = dot * std::fabs(dot) < signed_square * old_area * new_area ? 1.0F : 0.0F;
      // quality = 2 sqrt(3) |n| / sum of squared edges
      const float old_quality = 12.0F * old_area / (old_squares * old_squares + 1.0e-30F);
      const float new_quality = 12.0F * new_area / (new_squares * new_squares + 1.0e-30F);
      const float sliver =
          (new_quality < square_quality ? 1.0F : 0.0F) * (new_quality < old_quality ? 1.0F : 0.0F);
      const float had_area = old_quality > 1.0e-4F ? 1.0F : 0.0F;
      broken[k] = turned * had_area + sliver;
    }
    float sum = 0.0F;
    const std::uint32_t counted = bind_pose_only ? 1 : kLaneGroup;
    for (std::uint32_t k = 0; k < counted; ++k) sum += broken[k];
    if (sum > 0.0F) return true;
  }
  return false;
}

void PoseCost::merge(std::uint32_t a, std::uint32_t b) {
  const std::uint32_t lanes = lanes_;
  const float* __restrict from = quadric(a);
  float* __restrict to = quadric(b);
  const float* __restrict pa = position(a);
  const float* __restrict pb = position(b);
  for (std::uint32_t l = 0; l < lanes; ++l) {
    // the quadric of a about a, written about b
    const float x = pb[l] - pa[l], y = pb[lanes + l] - pa[lanes + l],
                z = pb[2 * lanes + l] - pa[2 * lanes + l];
    const float ax = from[l] * x + from[lanes + l] * y + from[2 * lanes + l] * z;
    const float ay = from[lanes + l] * x + from[3 * lanes + l] * y + from[4 * lanes + l] * z;
    const float az = from[2 * lanes + l] * x + from[4 * lanes + l] * y + from[5 * lanes + l] * z;
    to[9 * lanes + l] += x * (ax + 2.0F * from[6 * lanes + l]) +
                         y * (ay + 2.0F * from[7 * lanes + l]) +
                         z * (az + 2.0F * from[8 * lanes + l]) + from[9 * lanes + l];
    to[6 * lanes + l] += from[6 * lanes + l] + ax;
    to[7 * lanes + l] += from[7 * lanes + l] + ay;
    to[8 * lanes + l] += from[8 * lanes + l] + az;
    for (int term = 0; term < 6; ++term) to[term * lanes + l] += from[term * lanes + l];
  }
  area_[b] += area_[a];
}

}  // namespace throng::simplify
