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
  // another cast of as many members is asked for anew, the same one in other memory is not
  faster_rasterizer(std::make_shared<const Cast>(*cast), {.threads = 2}, again);
  EXPECT_EQ(again, why);
  auto other = std::make_shared<Cast>(*cast);
  other->members.back().character.name += " of another cast";
  faster_rasterizer(other, {.threads = 2}, again);
  EXPECT_NE(again, why);
}

}  // namespace
}  // namespace throng::render
