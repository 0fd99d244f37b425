#pragma once

#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <string>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::simplify {

/// A frame of a clip.
struct PoseId {
  std::uint32_t clip = 0;   // into Character::clips
  std::uint32_t frame = 0;  // of the clip
};

/// "walk frame 12"
std::string pose_name(const render::Character& character, PoseId pose);

/// A character's vertices in one pose.
struct PosedVertices {
  std::vector<glm::vec3> position;  // [C] metres, model frame
  std::vector<glm::vec3> normal;    // [C] unit length
};

/// Linear blend skinning of the first vertices (equation 2 of Dong & Peng 2019), as many as
/// `position` has room for, in a frame of the palette.
void pose_positions(const render::Character& character, std::size_t frame,
                    std::span<glm::vec3> position);

/// The same of all vertices, with normals.
PosedVertices pose_vertices(const render::Character& character, PoseId pose);

/// At most `count` poses over all clips by farthest-point sampling: the first frame of the first
/// walk (else of the first clip), then again and again the frame least like those chosen, by the
/// root mean square distance of vertices. Fewer where a character hasn't so many different frames.
std::vector<PoseId> choose_poses(const render::Character& character, std::uint32_t count);

}  // namespace throng::simplify
