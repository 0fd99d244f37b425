#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <string>
#include <vector>

#include "throng/render/asset.hpp"
#include "throng/render/camera.hpp"
#include "throng/render/color_map.hpp"
#include "throng/render/compute.hpp"
#include "throng/render/picture.hpp"
#include "throng/render/relief_box.hpp"

namespace throng::render {

/// kAuto: visibility where the geometry is made by cuda, gl where EGL offers a GPU, else
/// visibility; `RasterInfo::detail` says why.
enum class RasterKind { kAuto, kGl, kVisibility };

/// What a scene looks like beside its agents. Colours are linear.
struct Look {
  glm::vec3 sun_direction_world{0.45F, -0.55F, 0.70F};  // towards the sun, need not be unit length
  glm::vec3 sun_color{2.60F, 2.40F, 2.05F};
  glm::vec3 sky_color{0.45F, 0.60F, 0.92F};     // light from above, and the background's zenith
  glm::vec3 ground_light{0.26F, 0.24F, 0.21F};  // light from below
  glm::vec3 horizon_color{0.84F, 0.92F, 1.00F};
  glm::vec3 ground_color{0.245F, 0.240F, 0.230F};
  bool ground = true;   // plane z = 0 (of the crowd's origin) with a metre grid
  bool shadows = true;  // contact shadows
  float channel_low = 0.0F, channel_high = 1.0F;  // range of the channel's colours
  ColorMap color_map = ColorMap::kViridis;
  bool color_by_channel = false;
  ReliefSearch relief_search;
};

struct RasterInfo {
  std::string name;    // "gl (Mesa llvmpipe, EGL surfaceless)"
  std::string detail;  // vendor, renderer, version
};

/// Counters of the last frame. An instance counts once for each tile it may be seen in.
struct RasterCounters {
  std::uint64_t drawn = 0;       // instances
  std::uint64_t hidden = 0;      // instances not drawn: behind nearer ones
  std::uint64_t triangles = 0;   // looked at
  std::uint64_t surviving = 0;   // that face the eye and may cover a sample
  std::uint64_t shaded = 0;      // pixels of figures, once for each instance seen in them
  std::uint64_t size_bytes = 0;  // memory of the rasterizer, textures included
  double device_ms = 0;          // from the geometry to the picture, on a device that counts it
  // of it: who casts shadows, and those; all triangles; shading
  double device_shadows_ms = 0, device_triangles_ms = 0, device_resolve_ms = 0;
};

/// Pixels, inclusive; x_low > x_high: none.
struct PixelBox {
  std::int32_t x_low = 0, y_low = 0, x_high = -1, y_high = -1;
};

/// What each pixel shows beside its colour, rows from the top. Of a pixel's samples the instance
/// that most of them show decides, and of equals the nearer one, so masks never overlap.
struct PixelFacts {
  static constexpr std::uint32_t kNothing = 0xffffffffU;
  std::vector<float> depth;             // [height][width] of clip space, reversed; 0: nothing
  std::vector<std::uint32_t> instance;  // [height][width] of FrameGeometry::instances
  std::vector<PixelBox> bounds;         // [V] the picture's part that an instance stays within
};

/// Rasterization and shading of a frame. Not thread safe: one render loop owns it, and a GL context
/// stays on the thread that first drew.
class Rasterizer {
 public:
  virtual ~Rasterizer() = default;
  virtual RasterInfo info() const = 0;

  /// All 0 where the rasterizer doesn't count.
  virtual RasterCounters counters() const { return {}; }

  /// True where fused geometry can be drawn.
  virtual bool takes_fused() const { return false; }

  /// The draws that follow also fill `facts`; null: no longer. Unimplemented by a rasterizer that
  /// can't.
  virtual absl::Status keep_facts(PixelFacts* facts) {
    return facts == nullptr
               ? absl::OkStatus()
               : absl::UnimplementedError("keep_facts: this rasterizer draws colours only");
  }

  /// True where geometry is drawn from the memory of a CUDA device (FrameGeometry::on_device).
  virtual bool takes_device() const { return false; }

  /// True where agents can be drawn as this.
  virtual bool draws(Representation form) const { return form <= Representation::kMesh; }

  /// Textures of the cast, once.
  virtual absl::Status upload(std::shared_ptr<const Cast> cast) = 0;

  /// Draws the geometry seen by `camera`; `picture` is resized to the viewport. Batched geometry is
  /// taken by every rasterizer, fused geometry where `takes_fused()`; both show the same picture.
  /// @param ground_relative_m  height of the ground plane relative to the eye.
  /// InvalidArgument for a viewport outside 1..16384 px, ResourceExhausted, Internal (driver).
  virtual absl::Status draw(const FrameGeometry& geometry, const Camera& camera,
                            const Viewport& viewport, const glm::dvec3& origin_world,
                            const Look& look, Picture& picture) = 0;
};

/// Unavailable with the reason (which EGL platforms were tried and what each said).
/// @param compute  where the geometry is made: kVisibility draws it there.
absl::StatusOr<std::unique_ptr<Rasterizer>> make_rasterizer(
    RasterKind kind, unsigned threads = 0, BackendKind compute = BackendKind::kCpu);

/// What EGL can do on this machine, a line for each platform and device tried. For `throng doctor`.
std::vector<std::string> describe_egl();

}  // namespace throng::render
