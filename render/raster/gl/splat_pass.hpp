#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <span>

#include "render/raster/gl/mapped_buffer.hpp"
#include "throng/render/vertex.hpp"

namespace throng::render::gl {

/// Splats as points whose fragments keep within the disc: the same discs, colours and depths that
/// the visibility rasterizer draws (visibility/cpu/splat.hpp). Of two at one depth the earlier one
/// is seen there and the later one here. A disc wider than the driver's largest point is cut to it
/// (255 px with llvmpipe).
/// Needs the bound context in every call.
class SplatPass {
 public:
  /// Before the context goes.
  void release();

  /// Compiles the program for so many samples a pixel. Internal with what the driver said.
  absl::Status prepare(int samples);

  /// The frame's splats. ResourceExhausted for more than a draw takes.
  absl::Status stage(std::span<const Splat> splats);

  /// @param instance_count  V: splats of others have no tints.
  void set_view(const glm::mat3& view_from_relative, float px_per_tangent, std::uint32_t width_px,
                std::uint32_t height_px, std::size_t instance_count) const;

  /// Draws them; the frame's uniforms and instances are bound (shaders.cpp).
  void draw() const;

 private:
  std::uint32_t program_ = 0, array_ = 0;
  MappedBuffer buffer_;
  std::size_t count_ = 0;
};

}  // namespace throng::render::gl
