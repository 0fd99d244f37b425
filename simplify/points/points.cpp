#include "simplify/points/points.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <vector>

#include "throng/render/srgb.hpp"

namespace throng::simplify {
namespace {

using render::CharacterData;
using render::PointTone;

/// Metres that two opposite normals count as, halved: the thickness of what has two sides.
constexpr float kNormalM = 0.012F;

/// The golden ratio's companions in two dimensions (M. Roberts 2018): a sequence of low
/// discrepancy.
constexpr double kStepU = 0.7548776662466927, kStepV = 0.5698402909980532;

/// Samples of the surface by columns, so that the loop over all of them is one of vectors.
struct Candidates {
  std::vector<float> x, y, z, nx, ny, nz;
  std::vector<std::uint32_t> triangle;
  std::vector<glm::vec3> weight;  // of the triangle's corners
  std::vector<glm::vec3> color;   // linear
  std::vector<glm::vec4> regions;

  std::size_t size() const { return x.size(); }
};

/// A texel of the level where one candidate stands for about one.
struct Image {
  std::span<const std::uint8_t> texels;
  std::uint32_t width_px = 0, height_px = 0;

  Image(std::span<const std::uint8_t> all, std::uint32_t width, std::uint32_t height,
        std::uint32_t levels, float uv_area)
      : texels(all), width_px(width), height_px(height) {
    float area = uv_area * static_cast<float>(width) * static_cast<float>(height);
    for (std::uint32_t level = 1; level < levels && area > 2.0F; ++level, area *= 0.25F) {
      texels = texels.subspan(std::size_t{4} * width_px * height_px);
      width_px = std::max(1U, width_px / 2);
      height_px = std::max(1U, height_px / 2);
    }
  }
  const std::uint8_t* at(const glm::vec2& uv) const {
    const auto place = [](float t, std::uint32_t size) {
      return std::min(static_cast<std::uint32_t>(std::max(t, 0.0F) * static_cast<float>(size)),
                      size - 1);
    };
    return texels.data() +
           4 * (std::size_t{place(uv.y, height_px)} * width_px + place(uv.x, width_px));
  }
};

Candidates draw_candidates(const CharacterData& data, std::size_t count) {
  Candidates candidates;
  std::vector<double> area_to(data.triangle.size());
  double area = 0.0;
  for (std::size_t t = 0; t < data.triangle.size(); ++t) {
    const glm::uvec3& c = data.triangle[t];
    area +=
        0.5 * static_cast<double>(glm::length(glm::cross(data.position[c.y] - data.position[c.x],
                                                         data.position[c.z] - data.position[c.x])));
    area_to[t] = area;
  }
  if (!(area > 0.0) || !std::isfinite(area)) return candidates;
  std::array<float, 256> linear;
  for (std::size_t i = 0; i < linear.size(); ++i) {
    linear[i] = render::srgb_to_linear(static_cast<float>(i) / 255.0F);
  }
  std::size_t t = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double want = area * (static_cast<double>(i) + 0.5) / static_cast<double>(count);
    while (t + 1 < area_to.size() && area_to[t] < want) ++t;
    double u = std::fmod(0.5 + kStepU * static_cast<double>(i), 1.0);
    double v = std::fmod(0.5 + kStepV * static_cast<double>(i), 1.0);
    if (u + v > 1.0) {
      u = 1.0 - u;
      v = 1.0 - v;
    }
    const glm::vec3 w(static_cast<float>(1.0 - u - v), static_cast<float>(u),
                      static_cast<float>(v));
    const glm::uvec3& c = data.triangle[t];
    const glm::vec2 uv[3] = {glm::vec2(data.uv[c.x]) / 65535.0F, glm::vec2(data.uv[c.y]) / 65535.0F,
                             glm::vec2(data.uv[c.z]) / 65535.0F};
    const glm::vec2 place = w.x * uv[0] + w.y * uv[1] + w.z * uv[2];
    const glm::vec2 a = uv[1] - uv[0], b = uv[2] - uv[0];
    // the part of the texture that a candidate stands for
    const double own = area_to[t] - (t > 0 ? area_to[t - 1] : 0.0);
    const double share = own > 0.0 ? area / static_cast<double>(count) / own : 0.0;
    const float uv_area = 0.5F * std::abs(a.x * b.y - a.y * b.x) * static_cast<float>(share);
    const Image base(data.base_color, data.base_color_width_px, data.base_color_height_px,
                     data.base_color_levels, uv_area);
    const std::uint8_t* texel = base.at(place);
    if ((data.triangle_flags[t] & render::kTriangleAlphaCutout) != 0 && texel[3] < 128) continue;
    glm::vec3 p(0.0F), n(0.0F);
    for (int k = 0; k < 3; ++k) {
      p += w[k] * data.position[c[k]];
      n += w[k] * render::decode_octahedral(data.normal[c[k]]);
    }
    const float length = glm::length(n);
    n = length > 1e-6F ? n / length : glm::vec3(0.0F, 0.0F, 1.0F);
    candidates.x.push_back(p.x);
    candidates.y.push_back(p.y);
    candidates.z.push_back(p.z);
    candidates.nx.push_back(n.x * kNormalM);
    candidates.ny.push_back(n.y * kNormalM);
    candidates.nz.push_back(n.z * kNormalM);
    candidates.triangle.push_back(static_cast<std::uint32_t>(t));
    candidates.weight.push_back(w);
    candidates.color.push_back({linear[texel[0]], linear[texel[1]], linear[texel[2]]});
    glm::vec4 regions(0.0F);
    if (!data.tint_mask.empty()) {
      const Image mask(data.tint_mask, data.tint_mask_width_px, data.tint_mask_height_px,
                       data.tint_mask_levels, uv_area);
      const std::uint8_t* share_of = mask.at(place);
      regions = glm::vec4(share_of[0], share_of[1], share_of[2], share_of[3]);
    }
    candidates.regions.push_back(regions);
  }
  return candidates;
}

/// Neighbouring candidates, so that a new point only looks at those near it.
struct Block {
  std::size_t begin, end;
  glm::vec3 centre{0.0F};
  float radius_m = 0.0F;
  float farthest = std::numeric_limits<float>::max(), covered = farthest;  // squared
  std::size_t at = 0;                                                      // the farthest one
};

std::vector<Block> make_blocks(const Candidates& all) {
  constexpr std::size_t kBlock = 64;
  std::vector<Block> blocks;
  for (std::size_t begin = 0; begin < all.size(); begin += kBlock) {
    Block block{begin, std::min(begin + kBlock, all.size())};
    for (std::size_t i = block.begin; i < block.end; ++i) {
      block.centre += glm::vec3(all.x[i], all.y[i], all.z[i]);
    }
    block.centre /= static_cast<float>(block.end - block.begin);
    for (std::size_t i = block.begin; i < block.end; ++i) {
      block.radius_m = std::max(
          block.radius_m, glm::distance(block.centre, glm::vec3(all.x[i], all.y[i], all.z[i])));
    }
    block.radius_m *= 1.0001F;
    blocks.push_back(block);
  }
  return blocks;
}

/// The joints of a place within a triangle: the four strongest, shares that sum to 255.
void blend_joints(const CharacterData& data, const glm::uvec3& corner, const glm::vec3& weight,
                  render::SurfacePoint& point) {
  std::array<float, 256> share{};
  for (int k = 0; k < 3; ++k) {
    for (int j = 0; j < 4; ++j) {
      share[data.joint_index[corner[k]][j]] +=
          weight[k] * static_cast<float>(data.joint_weight[corner[k]][j]);
    }
  }
  float kept = 0.0F;
  std::array<std::size_t, 4> best{};
  std::array<float, 4> value{};
  for (int j = 0; j < 4; ++j) {
    const auto strongest = std::max_element(share.begin(), share.end());
    best[j] = static_cast<std::size_t>(strongest - share.begin());
    value[j] = *strongest;
    kept += value[j];
    *strongest = -1.0F;
  }
  int rest = 255;
  for (int j = 3; j > 0; --j) {
    const int own = kept > 0.0F ? static_cast<int>(255.0F * std::max(value[j], 0.0F) / kept) : 0;
    point.joint_index[j] = static_cast<std::uint8_t>(own > 0 ? best[j] : 0);
    point.joint_weight[j] = static_cast<std::uint8_t>(own);
    rest -= own;
  }
  point.joint_index[0] = static_cast<std::uint8_t>(best[0]);
  point.joint_weight[0] = static_cast<std::uint8_t>(rest);
}

PointTone pack(const glm::vec3& color, const glm::vec4& regions) {
  const glm::vec3 root = glm::sqrt(glm::clamp(color, 0.0F, 1.0F)) * 1023.0F + 0.5F;
  PointTone tone;
  for (int k = 0; k < 3; ++k) tone.base |= static_cast<std::uint32_t>(root[k]) << (10 * k);
  for (int k = 0; k < 4; ++k) {
    tone.regions |= static_cast<std::uint32_t>(std::min(regions[k] + 0.5F, 255.0F)) << (8 * k);
  }
  return tone;
}

/// Means over what is nearest to each of the first `count` points.
void add_tones(const Candidates& candidates, const std::vector<std::uint32_t>& nearest,
               std::uint32_t count, std::vector<PointTone>& tones) {
  std::vector<glm::vec3> color(count, glm::vec3(0.0F));
  std::vector<glm::vec4> regions(count, glm::vec4(0.0F));
  std::vector<float> members(count, 0.0F);
  for (std::size_t i = 0; i < candidates.size(); ++i) {
    color[nearest[i]] += candidates.color[i];
    regions[nearest[i]] += candidates.regions[i];
    members[nearest[i]] += 1.0F;
  }
  for (std::uint32_t i = 0; i < count; ++i) {
    const float each = 1.0F / std::max(members[i], 1.0F);
    tones.push_back(pack(color[i] * each, regions[i] * each));
  }
}

}  // namespace

