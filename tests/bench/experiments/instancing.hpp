#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "throng/render/asset.hpp"
#include "throng/render/camera.hpp"
#include "throng/render/crowd.hpp"
#include "throng/render/picture.hpp"

namespace throng::bench {

/// One agent as instancing draws it: a palette frame of one clip, no blending.
struct InstancedAgent {
  glm::vec3 position_relative;  // of the feet, to the eye
  float cosine_scale, sine_scale, scale;
  std::uint32_t character;
  std::uint32_t level;        // 0: full detail
  std::uint32_t first_joint;  // of its frame, in the character's palette
};

/// The published baseline: every character's vertices, indices, texture and animation frames stay
/// in OpenGL, one instanced call draws all agents of a character and level, and the vertex shader
/// skins each vertex of each agent from the palette of its frame (Zelsnack 2004, Peng et al. 2011).
///
/// Kept cheaper than throng's own gl path, so that a comparison errs on its side: one sample a
/// pixel, no smoothing, tints, ground or shadows, a lambertian light.
class Instancing {
 public:
  virtual ~Instancing() = default;

  /// Unavailable where there is no OpenGL.
  static absl::StatusOr<std::unique_ptr<Instancing>> make(std::shared_ptr<const render::Cast> cast);

  /// Sorts the agents by character and level, draws and reads back.
  virtual absl::Status draw(std::span<const InstancedAgent> agents, const render::Camera& camera,
                            const render::Viewport& viewport, render::Picture& picture) = 0;

  /// What OpenGL says it draws on.
  virtual std::string device() const = 0;

  /// Triangles of a level of a character.
  virtual std::uint32_t triangles(std::uint32_t character, std::uint32_t level) const = 0;
};

/// The present agents of a snapshot, as instancing draws them. Discrete levels are those of
/// render::LodRule::kDiscrete; without them everybody is drawn at full detail.
std::vector<InstancedAgent> instanced_agents(const render::Snapshot& snapshot,
                                             const render::Cast& cast, const render::Camera& camera,
                                             const render::Viewport& viewport, bool discrete);

}  // namespace throng::bench
