#include "render/compute/cpu/kernels.hpp"

#include <gtest/gtest.h>

#include <cstring>

#include "frame_fixture.hpp"
#include "render/compute/cpu/cpu_backend.hpp"

namespace throng::render {
namespace {

/// All bytes of a frame of a walking crowd.
std::vector<std::byte> frame_bytes(KernelLevel level, std::uint64_t budget) {
  const auto cast = test::tiny_cast();
  const auto crowd = test::walking_crowd(cast, 3000, 80.0, 4);
  test::Stage stage(cast);
  stage.backend = make_cpu_backend(2, level);
  EXPECT_TRUE(stage.backend->upload(cast).ok());
  stage.view = stage.backend->make_view().value();
  stage.advance(*crowd, 234'567);
  stage.finish({.vertex_budget = budget});
  const FrameGeometry geometry = stage.geometry();
  std::vector<std::byte> bytes;
  const auto append = [&bytes](const auto& span) {
    const auto raw = std::as_bytes(span);
    bytes.insert(bytes.end(), raw.begin(), raw.end());
  };
  append(geometry.instances);
  append(geometry.vertex_offset);
  append(geometry.vertices);
  append(geometry.indices);
  EXPECT_GT(bytes.size(), 500'000U);
  return bytes;
}

class KernelsTest : public testing::TestWithParam<KernelLevel> {};

INSTANTIATE_TEST_SUITE_P(Levels, KernelsTest,
                         testing::Values(KernelLevel::kPlain, KernelLevel::kAvx2,
                                         KernelLevel::kAvx512),
                         [](const auto& info) {
                           return info.param == KernelLevel::kPlain  ? "Plain"
                                  : info.param == KernelLevel::kAvx2 ? "Avx2"
                                                                     : "Avx512";
                         });

TEST_P(KernelsTest, GivesTheBytesOfThePlainLoops) {
  if (GetParam() > best_kernel_level()) GTEST_SKIP() << "this processor does not have it";
  for (const std::uint64_t budget : {20'000U, 45'000U, 1'000'000U}) {
    EXPECT_TRUE(frame_bytes(GetParam(), budget) == frame_bytes(KernelLevel::kPlain, budget))
        << budget;
  }
}

TEST_P(KernelsTest, SkinningGivesTheBytesOfTheElement) {
  if (GetParam() > best_kernel_level()) GTEST_SKIP() << "this processor does not have it";
  const Kernels& tested = kernels(GetParam());
  const auto table = make_cast_table(test::tiny_cast()).value();
  const CharacterTable& entry = table->characters[0];
  const Character& character = *entry.character;
  for (int trial = 0; trial < 200; ++trial) {
    element::InstanceState state{};
    const auto random = [&](int k) { return static_cast<float>(test::noise(100 * trial + k)); };
    state.placement = element::place(6.0F * random(1), 0.9F + 0.2F * random(2));
    state.pose = {static_cast<std::uint32_t>(8.0F * random(3)),
                  static_cast<std::uint32_t>(8.0F * random(4)),
                  static_cast<std::uint32_t>(8.0F + 16.0F * random(5)),
                  static_cast<std::uint32_t>(8.0F + 16.0F * random(6)),
                  random(7),
                  random(8),
                  trial % 3 == 0 ? 0.0F : random(9),
                  trial % 4 != 0 ? 0.0F : random(13),
                  static_cast<std::uint32_t>(24.0F * random(14)),
                  static_cast<std::uint32_t>(24.0F * random(15)),
                  random(16)};
    alignas(64) element::JointMatrix palette[2], expected[2];
    VisibleInstance instance{};
    instance.position_relative = {random(10) * 50.0F, random(11) * -50.0F, random(12)};
    instance.vertex_count = 1 + static_cast<std::uint32_t>(trial) % character.vertex_count();
    tested.pose_palette(entry, state, character.vertex_count(), palette);
    for (std::size_t j = 0; j < 2; ++j) {
      element::pose_joint(state.pose, state.placement, entry.palette.data() + j, 2, expected[j]);
    }
    ASSERT_EQ(std::memcmp(palette, expected, sizeof palette), 0);

    // one more, to see that nothing is written beyond the end
    std::vector<BatchVertex> out(instance.vertex_count + 1);
    out.back().visible = 0xabcdefU;
    out.back().position_relative.x = 77.0F;
    tested.skin(entry.vertex.data(), instance, 9, palette, out.data());
    EXPECT_EQ(out.back().visible, 0xabcdefU);
    EXPECT_EQ(out.back().position_relative.x, 77.0F);
    for (std::uint32_t i = 0; i < instance.vertex_count; ++i) {
      const element::SourceVertex source = {character.position[i],
                                            element::unpack_octahedral(character.normal[i]),
                                            character.joint_index[i], character.joint_weight[i]};
      const element::SkinnedVertex skinned = element::skin(source, expected);
      BatchVertex vertex{};
      vertex.position_relative = instance.position_relative + skinned.position_m;
      const std::uint32_t code =
          element::pack_octahedral(skinned.normal.x, skinned.normal.y, skinned.normal.z);
      std::memcpy(&vertex.normal, &code, sizeof code);
      vertex.uv = character.uv[i];
      vertex.visible = 9;
      ASSERT_EQ(std::memcmp(&vertex, &out[i], sizeof vertex), 0) << "vertex " << i;
    }
  }
}

}  // namespace
}  // namespace throng::render
