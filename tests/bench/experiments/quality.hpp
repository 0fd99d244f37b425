#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "bench/experiments/measure.hpp"
#include "bench/experiments/numbers.hpp"
#include "bench/experiments/options.hpp"
#include "bench/experiments/table.hpp"
#include "throng/render/frame.hpp"
#include "throng/render/picture.hpp"

namespace throng::bench {

/// Means over the frames that were judged. `near`: pixels within 8 px of an agent in either
/// picture.
struct Quality {
  Range near_psnr_db, near_ssim, frame_psnr_db, frame_ssim, flicker;
  nlohmann::ordered_json json() const;
};

/// A picture four times as wide and high brought to its size: means of 4x4 pixels in linear light.
/// InvalidArgument when a side is no multiple of 4.
absl::StatusOr<render::Picture> quarter(const render::Picture& picture);

/// Pixels that agents cover at least in part, as 1 and 0 [height][width]: drawn twice on black, lit
/// from two sides.
absl::StatusOr<std::vector<std::uint8_t>> covered_pixels(render::FramePipeline& pipeline,
                                                         const render::Crowd& crowd,
                                                         std::int64_t time_us,
                                                         render::ViewSettings view);

/// The reference of every quality number: each agent at full detail in its own pose, no sharing, no
/// occlusion culling, every pixel a mean of 16 shaded ones (in linear light) of 4 samples each.
/// The processor's visibility rasterizer draws it; it gives the same bytes for every instruction
/// set, the plain one included.
class Reference {
 public:
  static absl::StatusOr<Reference> make(
      std::shared_ptr<const render::Cast> cast, unsigned threads,
      render::RasterKind raster = render::RasterKind::kVisibility);

  struct Frame {
    render::Picture picture;
    std::vector<std::uint8_t> covered;
  };
  /// Where the agents in view at full detail would need over 8 GiB, each is drawn with the fewest
  /// vertices that are off by a 32nd of a pixel at most. ResourceExhausted where those need it too.
  absl::StatusOr<Frame> draw(const render::Crowd& crowd, std::int64_t time_us,
                             const render::ViewSettings& view);

 private:
  std::shared_ptr<const render::Cast> cast_;
  std::shared_ptr<render::FramePipeline> pipeline_;
};

/// Two consecutive frames of one configuration against the reference's.
absl::Status judge(const std::array<Reference::Frame, 2>& frames,
                   const std::array<Reference::Frame, 2>& references, Quality& quality);

/// A way to draw, and what came of it.
struct Judged {
  Form form;
  std::string name;  // of the budget
  std::uint64_t budget = 0;
  Quality quality;
  Measured measured;
};

/// Where ways to draw are judged.
struct Places {
  std::uint32_t agents = 0;
  std::string camera_path;            // empty: the walkthrough that comes with the bench
  std::uint32_t count = 4;            // spread over the walkthrough, two consecutive frames each
  Place place = Place::kWalkthrough;  // else one place
  std::uint32_t repeats = 1;          // of each frame; the one that took least counts
  render::RasterKind raster = render::RasterKind::kVisibility;
  render::LodRule lod = render::LodRule::kBudget;
  render::Look look;
  std::string pictures;  // folder for all that is compared, empty: none
};

/// A camera at a place that is not of the walkthrough.
render::Camera camera_at(Place place, const render::Crowd& crowd, const render::Viewport& viewport);

/// Draws all ways at all places and compares them with the reference.
absl::Status judge_places(const Common& common, const Places& places, std::vector<Judged>& ways);

/// SSIM, PSNR and flicker of each way.
Table quality_table(const std::vector<Judged>& ways);

}  // namespace throng::bench
