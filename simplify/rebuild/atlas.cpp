#include "simplify/rebuild/atlas.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "simplify/rebuild/image.hpp"

namespace throng::simplify {
namespace {

constexpr float kMaxRepeats = 4.0F;     // a texture laid out more often than this is squeezed
constexpr float kBorder = 1.0F / 1024;  // uvs this little outside of the texture count as inside
constexpr std::uint32_t kSolidSize_px = 8;

/// Shifts each chart by whole numbers so that its least uv lies in [0, 1). A chart that is already
/// inside the texture stays: a uv of exactly 1 is its far border, not the next copy.
std::vector<glm::vec2> unwrap(const std::vector<glm::vec2>& uv,
                              const std::vector<glm::uvec3>& triangles) {
  std::vector<std::uint32_t> parent(uv.size());
  std::iota(parent.begin(), parent.end(), 0U);
  const auto find = [&](std::uint32_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const glm::uvec3& triangle : triangles) {
    for (int i = 1; i < 3; ++i) parent[find(triangle[i])] = find(triangle[0]);
  }
  std::vector<glm::vec2> low(uv.size(), glm::vec2(INFINITY)), high(uv.size(), glm::vec2(-INFINITY));
  for (std::uint32_t i = 0; i < uv.size(); ++i) {
    const std::uint32_t chart = find(i);
    low[chart] = glm::min(low[chart], uv[i]);
    high[chart] = glm::max(high[chart], uv[i]);
  }
  std::vector<glm::vec2> result(uv.size());
  for (std::uint32_t i = 0; i < uv.size(); ++i) {
    const std::uint32_t chart = find(i);
    for (int k = 0; k < 2; ++k) {
      const bool is_inside = low[chart][k] >= -kBorder && high[chart][k] <= 1.0F + kBorder;
      result[i][k] = is_inside ? uv[i][k] : uv[i][k] - std::floor(low[chart][k] + kBorder);
    }
  }
  return result;
}

glm::u8vec4 apply_factor(const glm::u8vec4& texel, const SourceMaterial& material) {
  glm::u8vec4 result = texel;
  for (int i = 0; i < 3; ++i) {
    if (material.factor[i] != 1.0F)
      result[i] = srgb_from_linear(linear_from_srgb(texel[i]) * material.factor[i]);
  }
  if (!material.alpha_cutout) {
    result.a = 255;
  } else {
    // runtime cuts at one half, whatever the material's own limit was
    const float alpha = static_cast<float>(texel.a) / 255.0F * material.factor.a;
    const float cutoff = std::clamp(material.alpha_cutoff, 0.01F, 0.99F);
    const float moved =
        alpha < cutoff ? 0.5F * alpha / cutoff : 0.5F + 0.5F * (alpha - cutoff) / (1.0F - cutoff);
    result.a = static_cast<std::uint8_t>(std::clamp(moved, 0.0F, 1.0F) * 255.0F + 0.5F);
  }
  return result;
}

void put_texel(SourceImage& image, std::int64_t x, std::int64_t y, const glm::u8vec4& texel) {
  if (x < 0 || y < 0 || x >= image.width_px || y >= image.height_px) return;
  std::uint8_t* to =
      &image.rgba[4 * (static_cast<std::size_t>(y) * image.width_px + static_cast<std::size_t>(x))];
  for (int i = 0; i < 4; ++i) to[i] = texel[i];
}

/// The image that a material's cell is laid out with: its texture, else its mask.
const SourceImage& layout_image(const SourceMaterial& material) {
  return material.base_color.rgba.empty() ? material.tint_mask : material.base_color;
}

/// A rectangle of a material's texture and where it goes.
struct Cell {
  std::uint32_t material = 0;
  bool is_solid = false;
  glm::vec2 uv_low{0.0F}, uv_high{1.0F};  // unwrapped
  glm::ivec2 source_low_px{0};            // in the texture, may be outside of it
  glm::ivec2 source_size_px{1};
  glm::uvec2 size_px{1}, at_px{0};  // in the atlas, without the gutter
};

/// Shelf packing, tallest first. False where the cells don't fit.
bool pack(std::vector<Cell>& cells, glm::uvec2 atlas_px, std::uint32_t gutter_px) {
  std::vector<std::size_t> order(cells.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return cells[a].size_px.y > cells[b].size_px.y;
  });
  glm::uvec2 pen(0);
  std::uint32_t shelf_px = 0;
  for (const std::size_t i : order) {
    const glm::uvec2 size = cells[i].size_px + 2 * gutter_px;
    if (pen.x + size.x > atlas_px.x) {
      pen = {0, pen.y + shelf_px};
      shelf_px = 0;
    }
    if (pen.x + size.x > atlas_px.x || pen.y + size.y > atlas_px.y) return false;
    cells[i].at_px = pen + gutter_px;
    pen.x += size.x;
    shelf_px = std::max(shelf_px, size.y);
  }
  return true;
}

/// Gives every cell its size and place in the smallest atlas up to the limit, scaling cells down
/// where even that is too small.
glm::uvec2 lay_out(std::vector<Cell>& cells, std::uint32_t max_px, std::uint32_t& gutter_px,
                   float& scale) {
  // solid cells can't be scaled, so very many of them may need more than the limit
  for (scale = 1.0F;; scale *= 0.84F) {
    if (scale < 0.01F) {
      max_px *= 2;
      scale = 1.0F;
    }
    for (Cell& cell : cells) {
      if (cell.is_solid) {
        cell.size_px = glm::uvec2(kSolidSize_px);
      } else {
        cell.size_px =
            glm::max(glm::uvec2(glm::vec2(cell.source_size_px) * scale + 0.5F), glm::uvec2(4));
      }
    }
    for (std::uint32_t size = 32; size <= max_px; size *= 2) {
      for (const glm::uvec2 atlas_px : {glm::uvec2(size, size / 2), glm::uvec2(size, size)}) {
        gutter_px = std::clamp(size / 128, 2U, 16U);
        if (pack(cells, atlas_px, gutter_px)) return atlas_px;
      }
    }
  }
}

/// Copies a cell and its gutter, averaging where the cell was scaled down.
/// @param image  of the cell's material: its texture, or its tint mask where `is_mask`
/// @param layout_px  size of the image that the cell was laid out with; a mask may have another one
void copy_cell(const Cell& cell, const SourceImage& image, const SourceMaterial& material,
               bool is_mask, const glm::dvec2& layout_px, std::int64_t gutter_px,
               SourceImage& atlas) {
  const glm::dvec2 ratio = glm::dvec2(image.width_px, image.height_px) / layout_px;
  const glm::dvec2 step = glm::dvec2(cell.source_size_px) / glm::dvec2(cell.size_px) * ratio;
  const auto texel_at = [&](std::int64_t x, std::int64_t y) {
    const glm::u8vec4 texel = wrapped_texel(image, material.wrap_u, material.wrap_v, x, y);
    return is_mask ? texel : apply_factor(texel, material);
  };
  for (std::int64_t y = -gutter_px; y < static_cast<std::int64_t>(cell.size_px.y) + gutter_px;
       ++y) {
    for (std::int64_t x = -gutter_px; x < static_cast<std::int64_t>(cell.size_px.x) + gutter_px;
         ++x) {
      const glm::dvec2 low = glm::dvec2(cell.source_low_px) * ratio + glm::dvec2(x, y) * step;
      const glm::i64vec2 first(glm::floor(low + 1.0e-6));
      const glm::i64vec2 last =
          glm::max(first, glm::i64vec2(glm::ceil(low + step - 1.0e-6)) - std::int64_t{1});
      glm::u8vec4 texel = texel_at(first.x, first.y);
      if (first != last) {
        glm::vec4 sum(0.0F);
        for (std::int64_t sy = first.y; sy <= last.y; ++sy) {
          for (std::int64_t sx = first.x; sx <= last.x; ++sx) {
            const glm::u8vec4 each = texel_at(sx, sy);
            for (int i = 0; i < 4; ++i) {
              sum[i] += is_mask || i == 3 ? static_cast<float>(each[i]) : linear_from_srgb(each[i]);
            }
          }
        }
        sum /= static_cast<float>((last.x - first.x + 1) * (last.y - first.y + 1));
        for (int i = 0; i < 4; ++i) {
          texel[i] = is_mask || i == 3 ? static_cast<std::uint8_t>(sum[i] + 0.5F)
                                       : srgb_from_linear(sum[i]);
        }
      }
      put_texel(atlas, cell.at_px.x + x, cell.at_px.y + y, texel);
    }
  }
}

/// Fills a cell and its gutter with the colour of a material without a texture.
void fill_cell(const Cell& cell, const SourceMaterial& material, std::int64_t gutter_px,
               SourceImage& atlas) {
  const glm::u8vec4 color = apply_factor(glm::u8vec4(255), material);
  for (std::int64_t y = -gutter_px; y < static_cast<std::int64_t>(cell.size_px.y) + gutter_px;
       ++y) {
    for (std::int64_t x = -gutter_px; x < static_cast<std::int64_t>(cell.size_px.x) + gutter_px;
         ++x) {
      put_texel(atlas, cell.at_px.x + x, cell.at_px.y + y, color);
    }
  }
}

/// The one texture of the character as it is; only size limit and colour factor are applied.
Atlas keep_texture(const SourceMaterial& material, std::vector<glm::vec2> uv,
                   const RebuildOptions& options, std::vector<std::string>& notes) {
  Atlas atlas;
  atlas.uv = std::move(uv);
  for (glm::vec2& each : atlas.uv) each = glm::clamp(each, 0.0F, 1.0F);
  atlas.base_color = material.base_color;
  for (std::size_t i = 0; i < atlas.base_color.rgba.size(); i += 4) {
    std::uint8_t* texel = &atlas.base_color.rgba[i];
    const glm::u8vec4 colored = apply_factor({texel[0], texel[1], texel[2], texel[3]}, material);
    for (int k = 0; k < 4; ++k) texel[k] = colored[k];
  }
  const auto limit = [](SourceImage& image, std::uint32_t max_px, bool is_srgb) {
    const std::uint32_t widest = std::max(image.width_px, image.height_px);
    if (widest <= max_px) return false;
    const auto scaled = [&](std::uint32_t size) {
      return static_cast<std::uint32_t>(
          std::max<std::uint64_t>(1, std::uint64_t{size} * max_px / widest));
    };
    image = resize(image, scaled(image.width_px), scaled(image.height_px), is_srgb);
    return true;
  };
  if (limit(atlas.base_color, options.max_texture_px, true)) {
    notes.push_back(absl::StrCat("texture scaled down to ", atlas.base_color.width_px, " x ",
                                 atlas.base_color.height_px, " px"));
  }
  atlas.tint_mask = material.tint_mask;
  if (!atlas.tint_mask.rgba.empty()) limit(atlas.tint_mask, options.max_tint_mask_px, false);
  return atlas;
}

}  // namespace

