// What `auto` goes by beside a CUDA device, here with the processor's backend.
#include "render/frame/faster_rasterizer.hpp"

#include <gtest/gtest.h>

#include "render/compute/crowd_fixture.hpp"

namespace throng::render {
namespace {

TEST(FasterRasterizerTest, SaysWhatBothTookAndAsksOnce) {
  const auto cast = test::tiny_cast();
  std::string why, again;
  const RasterKind kind = faster_rasterizer(cast, {.threads = 2}, why);
  EXPECT_NE(kind, RasterKind::kAuto);
  EXPECT_NE(why.find("visibility"), std::string::npos) << why;
  EXPECT_NE(why.find("gl"), std::string::npos) << why;
  EXPECT_EQ(faster_rasterizer(cast, {.threads = 2}, again), kind);
  EXPECT_EQ(again, why);  // times that were measured anew would differ
}

}  // namespace
}  // namespace throng::render
