#include "simplify/tones/tones.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "simplify/collapse/pixels.hpp"
#include "throng/render/srgb.hpp"

namespace throng::simplify {
namespace {

using render::CharacterData;

constexpr float kFigurePx = 160.0F;  // of a figure's largest side
constexpr int kSizePx = 176;         // of a picture
constexpr int kDirections = 4;
constexpr std::uint32_t kMostCount = 4096;  // of vertices with tones
constexpr float kBandRatio = 0.7F;          // of the vertex counts of neighbouring bands
// Towards a triangle's mean: this share of its pixels and so many pixels more.
constexpr double kPull = 0.06, kPullPx = 6.0;
// A coarse triangle is where the full mesh shows it, give or take so many pixels of depth.
constexpr float kSamePlacePx = 8.0F;
// Errors that no eye tells apart: a code of 255. Tones cost less than texels.
constexpr double kSameError = 1.5e-5;
// Torn texture costs nothing where levels have tones, so those below are shaped better: worth up to
// so many times the error of colours where the choice is made.
constexpr double kNoLoss = 2.0;

/// What textures say of a place: linear colour, then the tint mask.
using Value = std::array<float, 7>;

/// A texture by its mip levels, as one value a pixel.
struct Image {
  struct Level {
    std::span<const std::uint8_t> texels;
    std::uint32_t width_px, height_px;
  };
  std::vector<Level> levels;

  Image(std::span<const std::uint8_t> texels, std::uint32_t width_px, std::uint32_t height_px,
        std::uint32_t count) {
    for (std::uint32_t level = 0; level < count; ++level) {
      const std::size_t size_bytes = std::size_t{4} * width_px * height_px;
      levels.push_back({texels.first(size_bytes), width_px, height_px});
      texels = texels.subspan(size_bytes);
      width_px = std::max(1U, width_px / 2);
      height_px = std::max(1U, height_px / 2);
    }
  }
  /// @param share  of the texture that a pixel stands for
  const std::uint8_t* at(const glm::vec2& uv, float share) const {
    std::size_t level = 0;
    float area =
        share * static_cast<float>(levels[0].width_px) * static_cast<float>(levels[0].height_px);
    for (; area > 2.0F && level + 1 < levels.size(); ++level) area *= 0.25F;
    const Level& image = levels[level];
    const auto place = [](float t, std::uint32_t size) {
      return std::min(static_cast<std::uint32_t>(std::max(t, 0.0F) * static_cast<float>(size)),
                      size - 1);
    };
    return image.texels.data() + 4 * (std::size_t{place(uv.y, image.height_px)} * image.width_px +
                                      place(uv.x, image.width_px));
  }
};

/// Both textures of a character.
class Textures {
 public:
  explicit Textures(const CharacterData& data)
      : base_(data.base_color, data.base_color_width_px, data.base_color_height_px,
              data.base_color_levels),
        mask_(data.tint_mask, data.tint_mask_width_px, data.tint_mask_height_px,
              data.tint_mask_levels) {
    for (std::size_t i = 0; i < linear_.size(); ++i) {
      linear_[i] = render::srgb_to_linear(static_cast<float>(i) / 255.0F);
    }
  }
  /// @param is_hole  set where alpha is under 128
  Value at(const glm::vec2& uv, float share, bool& is_hole) const {
    const std::uint8_t* base = base_.at(uv, share);
    is_hole = base[3] < 128;
    Value value{linear_[base[0]], linear_[base[1]], linear_[base[2]], 0.0F, 0.0F, 0.0F, 0.0F};
    if (!mask_.levels.empty()) {
      const std::uint8_t* mask = mask_.at(uv, share);
      for (int k = 0; k < 4; ++k) value[3 + k] = static_cast<float>(mask[k]) / 255.0F;
    }
    return value;
  }

