#pragma once

#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::simplify {

/// 8-bit sRGB colour with straight alpha, rows from the top: texel (x, y) is at 4 * (y * width_px +
/// x).
struct SourceImage {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<std::uint8_t> rgba;  // [height][width][4]
};

enum class Wrap : std::uint8_t { kRepeat, kClamp, kMirror };

struct SourceMaterial {
  std::string name;
  SourceImage base_color;  // empty: the factor alone
  SourceImage tint_mask;   // empty, or weights in r skin, g hair, b top, a bottom; any size
  glm::vec4 factor{1.0F};  // linear, multiplies the texture
  Wrap wrap_u = Wrap::kRepeat;
  Wrap wrap_v = Wrap::kRepeat;
  bool double_sided = false;
  bool alpha_cutout = false;
  float alpha_cutoff = 0.5F;
};

/// A point of the surface and what moves it.
struct SourcePoint {
  glm::vec3 position{0.0F};         // metres, bind pose, model frame
  glm::u16vec4 joint{0};            // strongest first
  glm::vec4 weight{1.0F, 0, 0, 0};  // sums to 1
};

/// One corner of a triangle: indices into SourceCharacter's points, normals and uvs.
struct SourceCorner {
  std::uint32_t point = 0;
  std::uint32_t normal = 0;
  std::uint32_t uv = 0;
};

struct SourceTriangle {
  std::array<SourceCorner, 3> corner;  // counter-clockwise seen from outside
  std::uint32_t material = 0;
};

struct SourceJoint {
  std::string name;
  std::int32_t parent = -1;          // smaller than the joint's own index, or -1
  glm::mat4 joint_from_model{1.0F};  // inverse bind matrix
};

/// A clip sampled at a fixed rate. Root motion may still be inside; baking removes it.
struct SourceClip {
  std::string name;
  render::ClipKind kind = render::ClipKind::kOther;  // kOther: decided at bake by name and speed
  float rate_hz = 30.0F;
  bool loop = true;
  std::uint32_t frame_count = 0;
  std::vector<glm::mat4> model_from_joint;  // [frame][J], animated joint matrices (equation 2's T)
  float stride_m = 0.0F;                    // distance of one cycle; 0: measured at bake
};

/// What import and the built-in cast hand to rebuilding: an indexed mesh with separate uv and
/// normal indices, a skeleton and sampled clips.
///
/// Model frame: right-handed, +Z up, facing +X, metres, feet on z = 0 and the origin between them.
/// uv: (0, 0) is the top left texel corner, as in glTF.
struct SourceCharacter {
  std::string name;
  std::vector<SourcePoint> points;
  std::vector<glm::vec3> normals;  // unit length
  std::vector<glm::vec2> uvs;
  std::vector<SourceTriangle> triangles;
  std::vector<SourceMaterial> materials;
  std::vector<SourceJoint> joints;
  std::vector<SourceClip> clips;
  std::vector<std::string> notes;  // what was left out or changed on the way in, for the user
};

}  // namespace throng::simplify
