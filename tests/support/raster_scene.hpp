#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <random>
#include <vector>

#include "throng/render/asset.hpp"
#include "throng/render/camera.hpp"
#include "throng/render/compute.hpp"

namespace throng::test {

/// Batched geometry that owns its arrays, for tests that need a rasterizer but no compute backend.
struct RasterScene {
  std::vector<render::VisibleInstance> instances;
  std::vector<std::uint32_t> vertex_offset{0}, triangle_offset{0};
  std::vector<render::BatchVertex> vertices;
  std::vector<std::uint32_t> indices;

  render::FrameGeometry geometry() const {
    return {instances, vertex_offset, triangle_offset, vertices, indices};
  }

  /// An instance standing at `feet_relative`; what follows belongs to it.
  void begin_instance(const glm::vec3& feet_relative, std::uint32_t character = 0,
                      std::uint32_t seed = 0, float channel = 0.0F, float scale = 1.0F) {
    render::VisibleInstance instance{};
    instance.position_relative = feet_relative;
    instance.slot = static_cast<std::uint32_t>(instances.size());
    instance.character = character;
    instance.seed = seed;
    instance.scale = scale;
    instance.channel = channel;
    instance.radius_m = 1.0F;
    instances.push_back(instance);
    vertex_offset.push_back(vertex_offset.back());
    triangle_offset.push_back(triangle_offset.back());
  }
  std::uint32_t add_vertex(const glm::vec3& position_relative, const glm::vec3& normal,
                           const glm::vec2& uv) {
    render::BatchVertex vertex{};
    vertex.position_relative = position_relative;
    vertex.normal = render::encode_octahedral(normal);
    vertex.uv = glm::u16vec2(glm::clamp(uv, 0.0F, 1.0F) * 65535.0F + 0.5F);
    vertex.visible = static_cast<std::uint32_t>(instances.size()) - 1;
    vertices.push_back(vertex);
    ++vertex_offset.back();
    ++instances.back().vertex_count;
    return static_cast<std::uint32_t>(vertices.size()) - 1;
  }
  void add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    indices.insert(indices.end(), {a, b, c});
    ++triangle_offset.back();
    ++instances.back().triangle_count;
  }
  /// Corners counter-clockwise seen from the front; uv (0,0) at a, (1,0) at b, (1,1) at c, (0,1) at
  /// d.
  void add_quad(const glm::vec3& a, const glm::vec3& b, const glm::vec3& c, const glm::vec3& d) {
    const glm::vec3 normal = glm::normalize(glm::cross(c - a, d - b));
    const std::uint32_t ia = add_vertex(a, normal, {0, 0}), ib = add_vertex(b, normal, {1, 0});
    const std::uint32_t ic = add_vertex(c, normal, {1, 1}), id = add_vertex(d, normal, {0, 1});
    add_triangle(ia, ib, ic);
    add_triangle(ia, ic, id);
  }
};

/// Texture column of each region of the mannequin; its texture and tint mask are 32x8 texels.
enum class Region { kSkin = 0, kHair = 1, kTop = 2, kBottom = 3 };

inline glm::vec2 region_uv(Region region) {
  return {(static_cast<float>(region) + 0.5F) / 4.0F, 0.5F};
}

/// A round bone from `a` to `b`, closed at both ends, in the instance's frame (turned by
/// `heading`).
inline void add_bone(RasterScene& scene, const glm::vec3& feet, float heading_rad, glm::vec3 a,
                     glm::vec3 b, float radius_a, float radius_b, Region region,
                     std::uint32_t sides) {
  const auto turned = [&](const glm::vec3& p) {
    const float c = std::cos(heading_rad), s = std::sin(heading_rad);
    return glm::vec3(c * p.x - s * p.y, s * p.x + c * p.y, p.z);
  };
  a = turned(a);
  b = turned(b);
  const glm::vec3 axis = glm::normalize(b - a);
  const glm::vec3 u = glm::normalize(
      glm::cross(axis, std::abs(axis.z) < 0.9F ? glm::vec3(0, 0, 1) : glm::vec3(1, 0, 0)));
  const glm::vec3 v = glm::cross(axis, u);
  const std::uint32_t rings = std::max(2u, sides / 2);
  std::uint32_t before = 0;
  // half a sphere, the cone, half a sphere: rings of one latitude each
  for (std::uint32_t ring = 0; ring <= 2 * rings + 1; ++ring) {
    const bool upper = ring > rings;
    const float angle = 1.5707963F * (static_cast<float>(upper ? ring - rings - 1 : ring) /
                                      static_cast<float>(rings)) -
                        (upper ? 0.0F : 1.5707963F);
    const glm::vec3 centre = upper ? b : a;
    const float radius = upper ? radius_b : radius_a;
    std::uint32_t first = 0;
    for (std::uint32_t side = 0; side <= sides; ++side) {
      const float turn = 6.2831853F * static_cast<float>(side % sides) / static_cast<float>(sides);
      const glm::vec3 normal =
          std::cos(angle) * (std::cos(turn) * u + std::sin(turn) * v) + std::sin(angle) * axis;
      const std::uint32_t index =
          scene.add_vertex(feet + centre + normal * radius, normal, region_uv(region));
      if (side == 0) first = index;
    }
    if (ring > 0) {
      for (std::uint32_t side = 0; side < sides; ++side) {
        scene.add_triangle(before + side, before + side + 1, first + side + 1);
        scene.add_triangle(before + side, first + side + 1, first + side);
      }
    }
    before = first;
  }
}

