#pragma once

#include <string>
#include <vector>

#include "throng/render/asset.hpp"

namespace throng::simplify::gltf {

/// The words of a clip, joint or file name in lower case: split at everything that is no letter or
/// digit, at camelCase and between letters and digits ("Rig|Walk_A2" gives rig, walk, a, 2).
std::vector<std::string> words_of(const std::string& name);

/// What each clip is for, by its words alone. A clip that walks or waits in a special way
/// ("Idle_Gun", "Walk_Carry") only counts when there is no plain one of its kind.
std::vector<render::ClipKind> kinds_of(const std::vector<std::string>& names);

}  // namespace throng::simplify::gltf
