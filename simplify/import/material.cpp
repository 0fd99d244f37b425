#include "simplify/import/material.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "simplify/import/image.hpp"
#include "simplify/import/limits.hpp"
#include "throng/render/srgb.hpp"

namespace throng::simplify::gltf {
namespace {

constexpr std::uint32_t kBlockPx = 4;  // of a palette colour, so that filtering stays inside

std::uint8_t to_srgb(float linear) {
  const float c = std::clamp(linear, 0.0F, 1.0F);
  return static_cast<std::uint8_t>(std::lround(render::linear_to_srgb(c) * 255.0F));
}

std::uint32_t pack(const glm::vec4& linear) {
  return std::uint32_t{to_srgb(linear.r)} | std::uint32_t{to_srgb(linear.g)} << 8 |
         std::uint32_t{to_srgb(linear.b)} << 16 |
         static_cast<std::uint32_t>(std::lround(linear.a * 255.0F)) << 24;
}

Wrap wrap_of(std::uint32_t code) {
  if (code == 33071) return Wrap::kClamp;
  if (code == 33648) return Wrap::kMirror;
  return Wrap::kRepeat;
}

/// A picture of up to `palette.size()` colours in square blocks, and the middle of each block.
SourceImage draw_palette(const std::vector<std::uint32_t>& palette,
                         std::vector<glm::vec2>& middle) {
  const std::uint32_t columns =
      static_cast<std::uint32_t>(std::ceil(std::sqrt(static_cast<double>(palette.size()))));
  const std::uint32_t rows = (static_cast<std::uint32_t>(palette.size()) + columns - 1) / columns;
  SourceImage image;
  image.width_px = columns * kBlockPx;
  image.height_px = rows * kBlockPx;
  image.rgba.resize(std::size_t{4} * image.width_px * image.height_px);
  for (std::uint32_t y = 0; y < image.height_px; ++y) {
    for (std::uint32_t x = 0; x < image.width_px; ++x) {
      const std::size_t entry = std::min<std::size_t>(
          std::size_t{y / kBlockPx} * columns + x / kBlockPx, palette.size() - 1);
      for (std::uint32_t c = 0; c < 4; ++c) {
        image.rgba[4 * (std::size_t{y} * image.width_px + x) + c] =
            static_cast<std::uint8_t>(palette[entry] >> (8 * c));
      }
    }
  }
  for (std::size_t i = 0; i < palette.size(); ++i) {
    middle.emplace_back((static_cast<float>(i % columns) + 0.5F) / static_cast<float>(columns),
                        (static_cast<float>(i / columns) + 0.5F) / static_cast<float>(rows));
  }
  return image;
}

glm::vec4 mean_of(const std::vector<glm::vec4>& colors) {
  glm::dvec4 sum(0.0);
  for (const glm::vec4& color : colors) sum += color;
  return sum / static_cast<double>(colors.size());
}

}  // namespace

absl::StatusOr<SourceImage> MaterialTable::decode(std::uint32_t image) {
  const auto found = images_.find(image);
  if (found != images_.end()) return found->second;
  const Image& source = document_.images[image];
  const auto fail = [&](absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat("image ", image, " ", what));
  };
  absl::StatusOr<SourceImage> decoded;
  if (source.view != kNone) {
    decoded = decode_image(document_.bytes(document_.views[static_cast<std::size_t>(source.view)]));
  } else if (!source.uri.empty()) {
    const absl::StatusOr<Bytes> bytes = read_uri(source.uri, document_.folder, kMaxFileBytes);
    if (!bytes.ok()) return fail(absl::StrCat("uri: ", bytes.status().message()));
    decoded = decode_image(*bytes);
  } else {
    return fail("has neither a uri nor a bufferView");
  }
  if (!decoded.ok()) return fail(decoded.status().message());
  images_[image] = *decoded;
  return decoded;
}

