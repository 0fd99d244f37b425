#pragma once

#include <cstdint>

namespace throng::render {

/// What a visible agent is drawn as in one frame.
enum class Representation : std::uint8_t {
  kNone = 0,      // smaller than a pixel, and chosen by its hash to be left out
  kMesh = 1,      // levels of detail of its mesh
  kImpostor = 2,  // relief impostor: a textured box for each joint (Beacco 2010)
  kPoints = 3,    // surface samples (Lyu et al.)
};
inline constexpr std::uint32_t kRepresentations = 4;

/// Which agents of a view are drawn as what. kMixed: each in the cheapest form that looks right.
enum class FormRule : std::uint8_t { kMesh, kImpostor, kPoints, kMixed };

/// An agent that is drawn from its joints, as an impostor or as points. 16 bytes.
struct JointedInstance {
  std::uint32_t first_joint;  // in FrameGeometry::joints
  float cosine_scale, sine_scale;
  std::uint32_t reserved;
};
static_assert(sizeof(JointedInstance) == 16);

}  // namespace throng::render