void sample_points(CharacterData& data, const PointOptions& options) {
  data.point.clear();
  data.point_radius_m.clear();
  data.point_tone.clear();
  const Candidates all =
      draw_candidates(data, std::size_t{options.count} * std::max(options.candidates_of, 1U));
  const std::size_t size = all.size();
  const auto count = static_cast<std::uint32_t>(std::min<std::size_t>(options.count, size));
  if (count == 0) return;

  // begin in the middle of everything: the one point that stands for all
  glm::vec3 low(std::numeric_limits<float>::max()), high(-low);
  for (std::size_t i = 0; i < size; ++i) {
    const glm::vec3 p(all.x[i], all.y[i], all.z[i]);
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  const glm::vec3 middle = 0.5F * (low + high);
  std::size_t next = 0;
  float nearest_m = std::numeric_limits<float>::max();
  for (std::size_t i = 0; i < size; ++i) {
    const float d = glm::distance(middle, glm::vec3(all.x[i], all.y[i], all.z[i]));
    if (d < nearest_m) {
      nearest_m = d;
      next = i;
    }
  }

  // squared distances to the nearest point so far: with the normals (order) and without (cover)
  std::vector<float> far(size, std::numeric_limits<float>::max()), cover = far;
  std::vector<std::uint32_t> nearest(size, 0);
  std::vector<Block> blocks = make_blocks(all);
  std::vector<std::vector<PointTone>> levels;
  // a candidate stands for what is around it
  double area = 0.0;
  for (const glm::uvec3& c : data.triangle) {
    area +=
        0.5 * static_cast<double>(glm::length(glm::cross(data.position[c.y] - data.position[c.x],
                                                         data.position[c.z] - data.position[c.x])));
  }
  const auto own_m = static_cast<float>(0.7 * std::sqrt(area / static_cast<double>(size)));
  for (std::uint32_t k = 0; k < count; ++k) {
    const float px = all.x[next], py = all.y[next], pz = all.z[next];
    const float nx = all.nx[next], ny = all.ny[next], nz = all.nz[next];
    for (Block& block : blocks) {
      // neighbours in a triangle list are neighbours in space: most blocks have nothing nearer
      const float gap_m = glm::distance(block.centre, glm::vec3(px, py, pz)) - block.radius_m;
      if (gap_m > 0.0F && gap_m * gap_m > block.farthest) continue;
      block.farthest = -1.0F;
      block.covered = 0.0F;
      for (std::size_t i = block.begin; i < block.end; ++i) {
        const float dx = all.x[i] - px, dy = all.y[i] - py, dz = all.z[i] - pz;
        const float ex = all.nx[i] - nx, ey = all.ny[i] - ny, ez = all.nz[i] - nz;
        const float plain = dx * dx + dy * dy + dz * dz;
        const float with = plain + (ex * ex + ey * ey + ez * ez);
        cover[i] = std::min(cover[i], plain);
        if (with < far[i]) {
          nearest[i] = k;
          far[i] = with;
        }
        block.covered = std::max(block.covered, cover[i]);
        if (far[i] > block.farthest) {
          block.farthest = far[i];
          block.at = i;
        }
      }
    }
    render::SurfacePoint& point = data.point.emplace_back();
    const std::uint32_t t = all.triangle[next];
    point.position = {px, py, pz};
    point.normal = render::encode_octahedral(glm::vec3(nx, ny, nz) / kNormalM);
    blend_joints(data, data.triangle[t], all.weight[next], point);
    float farthest = -1.0F, covered = 0.0F;
    for (const Block& block : blocks) {
      covered = std::max(covered, block.covered);
      if (block.farthest > farthest) {
        farthest = block.farthest;
        next = block.at;
      }
    }
    data.point_radius_m.push_back(std::sqrt(covered) + own_m);
    for (std::uint32_t level = count; level > 0; level >>= 1) {
      if (level == k + 1) add_tones(all, nearest, level, levels.emplace_back());
    }
  }
  for (auto level = levels.rbegin(); level != levels.rend(); ++level) {
    data.point_tone.insert(data.point_tone.end(), level->begin(), level->end());
  }
}

}  // namespace throng::simplify
