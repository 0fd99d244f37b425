#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::simplify {

/// Different places, of which the vertices are the wedges.
std::size_t point_count(const render::Character& character);

/// What is in a baked character: counts as in table 1 of Dong & Peng 2019, levels, clips, textures.
std::string inspect_text(const render::Character& character, std::uint64_t file_bytes);
/// The same counts of several characters, a line each, and the row of table 1 that a character
/// follows (within 2 %) beside it. Vertices are places, UVs different (place, uv).
std::string inspect_table(const std::vector<render::Character>& characters);
std::string inspect_json(const render::Character& character, std::uint64_t file_bytes);

}  // namespace throng::simplify