absl::StatusOr<std::uint32_t> MaterialTable::find_or_make(std::int32_t material, bool with_texture,
                                                          const glm::vec4& tint,
                                                          std::vector<std::string>& notes) {
  const auto [slot, added] = known_.try_emplace({material, with_texture, pack(tint)},
                                                static_cast<std::uint32_t>(materials_.size()));
  if (!added) return slot->second;
  const std::uint32_t index = slot->second;
  const Material from =
      material == kNone ? Material{} : document_.materials[static_cast<std::size_t>(material)];
  const auto fail = [&](absl::string_view what) {
    return absl::InvalidArgumentError(absl::StrCat("material ", material, " ", what));
  };

  SourceMaterial made;
  made.name =
      from.name.empty() ? absl::StrCat("material_", material == kNone ? 0 : material) : from.name;
  made.factor = glm::clamp(glm::vec4(from.factor), 0.0F, 1.0F) * tint;
  made.double_sided = from.double_sided;
  TextureRef ref = from.base_color;
  const glm::vec3 glow = glm::clamp(glm::vec3(from.emissive), 0.0F, 1.0F);
  const bool is_black = glm::vec3(made.factor) == glm::vec3(0.0F);
  if (is_black && glow != glm::vec3(0.0F)) {
    made.factor = glm::vec4(glow, made.factor.a);
    if (ref.texture == kNone) ref = from.emissive_texture;
    notes.push_back(
        absl::StrCat("material ", material, " only glows; its glow is taken as its colour"));
  }
  if (with_texture && ref.texture != kNone) {
    const Texture& texture = document_.textures[static_cast<std::size_t>(ref.texture)];
    if (texture.source == kNone) {
      notes.push_back(absl::StrCat(
          "texture ", ref.texture, texture.unsupported.empty() ? " has no picture" : " is ",
          texture.unsupported, ", which isn't supported; the plain colour is used"));
    } else {
      absl::StatusOr<SourceImage> image = decode(static_cast<std::uint32_t>(texture.source));
      if (!image.ok()) return fail(image.status().message());
      texels_ += image->rgba.size() / 4;
      if (texels_ > kMaxTexels)
        return fail(absl::StrCat("makes ", texels_, " texels, the limit is ", kMaxTexels));
      made.base_color = *std::move(image);
    }
    if (texture.sampler != kNone) {
      const Sampler& sampler = document_.samplers[static_cast<std::size_t>(texture.sampler)];
      made.wrap_u = wrap_of(sampler.wrap_s);
      made.wrap_v = wrap_of(sampler.wrap_t);
    }
  }

  // blending needs an order of drawing that a crowd doesn't have
  std::uint64_t holes = 0;
  for (std::size_t i = 3; i < made.base_color.rgba.size(); i += 4)
    holes += made.base_color.rgba[i] < 128;
  if (from.alpha == AlphaMode::kBlend) {
    made.alpha_cutout = holes > 0;
    notes.push_back(
        absl::StrCat("material ", material, " is blended; it is drawn ",
                     made.alpha_cutout ? "with holes where alpha is under 0.5" : "opaque"));
    made.factor.a = 1.0F;
  } else if (from.alpha == AlphaMode::kMask) {
    made.alpha_cutout = true;
    made.alpha_cutoff = static_cast<float>(std::clamp(from.alpha_cutoff, 0.0, 1.0));
  }
  if (!made.alpha_cutout) {
    made.factor.a = 1.0F;
    for (std::size_t i = 3; i < made.base_color.rgba.size(); i += 4) made.base_color.rgba[i] = 255;
  }
  materials_.push_back(std::move(made));
  return index;
}

