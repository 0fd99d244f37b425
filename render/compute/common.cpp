#include "render/compute/common.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace throng::render {

absl::Status check_snapshot(const Snapshot* snapshot, std::size_t character_count) {
  if (snapshot == nullptr || (snapshot->roster == nullptr && !snapshot->present.empty())) {
    return absl::InvalidArgumentError("upload: the snapshot or its roster is missing");
  }
  const std::size_t slots = snapshot->present.size();
  if (slots > 0) {
    const Roster& roster = *snapshot->roster;
    if (snapshot->position_m.size() != slots || snapshot->velocity_mps.size() != slots ||
        snapshot->heading_rad.size() != slots || snapshot->speed_mps.size() != slots ||
        snapshot->turn_radps.size() != slots || snapshot->walked_cycles.size() != slots ||
        (!snapshot->motion.empty() && snapshot->motion.size() != slots) ||
        roster.id.size() < slots || roster.character.size() < slots ||
        roster.scale.size() < slots || roster.seed.size() < slots) {
      return absl::InvalidArgumentError(
          absl::StrCat("upload: a column of the snapshot does not have its ", slots, " slots"));
    }
    for (const std::vector<float>& channel : snapshot->channels) {
      if (channel.size() == slots) continue;
      return absl::InvalidArgumentError(
          absl::StrCat("upload: a channel has ", channel.size(), " rows, must have ", slots));
    }
    std::uint16_t largest = 0;
    for (std::size_t i = 0; i < slots; ++i) largest = std::max(largest, roster.character[i]);
    if (largest >= character_count) {
      return absl::InvalidArgumentError(absl::StrCat("upload: the roster names character ", largest,
                                                     ", must be less than ", character_count));
    }
  }
  return absl::OkStatus();
}

absl::Status check_surroundings(const Surroundings& surroundings, std::size_t character_count) {
  const std::uint64_t end = std::uint64_t{surroundings.first_member} + surroundings.member_count;
  if (surroundings.member_count == 0 || end <= character_count) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("advance: the surroundings end with cast member ",
                                                 end - 1, ", must be less than ", character_count));
}

absl::Status check_bracket(std::int64_t older_time_us, std::int64_t newer_time_us) {
  if (older_time_us <= newer_time_us) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("advance: older is at ", older_time_us,
                                                 " us, must not be after newer at ", newer_time_us,
                                                 " us"));
}

absl::Status check_selection(const Selection& selection) {
  if (selection.alpha != 3.0F) {
    return absl::InvalidArgumentError(
        absl::StrCat("select: alpha is ", selection.alpha, ", must be 3"));
  }
  if (!(selection.point_size_px > 0.0F)) {
    return absl::InvalidArgumentError(
        absl::StrCat("select: point_size_px is ", selection.point_size_px, ", must be > 0"));
  }
  if (!(selection.mixed.error_px > 0.0F) || !(selection.mixed.speck_error > 0.0F) ||
      !(selection.mixed.least_px > 0.0F)) {
    return absl::InvalidArgumentError(absl::StrCat("select: error_px is ", selection.mixed.error_px,
                                                   ", speck_error ", selection.mixed.speck_error,
                                                   " and least_px ", selection.mixed.least_px,
                                                   ", all must be > 0"));
  }
  return absl::OkStatus();
}

absl::Status check_mask(std::size_t size, std::size_t instances) {
  if (size == instances) return absl::OkStatus();
  return absl::InvalidArgumentError(
      absl::StrCat("read_visible: visible has ", size, " elements, must have ", instances));
}

absl::Status check_batch(std::uint64_t vertices, std::uint64_t triangles) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (vertices <= kMost && 3 * triangles <= kMost) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat("allocate: ", vertices, " vertices and ",
                                                   3 * triangles, " indices, must each be at most ",
                                                   kMost, "; lower the vertex budget"));
}

absl::Status check_camera(const Camera& camera, const Viewport& viewport) {
  constexpr std::uint32_t kLargestPx = 16384;
  if (viewport.width_px == 0 || viewport.width_px > kLargestPx || viewport.height_px == 0 ||
      viewport.height_px > kLargestPx) {
    return absl::InvalidArgumentError(absl::StrCat("cull: the viewport is ", viewport.width_px, "x",
                                                   viewport.height_px, " px, must be 1 to ",
                                                   kLargestPx));
  }
  const bool is_finite = [&] {
    for (int i = 0; i < 3; ++i) {
      if (!std::isfinite(camera.eye_world[i]) || !std::isfinite(camera.target_world[i]) ||
          !std::isfinite(camera.up_world[i])) {
        return false;
      }
    }
    return true;
  }();
  if (!is_finite) {
    return absl::InvalidArgumentError("cull: the camera's eye, target and up must be numbers");
  }
  if (!(camera.near_m > 0.0) || !std::isfinite(camera.near_m)) {
    return absl::InvalidArgumentError(
        absl::StrCat("cull: near_m is ", camera.near_m, ", must be > 0"));
  }
  if (camera.ortho_height_m > 0.0) {
    if (!std::isfinite(camera.ortho_height_m) || !(camera.far_m > camera.near_m) ||
        !std::isfinite(camera.far_m)) {
      return absl::InvalidArgumentError(
          absl::StrCat("cull: an orthographic camera has a height of ", camera.ortho_height_m,
                       " m and far_m ", camera.far_m, ", must be beyond near_m ", camera.near_m));
    }
  } else if (!(camera.fov_y_rad > 0.0) || !(camera.fov_y_rad < 3.14)) {
    return absl::InvalidArgumentError(
        absl::StrCat("cull: fov_y_rad is ", camera.fov_y_rad, ", must be in (0, 3.14)"));
  }
  return absl::OkStatus();
}

element::Projection projection_of(const Camera& camera, const Viewport& viewport) {
  element::Projection projection;
  projection.perspective = camera.ortho_height_m > 0.0 ? 0 : 1;
  projection.focal_px = static_cast<float>(
      camera.ortho_height_m > 0.0 ? viewport.height_px / camera.ortho_height_m
                                  : 0.5 * viewport.height_px / std::tan(0.5 * camera.fov_y_rad));
  projection.viewport_px2 =
      static_cast<float>(viewport.width_px) * static_cast<float>(viewport.height_px);
  return projection;
}

absl::Status check_stage(const char* call, const ViewStage* stage, ViewStage needed,
                         const char* before) {
  if (stage == nullptr) {
    return absl::InvalidArgumentError(absl::StrCat(call, ": the view is of another backend"));
  }
  if (*stage < needed) {
    return absl::FailedPreconditionError(absl::StrCat(call, ": ", before, " comes first"));
  }
  return absl::OkStatus();
}

}  // namespace throng::render
