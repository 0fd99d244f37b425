// Forms other than meshes by CUDA: the processor's picture of the same geometry.
#include <cstring>

#include "render/cuda/frame_scene.hpp"
#include "simplify/impostor/relief.hpp"
#include "simplify/points/points.hpp"
#include "support/tiny_character.hpp"
#include "throng/render/far_crowd.hpp"
#if THRONG_CUDA_ON_HOST
#include <cuda_runtime_api.h>
#endif

namespace throng::render {
namespace {

using namespace test::cuda_frame;

/// Characters with impostors and points; a third one has neither.
std::shared_ptr<const Cast> cast_with_forms() {
  auto cast = std::make_shared<Cast>(*test::tiny_cast());
  for (float height_m : {1.9F, 1.3F}) {
    test::TinyOptions options;
    options.height_m = height_m;
    CharacterData data = test::make_tiny_character(options);
    simplify::sample_points(data, {.count = 512});
    Character character = make_character(std::move(data)).value();
    character.relief = make_relief(simplify::bake_relief(character).value());
    cast->members.push_back({std::move(character), 2.0F});
  }
  return cast;
}

class CudaFormsTest : public testing::TestWithParam<Scene> {
 protected:
  void SetUp() override { THRONG_SKIP_WITHOUT_CUDA(); }
};

TEST_P(CudaFormsTest, AreTheProcessorsPicture) {
  const Scene& scene = GetParam();
  const auto cast = cast_with_forms();
  const auto crowd = crowd_of(scene, cast);
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  ASSERT_TRUE(cpu.upload(cast).ok());
  ASSERT_TRUE(cuda.upload(cast).ok());
  ASSERT_TRUE(generate(cpu, scene, *crowd, {}).ok());
  const FrameGeometry geometry = cpu.backend->geometry(*cpu.view);
  std::size_t others = 0;
  for (const Representation form : geometry.representation) {
    others += form != Representation::kMesh ? 1 : 0;
  }
  ASSERT_GT(others, 5U);
  PixelFacts facts[2];
  Picture pictures[2];
  for (Renderer* renderer : {&cpu, &cuda}) {
    const std::size_t k = renderer == &cpu ? 0 : 1;
    ASSERT_TRUE(renderer->rasterizer->keep_facts(&facts[k]).ok());
    const absl::Status status = draw(*renderer, geometry, scene, pictures[k]);
    ASSERT_TRUE(status.ok()) << status;
  }
  EXPECT_EQ(facts[0].depth, facts[1].depth);
  EXPECT_EQ(facts[0].instance, facts[1].instance);
  for (std::size_t i = 0; i < others && scene.form == FormRule::kImpostor; ++i) {
    if (geometry.representation[i] != Representation::kImpostor) continue;
    const PixelBox &a = facts[0].bounds[i], &b = facts[1].bounds[i];
    EXPECT_EQ(a.x_low > a.x_high, b.x_low > b.x_high);
    if (a.x_low > a.x_high) continue;
    EXPECT_EQ(a.x_low, b.x_low);
    EXPECT_EQ(a.y_high, b.y_high);
  }
  expect_same_picture(pictures[0], pictures[1]);
}

const Camera kClose{.eye_world = {0, 0, 1.6}, .target_world = {3, 1, 1}};
const Camera kAway{.eye_world = {0, -40, 12}, .target_world = {0, 0, 0}, .fov_y_rad = 0.4};
const Camera kFlat{.eye_world = {5, -20, 25}, .target_world = {0, 0, 0}, .ortho_height_m = 18};
/// Of agents drawn in a form: among others, near, far away in shared poses, orthographic.
std::vector<Scene> scenes_of(FormRule form) {
  return {{.name = "Among", .agents = 50, .form = form},
          {.name = "Close", .agents = 50, .side_m = 8, .camera = kClose, .form = form},
          {.name = "FarInSharedPoses",
           .agents = 80,
           .camera = kAway,
           .pose_mode = PoseMode::kShared,
           .form = form},
          {.name = "Orthographic", .agents = 50, .camera = kFlat, .colors = true, .form = form}};
}
INSTANTIATE_TEST_SUITE_P(Impostors, CudaFormsTest,
                         testing::ValuesIn(scenes_of(FormRule::kImpostor)), scene_name);
INSTANTIATE_TEST_SUITE_P(Points, CudaFormsTest, testing::ValuesIn(scenes_of(FormRule::kPoints)),
                         scene_name);

template <typename T>
void expect_same_bytes(std::span<const T> cpu, std::span<const T> cuda, const char* what) {
  ASSERT_EQ(cpu.size(), cuda.size()) << what;
  for (std::size_t i = 0; i < cpu.size(); ++i) {
    ASSERT_EQ(std::memcmp(&cpu[i], &cuda[i], sizeof(T)), 0) << what << ", element " << i;
  }
}

std::vector<Speck> specks_of(const FrameGeometry& geometry) {
  std::vector<Speck> specks;
  for (const SpeckRun& run : geometry.speck_runs) {
    const auto own = geometry.specks.subspan(run.first, run.count);
    specks.insert(specks.end(), own.begin(), own.end());
  }
  return specks;
}

/// Chosen, posed and drawn by CUDA.
class CudaOwnFormsTest : public CudaFormsTest {};

TEST_P(CudaOwnFormsTest, AreThoseOfTheProcessor) {
  const Scene& scene = GetParam();
  const auto cast = cast_with_forms();
  const auto crowd = crowd_of(scene, cast);
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  Picture expected, actual, handed_over;
  for (Renderer* renderer : {&cpu, &cuda}) {
    ASSERT_TRUE(renderer->upload(cast).ok());
    absl::Status status = generate(*renderer, scene, *crowd, {});
    ASSERT_TRUE(status.ok()) << status;
    status = draw(*renderer, renderer->backend->geometry(*renderer->view), scene,
                  renderer == &cpu ? expected : actual);
    ASSERT_TRUE(status.ok()) << status;
  }
  const FrameGeometry geometry = cpu.backend->geometry(*cpu.view);
  ASSERT_NE(cuda.backend->geometry(*cuda.view).on_device, nullptr);
  expect_same_picture(expected, actual);
  if (geometry.shared.empty()) {
    ASSERT_TRUE(draw(cuda, geometry, scene, handed_over).ok());
    expect_same_picture(expected, handed_over);
  }
  const ComputeCounters counted = cpu.backend->counters(*cpu.view);
  const ComputeCounters counters = cuda.backend->counters(*cuda.view);
  EXPECT_EQ(counted.visible, counters.visible);
  EXPECT_EQ(counted.vertices, counters.vertices);
  EXPECT_EQ(counted.triangles, counters.triangles);
  EXPECT_EQ(counted.effective_budget, counters.effective_budget);
  EXPECT_EQ(counted.shared_poses, counters.shared_poses);
  EXPECT_EQ(counted.farthest_m, counters.farthest_m);
  for (std::uint32_t form = 0; form < kRepresentations; ++form) {
    EXPECT_EQ(counted.drawn_as[form], counters.drawn_as[form]) << form;
  }
  if (scene.form == FormRule::kMixed) {
    EXPECT_GT(counters.drawn_as[static_cast<std::size_t>(Representation::kSpeck)] +
                  counters.drawn_as[static_cast<std::size_t>(Representation::kImpostor)] +
                  counters.drawn_as[static_cast<std::size_t>(Representation::kNone)],
              0U);
  }
  // what was decided, read back
  cuda.on_device = false;
  ASSERT_TRUE(generate(cuda, scene, *crowd, {}).ok());
  const FrameGeometry read = cuda.backend->geometry(*cuda.view);
  expect_same_bytes(geometry.instances, read.instances, "visible instances");
  expect_same_bytes(geometry.representation, read.representation, "representations");
  expect_same_bytes(geometry.splats, read.splats, "splats");
  expect_same_bytes<Speck>(specks_of(geometry), specks_of(read), "specks");
  expect_same_bytes(geometry.vertices, read.vertices, "vertices");
  for (std::size_t i = 0; i < geometry.representation.size(); ++i) {
    if (geometry.representation[i] != Representation::kImpostor) continue;
    const JointedInstance &a = geometry.jointed[i], &b = read.jointed[i];
    ASSERT_EQ(std::memcmp(&a.cosine_scale, &b.cosine_scale, 8), 0);
    const std::size_t joints =
        cast->members[geometry.instances[i].character].character.joint_count();
    for (std::size_t k = 0; k < 16 * joints; ++k) {
      if (k % 4 == 3) continue;
      ASSERT_EQ(geometry.joints[std::size_t{16} * a.first_joint + k],
                read.joints[std::size_t{16} * b.first_joint + k])
          << i;
    }
  }
  // and drawn by the processor
  Picture through_host;
  ASSERT_TRUE(draw(cpu, read, scene, through_host).ok());
  EXPECT_EQ(through_host.rgbx, expected.rgbx);
}

INSTANTIATE_TEST_SUITE_P(Impostors, CudaOwnFormsTest,
                         testing::ValuesIn(scenes_of(FormRule::kImpostor)), scene_name);
INSTANTIATE_TEST_SUITE_P(Points, CudaOwnFormsTest, testing::ValuesIn(scenes_of(FormRule::kPoints)),
                         scene_name);

/// Of the mixed frame: specks alone and before meshes, from above, without images of their own,
/// impostors, and agents that stand for others.
std::vector<Scene> mixed_scenes() {
  Scene scene{.agents = 900,
              .side_m = 120.0,
              .camera = {.eye_world = {0, -70, 9}, .target_world = {0, 0, 0}, .fov_y_rad = 0.9},
              .viewport = {131, 98},
              .pose_mode = PoseMode::kShared,
              .geometry = GeometryKind::kFused,
              .form = FormRule::kMixed};
  std::vector<Scene> scenes;
  const auto add = [&](const char* name, const auto& change) {
    Scene own = scene;
    own.name = name;
    change(own);
    scenes.push_back(own);
  };
  add("FromTheStreet", [](Scene&) {});
  add("InBatchedForm", [](Scene& s) {
    s.geometry = GeometryKind::kBatched;
    s.pose_mode = PoseMode::kExact;
  });
  add("FromAbove", [](Scene& s) {
    s.camera = {.eye_world = {3, -5, 160}, .target_world = {0, 0, 0}};
    s.agents = 2500;
  });
  add("LessThanAPixel", [](Scene& s) {
    s.camera.eye_world = {0, -900, 300};
    s.side_m = 400;
  });
  add("CrowdedTiles", [](Scene& s) {  // lists that are sorted by 16 bits
    s.agents = 4000;
    s.side_m = 60;
    s.camera = {.eye_world = {0, -150, 20}, .target_world = {0, 0, 0}, .fov_y_rad = 0.5};
    s.colors = true;
  });
  add("Orthographic", [](Scene& s) {
    s.camera = {.eye_world = {5, -80, 90}, .target_world = {0, 0, 0}, .ortho_height_m = 110};
  });
  add("ImpostorsBesideMeshes", [](Scene& s) {
    s.mixed.specks = false;
    s.mixed.impostor_us = 0.01F;
    s.mixed.impostor_px2_us = 0.0001F;
    s.camera.eye_world = {0, -160, 30};
  });
  add("CoarseSlabs", [](Scene& s) { s.mixed.error_px = 6.0F; });
  add("BeyondItsBudget", [](Scene& s) {
    s.mixed.error_px = 0.1F;
    s.vertex_budget = 12'000;
  });
  return scenes;
}
INSTANTIATE_TEST_SUITE_P(Mixed, CudaOwnFormsTest, testing::ValuesIn(mixed_scenes()), scene_name);

/// A frame that is to take some time: the same error is chosen by the same estimate, from frame to
/// frame, also where one leap of the camera makes the error of the frame before a wrong one.
TEST_F(CudaFormsTest, ATimeIsKeptByTheProcessorsError) {
  const std::vector<Scene> mixed = mixed_scenes();
  const auto cast = cast_with_forms();
  Scene scene = mixed[0];
  scene.agents = 6000;  // more than are looked at
  const auto crowd = crowd_of(scene, cast);
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  ASSERT_TRUE(cpu.upload(cast).ok());
  ASSERT_TRUE(cuda.upload(cast).ok());
  cuda.on_device = false;
  struct Step {
    double budget_ms;
    std::size_t scene;  // whose camera
    bool specks;
  };
  std::vector<float> errors;
  for (const Step step : {Step{20.0, 0, true}, Step{20.0, 0, true}, Step{8.0, 0, true},
                          Step{8.0, 2, true}, Step{9.0, 3, true}, Step{9.0, 3, false},
                          Step{1e6, 0, true}, Step{0.1, 0, true}, Step{0.0, 0, true}}) {
    scene.camera = mixed[step.scene].camera;
    scene.mixed = {};
    scene.mixed.budget_ms = step.budget_ms;
    scene.mixed.specks = step.specks;
    for (Renderer* renderer : {&cpu, &cuda}) {
      const absl::Status status = generate(*renderer, scene, *crowd, {});
      ASSERT_TRUE(status.ok()) << status;
    }
    const ComputeCounters counted = cpu.backend->counters(*cpu.view);
    const ComputeCounters counters = cuda.backend->counters(*cuda.view);
    EXPECT_EQ(counted.error_px, counters.error_px);
    EXPECT_EQ(counted.work.known, counters.work.known);
    for (int i = 0; i < FrameWork::kParts; ++i) {
      EXPECT_EQ(counted.work.part[i], counters.work.part[i]) << i;
    }
    EXPECT_EQ(counted.visible, counters.visible);
    EXPECT_EQ(counted.vertices, counters.vertices);
    EXPECT_EQ(counted.effective_budget, counters.effective_budget);
    const FrameGeometry expected = cpu.backend->geometry(*cpu.view);
    const FrameGeometry read = cuda.backend->geometry(*cuda.view);
    expect_same_bytes(expected.instances, read.instances, "visible instances");
    expect_same_bytes(expected.representation, read.representation, "representations");
    expect_same_bytes<Speck>(specks_of(expected), specks_of(read), "specks");
    EXPECT_EQ(expected.speck_detail, read.speck_detail);
    if (step.budget_ms > 0.0) errors.push_back(counters.error_px);
  }
  EXPECT_EQ(errors[0], errors[1]);  // nothing changed
  EXPECT_LT(errors[1], errors[2]);
  EXPECT_LT(errors[6], errors[7]);
}

TEST_F(CudaFormsTest, SplatsOfNobodyStandBesideMeshesAndAlone) {
  const Scene scene{.agents = 30};
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  ASSERT_NO_FATAL_FAILURE(generate_alone(cpu, scene));
  ASSERT_NO_FATAL_FAILURE(generate_alone(cuda, scene));
  std::vector<Splat> splats;
  for (std::uint64_t i = 0; i < 400; ++i) {
    const auto noise = [i](std::uint64_t k) { return static_cast<float>(test::noise(9 * i + k)); };
    const glm::vec3 place(20 * noise(1) - 10, 4 + 20 * noise(2), 4 * noise(3) - 3);
    const float radius_m = 0.02F + (i % 40 == 0 ? 0.8F : 0.1F) * noise(4);
    splats.push_back({place, i % 3 == 0 ? -radius_m : radius_m,
                      encode_octahedral(glm::normalize(glm::vec3(noise(5) - 0.5F, -1, 0.3F))),
                      static_cast<std::uint32_t>(0x3fffffffU * noise(6)),
                      i % 3 == 0 ? static_cast<std::uint32_t>(i % 256) : 0, kNobody});
  }
  std::vector<Speck> shadows;
  for (std::uint64_t i = 0; i < 40; ++i) {
    const auto noise = [i](std::uint64_t k) { return static_cast<float>(test::noise(7 * i + k)); };
    const glm::vec3 feet(14 * noise(1) - 7, 5 + 12 * noise(2), -3);  // on the ground
    shadows.push_back({feet, 1.8F, 0, 1, 0.0F, 0});
  }
  for (const bool alone : {false, true}) {
    Picture expected, actual;
    for (Renderer* renderer : {&cpu, &cuda}) {
      FrameGeometry geometry;
      if (!alone) geometry = renderer->backend->geometry(*renderer->view);
      geometry.splats = splats;
      geometry.shadows = shadows;
      const absl::Status status =
          draw(*renderer, geometry, scene, renderer == &cpu ? expected : actual);
      ASSERT_TRUE(status.ok()) << status;
    }
    expect_same_picture(expected, actual);
  }
}

struct FarCase {
  const char* name;
  FormRule form;  // of who is near
  bool published;
  std::int64_t time_us;
};

/// A far crowd whose points CUDA makes of the processor's shares.
class CudaFarCrowdTest : public testing::TestWithParam<FarCase> {
 protected:
  void SetUp() override { THRONG_SKIP_WITHOUT_CUDA(); }
};

TEST_P(CudaFarCrowdTest, HasTheProcessorsPoints) {
  const Scene scene{
      .agents = 700,
      .side_m = 70.0,
      .camera = {.eye_world = {0, -40, 9}, .target_world = {0, 0, 0}, .fov_y_rad = 0.9},
      .viewport = {131, 98},
      .time_us = GetParam().time_us,
      .form = GetParam().form};
  const auto cast = cast_with_forms();
  const auto crowd = crowd_of(scene, cast);
  auto far = FarCrowd::make(cast, 1);
  ASSERT_TRUE(far.ok()) << far.status();
  const FarSettings settings{
      .enabled = true, .points = 4'000, .published = GetParam().published, .wait = true};
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  ASSERT_TRUE(cpu.upload(cast).ok());
  ASSERT_TRUE(cuda.upload(cast).ok());
  // twice: what was copied the first time is there, but for the shares from another place
  for (const double aside_m : {0.0, 3.0}) {
    Scene own = scene;
    own.camera.eye_world.x += aside_m;
    FarView view = make_far_view(own.camera, own.viewport, glm::dvec3(0.0));
    view.least_m = 35.0F;
    cpu.view->far_m = cuda.view->far_m = view.least_m;
    std::vector<Splat> splats;
    std::vector<Speck> shadows;
    FarCounters counters, planned;
    absl::Status status =
        (*far)->generate(*crowd, own.time_us, view, settings, splats, shadows, counters);
    ASSERT_TRUE(status.ok()) << status;
    ASSERT_GT(counters.drawn, 50U);
    const auto points = (*far)->plan(*crowd, own.time_us, view, settings, planned);
    ASSERT_TRUE(points.ok()) << points.status();
    EXPECT_EQ(planned.visible, counters.visible);
    ASSERT_GT((*points)->shares.size(), counters.drawn);  // some have gone, or are too near
    cuda.view->far = *points;

    ASSERT_TRUE(generate(cpu, own, *crowd, {}).ok());
    FrameGeometry geometry = cpu.backend->geometry(*cpu.view);
    std::vector<Splat> all = splats;
    all.insert(all.end(), geometry.splats.begin(), geometry.splats.end());
    geometry.splats = all;
    geometry.shadows = shadows;
    Picture expected, actual;
    ASSERT_TRUE(draw(cpu, geometry, own, expected).ok());

    cuda.on_device = true;
    status = generate(cuda, own, *crowd, {});
    ASSERT_TRUE(status.ok()) << status;
    EXPECT_EQ(cuda.backend->counters(*cuda.view).far_agents, counters.drawn);
    EXPECT_EQ(cuda.backend->counters(*cuda.view).far_points, splats.size());
    const FrameGeometry there = cuda.backend->geometry(*cuda.view);
    ASSERT_NE(there.on_device, nullptr);
    status = draw(cuda, there, own, actual);
    ASSERT_TRUE(status.ok()) << status;
    expect_same_picture(expected, actual);

    cuda.on_device = false;
    ASSERT_TRUE(generate(cuda, own, *crowd, {}).ok());
    const FrameGeometry read = cuda.backend->geometry(*cuda.view);
    expect_same_bytes<Splat>(all, read.splats, "splats");
    expect_same_bytes<Speck>(shadows, read.shadows, "shadows");
  }
  // nobody is far in the next frame
  cuda.view->far = nullptr;
  cuda.view->far_m = 0.0F;
  ASSERT_TRUE(generate(cuda, scene, *crowd, {}).ok());
  EXPECT_EQ(cuda.backend->counters(*cuda.view).far_points, 0U);
  EXPECT_TRUE(cuda.backend->geometry(*cuda.view).shadows.empty());
}

INSTANTIATE_TEST_SUITE_P(
    Larkin, CudaFarCrowdTest,
    testing::Values(FarCase{"FiguresBesideMeshes", FormRule::kMesh, false, 50'000},
                    FarCase{"FiguresBesidePoints", FormRule::kPoints, false, 50'000},
                    FarCase{"CloudBesideMeshes", FormRule::kMesh, true, 50'000},
                    // the slots of who was triangulated are others' by now
                    FarCase{"AfterTheRosterChanged", FormRule::kMesh, false, 100'000}),
    [](const auto& param) { return std::string(param.param.name); });

TEST_F(CudaFormsTest, FarCrowdThatDoesNotFitIsAnError) {
#if THRONG_CUDA_ON_HOST
  const Scene scene{.agents = 200, .side_m = 40.0};
  const auto cast = cast_with_forms();
  const auto crowd = crowd_of(scene, cast);
  auto far = FarCrowd::make(cast, 1);
  ASSERT_TRUE(far.ok());
  FarCounters counters;
  const FarView view = make_far_view(scene.camera, scene.viewport, glm::dvec3(0.0));
  const auto points =
      (*far)->plan(*crowd, scene.time_us, view, {.enabled = true, .points = 2'000}, counters);
  ASSERT_TRUE(points.ok());
  Renderer cuda = Renderer::on_cuda();
  ASSERT_TRUE(cuda.upload(cast).ok());
  ASSERT_TRUE(generate(cuda, scene, *crowd, {}).ok());
  cuda.view->far = *points;
  test::cuda_on_host::faults.most_bytes = (*points)->figure.size_bytes() - 1;
  const absl::Status status = generate(cuda, scene, *crowd, {});
  test::cuda_on_host::faults = {};
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_NE(status.message().find("the far crowd"), std::string::npos) << status;
  EXPECT_TRUE(generate(cuda, scene, *crowd, {}).ok());
  EXPECT_GT(cuda.backend->counters(*cuda.view).far_points, 0U);
#else
  GTEST_SKIP() << "needs a device whose memory can be said to be used up";
#endif
}

TEST_F(CudaFormsTest, RefusesWhatIsNotWhole) {
  const Scene scene{.agents = 20, .form = FormRule::kImpostor};
  const auto cast = cast_with_forms();
  const auto crowd = crowd_of(scene, cast);
  Renderer cpu = Renderer::on_processor(), cuda = Renderer::on_cuda();
  ASSERT_TRUE(cpu.upload(cast).ok());
  ASSERT_TRUE(cuda.upload(cast).ok());
  ASSERT_TRUE(generate(cpu, scene, *crowd, {}).ok());
  const FrameGeometry whole = cpu.backend->geometry(*cpu.view);
  Picture picture;
  FrameGeometry geometry = whole;
  geometry.joints = geometry.joints.first(16);
  EXPECT_EQ(draw(cuda, geometry, scene, picture).code(), absl::StatusCode::kInvalidArgument);
  geometry = whole;
  geometry.jointed = {};
  EXPECT_EQ(draw(cuda, geometry, scene, picture).code(), absl::StatusCode::kInvalidArgument);
  const Speck shadow{glm::vec3(0, 5, -1), 1.8F, 1, 0, 0.0F, 0};  // of a picture
  geometry = {};
  geometry.shadows = {&shadow, 1};
  for (Renderer* renderer : {&cpu, &cuda}) {
    EXPECT_EQ(draw(*renderer, geometry, scene, picture).code(), absl::StatusCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace throng::render
