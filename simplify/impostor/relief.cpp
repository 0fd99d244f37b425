#include "simplify/impostor/relief.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string_view>
#include <vector>

namespace throng::simplify {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::uint32_t kLeastPx = 4, kMostPx = 1024;

glm::mat4 matrix_of(const render::Affine& affine) {
  return glm::transpose(
      glm::mat4(affine.row[0], affine.row[1], affine.row[2], glm::vec4(0, 0, 0, 1)));
}

/// A character in one pose of its palette.
struct Posed {
  std::vector<glm::vec3> position, normal;  // [C] model frame
  std::vector<glm::mat4> bind_from_model;   // [J] back into each joint's frame
  std::vector<bool> is_usable;              // [J] the matrix has an inverse
};

Posed pose(const render::Character& character, std::uint32_t frame) {
  const std::size_t joints = character.joints.size();
  std::vector<glm::mat4> palette(joints);
  Posed posed;
  posed.bind_from_model.resize(joints);
  posed.is_usable.resize(joints);
  for (std::size_t j = 0; j < joints; ++j) {
    palette[j] = matrix_of(character.palette[frame * joints + j]);
    posed.is_usable[j] = std::abs(glm::determinant(glm::mat3(palette[j]))) > 1e-9F;
    if (posed.is_usable[j]) posed.bind_from_model[j] = glm::inverse(palette[j]);
  }
  for (std::size_t i = 0; i < character.position.size(); ++i) {
    glm::mat4 blended(0.0F);
    for (int k = 0; k < 4; ++k) {
      const float weight = static_cast<float>(character.joint_weight[i][k]) / 255.0F;
      if (weight > 0.0F) blended += palette[character.joint_index[i][k]] * weight;
    }
    posed.position.push_back(blended * glm::vec4(character.position[i], 1.0F));
    posed.normal.push_back(glm::mat3(blended) * render::decode_octahedral(character.normal[i]));
  }
  return posed;
}

/// Triangles by joint: each goes to every joint that moves a corner.
std::vector<std::vector<std::uint32_t>> triangles_by_joint(const render::Character& character,
                                                           float least_weight) {
  std::vector<std::vector<std::uint32_t>> result(character.joints.size());
  for (std::uint32_t t = 0; t < character.triangle_count(); ++t) {
    for (int c = 0; c < 3; ++c) {
      const std::uint32_t vertex = character.triangle[t][c];
      for (int k = 0; k < 4; ++k) {
        const std::uint8_t weight = character.joint_weight[vertex][k];
        if (weight == 0 || static_cast<float>(weight) < 255.0F * least_weight) continue;
        std::vector<std::uint32_t>& own = result[character.joint_index[vertex][k]];
        if (own.empty() || own.back() != t) own.push_back(t);
      }
    }
  }
  return result;
}

struct Box {
  glm::mat3 axes{1.0F};  // columns, unit length, at right angles
  glm::vec3 low{0.0F}, high{0.0F};
  float volume() const { return (high.x - low.x) * (high.y - low.y) * (high.z - low.z); }
};

Box box_along(const std::vector<glm::vec3>& points, const glm::mat3& axes) {
  Box box;
  box.axes = axes;
  box.low = glm::vec3(kInfinity);
  box.high = -box.low;
  for (const glm::vec3& p : points) {
    const glm::vec3 along = p * axes;  // components along the columns
    box.low = glm::min(box.low, along);
    box.high = glm::max(box.high, along);
  }
  return box;
}

/// Principal axes by Jacobi rotations of the covariance.
glm::mat3 principal_axes(const std::vector<glm::vec3>& points) {
  glm::dvec3 mean(0.0);
  for (const glm::vec3& p : points) mean += glm::dvec3(p);
  mean /= static_cast<double>(points.size());
  glm::dmat3 a(0.0);
  for (const glm::vec3& p : points)
    a += glm::outerProduct(glm::dvec3(p) - mean, glm::dvec3(p) - mean);
  glm::dmat3 axes(1.0);
  for (int sweep = 0; sweep < 12; ++sweep) {
    for (int p = 0; p < 2; ++p) {
      for (int q = p + 1; q < 3; ++q) {
        if (std::abs(a[q][p]) < 1e-18) continue;
        const double theta = 0.5 * std::atan2(2.0 * a[q][p], a[q][q] - a[p][p]);
        const double c = std::cos(theta), s = std::sin(theta);
        glm::dmat3 turn(1.0);
        turn[p][p] = turn[q][q] = c;
        turn[q][p] = s;
        turn[p][q] = -s;
        a = glm::transpose(turn) * a * turn;
        axes = axes * turn;
      }
    }
  }
  glm::mat3 result(axes);
  for (int i = 0; i < 3; ++i) result[i] = glm::normalize(result[i]);
  result[2] = glm::cross(result[0], result[1]);
  return result;
}

glm::mat3 joint_axes(const render::Joint& joint) {
  glm::mat3 axes;
  for (int r = 0; r < 3; ++r) {
    const glm::vec3 row(joint.joint_from_model.row[r]);
    axes[r] = glm::length(row) > 1e-6F ? glm::normalize(row) : glm::vec3(0.0F);
  }
  const bool is_square = std::abs(glm::dot(axes[0], axes[1])) < 1e-3F &&
                         std::abs(glm::dot(axes[1], axes[2])) < 1e-3F &&
                         std::abs(glm::dot(axes[2], axes[0])) < 1e-3F &&
                         std::abs(glm::determinant(axes)) > 0.5F;
  return is_square ? axes : glm::mat3(1.0F);
}

/// Corners of a joint's triangles in its own frame.
std::vector<glm::vec3> own_points(const render::Character& character, const Posed& posed,
                                  std::size_t joint, const std::vector<std::uint32_t>& triangles) {
  std::vector<glm::vec3> points;
  points.reserve(3 * triangles.size());
  for (const std::uint32_t t : triangles) {
    for (int c = 0; c < 3; ++c) {
      points.push_back(posed.bind_from_model[joint] *
                       glm::vec4(posed.position[character.triangle[t][c]], 1.0F));
    }
  }
  return points;
}

std::uint32_t choose_frame(const render::Character& character,
                           const std::vector<std::vector<std::uint32_t>>& triangles) {
  const render::Clip* walk = &character.clips[0];
  for (const render::Clip& clip : character.clips) {
    if (clip.kind == render::ClipKind::kWalk) {
      walk = &clip;
      break;
    }
  }
  std::uint32_t best = walk->first_frame;
  float least_m3 = kInfinity;
  constexpr std::uint32_t kTried = 8;
  for (std::uint32_t k = 0; k < std::min(kTried, walk->frame_count); ++k) {
    const std::uint32_t frame =
        walk->first_frame + k * walk->frame_count / std::min(kTried, walk->frame_count);
    const Posed posed = pose(character, frame);
    float sum_m3 = 0.0F;
    for (std::size_t j = 0; j < triangles.size(); ++j) {
      if (triangles[j].empty() || !posed.is_usable[j]) continue;
      sum_m3 += box_along(own_points(character, posed, j, triangles[j]), glm::mat3(1.0F)).volume();
    }
    if (sum_m3 < least_m3) {
      least_m3 = sum_m3;
      best = frame;
    }
  }
  return best;
}

/// What part of the body a joint is, by its name: heads are looked at, hands and feet are small.
float texel_share(std::string_view joint) {
  std::string name;
  for (const char c : joint) name += static_cast<char>(c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c);
  const auto has = [&name](std::initializer_list<const char*> words) {
    return std::any_of(words.begin(), words.end(),
                       [&](const char* word) { return name.find(word) != std::string::npos; });
  };
  if (has({"head", "face", "jaw", "eye", "brow", "cheek", "lip", "nose", "hair"})) return 0.5F;
  if (has({"hand", "finger", "thumb", "index", "middle", "ring", "pinky", "foot", "toe", "heel"}))
    return 0.75F;
  return 1.0F;
}

/// One texel while a face is captured.
struct Captured {
  float front = kInfinity, back = -kInfinity;
  std::uint32_t triangle = 0;  // that is at the front
  float b1 = 0.0F, b2 = 0.0F;
};

/// A triangle's corners in texels of a face, and depth 0 to 1.
void capture(const std::array<glm::vec3, 3>& p, std::uint32_t triangle, std::uint32_t width,
             std::uint32_t height, std::vector<Captured>& texels) {
  const float area = (p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x);
  if (!(std::abs(area) > 1e-12F)) return;
  const auto first = [](float a, float b, float c) {
    return static_cast<int>(std::floor(std::max(0.0F, std::min({a, b, c}) - 0.5F)));
  };
  const auto last = [](float a, float b, float c, std::uint32_t size) {
    return static_cast<int>(
        std::ceil(std::min(static_cast<float>(size) - 1.0F, std::max({a, b, c}) - 0.5F)));
  };
  for (int y = first(p[0].y, p[1].y, p[2].y); y <= last(p[0].y, p[1].y, p[2].y, height); ++y) {
    for (int x = first(p[0].x, p[1].x, p[2].x); x <= last(p[0].x, p[1].x, p[2].x, width); ++x) {
      const float px = static_cast<float>(x) + 0.5F, py = static_cast<float>(y) + 0.5F;
      const float b1 =
          ((px - p[0].x) * (p[2].y - p[0].y) - (py - p[0].y) * (p[2].x - p[0].x)) / area;
      const float b2 =
          ((p[1].x - p[0].x) * (py - p[0].y) - (p[1].y - p[0].y) * (px - p[0].x)) / area;
      // texels on an edge belong to both sides: no cracks
      if (b1 < -1e-5F || b2 < -1e-5F || b1 + b2 > 1.00001F) continue;
      const float depth = p[0].z + b1 * (p[1].z - p[0].z) + b2 * (p[2].z - p[0].z);
      Captured& texel = texels[static_cast<std::size_t>(y) * width + static_cast<std::size_t>(x)];
      if (depth < texel.front) {
        texel.front = depth;
        texel.triangle = triangle;
        texel.b1 = b1;
        texel.b2 = b2;
      }
      texel.back = std::max(texel.back, depth);
    }
  }
}

/// Nearest texel of a mip level, r g b a.
std::uint32_t sample(const render::MipImage& image, std::uint32_t level, const glm::vec2& uv) {
  std::uint64_t first = 0;
  std::uint32_t width = image.width_px, height = image.height_px;
  for (; level > 0; --level) {
    first += std::uint64_t{width} * height;
    width = std::max(1U, width / 2);
    height = std::max(1U, height / 2);
  }
  const auto place = [](float v, std::uint32_t size) {
    return static_cast<std::uint32_t>(
        std::clamp(v * static_cast<float>(size), 0.0F, static_cast<float>(size) - 1.0F));
  };
  const std::uint8_t* t =
      &image.texels[4 * (first + std::uint64_t{place(uv.y, height)} * width + place(uv.x, width))];
  return std::uint32_t{t[0]} | std::uint32_t{t[1]} << 8 | std::uint32_t{t[2]} << 16 |
         std::uint32_t{t[3]} << 24;
}

/// The level whose texels are about as large as the face's.
std::uint32_t level_for(const render::MipImage& image, float area_uv, float area_texels) {
  const float texels = area_uv * static_cast<float>(image.width_px) *
                       static_cast<float>(image.height_px) / std::max(area_texels, 0.25F);
  const float level = 0.5F * std::log2(std::max(texels, 1.0F));
  return std::min(static_cast<std::uint32_t>(level + 0.5F), image.level_count - 1);
}

std::uint32_t mean_bytes(const std::array<std::uint32_t, 4>& words, unsigned count) {
  std::uint32_t result = 0;
  for (unsigned shift = 0; shift < 32; shift += 8) {
    std::uint32_t sum = count / 2;
    for (unsigned i = 0; i < count; ++i) sum += words[i] >> shift & 255U;
    result |= sum / count << shift;
  }
  return result;
}

glm::vec3 unpack_normal(std::uint32_t shape) {
  const auto decode = [](std::uint32_t byte) {
    return static_cast<float>(static_cast<std::int8_t>(byte)) / 127.0F;
  };
  glm::vec3 n(decode(shape >> 16 & 255U), decode(shape >> 24 & 255U), 0.0F);
  n.z = 1.0F - std::abs(n.x) - std::abs(n.y);
  const float fold = std::max(-n.z, 0.0F);
  n.x += n.x >= 0.0F ? -fold : fold;
  n.y += n.y >= 0.0F ? -fold : fold;
  return glm::normalize(n);
}

constexpr std::uint32_t kNothing = 255U;  // front 255, back 0

/// The levels under a face's largest: what at least half of the texels show.
void add_levels(const render::ReliefFace& face, render::ReliefData& data) {
  std::size_t from = face.first;
  std::uint32_t width = face.width_px, height = face.height_px;
  for (std::uint32_t level = 1; level < render::relief_levels(face); ++level) {
    const std::uint32_t new_width = std::max(1U, width / 2), new_height = std::max(1U, height / 2);
    for (std::uint32_t y = 0; y < new_height; ++y) {
      for (std::uint32_t x = 0; x < new_width; ++x) {
        std::array<std::uint32_t, 4> shape{}, color{}, tint{};
        unsigned seen = 0, all = 0;
        std::uint32_t front = 0, back = 0;
        glm::vec3 normal(0.0F);
        const std::uint32_t x_end = x + 1 == new_width ? width : 2 * x + 2;
        const std::uint32_t y_end = y + 1 == new_height ? height : 2 * y + 2;
        for (std::uint32_t sy = 2 * y; sy < y_end; ++sy) {
          for (std::uint32_t sx = 2 * x; sx < x_end; ++sx) {
            ++all;
            const std::size_t at = from + std::size_t{sy} * width + sx;
            if (data.shape[at] == kNothing || seen == 4) continue;
            shape[seen] = data.shape[at];
            color[seen] = data.color[at];
            tint[seen] = data.tint[at];
            front += shape[seen] & 255U;
            back += shape[seen] >> 8 & 255U;
            normal += unpack_normal(shape[seen]);
            ++seen;
          }
        }
        if (2 * seen < std::min(all, 4U)) {
          data.shape.push_back(kNothing);
          data.color.push_back(0);
          data.tint.push_back(0);
          continue;
        }
        const float length = glm::length(normal);
        normal = length > 1e-6F ? normal / length : unpack_normal(shape[0]);
        data.shape.push_back(front / seen | ((back + seen - 1) / seen) << 8 |
                             render::pack_relief_normal(normal) << 16);
        data.color.push_back(mean_bytes(color, seen));
        data.tint.push_back(mean_bytes(tint, seen));
      }
    }
    from += std::size_t{width} * height;
    width = new_width;
    height = new_height;
  }
}

/// What of one joint is captured.
struct Part {
  std::size_t joint;
  const std::vector<std::uint32_t>& triangles;
  std::vector<glm::vec3> points;  // three for each triangle, joint's frame
};

float weight_of(const render::Character& character, std::uint32_t vertex, std::size_t joint) {
  float sum = 0.0F;
  for (int k = 0; k < 4; ++k) {
    if (character.joint_index[vertex][k] == joint)
      sum += static_cast<float>(character.joint_weight[vertex][k]) / 255.0F;
  }
  return sum;
}

void capture_face(const render::Character& character, const Posed& posed, const Part& part,
                  const Box& box, float sink_m, int number, render::ReliefFace& face,
                  render::ReliefData& data) {
  const int axis = number / 2;
  const bool is_far = number % 2 != 0;
  const std::uint32_t width = face.width_px, height = face.height_px;
  std::vector<Captured> texels(std::size_t{width} * height);
  const glm::vec3 extent = box.high - box.low;
  const int u_axis = (axis + 1) % 3, v_axis = (axis + 2) % 3;
  std::vector<float> area_texels(part.triangles.size());
  for (std::uint32_t k = 0; k < part.triangles.size(); ++k) {
    std::array<glm::vec3, 3> corner;
    for (std::size_t c = 0; c < 3; ++c) {
      const glm::vec3 e = (part.points[3 * k + c] * box.axes - box.low) / extent;
      corner[c] = {e[u_axis] * static_cast<float>(width), e[v_axis] * static_cast<float>(height),
                   is_far ? 1.0F - e[axis] : e[axis]};
    }
    area_texels[k] = 0.5F * std::abs((corner[1].x - corner[0].x) * (corner[2].y - corner[0].y) -
                                     (corner[1].y - corner[0].y) * (corner[2].x - corner[0].x));
    capture(corner, k, width, height, texels);
  }
  face.first = static_cast<std::uint32_t>(data.shape.size());
  const glm::mat3 bind_from_model(posed.bind_from_model[part.joint]);
  for (const Captured& texel : texels) {
    if (texel.front > texel.back) {
      data.shape.push_back(kNothing);
      data.color.push_back(0);
      data.tint.push_back(0);
      continue;
    }
    const glm::uvec3& corner = character.triangle[part.triangles[texel.triangle]];
    const float b0 = 1.0F - texel.b1 - texel.b2;
    const auto uv_of = [&](std::uint32_t i) { return glm::vec2(character.uv[i]) / 65535.0F; };
    const glm::vec2 uv0 = uv_of(corner.x), uv1 = uv_of(corner.y), uv2 = uv_of(corner.z);
    const glm::vec2 uv = b0 * uv0 + texel.b1 * uv1 + texel.b2 * uv2;
    const glm::vec2 du = uv1 - uv0, dv = uv2 - uv0;
    const float area_uv = 0.5F * std::abs(du.x * dv.y - du.y * dv.x);
    glm::vec3 normal =
        bind_from_model * (b0 * posed.normal[corner.x] + texel.b1 * posed.normal[corner.y] +
                           texel.b2 * posed.normal[corner.z]);
    const float length = glm::length(normal);
    normal = length > 1e-6F ? normal / length : glm::vec3(0, 0, 1);
    const float share = b0 * weight_of(character, corner.x, part.joint) +
                        texel.b1 * weight_of(character, corner.y, part.joint) +
                        texel.b2 * weight_of(character, corner.z, part.joint);
    const float sunk =
        std::min((1.0F - share) * sink_m / extent[axis], (texel.back - texel.front) / 3.0F);
    const auto front =
        static_cast<std::uint32_t>(std::clamp((texel.front + sunk) * 255.0F, 0.0F, 254.0F));
    const auto back = static_cast<std::uint32_t>(std::clamp(
        std::ceil((texel.back - sunk) * 255.0F), static_cast<float>(front) + 1.0F, 255.0F));
    data.shape.push_back(front | back << 8 | render::pack_relief_normal(normal) << 16);
    const float area = area_texels[texel.triangle];
    std::uint32_t color = 0xffb4b4b4U, tint = 0;
    if (character.base_color.level_count > 0) {
      color = sample(character.base_color, level_for(character.base_color, area_uv, area), uv);
    }
    if (character.tint_mask.level_count > 0) {
      tint = sample(character.tint_mask, level_for(character.tint_mask, area_uv, area), uv);
    }
    data.color.push_back(color | 0xff000000U);
    data.tint.push_back(tint);
  }
  add_levels(face, data);
}

}  // namespace

