#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cstring>
#include <new>

#include "render/raster/visibility/cpu/shade.hpp"
#include "throng/render/asset.hpp"

namespace throng::render::visibility {

TextureLevels levels_of(const TextureInfo& info) {
  TextureLevels levels{};
  const auto fill = [&levels](int t, std::int32_t first, std::int32_t width, std::int32_t height,
                              std::int32_t count) {
    levels.width[t] = width;
    levels.height[t] = height;
    levels.last_level[t] = count - 1;
    while ((width >> (levels.log2_width[t] + 1)) != 0) ++levels.log2_width[t];
    for (std::int32_t level = 0; level < count; ++level) {
      levels.first[t][level] = first;
      first += std::max(1, width >> level) * std::max(1, height >> level);
    }
  };
  fill(0, info.base_first, info.base_width, info.base_height, info.base_levels);
  levels.has_mask = info.mask_first >= 0 ? 1 : 0;
  if (levels.has_mask != 0) {
    fill(1, info.mask_first, info.mask_width, info.mask_height, info.mask_levels);
  } else {
    fill(1, 0, 1, 1, 1);
  }
  return levels;
}

absl::StatusOr<TextureStore> make_textures(const Cast& cast, TextureStore store, std::size_t kept) {
  try {
    constexpr std::size_t kRoom = 1u << 18;  // for surroundings, so that the cast isn't copied
    if (kept == 0) {
      store = {};
      std::size_t bytes = 0;
      for (const CastMember& member : cast.members) {
        bytes +=
            member.character.base_color.texels.size() + member.character.tint_mask.texels.size();
      }
      store.texels.reserve(bytes / 4 + kRoom);
    } else {
      store.texels.resize(store.infos.size() > kept
                              ? static_cast<std::size_t>(store.infos[kept].base_first)
                              : store.texels.size() - 1);
      store.infos.resize(kept);
      store.levels.resize(kept);
    }
    const auto append = [&store](const MipImage& image) {
      const std::size_t first = store.texels.size();
      store.texels.resize(first + image.texels.size() / 4);
      std::memcpy(store.texels.data() + first, image.texels.data(), image.texels.size() / 4 * 4);
      return first;
    };
    for (const CastMember& member : std::span(cast.members).subspan(kept)) {
      const Character& character = member.character;
      for (const MipImage* image : {&character.base_color, &character.tint_mask}) {
        std::uint64_t texels = 0;
        for (std::uint32_t level = 0; level < image->level_count; ++level) {
          texels += std::uint64_t{std::max(1U, image->width_px >> level)} *
                    std::max(1U, image->height_px >> level);
        }
        if (image->level_count > 15 || texels * 4 > image->texels.size()) {
          return absl::InvalidArgumentError(
              absl::StrCat("visibility upload: ", character.name, ": a texture of ",
                           image->width_px, "x", image->height_px, " px with ", image->level_count,
                           " levels has ", image->texels.size(), " bytes"));
        }
      }
      TextureInfo info;
      if (character.base_color.level_count == 0) {
        info.base_first = static_cast<std::int32_t>(store.texels.size());
        store.texels.push_back(0xffb4b4b4U);
      } else {
        info.base_first = static_cast<std::int32_t>(append(character.base_color));
        info.base_width = static_cast<std::int32_t>(character.base_color.width_px);
        info.base_height = static_cast<std::int32_t>(character.base_color.height_px);
        info.base_levels = static_cast<std::int32_t>(character.base_color.level_count);
      }
      if (character.tint_mask.level_count > 0) {
        info.mask_first = static_cast<std::int32_t>(append(character.tint_mask));
        info.mask_width = static_cast<std::int32_t>(character.tint_mask.width_px);
        info.mask_height = static_cast<std::int32_t>(character.tint_mask.height_px);
        info.mask_levels = static_cast<std::int32_t>(character.tint_mask.level_count);
      }
      if (store.texels.size() > 0x7fffffffULL) {
        return absl::ResourceExhaustedError(absl::StrCat("visibility upload: textures have ",
                                                         store.texels.size(), " texels, at most ",
                                                         0x7fffffff));
      }
      store.infos.push_back(info);
      store.levels.push_back(levels_of(info));
    }
    store.texels.push_back(0);
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError("visibility upload: no memory for the cast's textures");
  }
  return store;
}

}  // namespace throng::render::visibility
