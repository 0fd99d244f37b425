#pragma once

#include <cstdint>
#include <vector>

#include "render/compute/cpu/error_table.hpp"
#include "render/compute/element/work_sample.hpp"
#include "throng/render/compute.hpp"

namespace throng::render {

/// An agent in view as a frame's time goes by it.
struct WorkSample : element::WorkSize {
  const ErrorTable* error;
  bool may_be_speck, may_share;
};

/// Every so many of the agents in view, by slot: what a backend tells of who is seen.
struct WorkSamples {
  std::vector<WorkSample> sample;
  std::uint32_t every = 1;
  element::Projection projection;
};

/// The error at which a frame takes MixedForms::budget_ms: goes into `selection`, the work that is
/// estimated with it is returned.
/// @param error_px  of the frame before, which is kept as long as it fits; 0: there was none. Then
///                  what was chosen.
FrameWork fit_error(const WorkSamples& view, Selection& selection, float& error_px);

/// An error of the frame before, within what is asked for now.
float kept_error(const MixedForms& mixed, float error_px);

/// An error that was chosen, for all that goes by it.
void set_error(Selection& selection, float error_px);

}  // namespace throng::render
