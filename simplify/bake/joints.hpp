#pragma once

#include <absl/status/status.h>

#include <glm/glm.hpp>
#include <string>
#include <vector>

#include "simplify/source_character.hpp"

namespace throng::simplify {

/// Weights as 8-bit shares: strongest first, sum 255 exactly, each at most one off its rounded
/// value (largest remainders). Equal joints are joined; what is left without weight has joint 0.
void quantize_weights(const SourcePoint& point, glm::u8vec4& joint, glm::u8vec4& weight);

/// Leaves out joints that no point needs where there are more than 256. InvalidArgument if the used
/// ones alone are more.
absl::Status limit_joints(SourceCharacter& source, std::vector<std::string>& notes);

/// Scales everything in metres.
void scale(SourceCharacter& source, float factor);

}  // namespace throng::simplify
