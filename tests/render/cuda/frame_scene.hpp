#pragma once

#include <gtest/gtest.h>

#include "render/compute/cuda/cuda_backend.hpp"
#include "render/compute/frame_fixture.hpp"
#include "render/raster/visibility/cuda/cuda_rasterizer.hpp"
#include "throng/render/environment.hpp"
#include "throng/render/raster.hpp"

/// Of a test or its SetUp: skipped, with the reason, where no device runs what was built.
#define THRONG_SKIP_WITHOUT_CUDA()                                         \
  if (auto backend = ::throng::render::make_cuda_backend(); !backend.ok()) \
  GTEST_SKIP() << backend.status().message()

// Frames by CUDA beside the processor's. Compiled for a device, and with the CUDA sources compiled
// for the processor.
namespace throng::test::cuda_frame {

using namespace render;

/// A backend and a rasterizer, driven stage by stage.
struct Renderer {
  std::unique_ptr<ComputeBackend> backend;
  std::unique_ptr<Rasterizer> rasterizer;
  std::unique_ptr<ViewWork> view;
  bool on_device = false;

  static Renderer on_processor() {
    return {make_backend(BackendKind::kCpu, 2).value(),
            make_rasterizer(RasterKind::kVisibility, 2).value(), nullptr, false};
  }
  static Renderer on_cuda() {
    return {make_cuda_backend().value(), visibility::make_cuda_rasterizer().value(), nullptr, true};
  }

  absl::Status upload(const std::shared_ptr<const Cast>& cast) {
    if (absl::Status status = backend->upload(cast); !status.ok()) return status;
    if (absl::Status status = rasterizer->upload(cast); !status.ok()) return status;
    view = backend->make_view().value();
    return absl::OkStatus();
  }
};

struct Scene {
  const char* name = "";
  std::size_t agents = 0;
  double side_m = 20.0;
  Camera camera = {.eye_world = {0, -6, 3}, .target_world = {0, 4, 1}};
  Viewport viewport = {98, 70};  // no multiple of a tile
  std::uint64_t vertex_budget = 40'000;
  bool shadows = true;
  bool walls = false;
  bool colors = false;
  std::int64_t time_us = 50'000;
  PoseMode pose_mode = PoseMode::kExact;
  GeometryKind geometry = GeometryKind::kBatched;
  FormRule form = FormRule::kMesh;
  MixedForms mixed = {};
  MotionUpdate motion = {};
};

inline std::string scene_name(const testing::TestParamInfo<Scene>& info) { return info.param.name; }

/// The cast with walls after it, where the scene has some.
inline std::shared_ptr<const Cast> cast_of(const Scene& scene, Surroundings& surroundings) {
  auto cast = std::make_shared<Cast>(*test::tiny_cast());
  if (!scene.walls) return cast;
  const auto environment =
      make_environment("POLYGON ((-7 -7, 7 -7, 7 7, -7 7, -7 -7), (2 1, 4 1, 4 3, 2 3, 2 1))", {})
          .value();
  surroundings = {static_cast<std::uint32_t>(cast->members.size()),
                  static_cast<std::uint32_t>(environment->pieces.size())};
  for (const Character& piece : environment->pieces) cast->members.push_back({piece, 0.0F, true});
  return cast;
}

inline std::unique_ptr<Crowd> crowd_of(const Scene& scene,
                                       const std::shared_ptr<const Cast>& cast) {
  auto crowd = std::make_unique<Crowd>(cast, CrowdSettings{.channel_names = {"density"}});
  for (int f = 0; f < 2; ++f) {
    std::vector<std::uint64_t> ids;
    AgentFrame frame;
    std::vector<float> density;
    for (std::size_t i = 0; i < scene.agents; ++i) {
      if (f == 1 && i % 7 == 0) continue;  // the roster changes
      ids.push_back(1000 + i);
      const auto place = [&](std::uint64_t k) {
        return static_cast<float>((test::noise(5 * i + k) - 0.5) * scene.side_m + 0.1 * f);
      };
      frame.position_m.emplace_back(place(1), place(2), 0.0F);
      density.push_back(static_cast<float>(test::noise(5 * i + 3)));
    }
    frame.time_us = 100'000 * f;
    frame.membership = test::members(ids, static_cast<std::uint64_t>(f + 1));
    frame.channels.push_back(std::move(density));
    EXPECT_TRUE(crowd->push(frame).ok());
  }
  return crowd;
}

/// All stages up to the geometry.
inline absl::Status generate(Renderer& renderer, const Scene& scene, const Crowd& crowd,
                             Surroundings surroundings) {
  const Bracket bracket = crowd.bracket(scene.time_us);
  ComputeBackend& backend = *renderer.backend;
  auto older = backend.upload(bracket.older), newer = backend.upload(bracket.newer);
  if (!older.ok()) return older.status();
  if (!newer.ok()) return newer.status();
  auto instances = backend.advance(**older, **newer, scene.time_us, crowd.settings(),
                                   scene.colors ? 0 : -1, surroundings);
  if (!instances.ok()) return instances.status();
  absl::Status status = backend.cull(*renderer.view, *instances, scene.camera, scene.viewport);
  Selection selection;
  selection.vertex_budget = scene.vertex_budget;
  selection.on_device = renderer.on_device;
  selection.pose_mode = scene.pose_mode;
  selection.geometry = scene.geometry;
  selection.form = scene.form;
  selection.mixed = scene.mixed;
  selection.motion = scene.motion;
  if (status.ok()) status = backend.select(*renderer.view, selection);
  if (status.ok()) status = backend.allocate(*renderer.view);
  if (status.ok()) status = backend.generate(*renderer.view);
  return status;
}

inline absl::Status draw(Renderer& renderer, const FrameGeometry& geometry, const Scene& scene,
                         Picture& picture) {
  Look look;
  look.shadows = scene.shadows;
  look.color_by_channel = scene.colors;
  return renderer.rasterizer->draw(geometry, scene.camera, scene.viewport, {}, look, picture);
}

/// All stages up to the geometry, of a crowd with nothing around it.
inline void generate_alone(Renderer& renderer, const Scene& scene) {
  Surroundings none;
  const auto cast = cast_of(scene, none);
  const auto crowd = crowd_of(scene, cast);
  ASSERT_TRUE(renderer.upload(cast).ok());
  const absl::Status status = generate(renderer, scene, *crowd, none);
  ASSERT_TRUE(status.ok()) << status;
}

/// The shading of the two is written twice, for vectors and for threads: where samples lie and
/// which triangle they show is the same bit by bit, a colour may round the other way.
inline void expect_same_picture(const Picture& expected, const Picture& actual) {
  constexpr int kMostCodes = 4;
  constexpr double kMostValues = 0.005;
  ASSERT_EQ(expected.rgbx.size(), actual.rgbx.size());
  std::size_t different = 0;
  for (std::size_t i = 0; i < expected.rgbx.size(); ++i) {
    const int codes = std::abs(int{expected.rgbx[i]} - int{actual.rgbx[i]});
    ASSERT_LE(codes, kMostCodes) << "pixel " << i / 4 % expected.width_px << ", "
                                 << i / 4 / expected.width_px << ", channel " << i % 4 << ": "
                                 << int{expected.rgbx[i]} << " and " << int{actual.rgbx[i]};
    different += codes != 0 ? 1 : 0;
  }
  EXPECT_LE(static_cast<double>(different),
            kMostValues * static_cast<double>(expected.rgbx.size()));
}

}  // namespace throng::test::cuda_frame
