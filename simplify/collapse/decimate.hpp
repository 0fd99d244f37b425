#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "simplify/collapse/collapse.hpp"
#include "simplify/collapse/wedges.hpp"

namespace throng::simplify {

/// Runs OpenMesh's decimater over `mesh` with the chosen criterion; the record is in `mesh`.
absl::Status decimate(const PoseSet& poses, const CollapseOptions& options, WedgeMesh& mesh,
                      std::vector<std::string>& notes);

}  // namespace throng::simplify
