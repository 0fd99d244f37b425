#include "simplify/impostor/relief.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "support/temporary_folder.hpp"
#include "support/tiny_character.hpp"

namespace throng::simplify {
namespace {

using testing::HasSubstr;

render::Character tiny(const std::string& upper_joint = "upper") {
  render::CharacterData data = test::make_tiny_character();
  data.joints[1].name = upper_joint;
  return render::make_character(std::move(data)).value();
}

bool is_nothing(std::uint32_t shape) { return (shape & 0xffffU) == 255U; }

TEST(ReliefTest, BoxesHoldEveryVertexThatTheirJointMoves) {
  const render::Character character = tiny();
  const auto relief = bake_relief(character);
  ASSERT_TRUE(relief.ok()) << relief.status();
  ASSERT_EQ(relief->boxes.size(), 2U);
  const std::size_t joints = character.joints.size();
  for (const render::ReliefBox& box : relief->boxes) {
    const auto place = [&](std::uint32_t vertex) {
      // posed by all of its joints, and back by the box's own: both are stiff, so that the inverse
      // is the transpose
      const auto matrix = [&](std::uint32_t joint) {
        return character.palette[relief->capture_frame * joints + joint];
      };
      glm::vec3 posed(0.0F);
      for (int k = 0; k < 4; ++k) {
        const float weight = static_cast<float>(character.joint_weight[vertex][k]) / 255.0F;
        for (int r = 0; r < 3; ++r) {
          posed[r] += weight * glm::dot(matrix(character.joint_index[vertex][k]).row[r],
                                        glm::vec4(character.position[vertex], 1.0F));
        }
      }
      const render::Affine own = matrix(box.joint);
      glm::vec3 back(0.0F);
      for (int r = 0; r < 3; ++r) back += glm::vec3(own.row[r]) * (posed[r] - own.row[r].w);
      return back - box.origin;
    };
    for (const glm::uvec3& triangle : character.triangle) {
      bool is_moved = false;
      for (int c = 0; c < 3; ++c) {
        for (int k = 0; k < 4; ++k) {
          is_moved = is_moved || (character.joint_index[triangle[c]][k] == box.joint &&
                                  character.joint_weight[triangle[c]][k] > 0);
        }
      }
      if (!is_moved) continue;
      for (int c = 0; c < 3; ++c) {
        const glm::vec3 p = place(triangle[c]);
        for (const glm::vec3& side : box.side) {
          const float e = glm::dot(p, side) / glm::dot(side, side);
          EXPECT_GE(e, 0.0F);
          EXPECT_LE(e, 1.0F);
        }
      }
    }
  }
}

TEST(ReliefTest, FrontAndBackOfOppositeFacesAreTheSameSurface) {
  const auto relief = bake_relief(tiny());
  ASSERT_TRUE(relief.ok()) << relief.status();
  std::size_t seen = 0;
  for (const render::ReliefBox& box : relief->boxes) {
    for (int axis = 0; axis < 3; ++axis) {
      const render::ReliefFace &near = box.face[2 * axis], &far = box.face[2 * axis + 1];
      ASSERT_EQ(near.width_px, far.width_px);
      ASSERT_EQ(near.height_px, far.height_px);
      for (std::uint32_t i = 0; i < std::uint32_t{near.width_px} * near.height_px; ++i) {
        const std::uint32_t a = relief->shape[near.first + i], b = relief->shape[far.first + i];
        ASSERT_EQ(is_nothing(a), is_nothing(b));
        if (is_nothing(a)) continue;
        ++seen;
        EXPECT_LT(a & 255U, a >> 8 & 255U);
        EXPECT_NEAR(static_cast<int>(a & 255U), 255 - static_cast<int>(b >> 8 & 255U), 1);
      }
    }
  }
  EXPECT_GT(seen, 1000U);
}

TEST(ReliefTest, HeadsAreFinerThanOtherParts) {
  const auto plain = bake_relief(tiny());
  const auto head = bake_relief(tiny("Head"));
  ASSERT_TRUE(plain.ok() && head.ok());
  EXPECT_EQ(head->boxes[0].face[0].width_px, plain->boxes[0].face[0].width_px);
  EXPECT_NEAR(head->boxes[1].face[0].width_px, 2 * plain->boxes[1].face[0].width_px, 1);
}

TEST(ReliefTest, LargerTexelsKeepToTheLimit) {
  const auto relief = bake_relief(tiny(), {.texel_m = 0.001F, .most_bytes = 200'000});
  ASSERT_TRUE(relief.ok()) << relief.status();
  EXPECT_LE(12 * relief->shape.size(), 200'000U);
  EXPECT_GT(relief->texel_m, 0.001F);
}

TEST(ReliefTest, UniformFacesAreAllOfOneSize) {
  const auto relief = bake_relief(tiny(), {.uniform_px = 32});
  ASSERT_TRUE(relief.ok()) << relief.status();
  for (const render::ReliefBox& box : relief->boxes) {
    for (const render::ReliefFace& face : box.face) {
      EXPECT_EQ(face.width_px, 32);
      EXPECT_EQ(face.height_px, 32);
    }
  }
  EXPECT_EQ(relief->shape.size(), 2U * 6U * (1024 + 256 + 64 + 16 + 4 + 1));
}

TEST(ReliefTest, IsReadAsItWasWritten) {
  const test::TemporaryFolder folder;
  render::Character character = tiny();
  character.relief = render::make_relief(bake_relief(character).value());
  const std::string path = folder.file("tiny.throng");
  ASSERT_TRUE(render::write_character(character, path).ok());
  const auto read = render::read_character(path);
  ASSERT_TRUE(read.ok()) << read.status();
  ASSERT_NE(read->relief, nullptr);
  const render::Relief &a = *character.relief, &b = *read->relief;
  EXPECT_EQ(a.capture_frame, b.capture_frame);
  EXPECT_EQ(a.boxes.size(), b.boxes.size());
  EXPECT_TRUE(std::equal(a.shape.begin(), a.shape.end(), b.shape.begin(), b.shape.end()));
  EXPECT_TRUE(std::equal(a.color.begin(), a.color.end(), b.color.begin(), b.color.end()));
  EXPECT_TRUE(std::equal(a.tint.begin(), a.tint.end(), b.tint.begin(), b.tint.end()));
}

TEST(ReliefTest, ValidationNamesWhatIsWrong) {
  const render::Character character = tiny();
  const render::ReliefData good = bake_relief(character).value();
  const auto problem = [&](const auto& break_it) {
    render::ReliefData data = good;
    break_it(data);
    return std::string(
        render::validate_relief(*render::make_relief(std::move(data)), 2, 24).message());
  };
  EXPECT_EQ(problem([](render::ReliefData&) {}), "");
  EXPECT_THAT(problem([](auto& d) { d.boxes[1].joint = 2; }), HasSubstr("box 1 has joint 2"));
  EXPECT_THAT(problem([](auto& d) { d.boxes[0].face[3].first = 1U << 30; }), HasSubstr("end by"));
  EXPECT_THAT(problem([](auto& d) { d.boxes[0].face[0].width_px = 0; }), HasSubstr("at least 1"));
  EXPECT_THAT(problem([](auto& d) { d.boxes[0].side[1] = glm::vec3(0.0F); }), HasSubstr("side"));
  EXPECT_THAT(problem([](auto& d) { d.boxes[0].origin.x = NAN; }), HasSubstr("not finite"));
  EXPECT_THAT(problem([](auto& d) { d.tint.pop_back(); }), HasSubstr("as many"));
  EXPECT_THAT(problem([](auto& d) { d.capture_frame = 24; }), HasSubstr("below 24"));
}

TEST(ReliefTest, TexelsOfNoSizeAreRefused) {
  const auto relief = bake_relief(tiny(), {.texel_m = 0.0F});
  EXPECT_THAT(std::string(relief.status().message()), HasSubstr("must be over 0"));
}

}  // namespace
}  // namespace throng::simplify