Atlas make_atlas(const std::vector<SourceMaterial>& materials,
                 const std::vector<glm::vec2>& wedge_uv,
                 const std::vector<std::uint32_t>& wedge_material,
                 const std::vector<glm::uvec3>& triangles, const RebuildOptions& options,
                 std::vector<std::string>& notes) {
  const std::vector<glm::vec2> uv = unwrap(wedge_uv, triangles);

  // the rectangle each material uses
  std::vector<glm::vec2> low(materials.size(), glm::vec2(INFINITY)),
      high(materials.size(), glm::vec2(-INFINITY));
  for (std::size_t i = 0; i < uv.size(); ++i) {
    low[wedge_material[i]] = glm::min(low[wedge_material[i]], uv[i]);
    high[wedge_material[i]] = glm::max(high[wedge_material[i]], uv[i]);
  }
  std::vector<Cell> cells;
  for (std::uint32_t m = 0; m < materials.size(); ++m) {
    if (!(low[m].x <= high[m].x)) continue;  // no triangle uses it
    const SourceMaterial& material = materials[m];
    Cell cell;
    cell.material = m;
    cell.is_solid = material.base_color.rgba.empty() && material.tint_mask.rgba.empty();
    cell.uv_low = low[m];
    cell.uv_high = high[m];
    if (!cell.is_solid) {
      const SourceImage& image = layout_image(material);
      const glm::vec2 size(image.width_px, image.height_px);
      if (glm::any(glm::greaterThan(high[m] - low[m], glm::vec2(kMaxRepeats)))) {
        notes.push_back(absl::StrCat("material ", material.name, ": texture repeats ",
                                     std::max(high[m].x - low[m].x, high[m].y - low[m].y),
                                     " times, only ", kMaxRepeats, " are kept"));
        cell.uv_high = glm::min(high[m], low[m] + kMaxRepeats);
      }
      cell.source_low_px = glm::ivec2(glm::floor(cell.uv_low * size));
      cell.source_size_px =
          glm::max(glm::ivec2(glm::ceil(cell.uv_high * size)) - cell.source_low_px, glm::ivec2(1));
    }
    cells.push_back(cell);
  }

  const glm::vec2 inside_low(-kBorder), inside_high(1.0F + kBorder);
  if (cells.size() == 1 && !materials[cells[0].material].base_color.rgba.empty() &&
      glm::all(glm::greaterThanEqual(cells[0].uv_low, inside_low)) &&
      glm::all(glm::lessThanEqual(cells[0].uv_high, inside_high))) {
    return keep_texture(materials[cells[0].material], uv, options, notes);
  }

  std::uint32_t gutter_px = 2;
  float scale = 1.0F;
  const glm::uvec2 atlas_px = lay_out(cells, options.max_texture_px, gutter_px, scale);
  if (scale < 1.0F)
    notes.push_back(absl::StrCat("textures scaled by ", scale, " to fit one atlas"));

  Atlas atlas;
  atlas.base_color = {atlas_px.x, atlas_px.y, {}};
  atlas.base_color.rgba.assign(std::size_t{4} * atlas_px.x * atlas_px.y, 255);
  const bool has_mask = std::any_of(cells.begin(), cells.end(), [&](const Cell& cell) {
    return !materials[cell.material].tint_mask.rgba.empty();
  });
  std::uint32_t mask_divisor = 1;
  if (has_mask) {
    while (std::max(atlas_px.x, atlas_px.y) / mask_divisor > options.max_tint_mask_px)
      mask_divisor *= 2;
    atlas.tint_mask = {atlas_px.x, atlas_px.y, {}};
    atlas.tint_mask.rgba.assign(std::size_t{4} * atlas_px.x * atlas_px.y, 0);
  }
  std::vector<const Cell*> cell_of(materials.size(), nullptr);
  for (Cell& cell : cells) {
    const SourceMaterial& material = materials[cell.material];
    cell_of[cell.material] = &cell;
    const SourceImage& layout = layout_image(material);
    const glm::dvec2 layout_px(layout.width_px, layout.height_px);
    if (material.base_color.rgba.empty()) {
      fill_cell(cell, material, gutter_px, atlas.base_color);
    } else {
      copy_cell(cell, material.base_color, material, false, layout_px, gutter_px, atlas.base_color);
    }
    if (!material.tint_mask.rgba.empty()) {
      copy_cell(cell, material.tint_mask, material, true, layout_px, gutter_px, atlas.tint_mask);
    }
  }
  if (has_mask && mask_divisor > 1) {
    atlas.tint_mask = resize(atlas.tint_mask, std::max(1U, atlas_px.x / mask_divisor),
                             std::max(1U, atlas_px.y / mask_divisor), false);
  }

  atlas.uv.resize(uv.size());
  for (std::size_t i = 0; i < uv.size(); ++i) {
    const Cell& cell = *cell_of[wedge_material[i]];
    glm::vec2 at_px = glm::vec2(cell.at_px);
    if (cell.is_solid) {
      at_px += 0.5F * glm::vec2(cell.size_px);
    } else {
      const SourceMaterial& material = materials[cell.material];
      const SourceImage& image = layout_image(material);
      const glm::vec2 clamped = glm::clamp(uv[i], cell.uv_low, cell.uv_high);
      const glm::vec2 source_px =
          clamped * glm::vec2(image.width_px, image.height_px) - glm::vec2(cell.source_low_px);
      at_px += source_px * glm::vec2(cell.size_px) / glm::vec2(cell.source_size_px);
    }
    atlas.uv[i] = at_px / glm::vec2(atlas_px);
  }
  return atlas;
}

}  // namespace throng::simplify