absl::StatusOr<Dressed> MaterialTable::dress(const Primitive& primitive, const PrimitiveData& data,
                                             std::vector<std::string>& notes) {
  TextureRef ref;
  if (primitive.material != kNone) {
    const Material& material = document_.materials[static_cast<std::size_t>(primitive.material)];
    ref = material.base_color.texture != kNone ? material.base_color : material.emissive_texture;
  }
  const auto uvs = data.uvs.find(ref.uv_set);
  const bool with_texture = ref.texture != kNone && uvs != data.uvs.end();
  if (ref.texture != kNone && !with_texture) {
    notes.push_back(absl::StrCat("a primitive of material ", primitive.material,
                                 " has no TEXCOORD_", ref.uv_set,
                                 "; it is drawn in the plain colour"));
  }

  glm::vec4 tint(1.0F);
  bool is_varied = false;
  for (const glm::vec4& color : data.colors)
    is_varied = is_varied || pack(color) != pack(data.colors[0]);
  if (!data.colors.empty()) tint = mean_of(data.colors);
  if (is_varied && with_texture) {
    notes.push_back(absl::StrCat("vertex colours over the texture of material ", primitive.material,
                                 " are averaged"));
  }
  const bool with_palette = is_varied && !with_texture;
  absl::StatusOr<std::uint32_t> material =
      find_or_make(primitive.material, with_texture, with_palette ? glm::vec4(1.0F) : tint, notes);
  if (!material.ok()) return material.status();

  Dressed dressed;
  dressed.material = *material;
  dressed.corner_uv.assign(data.triangles.size(), {});
  if (with_texture) {
    // KHR_texture_transform: scale, then rotate counter-clockwise in an upside-down frame, then
    // shift
    const double sine = std::sin(ref.rotation_rad);
    const double cosine = std::cos(ref.rotation_rad);
    const auto transform = [&](const glm::vec2& uv) {
      const glm::dvec2 scaled = glm::dvec2(uv) * ref.scale;
      return glm::vec2(
          glm::dvec2(cosine * scaled.x + sine * scaled.y, -sine * scaled.x + cosine * scaled.y) +
          ref.offset);
    };
    for (std::size_t t = 0; t < data.triangles.size(); ++t) {
      for (int c = 0; c < 3; ++c)
        dressed.corner_uv[t][c] = transform(uvs->second[data.triangles[t][c]]);
    }
  }
  if (!with_palette) return dressed;

  // few enough colours that a palette stays small: drop low bits until they are
  constexpr std::size_t kMaxColors = 256;
  std::vector<std::uint32_t> color_of(data.triangles.size());
  std::vector<std::uint32_t> palette;
  for (int dropped = 0; dropped < 8; ++dropped) {
    const std::uint32_t keep = (0xFFU << dropped) & 0xFFU;
    const std::uint32_t mask = keep | keep << 8 | keep << 16 | 0xFF000000U;
    for (std::size_t t = 0; t < data.triangles.size(); ++t) {
      const auto& triangle = data.triangles[t];
      const glm::vec4 mean =
          (data.colors[triangle[0]] + data.colors[triangle[1]] + data.colors[triangle[2]]) / 3.0F;
      color_of[t] = (pack(mean) | 0xFF000000U) & mask;
    }
    palette = color_of;
    std::sort(palette.begin(), palette.end());
    palette.erase(std::unique(palette.begin(), palette.end()), palette.end());
    if (palette.size() <= kMaxColors) break;
  }
  if (palette.empty()) return dressed;
  std::vector<glm::vec2> middle;
  SourceMaterial painted = materials_[dressed.material];
  painted.base_color = draw_palette(palette, middle);
  painted.wrap_u = painted.wrap_v = Wrap::kClamp;
  texels_ += painted.base_color.rgba.size() / 4;
  for (std::size_t t = 0; t < data.triangles.size(); ++t) {
    const auto found = std::lower_bound(palette.begin(), palette.end(), color_of[t]);
    dressed.corner_uv[t].fill(middle[static_cast<std::size_t>(found - palette.begin())]);
  }
  dressed.material = static_cast<std::uint32_t>(materials_.size());
  painted.name += "_colors";
  materials_.push_back(std::move(painted));
  notes.push_back(absl::StrCat("vertex colours of material ", primitive.material,
                               " became a palette of ", palette.size(),
                               ", one colour for each triangle"));
  return dressed;
}

}  // namespace throng::simplify::gltf
