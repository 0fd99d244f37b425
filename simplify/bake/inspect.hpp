#pragma once

#include <string>

#include "throng/render/asset.hpp"

namespace throng::simplify {

/// What is in a baked character: counts as in table 1 of Dong & Peng 2019, levels, clips, textures.
std::string inspect_text(const render::Character& character, std::uint64_t file_bytes);
std::string inspect_json(const render::Character& character, std::uint64_t file_bytes);

}  // namespace throng::simplify
