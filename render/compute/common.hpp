#pragma once

#include <absl/status/status.h>

#include "render/compute/element/selection.hpp"
#include "throng/render/compute.hpp"

namespace throng::render {

// What every backend does on the host: refuse in the same words, and project.

/// InvalidArgument: a column that is missing or of the wrong length, a character beyond the cast.
absl::Status check_snapshot(const Snapshot* snapshot, std::size_t character_count);

/// InvalidArgument: members beyond the cast.
absl::Status check_surroundings(const Surroundings& surroundings, std::size_t character_count);

/// InvalidArgument: the older snapshot is the later one.
absl::Status check_bracket(std::int64_t older_time_us, std::int64_t newer_time_us);

/// InvalidArgument: a selection that can't be made.
absl::Status check_selection(const Selection& selection);

/// InvalidArgument: a mask of another length than there are instances.
absl::Status check_mask(std::size_t size, std::size_t instances);

/// ResourceExhausted: more vertices or indices than 32 bits number.
absl::Status check_batch(std::uint64_t vertices, std::uint64_t triangles);

/// InvalidArgument: a camera or viewport that can't be drawn with.
absl::Status check_camera(const Camera& camera, const Viewport& viewport);

/// How big spheres look to a camera that was checked.
element::Projection projection_of(const Camera& camera, const Viewport& viewport);

/// How far a view has come in its frame.
enum class ViewStage { kNew, kCulled, kSelected, kAllocated, kGenerated };

/// InvalidArgument when there is no view (it is of another backend), FailedPrecondition when the
/// stage `before` has not run.
absl::Status check_stage(const char* call, const ViewStage* stage, ViewStage needed,
                         const char* before);

}  // namespace throng::render
