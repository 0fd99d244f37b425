#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <vector>

#include "simplify/source_character.hpp"

namespace throng::test {

using simplify::SourceCharacter;

/// A character with one joint, a white material of 16 x 16 texels and nothing else.
inline SourceCharacter make_empty_source() {
  SourceCharacter source;
  source.name = "shape";
  source.joints.push_back({"root", -1, glm::mat4(1.0F)});
  simplify::SourceMaterial material;
  material.name = "skin";
  material.base_color.width_px = material.base_color.height_px = 16;
  material.base_color.rgba.assign(16 * 16 * 4, 255);
  source.materials.push_back(material);
  return source;
}

inline void add_triangle(SourceCharacter& source, std::array<std::uint32_t, 3> points,
                         std::array<std::uint32_t, 3> normals, std::array<std::uint32_t, 3> uvs,
                         std::uint32_t material = 0) {
  simplify::SourceTriangle triangle;
  triangle.material = material;
  for (int i = 0; i < 3; ++i) triangle.corner[i] = {points[i], normals[i], uvs[i]};
  source.triangles.push_back(triangle);
}

/// The cube of figure 3 in Dong & Peng 2019: 8 points, 12 triangles, unfolded to a cross of 14 uvs.
/// One smooth normal for each point, 1 m wide, on the ground.
inline SourceCharacter make_cube() {
  SourceCharacter source = make_empty_source();
  for (int i = 0; i < 8; ++i) {
    const glm::vec3 corner(i & 1, (i >> 1) & 1, i >> 2);
    source.points.push_back({corner - glm::vec3(0.5F, 0.5F, 0), glm::u16vec4(0), {1, 0, 0, 0}});
    source.normals.push_back(glm::normalize(corner - 0.5F));
  }
  // a cross: four squares in a row (the sides), one above and one below the second
  std::vector<std::array<int, 2>> places;
  const auto uv_at = [&](int x, int y) {
    for (std::uint32_t i = 0; i < places.size(); ++i) {
      if (places[i] == std::array{x, y}) return i;
    }
    places.push_back({x, y});
    source.uvs.emplace_back(static_cast<float>(x) / 4, static_cast<float>(y) / 3);
    return static_cast<std::uint32_t>(places.size() - 1);
  };
  struct Face {
    std::array<std::uint32_t, 4> points;  // counter-clockwise from outside
    int x, y;  // lower left place; the points go x y, x+1 y, x+1 y+1, x y+1
  };
  // sides: x = -, y = -, x = +, y = +; then top and bottom, attached to the side y = -
  const Face faces[] = {{{2, 0, 4, 6}, 0, 1}, {{0, 1, 5, 4}, 1, 1}, {{1, 3, 7, 5}, 2, 1},
                        {{3, 2, 6, 7}, 3, 1}, {{4, 5, 7, 6}, 1, 2}, {{2, 3, 1, 0}, 1, 0}};
  for (const Face& face : faces) {
    const std::array<std::uint32_t, 4> uv = {uv_at(face.x, face.y), uv_at(face.x + 1, face.y),
                                             uv_at(face.x + 1, face.y + 1),
                                             uv_at(face.x, face.y + 1)};
    const auto& p = face.points;
    add_triangle(source, {p[0], p[1], p[2]}, {p[0], p[1], p[2]}, {uv[0], uv[1], uv[2]});
    add_triangle(source, {p[0], p[2], p[3]}, {p[0], p[2], p[3]}, {uv[0], uv[2], uv[3]});
  }
  return source;
}

struct TubeOptions {
  std::uint32_t columns = 16;
  std::uint32_t rings = 21;
  float radius_m = 0.15F;
  float height_m = 1.8F;
  float bulge = 0.0F;      // 1: an ellipsoid
  bool has_elbow = false;  // a second joint at half the height, which a walk clip bends
};

/// A closed upright tube with a texture seam along one side: columns * rings + 2 points, and as
/// many wedges with the seam and the caps' own uvs added.
inline SourceCharacter make_tube(const TubeOptions& options = {}) {
  SourceCharacter source = make_empty_source();
  const auto columns = options.columns, rings = options.rings;
  for (std::uint32_t ring = 0; ring < rings; ++ring) {
    const float along = static_cast<float>(ring) / static_cast<float>(rings - 1);
    const float round =
        std::sqrt(std::max(0.02F, 1.0F - (2.0F * along - 1.0F) * (2.0F * along - 1.0F)));
    const float radius_m = options.radius_m * (1.0F - options.bulge + options.bulge * round);
    for (std::uint32_t column = 0; column < columns; ++column) {
      const float angle_rad = 6.2831853F * static_cast<float>(column) / static_cast<float>(columns);
      const glm::vec3 out(std::cos(angle_rad), std::sin(angle_rad), 0);
      simplify::SourcePoint point{out * radius_m + glm::vec3(0, 0, along * options.height_m),
                                  glm::u16vec4(0),
                                  {1, 0, 0, 0}};
      if (options.has_elbow) {
        const float upper = std::min(1.0F, std::max(0.0F, (along - 0.5F) * 8.0F + 0.5F));
        point.joint = upper > 0.5F ? glm::u16vec4(1, 0, 0, 0) : glm::u16vec4(0, 1, 0, 0);
        point.weight =
            upper > 0.5F ? glm::vec4(upper, 1 - upper, 0, 0) : glm::vec4(1 - upper, upper, 0, 0);
      }
      source.points.push_back(point);
      source.normals.push_back(out);
    }
    for (std::uint32_t column = 0; column <= columns; ++column) {
      source.uvs.emplace_back(static_cast<float>(column) / static_cast<float>(columns),
                              1.0F - 0.8F * along);
    }
  }
  const auto bottom = static_cast<std::uint32_t>(source.points.size());
  source.points.push_back({{0, 0, 0}, glm::u16vec4(0), {1, 0, 0, 0}});
  source.points.push_back(
      {{0, 0, options.height_m}, glm::u16vec4(options.has_elbow ? 1 : 0, 0, 0, 0), {1, 0, 0, 0}});
  source.normals.emplace_back(0, 0, -1);
  source.normals.emplace_back(0, 0, 1);
  const auto cap_uv = static_cast<std::uint32_t>(source.uvs.size());
  source.uvs.emplace_back(0.5F, 1.0F);
  source.uvs.emplace_back(0.5F, 0.1F);
  for (std::uint32_t column = 0; column < columns; ++column) {
    const std::uint32_t next = (column + 1) % columns;
    for (std::uint32_t ring = 0; ring + 1 < rings; ++ring) {
      const std::uint32_t a = ring * columns + column, b = ring * columns + next;
      const std::uint32_t c = a + columns, d = b + columns;
      const std::uint32_t ua = ring * (columns + 1) + column, ub = ua + 1, uc = ua + columns + 1,
                          ud = uc + 1;
      add_triangle(source, {a, b, d}, {a, b, d}, {ua, ub, ud});
      add_triangle(source, {a, d, c}, {a, d, c}, {ua, ud, uc});
    }
    const std::uint32_t top_row = (rings - 1) * columns, top_uv = (rings - 1) * (columns + 1);
    add_triangle(source, {bottom, next, column}, {next, next, column},
                 {cap_uv, column + 1, column});
    add_triangle(source, {bottom + 1, top_row + column, top_row + next},
                 {column, top_row + column, top_row + next},
                 {cap_uv + 1, top_uv + column, top_uv + column + 1});
  }
  if (options.has_elbow) {
    const glm::mat4 model_from_upper =
        glm::translate(glm::mat4(1.0F), {0, 0, options.height_m / 2});
    source.joints.push_back({"upper", 0, glm::inverse(model_from_upper)});
    simplify::SourceClip clip;
    clip.name = "walk";
    clip.frame_count = 12;
    clip.stride_m = 1.2F;
    for (std::uint32_t frame = 0; frame < clip.frame_count; ++frame) {
      const float phase_rad =
          6.2831853F * static_cast<float>(frame) / static_cast<float>(clip.frame_count);
      clip.model_from_joint.push_back(glm::mat4(1.0F));
      clip.model_from_joint.push_back(
          glm::rotate(model_from_upper, 1.2F * std::sin(phase_rad), {0, 1, 0}));
    }
    source.clips.push_back(clip);
  }
  return source;
}

/// A flat square of n x n quads standing in the plane x = 0, 1 m wide. Two charts: the texture is
/// cut along the vertical middle line, where the right half is moved to other texels.
inline SourceCharacter make_cut_sheet(std::uint32_t n = 16) {
  SourceCharacter source = make_empty_source();
  source.materials[0].double_sided = true;
  source.normals.emplace_back(1, 0, 0);
  const std::uint32_t middle = n / 2;
  std::vector<std::uint32_t> left((n + 1) * (n + 1)), right((n + 1) * (n + 1));
  for (std::uint32_t row = 0; row <= n; ++row) {
    for (std::uint32_t column = 0; column <= n; ++column) {
      const float y = static_cast<float>(column) / static_cast<float>(n),
                  z = static_cast<float>(row) / static_cast<float>(n);
      source.points.push_back({{0, y - 0.5F, z}, glm::u16vec4(0), {1, 0, 0, 0}});
      const std::uint32_t at = row * (n + 1) + column;
      left[at] = static_cast<std::uint32_t>(source.uvs.size());
      source.uvs.emplace_back(0.4F * y, 0.4F * z);
      right[at] = left[at] + 1;
      source.uvs.emplace_back(0.5F + 0.4F * y, 0.5F + 0.4F * z);
    }
  }
  for (std::uint32_t row = 0; row < n; ++row) {
    for (std::uint32_t column = 0; column < n; ++column) {
      const auto& uv = column < middle ? left : right;
      const std::uint32_t a = row * (n + 1) + column, b = a + 1, c = a + n + 1, d = c + 1;
      add_triangle(source, {a, b, d}, {0, 0, 0}, {uv[a], uv[b], uv[d]});
      add_triangle(source, {a, d, c}, {0, 0, 0}, {uv[a], uv[d], uv[c]});
    }
  }
  return source;
}

}  // namespace throng::test
