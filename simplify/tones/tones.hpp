#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::simplify {

/// Fills `tone_band` and `corner_tone` (render::CornerTones) of a baked mesh, by looking.
///
/// Pictures of the full mesh, from four sides in each pose, say what is seen where. The colours of
/// a coarse triangle's corners are the linear least-squares fit to what its pixels show there, over
/// all pictures (textures in linear light, tint masks likewise), pulled a little towards the
/// triangle's mean, the more the fewer pixels there are. A band is fitted to its finest level and
/// to the one next below it at once.
///
/// Levels get tones from where on, towards the coarsest, their picture at the height that they are
/// judged at (LevelSpec::native_px) is nearer to the full mesh's than with the texture, or no eye
/// tells which is.
///
/// @param poses  [P][C] positions of the vertices, metres, model frame; none: no tones
/// @param least_count  levels of at most so many vertices have tones in any case
void make_corner_tones(render::CharacterData& data,
                       const std::vector<std::vector<glm::vec3>>& poses,
                       std::uint32_t least_count = 0);

/// Whether corner tones are the better choice for a mesh that is still to be made coarser than
/// `count` vertices: judged as make_corner_tones does, but they may differ from the full mesh by
/// twice the texture's error.
/// @param data  its coarsest_count is where the least height is meant
bool prefers_corner_tones(render::CharacterData& data,
                          const std::vector<std::vector<glm::vec3>>& poses, std::uint32_t count);

}  // namespace throng::simplify
