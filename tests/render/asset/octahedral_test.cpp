#include <gtest/gtest.h>

#include <cmath>

#include "throng/render/asset.hpp"

namespace throng::render {
namespace {

TEST(OctahedralTest, AxesAreExact) {
  for (const glm::vec3& axis : {glm::vec3(1, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1),
                                glm::vec3(-1, 0, 0), glm::vec3(0, -1, 0), glm::vec3(0, 0, -1)}) {
    const glm::vec3 decoded = decode_octahedral(encode_octahedral(axis));
    EXPECT_EQ(decoded.x, axis.x);
    EXPECT_EQ(decoded.y, axis.y);
    EXPECT_EQ(decoded.z, axis.z);
  }
}

TEST(OctahedralTest, DirectionsComeBackWithinAHundredthOfADegree) {
  for (int i = 0; i < 20000; ++i) {
    // Fibonacci sphere
    const double z = 1.0 - (2.0 * i + 1.0) / 20000.0;
    const double angle_rad = 2.39996322972865332 * i;
    const double r = std::sqrt(1.0 - z * z);
    const glm::vec3 unit(r * std::cos(angle_rad), r * std::sin(angle_rad), z);
    EXPECT_LT(glm::length(decode_octahedral(encode_octahedral(unit)) - unit), 1.7e-4F);
  }
}

TEST(OctahedralTest, EveryCodeDecodesToAUnitVector) {
  for (int x = -32768; x <= 32767; x += 257) {
    for (int y = -32768; y <= 32767; y += 257) {
      EXPECT_NEAR(glm::length(decode_octahedral({x, y})), 1.0F, 1.0e-5F);
    }
  }
}

TEST(OctahedralTest, ZeroAndNanBecomeUp) {
  EXPECT_EQ(decode_octahedral(encode_octahedral(glm::vec3(0.0F))).z, 1.0F);
  EXPECT_EQ(decode_octahedral(encode_octahedral(glm::vec3(std::nanf("")))).z, 1.0F);
}

}  // namespace
}  // namespace throng::render
