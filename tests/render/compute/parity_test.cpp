// The same frame from the processor and from the GPU: decisions and snapped vertices are equal bit
// by bit. Skipped, with the reason, where there is no CUDA device.
#include <gtest/gtest.h>

#include <cstring>
#include <vector>

#include "frame_fixture.hpp"

namespace throng::render {
namespace {

struct Scene {
  const char* name;
  std::size_t agents;
  std::int64_t time_us;
  double ortho_height_m;
  Selection selection;
};

class ParityTest : public testing::TestWithParam<Scene> {
 protected:
  void SetUp() override {
    if (auto cuda = make_backend(BackendKind::kCuda); !cuda.ok()) {
      GTEST_SKIP() << cuda.status().message();
    }
  }
};

template <typename T>
void expect_same_bytes(std::span<const T> cpu, std::span<const T> cuda, const char* what) {
  ASSERT_EQ(cpu.size(), cuda.size()) << what;
  for (std::size_t i = 0; i < cpu.size(); ++i) {
    ASSERT_EQ(std::memcmp(&cpu[i], &cuda[i], sizeof(T)), 0) << what << ", element " << i;
  }
}

TEST_P(ParityTest, FrameIsTheSameBitByBit) {
  const Scene& scene = GetParam();
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, scene.agents, 150.0);
  test::Stage cpu(cast, BackendKind::kCpu), cuda(cast, BackendKind::kCuda);
  std::vector<std::uint8_t> cpu_mask, cuda_mask;
  for (auto [stage, mask] : {std::pair{&cpu, &cpu_mask}, std::pair{&cuda, &cuda_mask}}) {
    stage->camera.ortho_height_m = scene.ortho_height_m;
    stage->advance(*crowd, scene.time_us);
    stage->finish(scene.selection);
    mask->resize(stage->instances->count);
    ASSERT_TRUE(stage->backend->read_visible(*stage->view, *mask).ok());
  }
  EXPECT_EQ(cpu_mask, cuda_mask);
  const ComputeCounters a = cpu.counters(), b = cuda.counters();
  EXPECT_EQ(a.agents, b.agents);
  EXPECT_EQ(a.visible, b.visible);
  EXPECT_EQ(a.vertices, b.vertices);
  EXPECT_EQ(a.triangles, b.triangles);
  EXPECT_EQ(a.effective_budget, b.effective_budget);
  const FrameGeometry from = cpu.geometry(), to = cuda.geometry();
  expect_same_bytes(from.instances, to.instances, "visible instances");
  expect_same_bytes(from.vertex_offset, to.vertex_offset, "vertex offsets");
  expect_same_bytes(from.triangle_offset, to.triangle_offset, "triangle offsets");
  expect_same_bytes(from.vertices, to.vertices, "vertices");
  expect_same_bytes(from.indices, to.indices, "indices");
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, ParityTest,
    testing::Values(
        Scene{"Nobody", 0, 0, 0.0, {}}, Scene{"One", 1, 150'000, 0.0, {}},
        Scene{"Thousands", 5000, 150'000, 0.0, {.vertex_budget = 40'000}},
        Scene{"FullDetail", 800, 250'000, 0.0, {.vertex_budget = 100'000'000}},
        Scene{"NoBudget", 800, 250'000, 0.0, {.vertex_budget = 0}},
        Scene{"Extrapolated", 3000, 1'300'000, 0.0, {.vertex_budget = 60'000}},
        Scene{
            "Dong2019", 3000, 150'000, 0.0, {.vertex_budget = 60'000, .rule = LodRule::kDong2019}},
        Scene{"Orthographic", 3000, 150'000, 90.0, {.vertex_budget = 60'000}}),
    [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace throng::render
