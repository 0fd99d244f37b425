#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

namespace throng::render {

/// From the colour of a channel's lowest value to that of its highest.
enum class ColorMap : std::uint32_t { kViridis, kPlasma, kInferno, kMagma, kCividis };

inline constexpr std::array<const char*, 5> kColorMapNames = {"viridis", "plasma", "inferno",
                                                              "magma", "cividis"};

constexpr const char* name_of(ColorMap map) {
  return kColorMapNames[static_cast<std::size_t>(map)];
}

/// None: no map has this name.
constexpr std::optional<ColorMap> color_map_of(std::string_view name) {
  for (std::size_t i = 0; i < kColorMapNames.size(); ++i) {
    if (name == kColorMapNames[i]) return static_cast<ColorMap>(i);
  }
  return std::nullopt;
}

}  // namespace throng::render
