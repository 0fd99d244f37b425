#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <numeric>
#include <set>
#include <span>
#include <unordered_map>

#include "simplify/rebuild/atlas.hpp"
#include "simplify/rebuild/image.hpp"
#include "simplify/rebuild/surface.hpp"
#include "simplify/rebuild/weld.hpp"

namespace throng::simplify {
namespace {

constexpr std::uint32_t kNone = 0xFFFFFFFFU;

template <typename... Parts>
absl::Status bad(const Parts&... parts) {
  return absl::InvalidArgumentError(absl::StrCat(parts...));
}

bool is_finite(const glm::vec3& v) {
  return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
}

absl::Status check_image(const SourceImage& image, const std::string& what) {
  constexpr std::uint32_t kMaxSize_px = 16384;
  if (image.rgba.empty()) return absl::OkStatus();
  if (image.width_px < 1 || image.width_px > kMaxSize_px || image.height_px < 1 ||
      image.height_px > kMaxSize_px ||
      image.rgba.size() != std::size_t{4} * image.width_px * image.height_px) {
    return bad(what, " is ", image.width_px, " x ", image.height_px, " px with ", image.rgba.size(),
               " bytes, must be 1 to ", kMaxSize_px, " px with 4 bytes for each texel");
  }
  return absl::OkStatus();
}

absl::Status check(const SourceCharacter& source) {
  for (std::size_t i = 0; i < source.points.size(); ++i) {
    const SourcePoint& point = source.points[i];
    if (!is_finite(point.position) || glm::length(point.position) > 1.0e6F) {
      return bad("point ", i, " is (", point.position.x, ", ", point.position.y, ", ",
                 point.position.z, "), must be finite and within 1e6 m");
    }
    for (int k = 0; k < 4; ++k) {
      if (point.joint[k] >= source.joints.size()) {
        return bad("point ", i, " has joint ", point.joint[k], ", must be below ",
                   source.joints.size());
      }
      if (!(point.weight[k] >= 0.0F && point.weight[k] <= 2.0F)) {
        return bad("point ", i, " has weight ", point.weight[k], ", must be 0 to 1");
      }
    }
  }
  for (std::size_t i = 0; i < source.normals.size(); ++i) {
    if (!is_finite(source.normals[i])) return bad("normal ", i, " is not finite");
  }
  for (std::size_t i = 0; i < source.uvs.size(); ++i) {
    if (!(std::fabs(source.uvs[i].x) <= 1.0e5F && std::fabs(source.uvs[i].y) <= 1.0e5F)) {
      return bad("uv ", i, " is (", source.uvs[i].x, ", ", source.uvs[i].y,
                 "), must be finite and within 1e5");
    }
  }
  for (std::size_t t = 0; t < source.triangles.size(); ++t) {
    const SourceTriangle& triangle = source.triangles[t];
    if (triangle.material >= source.materials.size()) {
      return bad("triangle ", t, " has material ", triangle.material, ", must be below ",
                 source.materials.size());
    }
    for (const SourceCorner& corner : triangle.corner) {
      if (corner.point >= source.points.size()) {
        return bad("triangle ", t, " has point ", corner.point, ", must be below ",
                   source.points.size());
      }
      if (corner.normal >= source.normals.size()) {
        return bad("triangle ", t, " has normal ", corner.normal, ", must be below ",
                   source.normals.size());
      }
      if (corner.uv >= source.uvs.size()) {
        return bad("triangle ", t, " has uv ", corner.uv, ", must be below ", source.uvs.size());
      }
    }
  }
  for (const SourceMaterial& material : source.materials) {
    if (auto status = check_image(material.base_color, "texture of material " + material.name);
        !status.ok())
      return status;
    if (auto status = check_image(material.tint_mask, "tint mask of material " + material.name);
        !status.ok())
      return status;
    for (int i = 0; i < 4; ++i) {
      if (!(material.factor[i] >= 0.0F && material.factor[i] <= 1000.0F)) {
        return bad("colour factor of material ", material.name, " is ", material.factor[i],
                   ", must be 0 to 1000");
      }
    }
  }
  return absl::OkStatus();
}

bool same_image(const SourceImage& a, const SourceImage& b) {
  return a.width_px == b.width_px && a.height_px == b.height_px && a.rgba == b.rgba;
}

/// For each material the first one that looks the same.
std::vector<std::uint32_t> merge_materials(const std::vector<SourceMaterial>& materials) {
  std::vector<std::uint32_t> first(materials.size());
  for (std::uint32_t m = 0; m < materials.size(); ++m) {
    first[m] = m;
    for (std::uint32_t other = 0; other < m; ++other) {
      const SourceMaterial &a = materials[m], &b = materials[other];
      const bool is_same = a.factor == b.factor && a.wrap_u == b.wrap_u && a.wrap_v == b.wrap_v &&
                           a.double_sided == b.double_sided && a.alpha_cutout == b.alpha_cutout &&
                           a.alpha_cutoff == b.alpha_cutoff &&
                           same_image(a.base_color, b.base_color) &&
                           same_image(a.tint_mask, b.tint_mask);
      if (!is_same) continue;
      first[m] = first[other];
      break;
    }
  }
  return first;
}

/// A side of a point before its point is final: what makes two corners the same wedge.
struct Side {
  std::uint32_t point;
  std::uint32_t material;
  glm::vec2 uv;
  glm::vec3 normal;  // of the first corner
  glm::vec3 normal_sum;
};

struct SideKey {
  std::uint32_t point, material;
  glm::vec2 uv;
  bool operator==(const SideKey& other) const {
    return point == other.point && material == other.material && uv == other.uv;
  }
};

struct SideKeyHash {
  std::size_t operator()(const SideKey& key) const {
    std::uint64_t bits;
    const glm::vec2 uv = key.uv + 0.0F;  // -0 and 0 are equal, so they must hash alike
    std::memcpy(&bits, &uv, sizeof(bits));
    bits ^= (std::uint64_t{key.point} << 32U | key.material) * 0x9E3779B97F4A7C15U;
    bits = (bits ^ (bits >> 29U)) * 0xBF58476D1CE4E5B9U;
    return static_cast<std::size_t>(bits ^ (bits >> 32U));
  }
};

/// Takes the flag from what is closed and turned outwards.
void drop_hidden_backs(std::span<const glm::uvec3> triangles, Surface& surface) {
  if (!surface.is_two_sided()) return;
  const auto& points = surface.points;
  std::vector<std::uint32_t> piece(points.size());
  std::iota(piece.begin(), piece.end(), 0U);
  const auto find = [&](std::uint32_t i) {
    while (piece[i] != i) i = piece[i] = piece[piece[i]];
    return i;
  };
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> edges;  // with one triangle
  for (const glm::uvec3& t : triangles) {
    for (int i = 0; i < 3; ++i) {
      const std::uint32_t a = t[i], b = t[(i + 1) % 3];
      piece[find(a)] = find(b);
      if (edges.erase({b, a}) == 0) edges[{a, b}] = a;
    }
  }
  std::vector<bool> is_open(points.size(), false);
  for (const auto& [edge, point] : edges) is_open[find(point)] = true;
  std::vector<double> volume_m3(points.size(), 0.0), area_m2(points.size(), 0.0);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const std::uint32_t own = find(triangles[t].x);
    const glm::dvec3 origin(points[own].position);
    const auto at = [&](int i) { return glm::dvec3(points[triangles[t][i]].position) - origin; };
    volume_m3[own] += glm::dot(at(0), glm::cross(at(1), at(2))) / 6.0;
    area_m2[own] += 0.5 * glm::length(glm::cross(at(1) - at(0), at(2) - at(0)));
    if ((surface.triangle_flags[t] & render::kTriangleAlphaCutout) != 0) is_open[own] = true;
  }
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const std::uint32_t own = find(triangles[t].x);
    // two sheets back to back hold nothing, give or take rounding
    if (is_open[own] || volume_m3[own] < -1.0e-6 * std::pow(area_m2[own], 1.5)) continue;
    surface.triangle_flags[t] &= static_cast<std::uint8_t>(~render::kTriangleDoubleSided);
  }
}

}  // namespace

