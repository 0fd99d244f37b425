#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "support/tiny_character.hpp"
#include "throng/render/asset.hpp"

namespace throng::render {
namespace {

using ::testing::HasSubstr;

struct Fault {
  const char* name;
  std::function<void(CharacterData&)> inject;
  const char* message;
};

class ValidateTest : public ::testing::TestWithParam<Fault> {};

TEST_P(ValidateTest, NamesWhatIsWrong) {
  CharacterData data = test::make_tiny_character();
  GetParam().inject(data);
  const auto character = make_character(std::move(data));
  ASSERT_FALSE(character.ok());
  EXPECT_EQ(character.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(character.status().message()), HasSubstr(GetParam().message));
}

const Fault kFaults[] = {
    {"NoVertex", [](CharacterData& d) { d.position.clear(); }, "position has 0"},
    {"NoTriangle", [](CharacterData& d) { d.triangle.clear(); }, "triangle has 0"},
    {"NoJoint", [](CharacterData& d) { d.joints.clear(); }, "joint has 0"},
    {"NoClip", [](CharacterData& d) { d.clips.clear(); }, "clip has 0"},
    {"NoName", [](CharacterData& d) { d.name.clear(); }, "name has 0"},
    {"ShortUv", [](CharacterData& d) { d.uv.pop_back(); }, "uv has 37 elements, must have 38"},
    {"ShortLegalCount", [](CharacterData& d) { d.legal_count.pop_back(); }, "legal count has 38"},
    {"NanPosition", [](CharacterData& d) { d.position[5].y = std::nanf(""); }, "position 5"},
    {"InfinitePosition", [](CharacterData& d) { d.position[0].x = INFINITY; }, "position 0"},
    {"WeightSum",
     [](CharacterData& d) {
       d.joint_weight[3] = {200, 0, 0, 0};
     },
     "joint weight 3 sums to 200"},
    {"WeightOrder",
     [](CharacterData& d) {
       d.joint_weight[3] = {100, 155, 0, 0};
     },
     "not strongest first"},
    {"JointIndex", [](CharacterData& d) { d.joint_index[7].w = 2; },
     "joint index 7 is 2, must be below 2"},
    {"TargetNotSmaller", [](CharacterData& d) { d.collapse_target[20] = 20; },
     "collapse target 20 is 20"},
    {"TargetOfFirst", [](CharacterData& d) { d.collapse_target[0] = 1; }, "collapse target 0 is 1"},
    {"Corner", [](CharacterData& d) { d.triangle[9].z = 38; },
     "triangle 9 has corner 38, must be below 38"},
    {"LostCorner", [](CharacterData& d) { d.triangle[0].y = d.triangle[0].x; },
     "triangle 0 is drawn at"},
    {"FallingCount", [](CharacterData& d) { d.triangle_count_at[20] = 0; }, "triangle count at 20"},
    {"CountOverAll", [](CharacterData& d) { d.triangle_count_at[20] = 65; },
     "triangle count at 20 is 65"},
    {"LegalOverN", [](CharacterData& d) { d.legal_count[20] = 21; }, "legal count 20 is 21"},
    {"LegalBelowCoarsest", [](CharacterData& d) { d.legal_count[4] = 4; }, "legal count 4 is 4"},
    {"CoarsestOverAll", [](CharacterData& d) { d.coarsest_count = 39; }, "coarsest count is 39"},
    {"NanError", [](CharacterData& d) { d.collapse_error_m[30] = std::nanf(""); },
     "collapse error 30"},
    {"ParentCycle", [](CharacterData& d) { d.joints[1].parent = 1; }, "joint 1 has parent 1"},
    {"NanBind", [](CharacterData& d) { d.joints[1].joint_from_model.row[2].w = std::nanf(""); },
     "joint 1 has an inverse"},
    {"PaletteShape", [](CharacterData& d) { d.palette.pop_back(); }, "multiple of 2 joints"},
    {"NanPalette", [](CharacterData& d) { d.palette[11].row[0].x = std::nanf(""); },
     "frame 5 joint 1"},
    {"ClipRange", [](CharacterData& d) { d.clips[1].first_frame = 9; }, "clip 1 has frames 9 + 16"},
    {"ClipRangeWraps", [](CharacterData& d) { d.clips[1].first_frame = 0xFFFFFFF8U; },
     "clip 1 has frames"},
    {"ClipEmpty", [](CharacterData& d) { d.clips[0].frame_count = 0; }, "clip 0 has frames"},
    {"ClipKind", [](CharacterData& d) { d.clips[0].kind = static_cast<ClipKind>(99); },
     "unknown kind 99"},
    {"ClipRate", [](CharacterData& d) { d.clips[0].rate_hz = 0; }, "clip 0 has rate 0"},
    {"ClipStride", [](CharacterData& d) { d.clips[1].stride_m = -1; }, "clip 1 has stride -1"},
    {"Bounds", [](CharacterData& d) { d.bounds.w = 0; }, "bounds have radius 0"},
    {"Height", [](CharacterData& d) { d.height_m = std::nanf(""); }, "height is nan"},
    {"ImageSize", [](CharacterData& d) { d.base_color_width_px = 0; }, "base colour is 0 x 16"},
    {"ImageLevels", [](CharacterData& d) { d.base_color_levels = 6; }, "base colour has 6 levels"},
    {"ImageBytes", [](CharacterData& d) { d.base_color.pop_back(); }, "base colour has 1363 bytes"},
    {"ToneBandOfTooManyVertices", [](CharacterData& d) { d.tone_band[0].vertex_count = 39; },
     "corner tone band 0 is for 39 vertices, must be 1 to 38"},
    {"ToneBandsOfEqualVertices", [](CharacterData& d) { d.tone_band[1].vertex_count = 20; },
     "corner tone band 1 is for 20 vertices, must be 1 to 19"},
    {"ToneBandOfNothing", [](CharacterData& d) { d.tone_band[1].vertex_count = 0; },
     "corner tone band 1 is for 0 vertices"},
    {"ToneBandElsewhere", [](CharacterData& d) { d.tone_band[1].first = 3; },
     "corner tone band 1 begins at 3"},
    {"ToneBands",
     [](CharacterData& d) {
       d.tone_band.assign(65, {20, 0});
     },
     "corner tone has 65 bands"},
    {"ToneWords", [](CharacterData& d) { d.corner_tone.pop_back(); }, "corner tone has "},
    {"MaskBytes", [](CharacterData& d) { d.tint_mask.clear(); }, "tint mask has 0 bytes"},
};

INSTANTIATE_TEST_SUITE_P(Faults, ValidateTest, ::testing::ValuesIn(kFaults),
                         [](const auto& info) { return info.param.name; });

TEST(ValidateChainTest, RefusesAChainOfTargetsThatWouldTakeTooLong) {
  CharacterData data = test::make_tiny_character();
  const std::size_t vertices = 10000;
  data.position.resize(vertices, glm::vec3(0.0F));
  data.normal.resize(vertices);
  data.uv.resize(vertices);
  data.joint_index.resize(vertices, glm::u8vec4(0));
  data.joint_weight.resize(vertices, glm::u8vec4(255, 0, 0, 0));
  data.collapse_error_m.resize(vertices, 0.0F);
  data.triangle_count_at.resize(vertices + 1, 64);
  data.legal_count.resize(vertices + 1);
  for (std::uint32_t i = 38; i < vertices; ++i) data.collapse_target.push_back(i - 1);
  for (std::uint32_t n = 39; n <= vertices; ++n) data.legal_count[n] = n;
  EXPECT_THAT(std::string(make_character(std::move(data)).status().message()),
              HasSubstr("chain longer than 4096"));
}

TEST(ValidateImageTest, MaskMayBeEmpty) {
  CharacterData data = test::make_tiny_character();
  data.tint_mask.clear();
  data.tint_mask_width_px = data.tint_mask_height_px = data.tint_mask_levels = 0;
  EXPECT_TRUE(make_character(std::move(data)).ok());
}

}  // namespace
}  // namespace throng::render
