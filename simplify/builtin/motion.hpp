#pragma once

#include <vector>

#include "simplify/builtin/rig.hpp"
#include "simplify/source_character.hpp"

namespace throng::builtin {

/// Idle, walk and run at 30 Hz, in place: during stance the sole moves back at stride_m per cycle,
/// so a character that advances by stride_m each cycle does not slide.
///
/// The legs follow planned ankle paths by two-bone inverse kinematics. Hip and knee angles are
/// those of a CMU walk and a CMU run (subject 02, takes 01 and 03) as Fourier series, bent so that
/// the foot rolls from heel over the flat sole to the ball without leaving its place.
std::vector<simplify::SourceClip> make_clips(const Figure& figure, const Rig& rig);

}  // namespace throng::builtin
