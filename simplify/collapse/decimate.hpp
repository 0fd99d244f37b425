#pragma once

#include <absl/status/status.h>

#include <functional>
#include <string>
#include <vector>

#include "simplify/collapse/collapse.hpp"
#include "simplify/collapse/wedges.hpp"

namespace throng::simplify {

/// Runs OpenMesh's decimater over `mesh` with the chosen criterion; the record is in `mesh`.
/// @param prefers_tones, toned_count  as of `contract`
absl::Status decimate(const PoseSet& poses, const CollapseOptions& options,
                      const std::function<bool()>& prefers_tones, WedgeMesh& mesh,
                      std::uint32_t& toned_count, std::vector<std::string>& notes);

}  // namespace throng::simplify