absl::StatusOr<Surface> rebuild(const SourceCharacter& source, const RebuildOptions& options) {
  if (auto status = check(source); !status.ok()) return status;
  Surface surface;

  // triangles of welded points
  glm::vec3 low(INFINITY), high(-INFINITY);
  for (const SourceTriangle& triangle : source.triangles) {
    for (const SourceCorner& corner : triangle.corner) {
      low = glm::min(low, source.points[corner.point].position);
      high = glm::max(high, source.points[corner.point].position);
    }
  }
  const float size_m = source.triangles.empty() ? 0.0F : glm::length(high - low);
  if (!(size_m > 0.0F)) return bad("the mesh has no triangle with an area");
  const std::vector<std::uint32_t> welded =
      weld_points(source.points, size_m * options.weld_distance);
  const std::vector<std::uint32_t> material_of = merge_materials(source.materials);

  std::vector<glm::uvec3> corners;
  std::vector<const SourceTriangle*> kept;
  std::set<std::pair<std::array<std::uint32_t, 3>, std::uint32_t>> seen;
  std::size_t degenerate = 0, copies = 0;
  double area_m2 = 0.0;
  for (const SourceTriangle& triangle : source.triangles) {
    glm::uvec3 corner;
    for (int i = 0; i < 3; ++i) corner[i] = welded[triangle.corner[i].point];
    if (corner.x == corner.y || corner.y == corner.z || corner.z == corner.x) {
      ++degenerate;
      continue;
    }
    // the same triangle starts with its least corner, whichever way it was written
    std::array<std::uint32_t, 3> turned = {corner.x, corner.y, corner.z};
    std::rotate(turned.begin(), std::min_element(turned.begin(), turned.end()), turned.end());
    if (!seen.insert({turned, 0}).second) {
      ++copies;
      continue;
    }
    const glm::vec3 &a = source.points[corner.x].position, &b = source.points[corner.y].position,
                    &c = source.points[corner.z].position;
    area_m2 +=
        0.5 * glm::length(glm::cross(glm::dvec3(b) - glm::dvec3(a), glm::dvec3(c) - glm::dvec3(a)));
    corners.push_back(corner);
    kept.push_back(&triangle);
  }
  if (!(area_m2 > 0.0)) return bad("the mesh has no triangle with an area");
  if (degenerate > 0)
    surface.notes.push_back(absl::StrCat(degenerate, " triangles without an area left out"));
  if (copies > 0)
    surface.notes.push_back(absl::StrCat(copies, " triangles that appear twice left out"));

  // sides: corners with the same welded point, uv, material and a normal within the crease angle
  std::vector<Side> sides;
  std::unordered_map<SideKey, std::vector<std::uint32_t>, SideKeyHash> by_key;
  std::vector<glm::uvec3> corner_side(corners.size());
  const float least_cosine = std::cos(options.crease_angle_rad);
  for (std::size_t t = 0; t < corners.size(); ++t) {
    const std::uint32_t material = material_of[kept[t]->material];
    const bool has_uv = !source.materials[material].base_color.rgba.empty() ||
                        !source.materials[material].tint_mask.rgba.empty();
    const glm::vec3 face =
        glm::cross(source.points[corners[t].y].position - source.points[corners[t].x].position,
                   source.points[corners[t].z].position - source.points[corners[t].x].position);
    for (int i = 0; i < 3; ++i) {
      const SourceCorner& corner = kept[t]->corner[i];
      const glm::vec2 uv = has_uv ? source.uvs[corner.uv] : glm::vec2(0.0F);
      glm::vec3 normal = source.normals[corner.normal];
      if (glm::dot(normal, normal) < 1.0e-6F) normal = face;
      const float length = glm::length(normal);
      normal = length > 0.0F ? normal / length : glm::vec3(0, 0, 1);
      std::vector<std::uint32_t>& candidates = by_key[{corners[t][i], material, uv}];
      std::uint32_t found = kNone;
      for (const std::uint32_t candidate : candidates) {
        if (glm::dot(sides[candidate].normal, normal) < least_cosine) continue;
        found = candidate;
        break;
      }
      if (found == kNone) {
        found = static_cast<std::uint32_t>(sides.size());
        candidates.push_back(found);
        sides.push_back({corners[t][i], material, uv, normal, glm::vec3(0.0F)});
      }
      sides[found].normal_sum += normal;
      corner_side[t][i] = found;
    }
  }

  // points: the manifold's, each with the wedges that its own corners use
  std::vector<glm::vec3> position(source.points.size());
  for (std::size_t i = 0; i < position.size(); ++i) position[i] = source.points[i].position;
  std::vector<std::uint32_t> origin;
  const std::vector<glm::uvec3> points = make_manifold(corners, corner_side, position, origin);
  std::set<std::uint32_t> places(origin.begin(), origin.end());
  if (places.size() < origin.size()) {
    surface.notes.push_back(absl::StrCat("surface opened at ", origin.size() - places.size(),
                                         " points where it was no manifold"));
  }
  for (const std::uint32_t point : origin) surface.points.push_back(source.points[point]);

  std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> wedge_of;  // (point, side)
  std::vector<glm::vec2> source_uv;
  std::vector<std::uint32_t> wedge_material;
  for (std::size_t t = 0; t < points.size(); ++t) {
    glm::uvec3 triangle;
    for (int i = 0; i < 3; ++i) {
      const Side& side = sides[corner_side[t][i]];
      const auto [found, is_new] =
          wedge_of.emplace(std::pair{points[t][i], corner_side[t][i]}, surface.wedge_count());
      if (is_new) {
        surface.wedge_point.push_back(points[t][i]);
        const float length = glm::length(side.normal_sum);
        surface.wedge_normal.push_back(length > 1.0e-3F ? side.normal_sum / length : side.normal);
        source_uv.push_back(side.uv);
        wedge_material.push_back(side.material);
      }
      triangle[i] = found->second;
    }
    surface.triangles.push_back(triangle);
    const SourceMaterial& material = source.materials[kept[t]->material];
    surface.triangle_flags.push_back(
        static_cast<std::uint8_t>((material.double_sided ? render::kTriangleDoubleSided : 0) |
                                  (material.alpha_cutout ? render::kTriangleAlphaCutout : 0)));
  }

  drop_hidden_backs(points, surface);

  // one texture
  Atlas atlas = make_atlas(source.materials, source_uv, wedge_material, surface.triangles, options,
                           surface.notes);
  surface.wedge_uv = std::move(atlas.uv);
  std::vector<glm::vec2> triangle_uv;
  triangle_uv.reserve(3 * surface.triangles.size());
  for (const glm::uvec3& triangle : surface.triangles) {
    for (int i = 0; i < 3; ++i) triangle_uv.push_back(surface.wedge_uv[triangle[i]]);
  }
  surface.base_color = make_mips(atlas.base_color, triangle_uv, true);
  if (!atlas.tint_mask.rgba.empty())
    surface.tint_mask = make_mips(atlas.tint_mask, triangle_uv, false);
  return surface;
}

}  // namespace throng::simplify
