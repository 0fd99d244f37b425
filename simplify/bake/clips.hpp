#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "simplify/source_character.hpp"

namespace throng::simplify {

struct BakedClips {
  std::vector<render::Clip> clips;
  std::vector<render::Affine> palette;  // [F][J]
};

/// Palettes of all clips, ready to use: model_from_joint * joint_from_model (equation 2's T *
/// B^-1).
///
/// - The horizontal way that the body goes in one cycle is taken out evenly, so that sway stays,
/// and
///   becomes the stride. Where there is none, the stride of a walk or run is measured at the stance
///   foot: the lowest points of the legs move backward as fast as the body would go forward.
/// - A last frame that repeats the first is dropped.
/// - A clip that stands, walks or runs a little above or below the ground is put on it.
/// - Kind: from the source, else from the name, else from the measured speed.
/// - No clip at all: a rest pose of one frame.
/// InvalidArgument names the clip, frame and joint of a matrix that isn't finite, or a wrong shape.
absl::StatusOr<BakedClips> bake_clips(const SourceCharacter& source,
                                      std::vector<std::string>& notes);

/// What a clip's name says, kOther where it says nothing. Ways to go that aren't straight ahead
/// (backward, sideways, crouched) are kOther too, because nothing chooses them.
render::ClipKind kind_from_name(const std::string& name);

/// True for names that tools give by themselves ("Take 001", "Armature|mixamo.com", "").
bool is_generic_name(const std::string& name);

}  // namespace throng::simplify
