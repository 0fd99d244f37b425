#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "bench/experiments/machine.hpp"
#include "throng/render/frame.hpp"

namespace throng::bench {

/// What all experiments share.
struct Common {
  Machine machine;
  std::shared_ptr<const render::Cast> cast;
  render::Viewport viewport;
  unsigned threads = 0;
  std::string json;  // file, empty: none
};

/// What crosses from compute to the rasterizer.
struct Form {
  const char* name;
  render::GeometryKind geometry;
  render::PoseMode pose;
  render::FormRule rule = render::FormRule::kMesh;
  float error_px = 0.5F;   // of kMixed
  float point_px = 1.25F;  // of kPoints
  std::uint32_t oversampling = 1;
};
/// The published method: each agent in its own pose, all of them in one batched buffer.
inline constexpr Form kBatched{"batched, exact", render::GeometryKind::kBatched,
                               render::PoseMode::kExact};
/// What throng does where the rasterizer takes it: far agents share posed meshes.
inline constexpr Form kFused{"fused, shared", render::GeometryKind::kFused,
                             render::PoseMode::kShared};

struct PaperOptions {
  std::uint32_t agents = 30000;
  std::vector<double> budgets_million{1, 5, 10, 15, 20};
  std::uint32_t frames = 100;  // of the walkthrough's 1,000, evenly spread
  render::BackendKind compute = render::BackendKind::kCpu;
  render::RasterKind raster = render::RasterKind::kVisibility;
  std::vector<Form> forms{kFused, kBatched};
  render::LodRule lod = render::LodRule::kDong2019;
  std::uint32_t quality_places = 0;  // of the walkthrough where quality is judged as well
  bool equal_triangles = true;       // also at the triangles of the paper's rows
  std::string camera_path;           // file, empty: the walkthrough that comes with the bench
  // figure 5: who chooses the levels, and from where they are looked at (empty: the bench's own)
  std::string selection_camera, reference_camera;
  std::string output = "figure5.png";
  // figure 7
  std::vector<std::uint32_t> counts{1000, 2000, 5000, 10000, 20000};
  std::string pictures;  // folder, empty: none
};

struct RasterOptions {
  std::uint32_t pairs = 9;
  unsigned gl_samples = 1;  // a pixel, of what is timed: 1 (then edges are smoothed) or 4
  double scale = 1.0;       // of the instances, for tests
  std::string pictures;     // folder for the pictures that are compared, empty: none
};

struct PengOptions {
  std::uint32_t frames = 5;
  std::uint32_t most = 32768;  // rows with more instances are left out
  std::string pictures;        // folder, empty: none
};

struct BeaccoOptions {
  std::vector<std::uint32_t> counts{50, 100, 250, 500, 1000, 2000, 5000};
  std::uint32_t frames = 3;
  std::string pictures;  // folder, empty: none
};

/// From where a crowd is looked at: along the walkthrough, through the eyes of somebody in it, or
/// all of it from above.
enum class Place { kWalkthrough, kStreet, kAbove };

struct MixedOptions {
  std::vector<std::uint32_t> counts{1000, 10'000, 100'000};
  std::vector<Place> places{Place::kStreet, Place::kAbove};
  std::vector<double> points_px{1.0, 2.0};
  std::uint32_t repeats = 3;  // of each frame; its time is the least
  std::vector<double> budgets_million{0.5, 1, 2, 4};
  std::vector<double> errors_px{0.15, 0.25, 0.35, 0.5};
  std::vector<std::uint32_t> oversampling{1, 2};  // of every form
  std::uint32_t frames = 2;                       // of the walkthrough, two consecutive ones each
  std::string pictures;                           // folder, empty: none
};

struct QualityOptions {
  std::uint32_t agents = 1000;
  std::vector<double> budgets_million{0.1, 0.25, 0.5, 1, 2};
  std::uint32_t places = 4;  // of the walkthrough, two consecutive frames each
  render::RasterKind raster = render::RasterKind::kVisibility;
  std::vector<Form> forms{kFused, kBatched};
  render::LodRule lod = render::LodRule::kBudget;
  bool shadows = true;
  std::string pictures;  // folder, empty: none
  std::string camera_path;
};

struct LarkinOptions {
  std::vector<std::uint32_t> counts{10'000, 30'000, 100'000, 300'000, 1'000'000};
  std::uint64_t points = 200'000;  // budget
  std::uint32_t frames = 5;
  std::uint32_t quality_agents = 10'000;  // 0: quality is not judged
  std::vector<std::uint64_t> quality_points{25'000, 50'000, 100'000, 200'000};
  std::string pictures;  // folder, empty: none
};

struct SfsmOptions {
  std::uint32_t agents = 20'000;
  std::uint32_t frames = 60;  // of each of the two experiments
  double view_share = 0.095;  // target of the changing views, of the State-0 time
  std::string pictures;       // folder, empty: none
};

struct GpuOptions {
  std::uint32_t draws = 20;
  std::string camera_path;                // file, empty: the walkthrough that comes with the bench
  std::vector<std::string> trajectories;  // files: only their crowds are drawn
  std::uint32_t most_agents = 1'000'000;  // larger crowds are left out
};

/// Every experiment, short enough for all of them to end within ten minutes on two cores.
/// @param folder  of the JSON files, one for each experiment.
absl::Status run_all(const Common& common, const std::string& folder);

/// Dong & Peng 2019, table 2.
absl::Status run_paper(const Common& common, const PaperOptions& options);

/// Its figure 5: levels chosen by one camera, drawn from another.
absl::Status run_figure5(const Common& common, const PaperOptions& options);

/// Its figure 7: frame rate over the number of instances, against instancing.
absl::Status run_figure7(const Common& common, const PaperOptions& options);

/// Peng et al. 2011, tables 1 and 2 and figure 5.
absl::Status run_peng2011(const Common& common, const PengOptions& options);

/// Beacco 2010: figures 4.1, 4.2, 4.7, 4.8 and 4.9.
absl::Status run_beacco2010(const Common& common, const BeaccoOptions& options);

/// The mixed frame against every single form, by SSIM, flicker and CPU time.
absl::Status run_mixed(const Common& common, const MixedOptions& options);

/// PSNR, SSIM and flicker of budgets (design: quality is measured).
absl::Status run_quality(const Common& common, const QualityOptions& options);

/// Larkin et al.: a far crowd under a fixed budget of points.
absl::Status run_larkin(const Common& common, const LarkinOptions& options);

/// Lyu et al.: controllers under targets that change and in views that do.
absl::Status run_sfsm(const Common& common, const SfsmOptions& options);

/// Visibility against gl on identical buffers. DataLoss when pictures differ beyond the limits.
absl::Status run_raster(const Common& common, const RasterOptions& options);

/// The rasterizer on a CUDA device, and the device's own rates. Unavailable without one.
absl::Status run_gpu(const Common& common, const GpuOptions& options);

}  // namespace throng::bench