 private:
  Image base_, mask_;
  std::array<float, 256> linear_{};
};

/// One view of one pose: where vertices are, and what the full mesh shows.
struct Picture {
  std::vector<glm::vec3> place;  // [C] pixels right and down, and nearness
  std::vector<float> near;       // of what is seen; kNothing: background
  std::vector<Value> seen;

  static constexpr float kNothing = -1.0e30F;
};

/// A level's triangles with corners below its vertex count.
struct Mesh {
  std::uint32_t count = 0;
  std::vector<glm::uvec3> triangles;
};

Mesh mesh_at(const CharacterData& data, std::uint32_t count) {
  Mesh mesh{count, {}};
  std::vector<std::uint32_t> follow(data.position.size());
  for (std::uint32_t i = 0; i < follow.size(); ++i) {
    follow[i] = i < count ? i : follow[data.collapse_target[i]];
  }
  for (std::uint32_t t = 0; t < data.triangle_count_at[count]; ++t) {
    const glm::uvec3& corner = data.triangle[t];
    mesh.triangles.push_back({follow[corner.x], follow[corner.y], follow[corner.z]});
  }
  return mesh;
}

/// Pixels of the nearest triangles: its number, or kNobody, and the weights of two corners.
struct Items {
  static constexpr std::uint32_t kNobody = 0xffffffffU;
  std::vector<float> near;
  std::vector<std::uint32_t> who;
  std::vector<glm::vec2> weight;
};

/// `keep(t, w0, w1, area)` says whether a triangle is there at all; `area` is twice its pixels.
template <typename Keep>
void draw(const CharacterData& data, const Mesh& mesh, const Picture& picture, const Keep& keep,
          Items& items) {
  const bool is_two_sided =
      std::any_of(data.triangle_flags.begin(), data.triangle_flags.end(),
                  [](std::uint8_t flags) { return (flags & render::kTriangleDoubleSided) != 0; });
  constexpr std::size_t kPixels = std::size_t{kSizePx} * kSizePx;
  items.near.assign(kPixels, Picture::kNothing);
  items.who.assign(kPixels, Items::kNobody);
  items.weight.resize(kPixels);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const glm::uvec3& corner = mesh.triangles[t];
    const glm::vec3 &a = picture.place[corner.x], &b = picture.place[corner.y],
                    &c = picture.place[corner.z];
    const float area = doubled_area(a, b, c);
    if (area == 0.0F) continue;
    if (area > 0.0F && !is_two_sided) continue;
    for_pixels(a, b, c, 0, 0, kSizePx, kSizePx, [&](int x, int y, float w0, float w1) {
      const float nearness = w0 * a.z + w1 * b.z + (1.0F - w0 - w1) * c.z;
      const std::size_t pixel = static_cast<std::size_t>(y) * kSizePx + static_cast<std::size_t>(x);
      if (nearness <= items.near[pixel] || !keep(t, w0, w1, std::fabs(area))) return;
      items.near[pixel] = nearness;
      items.who[pixel] = t;
      items.weight[pixel] = {w0, w1};
    });
  }
}

/// Of one character.
class Toner {
 public:
  Toner(CharacterData& data, const std::vector<std::vector<glm::vec3>>& poses)
      : data_(data), textures_(data) {
    glm::vec3 low(poses[0][0]), high(low);
    for (const auto& pose : poses) {
      for (const glm::vec3& p : pose) {
        low = glm::min(low, p);
        high = glm::max(high, p);
      }
    }
    const glm::vec3 side = high - low;
    px_per_m_ = kFigurePx / std::max({side.x, side.y, side.z, 1.0e-6F});
    for (std::size_t p = 0; p < poses.size(); ++p) add_pictures(poses[p], static_cast<float>(p));
  }

  void run(std::uint32_t least_count);
  /// @param most  times the texture's error
  bool prefers_tones(std::uint32_t count, double most) const;

