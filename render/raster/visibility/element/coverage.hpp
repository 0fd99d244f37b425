#pragma once

#include <cstdint>

#include "render/compute/element/host_device.hpp"

namespace throng::render::element {

/// Vertices are snapped to 1/256 of a sample; sample (i, j) has its centre at 256 i + 128, 256 j +
/// 128.
inline constexpr int kSubBits = 8;
inline constexpr std::int32_t kSubUnit = 1 << kSubBits;

/// Snapped coordinates lie within +-kGuardUnits of the picture's centre; what goes beyond is
/// clipped. With it an edge's slope fits 24 bits, and an edge function anywhere in a tile fits 32.
inline constexpr std::int32_t kGuardUnits = 1 << 22;

/// A triangle whose sides are shorter than this needs 32-bit products only.
inline constexpr std::int32_t kSmallUnits = 1 << 14;

/// An edge function over the samples of a tile, in whole steps of one sample:
///
///     inside  <=>  at_origin + dx * i + dy * j >= 0
///
/// Exact: with E the edge function at sample (0, 0) in sub-units, E + 256 k >= 0 holds just when
/// floor(E / 256) + k >= 0. The top-left rule is folded in as E - 1 for edges that don't own their
/// samples.
struct Edge {
  std::int32_t at_origin;
  std::int32_t dx;
  std::int32_t dy;
};

/// The edge from a to b (sub-units relative to the tile's corner, y down) of a triangle whose
/// inside is where the function is positive.
THRONG_HOST_DEVICE inline Edge edge_between(std::int32_t ax, std::int32_t ay, std::int32_t bx,
                                            std::int32_t by) {
  Edge edge;
  edge.dx = by - ay;
  edge.dy = ax - bx;
  const std::int64_t half = kSubUnit / 2;
  std::int64_t value = static_cast<std::int64_t>(edge.dx) * (half - ax) +
                       static_cast<std::int64_t>(edge.dy) * (half - ay);
  const bool owns = edge.dx > 0 || (edge.dx == 0 && edge.dy > 0);  // left or top edge
  if (!owns) value -= 1;
  value >>= kSubBits;
  // beyond this no sample of a tile can change the sign (63 * 2 * 2^23 < 2^30)
  constexpr std::int64_t kFar = std::int64_t{1} << 30;
  edge.at_origin = static_cast<std::int32_t>(value > kFar ? kFar : (value < -kFar ? -kFar : value));
  return edge;
}

/// Twice the area in sub-units squared, positive for triangles that face the viewer
/// (counter-clockwise in clip space, so clockwise with y down).
THRONG_HOST_DEVICE inline std::int64_t doubled_area(std::int32_t x0, std::int32_t y0,
                                                    std::int32_t x1, std::int32_t y1,
                                                    std::int32_t x2, std::int32_t y2) {
  return static_cast<std::int64_t>(x2 - x0) * (y1 - y0) -
         static_cast<std::int64_t>(x1 - x0) * (y2 - y0);
}

/// Reversed depth over the picture: a plane through three snapped vertices, evaluated in one
/// written order and kept within the triangle's own range.
struct DepthPlane {
  float z0, dzdx, dzdy;  // per sub-unit, from vertex 0
  float low, high;
};

THRONG_HOST_DEVICE inline DepthPlane depth_plane(std::int32_t x0, std::int32_t y0, float z0,
                                                 std::int32_t x1, std::int32_t y1, float z1,
                                                 std::int32_t x2, std::int32_t y2, float z2,
                                                 float area) {
  const float inverse = 1.0F / area;
  const float ux = static_cast<float>(x1 - x0), uy = static_cast<float>(y1 - y0), uz = z1 - z0;
  const float vx = static_cast<float>(x2 - x0), vy = static_cast<float>(y2 - y0), vz = z2 - z0;
  DepthPlane plane;
  plane.z0 = z0;
  const float a = vz * uy, b = uz * vy, c = uz * vx, d = vz * ux;
  plane.dzdx = (a - b) * inverse;
  plane.dzdy = (c - d) * inverse;
  const float l = z1 < z2 ? z1 : z2, h = z1 < z2 ? z2 : z1;
  plane.low = z0 < l ? z0 : l;
  plane.high = z0 > h ? z0 : h;
  return plane;
}

}  // namespace throng::render::element
