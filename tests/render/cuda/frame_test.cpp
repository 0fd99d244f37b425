// Whole frames by CUDA: the same decisions, vertices and pictures as by the processor's own backend
// and rasterizer: geometry bit for bit, pictures but for rounding. Compiled twice: with the sources
// compiled for the processor, and for a device (skipped, with the reason, where there is none).
#include <gtest/gtest.h>

#include <cstring>

#include "render/cuda/frame_scene.hpp"
#include "throng/render/device_picture.hpp"
#if THRONG_CUDA_ON_HOST
#include <cuda_runtime_api.h>

#include "render/compute/cuda/memory.hpp"
#endif

namespace throng::render {
namespace {

using namespace test::cuda_frame;

template <typename T>
void expect_same_bytes(std::span<const T> cpu, std::span<const T> cuda, const char* what) {
  ASSERT_EQ(cpu.size(), cuda.size()) << what;
  for (std::size_t i = 0; i < cpu.size(); ++i) {
    ASSERT_EQ(std::memcmp(&cpu[i], &cuda[i], sizeof(T)), 0) << what << ", element " << i;
  }
}

/// Posed meshes lie anywhere; what is in them is the same.
void expect_same_posed(const FrameGeometry& cpu, const FrameGeometry& cuda) {
  ASSERT_EQ(cpu.shared.size(), cuda.shared.size());
  for (std::size_t i = 0; i < cpu.shared.size(); ++i) {
    const SharedInstance& a = cpu.shared[i];
    const SharedInstance& b = cuda.shared[i];
    ASSERT_EQ(a.level, b.level) << i;
    if (a.level == SharedInstance::kOwn) continue;
    ASSERT_EQ(std::memcmp(&a.cosine_scale, &b.cosine_scale, 8), 0) << i;
    const std::uint32_t count = cpu.instances[i].vertex_count;
    for (std::uint32_t column = 0; column < 4; ++column) {
      ASSERT_EQ(std::memcmp(cpu.posed + a.posed + kPosedHeader + column * a.stride,
                            cuda.posed + b.posed + kPosedHeader + column * b.stride,
                            sizeof(float) * count),
                0)
          << "column " << column << " of instance " << i;
    }
  }
}

class CudaFrameTest : public testing::TestWithParam<Scene> {
 protected:
  void SetUp() override { THRONG_SKIP_WITHOUT_CUDA(); }
};

TEST_P(CudaFrameTest, IsTheProcessorsPicture) {
  const Scene& scene = GetParam();
  Surroundings surroundings;
  const auto cast = cast_of(scene, surroundings);
  const auto crowd = crowd_of(scene, cast);
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  for (Renderer* renderer : {&cpu, &cuda}) {
    ASSERT_TRUE(renderer->upload(cast).ok());
    const absl::Status status = generate(*renderer, scene, *crowd, surroundings);
    ASSERT_TRUE(status.ok()) << status;
  }
  Picture expected, actual, through_host;
  const FrameGeometry geometry = cpu.backend->geometry(*cpu.view);
  ASSERT_TRUE(draw(cpu, geometry, scene, expected).ok());
  const FrameGeometry frame = cuda.backend->geometry(*cuda.view);
  ASSERT_NE(frame.on_device, nullptr);
  absl::Status status = draw(cuda, frame, scene, actual);
  ASSERT_TRUE(status.ok()) << status;
  expect_same_picture(expected, actual);
  EXPECT_EQ(cpu.backend->counters(*cpu.view).visible > 0, scene.agents > 0);
  if (scene.geometry == GeometryKind::kBatched) {  // the processor's geometry drawn by CUDA
    status = draw(cuda, geometry, scene, through_host);
    ASSERT_TRUE(status.ok()) << status;
    expect_same_picture(expected, through_host);
  }
  // and what CUDA decided, read back
  cuda.on_device = false;
  status = generate(cuda, scene, *crowd, surroundings);
  ASSERT_TRUE(status.ok()) << status;
  const FrameGeometry read = cuda.backend->geometry(*cuda.view);
  expect_same_bytes(geometry.instances, read.instances, "visible instances");
  expect_same_bytes(geometry.vertex_offset, read.vertex_offset, "vertex offsets");
  expect_same_bytes(geometry.triangle_offset, read.triangle_offset, "triangle offsets");
  expect_same_bytes(geometry.vertices, read.vertices, "vertices");
  expect_same_bytes(geometry.indices, read.indices, "indices");
  expect_same_posed(geometry, read);
  EXPECT_EQ(cpu.backend->counters(*cpu.view).shared_poses,
            cuda.backend->counters(*cuda.view).shared_poses);
  if (read.shared.empty()) return;
  // and drawn by the processor
  status = draw(cpu, read, scene, through_host);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(through_host.rgbx, expected.rgbx);
}

TEST_P(CudaFrameTest, TellsWhatEachPixelShowsAsTheProcessor) {
  const Scene& scene = GetParam();
  Surroundings surroundings;
  const auto cast = cast_of(scene, surroundings);
  const auto crowd = crowd_of(scene, cast);
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  PixelFacts expected, actual;
  for (Renderer* renderer : {&cpu, &cuda}) {
    ASSERT_TRUE(renderer->upload(cast).ok());
    ASSERT_TRUE(generate(*renderer, scene, *crowd, surroundings).ok());
    ASSERT_TRUE(renderer->rasterizer->keep_facts(renderer == &cpu ? &expected : &actual).ok());
    Picture picture;
    const FrameGeometry geometry = renderer->backend->geometry(*renderer->view);
    const absl::Status status = draw(*renderer, geometry, scene, picture);
    ASSERT_TRUE(status.ok()) << status;
  }
  EXPECT_EQ(expected.depth, actual.depth);
  EXPECT_EQ(expected.instance, actual.instance);
  ASSERT_EQ(expected.bounds.size(), actual.bounds.size());
  for (std::size_t pixel = 0; pixel < actual.instance.size(); ++pixel) {
    if (actual.instance[pixel] == PixelFacts::kNothing) continue;
    const PixelBox& box = actual.bounds[actual.instance[pixel]];
    const auto x = static_cast<std::int32_t>(pixel % scene.viewport.width_px);
    const auto y = static_cast<std::int32_t>(pixel / scene.viewport.width_px);
    ASSERT_TRUE(box.x_low <= x && x <= box.x_high && box.y_low <= y && y <= box.y_high)
        << "pixel " << x << ", " << y;
  }
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, CudaFrameTest,
    testing::Values(Scene{.name = "Nobody"}, Scene{.name = "Crowd", .agents = 60},
                    Scene{.name = "Close",
                          .agents = 60,
                          .side_m = 8,
                          .camera = {.eye_world = {0, 0, 1.6}, .target_world = {3, 1, 1}}},
                    Scene{.name = "Far",
                          .agents = 150,
                          .side_m = 60,
                          .camera = {.eye_world = {0, -90, 30}, .target_world = {0, 0, 0}},
                          .vertex_budget = 10'000},
                    Scene{.name = "Orthographic",
                          .agents = 60,
                          .camera = {.eye_world = {5, -20, 25},
                                     .target_world = {0, 0, 0},
                                     .ortho_height_m = 18}},
                    Scene{.name = "Colors", .agents = 40, .colors = true},
                    Scene{.name = "NoShadows", .agents = 40, .shadows = false},
                    Scene{.name = "Walls", .agents = 60, .side_m = 10, .walls = true},
                    Scene{.name = "AtTheEnd",
                          .agents = 40,
                          .side_m = 6,
                          .walls = true,
                          .colors = true,
                          .time_us = 100'000}),
    scene_name);

constexpr PoseMode kShared = PoseMode::kShared;
constexpr GeometryKind kFused = GeometryKind::kFused;
INSTANTIATE_TEST_SUITE_P(
    SharedPoses, CudaFrameTest,
    testing::Values(Scene{.name = "SharedNobody", .pose_mode = kShared, .geometry = kFused},
                    Scene{.name = "SharedBatched", .agents = 60, .pose_mode = kShared},
                    Scene{.name = "ExactFused", .agents = 40, .geometry = kFused},
                    Scene{.name = "SharedClose",
                          .agents = 60,
                          .side_m = 8,
                          .camera = {.eye_world = {0, 0, 1.6}, .target_world = {3, 1, 1}},
                          .pose_mode = kShared,
                          .geometry = kFused},
                    Scene{.name = "SharedFar",
                          .agents = 250,
                          .side_m = 60,
                          .camera = {.eye_world = {0, -90, 30}, .target_world = {0, 0, 0}},
                          .vertex_budget = 10'000,
                          .pose_mode = kShared,
                          .geometry = kFused},
                    Scene{.name = "SharedOrthographic",
                          .agents = 60,
                          .camera = {.eye_world = {5, -20, 25},
                                     .target_world = {0, 0, 0},
                                     .ortho_height_m = 18},
                          .colors = true,
                          .pose_mode = kShared,
                          .geometry = kFused},
                    Scene{.name = "SharedWalls",
                          .agents = 60,
                          .side_m = 14,
                          .walls = true,
                          .pose_mode = kShared,
                          .geometry = kFused}),
    scene_name);

TEST_F(CudaFrameTest, LeavesPicturesOnTheDeviceUntilTheyAreFetched) {
  const Scene scene{.agents = 40};
  Renderer cuda = Renderer::on_cuda();
  ASSERT_NO_FATAL_FAILURE(generate_alone(cuda, scene));
  const FrameGeometry geometry = cuda.backend->geometry(*cuda.view);
  Picture expected;
  ASSERT_TRUE(draw(cuda, geometry, scene, expected).ok());
  // two are under way while a third is drawn; they outlive who drew them
  Picture pictures[3];
  for (Picture& picture : pictures) {
    picture.may_stay = true;
    const absl::Status status = draw(cuda, geometry, scene, picture);
    ASSERT_TRUE(status.ok()) << status;
    ASSERT_NE(picture.on_device, nullptr);
    EXPECT_TRUE(picture.rgbx.empty());
  }
  cuda.rasterizer.reset();
  for (Picture& picture : pictures) {
    const absl::Status status = picture.on_device->fetch(picture.rgbx);
    ASSERT_TRUE(status.ok()) << status;
    EXPECT_EQ(picture.rgbx, expected.rgbx);
    std::vector<std::uint8_t> jpeg;
    const absl::Status encoded = picture.on_device->encode_jpeg(80, jpeg);
    EXPECT_TRUE(encoded.ok() || absl::IsUnimplemented(encoded)) << encoded;
    EXPECT_EQ(encoded.ok(), !jpeg.empty());
  }
}

TEST_F(CudaFrameTest, KeepsPosedMeshesFromFrameToFrame) {
  Scene scene{.agents = 80, .pose_mode = kShared, .geometry = kFused};
  Surroundings none;
  const auto cast = cast_of(scene, none);
  const auto crowd = crowd_of(scene, cast);
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  ASSERT_TRUE(cpu.upload(cast).ok());
  ASSERT_TRUE(cuda.upload(cast).ok());
  // forth and back: nothing new the second time; finer levels replace coarser ones
  std::uint32_t made[4];
  int frame = 0;
  for (const std::uint64_t budget : {1'500, 1'500, 6'000, 1'500}) {
    scene.vertex_budget = budget;
    for (Renderer* renderer : {&cpu, &cuda}) {
      const absl::Status status = generate(*renderer, scene, *crowd, none);
      ASSERT_TRUE(status.ok()) << status;
    }
    made[frame++] = cuda.backend->counters(*cuda.view).posed_meshes;
    Picture expected, actual;
    ASSERT_TRUE(draw(cpu, cpu.backend->geometry(*cpu.view), scene, expected).ok());
    ASSERT_TRUE(draw(cuda, cuda.backend->geometry(*cuda.view), scene, actual).ok());
    expect_same_picture(expected, actual);
  }
  EXPECT_GT(made[0], 0U);
  EXPECT_EQ(made[1], 0U);
  EXPECT_GT(made[2], 0U);
  EXPECT_EQ(made[3], 0U);
}

TEST_F(CudaFrameTest, HoldsPosesAsTheProcessor) {
  Scene scene{.agents = 80, .side_m = 40};
  Surroundings none;
  const auto cast = cast_of(scene, none);
  const auto crowd = crowd_of(scene, cast);
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  cuda.on_device = false;
  ASSERT_TRUE(cpu.upload(cast).ok());
  ASSERT_TRUE(cuda.upload(cast).ok());
  std::uint32_t held = 0, held_before = 0;
  for (std::uint64_t frame = 0; frame < 6; ++frame) {
    scene.time_us = 10'000 + 18'000 * static_cast<std::int64_t>(frame);
    // one frame of all poses in between
    scene.motion = {.distance_m = frame == 3 ? 0.0F : 8.0F, .k_per_m = 0.3F, .frame = frame};
    for (Renderer* renderer : {&cpu, &cuda}) {
      const absl::Status status = generate(*renderer, scene, *crowd, none);
      ASSERT_TRUE(status.ok()) << status;
    }
    const FrameGeometry expected = cpu.backend->geometry(*cpu.view);
    const FrameGeometry actual = cuda.backend->geometry(*cuda.view);
    expect_same_bytes(expected.vertices, actual.vertices, "vertices");
    expect_same_bytes(expected.indices, actual.indices, "indices");
    EXPECT_EQ(cuda.backend->counters(*cuda.view).held_poses, held_before);
    held_before = cpu.backend->counters(*cpu.view).held_poses;
    held += held_before;
  }
  EXPECT_GT(held, 20U);
}

TEST_F(CudaFrameTest, CullsWhoBelongsToTheFarCrowd) {
  const Scene scene{.agents = 80, .side_m = 40};
  Surroundings none;
  const auto cast = cast_of(scene, none);
  const auto crowd = crowd_of(scene, cast);
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  cuda.on_device = false;
  for (Renderer* renderer : {&cpu, &cuda}) {
    ASSERT_TRUE(renderer->upload(cast).ok());
    renderer->view->far_m = 15.0F;
    ASSERT_TRUE(generate(*renderer, scene, *crowd, none).ok());
  }
  const FrameGeometry expected = cpu.backend->geometry(*cpu.view);
  ASSERT_GT(expected.instances.size(), 5U);
  expect_same_bytes(expected.instances, cuda.backend->geometry(*cuda.view).instances, "instances");
}

TEST_F(CudaFrameTest, RefusesWhatItCanNotDraw) {
  const Scene scene{.agents = 5};
  Surroundings none;
  const auto cast = cast_of(scene, none);
  Renderer cuda = Renderer::on_cuda();
  Picture picture;
  EXPECT_EQ(draw(cuda, {}, scene, picture).code(), absl::StatusCode::kFailedPrecondition);
  ASSERT_TRUE(cuda.upload(cast).ok());
  Scene huge = scene;
  huge.viewport = {20'000, 10};
  EXPECT_EQ(draw(cuda, {}, huge, picture).code(), absl::StatusCode::kInvalidArgument);
  struct Other : DeviceGeometry {
  } other;
  FrameGeometry geometry;
  geometry.on_device = &other;
  EXPECT_EQ(draw(cuda, geometry, scene, picture).code(), absl::StatusCode::kInvalidArgument);
}

#if THRONG_CUDA_ON_HOST  // a device can't be asked to fail

class CudaFaultTest : public CudaFrameTest {
 protected:
  void TearDown() override { faults = {}; }
  test::cuda_on_host::Faults& faults = test::cuda_on_host::faults;
};

TEST_F(CudaFaultTest, MakesItsGraphsAnewOnlyWhereTheyHaveOtherNodes) {
  Scene scene{.agents = 40, .pose_mode = kShared, .geometry = kFused};
  Surroundings none;
  const auto cast = cast_of(scene, none);
  const auto crowd = crowd_of(scene, cast);
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  ASSERT_TRUE(cpu.upload(cast).ok());
  ASSERT_TRUE(cuda.upload(cast).ok());
  int& made = test::cuda_on_host::graphs_made;
  int& updated = test::cuda_on_host::graphs_updated;
  const auto frame = [&](int expected_made, int expected_updated) {
    made = updated = 0;
    Picture expected, actual;
    ASSERT_TRUE(generate(cpu, scene, *crowd, none).ok());
    ASSERT_TRUE(generate(cuda, scene, *crowd, none).ok());
    ASSERT_TRUE(draw(cpu, cpu.backend->geometry(*cpu.view), scene, expected).ok());
    ASSERT_TRUE(draw(cuda, cuda.backend->geometry(*cuda.view), scene, actual).ok());
    expect_same_picture(expected, actual);
    EXPECT_EQ(made, expected_made);
    EXPECT_EQ(updated, expected_updated);
  };
  frame(0, 0);  // launched one by one
  frame(2, 0);  // stages, rasterizer
  scene.camera.eye_world.x = 2.0;
  scene.vertex_budget = 8'000;
  frame(0, 2);  // the same kernels with other arguments
  scene.shadows = false;
  frame(1, 1);
  frame(0, 2);
  scene.form = FormRule::kMixed;
  frame(2, 0);  // other kernels select, and the rasterizer looks for impostors
}

TEST_F(CudaFaultTest, TellsWhatIsMissing) {
  struct Case {
    cudaError_t devices;
    int driver;
    const char* remedy;
  };
  for (const Case& one : {Case{cudaErrorNoDevice, 13000, "nvidia-smi"},
                          Case{cudaErrorInsufficientDriver, 0, "there is no driver"},
                          Case{cudaErrorInsufficientDriver, 12040, "update it"},
                          Case{cudaErrorSystemNotReady, 13000, "nvidia-fabricmanager"},
                          Case{cudaErrorSystemDriverMismatch, 13000, "of different versions"}}) {
    faults = {.devices = one.devices, .driver = one.driver};
    const auto backend = make_cuda_backend();
    EXPECT_EQ(backend.status().code(), absl::StatusCode::kUnavailable);
    const auto rasterizer = visibility::make_cuda_rasterizer();
    EXPECT_EQ(rasterizer.status().code(), absl::StatusCode::kUnavailable);
    for (const absl::Status& status : {backend.status(), rasterizer.status()}) {
      EXPECT_NE(status.message().find(one.remedy), std::string::npos) << status;
    }
  }
  // built for other devices: the first kernel tells
  faults = {.launch = cudaErrorNoKernelImageForDevice};
  const auto backend = make_cuda_backend();
  EXPECT_EQ(backend.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_NE(backend.status().message().find("CMAKE_CUDA_ARCHITECTURES"), std::string::npos)
      << backend.status();
  faults = {.launch = cudaErrorDevicesUnavailable};
  const auto rasterizer = visibility::make_cuda_rasterizer();
  EXPECT_NE(rasterizer.status().message().find("another process"), std::string::npos)
      << rasterizer.status();
}

TEST_F(CudaFaultTest, RunsOutOfMemoryWithoutLosingTheRest) {
  const Scene scene{.agents = 50};
  Renderer cuda = Renderer::on_cuda();
  ASSERT_NO_FATAL_FAILURE(generate_alone(cuda, scene));
  Picture picture;
  faults.most_bytes = 1000;
  const absl::Status full = draw(cuda, cuda.backend->geometry(*cuda.view), scene, picture);
  EXPECT_EQ(full.code(), absl::StatusCode::kResourceExhausted) << full;
  faults = {};
  const absl::Status again = draw(cuda, cuda.backend->geometry(*cuda.view), scene, picture);
  EXPECT_TRUE(again.ok()) << again;
}

TEST_F(CudaFaultTest, HoldsNoPoseOfAFrameThatWasLeftHalfWay) {
  Scene scene{.agents = 80, .side_m = 40, .time_us = 10'000};
  scene.motion = {.distance_m = 1.0F, .k_per_m = 10.0F};
  Surroundings none;
  const auto cast = cast_of(scene, none);
  const auto crowd = crowd_of(scene, cast);
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  cuda.on_device = false;
  ASSERT_TRUE(cpu.upload(cast).ok());
  ASSERT_TRUE(cuda.upload(cast).ok());
  ASSERT_TRUE(generate(cuda, scene, *crowd, none).ok());
  const std::size_t vertices = cuda.backend->geometry(*cuda.view).vertices.size();
  faults.most_bytes = vertices * sizeof(BatchVertex) - 1;
  EXPECT_EQ(generate(cuda, scene, *crowd, none).code(), absl::StatusCode::kResourceExhausted);
  faults = {};
  // nothing is there of the frame before: every pose is made anew
  ASSERT_TRUE(generate(cuda, scene, *crowd, none).ok());
  scene.motion = {};
  ASSERT_TRUE(generate(cpu, scene, *crowd, none).ok());
  expect_same_bytes(cpu.backend->geometry(*cpu.view).vertices,
                    cuda.backend->geometry(*cuda.view).vertices, "vertices");
}

TEST_F(CudaFaultTest, ACrowdWithoutRoomLeavesItToOthers) {
  const Scene small{.agents = 20};
  Scene large = small;
  large.agents = 2'000;
  Surroundings none;
  const auto cast = cast_of(small, none);
  const auto few = crowd_of(small, cast), many = crowd_of(large, cast);
  Renderer cuda = Renderer::on_cuda();
  ASSERT_TRUE(cuda.upload(cast).ok());
  ASSERT_TRUE(generate(cuda, small, *few, none).ok());
  const std::uint64_t held_bytes = render::cuda::device_memory_held();
  // wherever it is that there is no more
  int refused = 0;
  for (std::uint64_t more = 400'000; more < 20'000'000; more += 200'000) {
    render::cuda::limit_device_memory(held_bytes + more);
    const absl::Status status = generate(cuda, large, *many, none);
    render::cuda::limit_device_memory(UINT64_MAX);
    if (status.ok()) break;
    EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
    EXPECT_LT(render::cuda::device_memory_held(), held_bytes + 100'000) << status;  // the roster
    ++refused;
    ASSERT_TRUE(generate(cuda, small, *few, none).ok());
  }
  EXPECT_GT(refused, 3);
  EXPECT_LT(refused, 90);
}

TEST_F(CudaFaultTest, DrawsNothingOfACastThatFoundNoMemory) {
  Scene scene{.agents = 5};
  Renderer cuda = Renderer::on_cuda();
  ASSERT_NO_FATAL_FAILURE(generate_alone(cuda, scene));
  const FrameGeometry geometry = cuda.backend->geometry(*cuda.view);
  scene.walls = true;
  Surroundings walls;
  const auto longer = cast_of(scene, walls);
  faults.most_bytes = 10;
  EXPECT_EQ(cuda.rasterizer->upload(longer).code(), absl::StatusCode::kResourceExhausted);
  faults = {};
  Picture picture;
  EXPECT_EQ(draw(cuda, geometry, scene, picture).code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_TRUE(cuda.rasterizer->upload(longer).ok());
  EXPECT_TRUE(draw(cuda, geometry, scene, picture).ok());
}

TEST_F(CudaFaultTest, KeepsToItsLimitOfMemory) {
  const Scene scene{.agents = 50};
  Surroundings none;
  const auto cast = cast_of(scene, none);
  const auto crowd = crowd_of(scene, cast);
  Renderer first = Renderer::on_cuda(), second = Renderer::on_cuda();
  ASSERT_TRUE(first.upload(cast).ok());
  ASSERT_TRUE(generate(first, scene, *crowd, none).ok());
  render::cuda::limit_device_memory(render::cuda::device_memory_held());
  const absl::Status refused = second.upload(cast);
  render::cuda::limit_device_memory(UINT64_MAX);
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted) << refused;
  EXPECT_NE(refused.message().find("--gpu-memory-mib"), std::string::npos) << refused;
  // the others go on, and so does who was refused once there is room
  Picture picture;
  EXPECT_TRUE(draw(first, first.backend->geometry(*first.view), scene, picture).ok());
  EXPECT_TRUE(second.upload(cast).ok());
}

TEST_F(CudaFaultTest, TellsOfAKernelThatWentWrong) {
  const Scene scene{.agents = 5};
  Renderer cuda = Renderer::on_cuda();
  ASSERT_NO_FATAL_FAILURE(generate_alone(cuda, scene));
  Picture picture;
  for (const cudaError_t error :
       {cudaErrorIllegalAddress, cudaErrorLaunchFailure, cudaErrorLaunchTimeout,
        cudaErrorMisalignedAddress, cudaErrorIllegalInstruction, cudaErrorECCUncorrectable}) {
    faults.wait = error;
    const absl::Status status = draw(cuda, cuda.backend->geometry(*cuda.view), scene, picture);
    EXPECT_EQ(status.code(), absl::StatusCode::kInternal) << status;
    EXPECT_NE(status.message().find("must be restarted"), std::string::npos) << status;
  }
  faults = {};
  faults.launch = cudaErrorLaunchFailure;
  EXPECT_EQ(draw(cuda, cuda.backend->geometry(*cuda.view), scene, picture).code(),
            absl::StatusCode::kInternal);
}

#endif

}  // namespace
}  // namespace throng::render
