#pragma once

#include <absl/status/status.h>

#include <cstdint>
#include <vector>

#include "render/raster/visibility/cpu/relief.hpp"
#include "throng/render/raster.hpp"

namespace throng::render::gl {

/// Relief impostors as boxes whose fragments search for the surface (Beacco 2010, appendix A and
/// B). The vertex shader moves the boxes by the joints' matrices, as they come with the frame.
/// Needs the bound context in every call.
class ReliefPass {
 public:
  ~ReliefPass() = default;  // `release` first
  void release();

  /// Compiles the program. Internal with what the driver said.
  absl::Status prepare();

  /// Boxes and texels of the cast. ResourceExhausted beyond what a storage block holds.
  absl::Status upload(const Cast& cast);

  /// The frame's boxes and joints.
  absl::Status stage(const FrameGeometry& geometry, float px_per_tangent, bool orthographic);

  /// Draws them; the frame's uniforms and instances are bound (shaders.cpp).
  void draw(const ReliefSearch& search) const;

 private:
  struct DrawnBox {
    std::uint32_t instance, box, first_joint;
    float px_per_m;
    float cosine_scale, sine_scale, scale, reserved;
  };
  static_assert(sizeof(DrawnBox) == 32);

  std::vector<visibility::ReliefStore::Member> members_;
  std::uint32_t program_ = 0, array_ = 0;
  std::uint32_t boxes_ = 0, shape_ = 0, base_ = 0, regions_ = 0;  // of the cast
  std::uint32_t drawn_ = 0, joints_ = 0;                          // of the frame
  std::vector<DrawnBox> staged_;
};

}  // namespace throng::render::gl