 private:
  void add_pictures(const std::vector<glm::vec3>& pose, float number);
  Value texture_at(const glm::uvec3& corner, float w0, float w1, float area_px,
                   bool& is_hole) const;
  using Corners = std::array<Value, 3>;
  /// The best colours of the first mesh's triangles, which the others' are the first of.
  std::vector<Corners> fit(std::span<const Mesh> meshes, std::span<const Picture> pictures) const;
  float native_px(std::uint32_t count) const;
  /// Mean squared errors of a level with tones and with the texture.
  std::array<double, 2> errors(const Mesh& mesh, const std::vector<Corners>& tones,
                               std::span<const Picture> pictures) const;
  std::uint32_t choose_count(std::uint32_t least_count) const;

  CharacterData& data_;
  Textures textures_;
  float px_per_m_ = 0.0F;
  std::vector<Picture> pictures_;
};

Value Toner::texture_at(const glm::uvec3& corner, float w0, float w1, float area_px,
                        bool& is_hole) const {
  glm::vec2 uv[3];
  for (int k = 0; k < 3; ++k) uv[k] = glm::vec2(data_.uv[corner[k]]) / 65535.0F;
  const glm::vec2 a = uv[1] - uv[0], b = uv[2] - uv[0];
  return textures_.at(w0 * uv[0] + w1 * uv[1] + (1.0F - w0 - w1) * uv[2],
                      std::fabs(a.x * b.y - a.y * b.x) / area_px, is_hole);
}

void Toner::add_pictures(const std::vector<glm::vec3>& pose, float number) {
  glm::vec3 low(pose[0]), high(low);
  for (const glm::vec3& p : pose) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  const Mesh full = mesh_at(data_, static_cast<std::uint32_t>(data_.position.size()));
  Items items;
  for (int k = 0; k < kDirections; ++k) {
    // every pose from other sides
    const float azimuth_rad = 6.2831853F / kDirections * (static_cast<float>(k) + 0.37F * number);
    const float elevation_rad = k % 2 == 0 ? 0.1F : 0.45F;
    const glm::vec3 towards(std::cos(elevation_rad) * std::cos(azimuth_rad),
                            std::cos(elevation_rad) * std::sin(azimuth_rad),
                            std::sin(elevation_rad));
    const glm::vec3 right = glm::normalize(glm::cross(glm::vec3(0, 0, 1), towards));
    const glm::vec3 up = glm::cross(towards, right);
    Picture& picture = pictures_.emplace_back();
    picture.place.reserve(pose.size());
    for (const glm::vec3& p : pose) {
      const glm::vec3 d = (p - 0.5F * (low + high)) * px_per_m_;
      picture.place.emplace_back(0.5F * kSizePx + glm::dot(d, right),
                                 0.5F * kSizePx - glm::dot(d, up), glm::dot(d, towards));
    }
    draw(
        data_, full, picture,
        [&](std::uint32_t t, float w0, float w1, float area) {
          if ((data_.triangle_flags[t] & render::kTriangleAlphaCutout) == 0) return true;
          bool is_hole = false;
          texture_at(full.triangles[t], w0, w1, area, is_hole);
          return !is_hole;
        },
        items);
    picture.near = items.near;
    picture.seen.resize(items.who.size());
    for (std::size_t i = 0; i < items.who.size(); ++i) {
      if (items.who[i] == Items::kNobody) continue;
      const glm::uvec3& corner = full.triangles[items.who[i]];
      const float area = std::fabs(
          doubled_area(picture.place[corner.x], picture.place[corner.y], picture.place[corner.z]));
      bool is_hole = false;
      picture.seen[i] = texture_at(corner, items.weight[i].x, items.weight[i].y, area, is_hole);
    }
  }
}

std::vector<Toner::Corners> Toner::fit(std::span<const Mesh> meshes,
                                       std::span<const Picture> pictures) const {
  // what the pixels of a triangle say of its corners: normal equations
  struct Equations {
    double pair[6] = {};  // of weights: 00, 11, 22, 01, 02, 12
    std::array<double, 7> right[3] = {}, sum = {};
    double pixels = 0.0;
  };
  const std::size_t count = meshes[0].triangles.size();
  std::vector<Equations> all(count);
  Items items;
  for (const Mesh& mesh : meshes) {
    for (const Picture& picture : pictures) {
      draw(
          data_, mesh, picture, [](std::uint32_t, float, float, float) { return true; }, items);
      for (std::size_t i = 0; i < items.who.size(); ++i) {
        // what is far before or behind is another limb, and background is as far as can be
        if (items.who[i] == Items::kNobody ||
            std::fabs(items.near[i] - picture.near[i]) > kSamePlacePx) {
          continue;
        }
        Equations& own = all[items.who[i]];
        const auto w0 = static_cast<double>(items.weight[i].x);
        const auto w1 = static_cast<double>(items.weight[i].y);
        const double w[3] = {w0, w1, 1.0 - w0 - w1};
        own.pair[0] += w[0] * w[0];
        own.pair[1] += w[1] * w[1];
        own.pair[2] += w[2] * w[2];
        own.pair[3] += w[0] * w[1];
        own.pair[4] += w[0] * w[2];
        own.pair[5] += w[1] * w[2];
        own.pixels += 1.0;
        for (int c = 0; c < 7; ++c) {
          const auto seen = static_cast<double>(picture.seen[i][c]);
          own.sum[c] += seen;
          for (int k = 0; k < 3; ++k) own.right[k][c] += w[k] * seen;
        }
      }
    }
  }

  // means: what was seen of a triangle, and where that is little, of those around it
  struct Mean {
    std::array<double, 7> sum = {};
    double pixels = 0.0;
  };
  std::vector<Mean> around(data_.position.size());
  for (std::size_t t = 0; t < count; ++t) {
    for (int k = 0; k < 3; ++k) {
      Mean& mean = around[meshes[0].triangles[t][k]];
      mean.pixels += all[t].pixels;
      for (int c = 0; c < 7; ++c) mean.sum[c] += all[t].sum[c];
    }
  }
  std::vector<Corners> corners(count);
  for (std::size_t t = 0; t < count; ++t) {
    const Equations& own = all[t];
    std::array<double, 7> mean = own.sum;
    double pixels = own.pixels;
    if (pixels < kPullPx) {
      for (int k = 0; k < 3; ++k) {
        const Mean& other = around[meshes[0].triangles[t][k]];
        if (other.pixels == 0.0) continue;
        pixels += 1.0;
        for (int c = 0; c < 7; ++c) mean[c] += other.sum[c] / other.pixels;
      }
    }
    if (pixels == 0.0) {  // seen nowhere
      bool is_hole = false;
      const Value value = texture_at(meshes[0].triangles[t], 0.34F, 0.33F, 100.0F, is_hole);
      for (int c = 0; c < 7; ++c) mean[c] = static_cast<double>(value[c]);
      pixels = 1.0;
    }
    for (double& c : mean) c /= pixels;
    // the mean and what differs from it at the corners: three equations, by Cramer's rule
    const double pull = kPull * own.pixels + kPullPx;
    const double a = own.pair[0] + pull, b = own.pair[1] + pull, c = own.pair[2] + pull;
    const double d = own.pair[3], e = own.pair[4], f = own.pair[5];
    const double inverse = 1.0 / (a * (b * c - f * f) - d * (d * c - f * e) + e * (d * f - b * e));
    double weight[3];
    weight[0] = own.pair[0] + d + e;
    weight[1] = own.pair[1] + d + f;
    weight[2] = own.pair[2] + e + f;
    for (int i = 0; i < 7; ++i) {
      const double x = own.right[0][i] - weight[0] * mean[i];
      const double y = own.right[1][i] - weight[1] * mean[i];
      const double z = own.right[2][i] - weight[2] * mean[i];
      const double differs[3] = {
          inverse * (x * (b * c - f * f) - d * (y * c - f * z) + e * (y * f - b * z)),
          inverse * (a * (y * c - f * z) - x * (d * c - f * e) + e * (d * z - y * e)),
          inverse * (a * (b * z - y * f) - d * (d * z - y * e) + x * (d * f - b * e))};
      for (int k = 0; k < 3; ++k) {
        corners[t][k][i] = static_cast<float>(std::clamp(mean[i] + differs[k], 0.0, 1.0));
      }
    }
  }
  return corners;
}

/// How tall a level is judged, between the sizes of LevelSpec.
float Toner::native_px(std::uint32_t count) const {
  const auto all = static_cast<float>(data_.position.size());
  const float coarsest = static_cast<float>(data_.coarsest_count) / all;
  const std::array<glm::vec2, 6> sizes{glm::vec2(1.0F, 400.0F), {0.5F, 200.0F}, {0.25F, 120.0F},
                                       {0.1F, 60.0F},           {0.05F, 40.0F}, {coarsest, 20.0F}};
  const float share = static_cast<float>(count) / all;
  for (std::size_t i = 1; i < sizes.size(); ++i) {
    if (share < sizes[i].x) continue;
    const float t = std::log(share / sizes[i].x) / std::log(sizes[i - 1].x / sizes[i].x);
    return sizes[i].y * std::pow(sizes[i - 1].y / sizes[i].y, std::clamp(t, 0.0F, 1.0F));
  }
  return sizes.back().y;
}

/// As an eye sees it: dyed, as tops and bottoms are, and by square roots.
glm::vec3 dyed(const Value& value) {
  constexpr glm::vec3 kTop{0.90F, 0.42F, 0.36F}, kBottom{0.36F, 0.48F, 0.85F};
  return glm::vec3(value[0], value[1], value[2]) *
         (glm::vec3(1.0F) + value[5] * (kTop - 1.0F) + value[6] * (kBottom - 1.0F));
}

std::array<double, 2> Toner::errors(const Mesh& mesh, const std::vector<Corners>& tones,
                                    std::span<const Picture> pictures) const {
  const float shrink = px_per_m_ * data_.height_m / native_px(mesh.count);
  const int step = std::clamp(static_cast<int>(shrink + 0.5F), 1, kSizePx);
  const int side = (kSizePx + step - 1) / step;
  std::array<double, 2> error{};
  double pixels = 0.0;
  Items items;
  struct Sum {
    glm::vec3 seen{0.0F}, toned{0.0F}, textured{0.0F};
    float pixels = 0.0F;
  };
  std::vector<Sum> sums;
  for (const Picture& picture : pictures) {
    draw(
        data_, mesh, picture, [](std::uint32_t, float, float, float) { return true; }, items);
    sums.assign(static_cast<std::size_t>(side) * side, Sum{});
    for (std::size_t i = 0; i < items.who.size(); ++i) {
      if (items.who[i] == Items::kNobody || picture.near[i] == Picture::kNothing) continue;
      const glm::uvec3& corner = mesh.triangles[items.who[i]];
      const float w[3] = {items.weight[i].x, items.weight[i].y,
                          1.0F - items.weight[i].x - items.weight[i].y};
      Value toned{};
      for (int k = 0; k < 3; ++k) {
        for (int c = 0; c < 7; ++c) toned[c] += w[k] * tones[items.who[i]][k][c];
      }
      const float area = std::fabs(
          doubled_area(picture.place[corner.x], picture.place[corner.y], picture.place[corner.z]));
      bool is_hole = false;
      const Value textured = texture_at(corner, w[0], w[1], area, is_hole);
      const std::size_t x = i % kSizePx / static_cast<std::size_t>(step);
      const std::size_t y = i / kSizePx / static_cast<std::size_t>(step);
      Sum& sum = sums[y * static_cast<std::size_t>(side) + x];
      sum.seen += dyed(picture.seen[i]);
      sum.toned += dyed(toned);
      sum.textured += dyed(textured);
      sum.pixels += 1.0F;
    }
    for (const Sum& sum : sums) {
      if (sum.pixels == 0.0F) continue;
      const glm::vec3 seen = glm::sqrt(sum.seen / sum.pixels);
      const glm::vec3 by_tone = glm::sqrt(sum.toned / sum.pixels) - seen;
      const glm::vec3 by_texture = glm::sqrt(sum.textured / sum.pixels) - seen;
      error[0] += static_cast<double>(sum.pixels * glm::dot(by_tone, by_tone));
      error[1] += static_cast<double>(sum.pixels * glm::dot(by_texture, by_texture));
      pixels += static_cast<double>(sum.pixels);
    }
  }
  for (double& each : error) each /= std::max(pixels, 1.0);
  return error;
}

std::uint32_t Toner::choose_count(std::uint32_t least_count) const {
  const auto all = static_cast<std::uint32_t>(data_.position.size());
  std::vector<std::uint32_t> counts;  // rising, a fifth apart
  for (std::uint32_t n = data_.legal_count[std::min(kMostCount, all / 4)];
       n >= data_.coarsest_count && n > 0; n = data_.legal_count[n - std::max(1U, n / 5)]) {
    counts.push_back(n);
    if (n == data_.coarsest_count) break;
  }
  if (counts.empty() || counts.back() != data_.coarsest_count)
    counts.push_back(data_.coarsest_count);
  std::reverse(counts.begin(), counts.end());
  std::uint32_t best = data_.legal_count[std::min(least_count, all)];
  for (const std::uint32_t n : counts) {
    if (n <= best) continue;
    if (!prefers_tones(n, 1.0)) break;
    best = n;
  }
  return best;
}

void Toner::run(std::uint32_t least_count) {
  std::uint32_t count = choose_count(least_count);
  std::uint32_t first = 0;
  while (count > 0 && data_.tone_band.size() < render::CornerTones::kMostBands) {
    const auto wanted = static_cast<std::uint32_t>(kBandRatio * static_cast<float>(count));
    const std::uint32_t next = data_.legal_count[std::min(wanted, count - 1)];
    std::vector<Mesh> meshes{mesh_at(data_, count)};
    const std::uint32_t least = std::max(next, data_.coarsest_count);
    if (least < count) meshes.push_back(mesh_at(data_, least));
    data_.tone_band.push_back({count, first});
    for (const Corners& corners : fit(meshes, pictures_)) {
      for (const Value& tone : corners) {
        data_.corner_tone.push_back(render::pack_corner_tone({tone[0], tone[1], tone[2]},
                                                             {tone[3], tone[4], tone[5], tone[6]}));
      }
      ++first;
    }
    count = next;  // 0 below the coarsest
  }
}

bool Toner::prefers_tones(std::uint32_t count, double most) const {
  const Mesh mesh = mesh_at(data_, count);
  // by pictures that were not fitted to: a fit is better in its own
  const std::span<const Picture> all(pictures_), half = all.first((all.size() + 1) / 2);
  const std::array<double, 2> error =
      errors(mesh, fit({&mesh, 1}, half), all.subspan(all.size() / 2));
  return error[0] <= most * error[1] + kSameError;
}

}  // namespace

bool prefers_corner_tones(CharacterData& data, const std::vector<std::vector<glm::vec3>>& poses,
                          std::uint32_t count) {
  if (poses.empty() || data.position.empty()) return false;
  return Toner(data, poses).prefers_tones(count, kNoLoss);
}

void make_corner_tones(CharacterData& data, const std::vector<std::vector<glm::vec3>>& poses,
                       std::uint32_t least_count) {
  data.tone_band.clear();
  data.corner_tone.clear();
  if (poses.empty() || data.position.empty() || data.coarsest_count == 0) return;
  Toner(data, poses).run(least_count);
}

}  // namespace throng::simplify