absl::StatusOr<render::ReliefData> bake_relief(const render::Character& character,
                                               const ReliefOptions& options) {
  if (!(options.texel_m > 0.0F) && options.uniform_px == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat("bake_relief: texels are ", options.texel_m, " m, must be over 0"));
  }
  const std::vector<std::vector<std::uint32_t>> triangles =
      triangles_by_joint(character, options.uniform_px > 0 ? 0.0F : options.least_weight);
  render::ReliefData data;
  data.capture_frame = choose_frame(character, triangles);
  const Posed posed = pose(character, data.capture_frame);
  std::vector<Part> parts;
  std::vector<Box> boxes;
  for (std::size_t j = 0; j < triangles.size(); ++j) {
    if (triangles[j].empty() || !posed.is_usable[j]) continue;
    Part part{j, triangles[j], own_points(character, posed, j, triangles[j])};
    Box best = box_along(part.points, glm::mat3(1.0F));
    for (const glm::mat3& axes : {joint_axes(character.joints[j]), principal_axes(part.points)}) {
      const Box other = box_along(part.points, axes);
      if (other.volume() < 0.95F * best.volume()) best = other;
    }
    // a surface in a box's face would be neither in front of it nor behind
    const glm::vec3 pad = glm::max(0.01F * (best.high - best.low), glm::vec3(0.002F));
    best.low -= pad;
    best.high += pad;
    if (!std::isfinite(best.volume())) continue;
    parts.push_back(std::move(part));
    boxes.push_back(best);
  }
  if (parts.empty()) {
    return absl::InvalidArgumentError("bake_relief: no joint moves a triangle");
  }

  // sizes first, so that one round of larger texels keeps to the limit
  data.texel_m = options.uniform_px > 0 ? 0.0F : options.texel_m;
  std::vector<std::array<render::ReliefFace, 6>> faces(parts.size());
  for (int round = 0; round < 16; ++round) {
    std::uint64_t texels = 0;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const float texel_m = data.texel_m * texel_share(character.joints[parts[i].joint].name);
      const glm::vec3 extent = boxes[i].high - boxes[i].low;
      for (int f = 0; f < 6; ++f) {
        const auto size = [&](int axis) {
          if (options.uniform_px > 0) return static_cast<std::uint16_t>(options.uniform_px);
          return static_cast<std::uint16_t>(std::clamp(std::ceil(extent[axis] / texel_m),
                                                       static_cast<float>(kLeastPx),
                                                       static_cast<float>(kMostPx)));
        };
        faces[i][static_cast<std::size_t>(f)] = {0, size((f / 2 + 1) % 3), size((f / 2 + 2) % 3)};
        texels += render::relief_texels(faces[i][static_cast<std::size_t>(f)]);
      }
    }
    const double over =
        12.0 * static_cast<double>(texels) / static_cast<double>(options.most_bytes);
    if (options.uniform_px > 0 || over <= 1.0) break;
    data.texel_m *= static_cast<float>(std::sqrt(over)) * 1.02F;
  }

  for (std::size_t i = 0; i < parts.size(); ++i) {
    render::ReliefBox box;
    box.joint = static_cast<std::uint32_t>(parts[i].joint);
    box.origin = boxes[i].axes * boxes[i].low;
    for (int a = 0; a < 3; ++a) {
      box.side[a] = boxes[i].axes[a] * (boxes[i].high[a] - boxes[i].low[a]);
    }
    for (int f = 0; f < 6; ++f) {
      box.face[f] = faces[i][static_cast<std::size_t>(f)];
      capture_face(character, posed, parts[i], boxes[i],
                   options.uniform_px > 0 ? 0.0F : options.sink_m, f, box.face[f], data);
    }
    data.boxes.push_back(box);
  }
  return data;
}

}  // namespace throng::simplify
