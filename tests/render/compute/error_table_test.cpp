#include "render/compute/cpu/error_table.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace throng::render {
namespace {

/// 2,000 vertices of a man, any number of them legal; what is recorded is set by the test.
class ErrorTableTest : public ::testing::Test {
 protected:
  static constexpr std::uint32_t kVertices = 2000, kCoarsest = 28;

  ErrorTableTest() : position_(kVertices), legal_(kVertices + 1), error_m_(kVertices) {
    for (std::uint32_t n = kCoarsest; n <= kVertices; ++n) legal_[n] = n;
    for (std::uint32_t n = 0; n < kVertices; ++n) error_m_[n] = law_m(n);
  }
  static float law_m(std::uint32_t n) { return 12.0F / static_cast<float>(std::max(n, kCoarsest)); }

  std::uint32_t vertices_for(float error_m) {
    Character character;
    character.position = position_;
    character.legal_count = legal_;
    character.collapse_error_m = error_m_;
    character.coarsest_count = kCoarsest;
    character.height_m = 1.75F;
    return make_error_table(character).vertex_count[ErrorTable::step_of(error_m)];
  }

  std::vector<glm::vec3> position_;
  std::vector<std::uint32_t> legal_;
  std::vector<float> error_m_;
};

TEST_F(ErrorTableTest, GivesTheVerticesOfTheRecordedErrors) {
  // steps are an eighth of an octave apart and round towards more vertices
  for (const float error_m : {0.02F, 0.05F, 0.1F}) {
    const std::uint32_t exact = static_cast<std::uint32_t>(12.0F / error_m);
    EXPECT_GE(vertices_for(error_m), exact) << error_m;
    EXPECT_LE(vertices_for(error_m), exact + exact / 6) << error_m;
  }
}

TEST_F(ErrorTableTest, OneBadCollapseDoesNotHoldBackAllOthers) {
  const std::uint32_t before = vertices_for(0.05F);
  // at 500 vertices one that is off by what 200 are; what is recorded never falls
  for (std::uint32_t n = 200; n < 500; ++n) error_m_[n] = law_m(200);
  const std::uint32_t after = vertices_for(0.05F);
  EXPECT_GT(after, before);  // it counts,
  EXPECT_LT(after, 400U);    // but as one: recorded alone it would be 500
}

TEST_F(ErrorTableTest, AllVerticesWhereTheLawLeavesNoneOver) {
  for (std::uint32_t n = 1000; n < kVertices; ++n) error_m_[n] = 0.0F;
  EXPECT_EQ(vertices_for(0.005F), kVertices);
  EXPECT_LT(vertices_for(0.01F), kVertices);
}

TEST_F(ErrorTableTest, ErrorsThatAreNotKnownFollowFromTheSpacingOfPoints) {
  error_m_.assign(kVertices, 0.0F);
  EXPECT_GT(vertices_for(0.01F), vertices_for(0.03F));
  EXPECT_EQ(vertices_for(10.0F), kCoarsest);
}

}  // namespace
}  // namespace throng::render