/// A walking mannequin of 14 bones, 1.75 m tall, facing +X before it is turned. `phase` in turns.
inline void add_mannequin(RasterScene& scene, const glm::vec3& feet, float heading_rad, float phase,
                          std::uint32_t seed, float channel = 0.0F, std::uint32_t sides = 12,
                          std::uint32_t character = 0) {
  scene.begin_instance(feet, character, seed, channel);
  scene.instances.back().heading_rad = heading_rad;
  const auto bone = [&](const glm::vec3& a, const glm::vec3& b, float ra, float rb, Region region) {
    add_bone(scene, feet, heading_rad, a, b, ra, rb, region, sides);
  };
  const float swing = std::sin(6.2831853F * phase);
  for (const float side : {-1.0F, 1.0F}) {
    const float leg = 0.42F * swing * side,
                knee_bend = 0.10F + 0.35F * std::max(0.0F, -swing * side);
    const glm::vec3 hip(0.0F, 0.10F * side, 0.90F);
    const glm::vec3 knee = hip + 0.43F * glm::vec3(std::sin(leg), 0.0F, -std::cos(leg));
    const float shin = leg - knee_bend;
    glm::vec3 ankle = knee + 0.40F * glm::vec3(std::sin(shin), 0.0F, -std::cos(shin));
    ankle.z = std::max(ankle.z, 0.07F);
    bone(hip, knee, 0.085F, 0.062F, Region::kBottom);
    bone(knee, ankle, 0.060F, 0.045F, Region::kBottom);
    bone(ankle + glm::vec3(-0.03F, 0, -0.025F), ankle + glm::vec3(0.15F, 0.01F * side, -0.03F),
         0.042F, 0.034F, Region::kHair);
    const float arm = -0.38F * swing * side;
    const glm::vec3 shoulder(0.0F, 0.20F * side, 1.40F);
    const glm::vec3 elbow =
        shoulder + 0.28F * glm::vec3(std::sin(arm), 0.10F * side, -std::cos(arm));
    const glm::vec3 hand =
        elbow + 0.26F * glm::vec3(std::sin(arm + 0.35F), 0.0F, -std::cos(arm + 0.35F));
    bone(shoulder, elbow, 0.055F, 0.042F, Region::kTop);
    bone(elbow, hand, 0.038F, 0.034F, Region::kSkin);
  }
  bone({0, -0.05F, 0.95F}, {0, 0.05F, 0.95F}, 0.125F, 0.125F, Region::kBottom);
  bone({0, 0, 1.05F}, {0, 0, 1.34F}, 0.130F, 0.155F, Region::kTop);
  bone({0, -0.15F, 1.39F}, {0, 0.15F, 1.39F}, 0.075F, 0.075F, Region::kTop);
  bone({0, 0, 1.44F}, {0.01F, 0, 1.54F}, 0.052F, 0.050F, Region::kSkin);
  bone({0.02F, 0, 1.58F}, {0.015F, 0, 1.65F}, 0.078F, 0.092F, Region::kSkin);
  bone({-0.012F, 0, 1.645F}, {-0.012F, 0, 1.665F}, 0.094F, 0.092F, Region::kHair);
}

/// A cast of one member with the mannequin's texture and tint mask, no mesh of its
/// own.
inline std::shared_ptr<const render::Cast> mannequin_cast() {
  auto texels = std::make_shared<std::vector<std::uint8_t>>();
  auto mask = std::make_shared<std::vector<std::uint8_t>>();
  for (std::uint32_t i = 0; i < 32 * 8; ++i) {
    const std::uint32_t region = i % 32 / 8;
    // painted as the tints expect: skin and hair in their own tone, clothes as light neutrals
    constexpr std::uint8_t kBase[4][3] = {
        {222, 176, 148}, {104, 78, 58}, {189, 189, 189}, {158, 158, 158}};
    texels->insert(texels->end(), {kBase[region][0], kBase[region][1], kBase[region][2], 255});
    for (std::uint32_t k = 0; k < 4; ++k) mask->push_back(k == region ? 255 : 0);
  }
  auto cast = std::make_shared<render::Cast>();
  render::CastMember member;
  member.character.name = "mannequin";
  member.character.height_m = 1.75F;
  member.character.base_color = {32, 8, 1, *texels};
  member.character.tint_mask = {32, 8, 1, *mask};
  member.character.storage =
      std::make_shared<std::pair<decltype(texels), decltype(mask)>>(texels, mask);
  cast->members.push_back(std::move(member));
  return cast;
}

/// `count` mannequins on a loose grid around the origin, all walking roughly +X or -X.
inline RasterScene mannequin_crowd(const render::Camera& camera, std::uint32_t count,
                                   float spacing_m, std::uint32_t sides = 8) {
  RasterScene scene;
  const auto columns = static_cast<std::uint32_t>(std::ceil(std::sqrt(static_cast<double>(count))));
  std::mt19937 random(7);
  const auto uniform = [&] { return static_cast<float>(random() >> 8) * (1.0F / 16777216.0F); };
  for (std::uint32_t i = 0; i < count; ++i) {
    const glm::dvec3 place(
        (static_cast<double>(i % columns) - 0.5 * (columns - 1) + 0.5 * uniform()) * spacing_m,
        (static_cast<double>(i / columns) - 0.5 * (columns - 1) + 0.5 * uniform()) * spacing_m,
        0.0);
    const float heading = (uniform() < 0.5F ? 0.0F : 3.1415927F) + 0.6F * (uniform() - 0.5F);
    const float phase = uniform();
    const auto seed = static_cast<std::uint32_t>(random());
    add_mannequin(scene, glm::vec3(place - camera.eye_world), heading, phase, seed,
                  static_cast<float>(i) / static_cast<float>(std::max(1u, count - 1)), sides);
  }
  return scene;
}

}  // namespace throng::test
