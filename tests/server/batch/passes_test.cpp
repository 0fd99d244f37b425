#include "server/batch/passes.hpp"

#include <gtest/gtest.h>

namespace throng::server {
namespace {

using render::FramePasses;
using render::SeenInstance;

TEST(PassesTest, ParseTakesEachPassOnceOrTwice) {
  const auto set = parse_passes("id,color,id");
  ASSERT_TRUE(set.ok());
  EXPECT_TRUE(set->color && set->id && !set->depth);
  EXPECT_EQ(set->count(), 2);
  EXPECT_TRUE(set->data());
}

TEST(PassesTest, ParseNamesWhatIsNoPass) {
  for (const char* text : {"", "color,", "Depth", "color,,id"}) {
    EXPECT_EQ(parse_passes(text).status().code(), absl::StatusCode::kInvalidArgument) << text;
  }
}

FramePasses four_agents() {
  FramePasses passes;
  passes.instances = {
      SeenInstance{9, false, 4, {3, 1, 4, 2}, {2, 1, 6, 5}},
      SeenInstance{7, false, 1, {0, 0, 0, 0}, {0, 0, 0, 0}},
      SeenInstance{8, false, 0, {}, {5, 5, 6, 6}},            // hidden
      SeenInstance{0, true, 90, {0, 0, 9, 9}, {0, 0, 9, 9}},  // a wall
  };
  return passes;
}

TEST(PassesTest, BoxesCountPixelsFromOneAndGoById) {
  EXPECT_EQ(box_lines(12, four_agents(), BoxExtent::kVisible),
            "12,7,1,1,1,1,1,-1,-1,-1\n12,9,4,2,2,2,1,-1,-1,-1\n");
}

TEST(PassesTest, WholeBoxesHoldTheBoundsAndThePixels) {
  FramePasses passes = four_agents();
  passes.instances[0].bounds = {3, 2, 6, 5};  // misses a row that is seen
  EXPECT_EQ(box_lines(1, passes, BoxExtent::kWhole),
            "1,7,1,1,1,1,1,-1,-1,-1\n1,9,4,2,4,5,1,-1,-1,-1\n");
}

TEST(PassesTest, EncodedPassesAreExr) {
  FramePasses passes;
  passes.width_px = 2;
  passes.height_px = 1;
  passes.depth_m = {1.0F, 2.0F};
  passes.instance = {FramePasses::kNothing, 0};
  passes.instances = {SeenInstance{}};
  for (const auto& bytes : {encode_depth(passes), encode_ids(passes)}) {
    ASSERT_TRUE(bytes.ok()) << bytes.status();
    EXPECT_EQ((*bytes)[0], 0x76);  // OpenEXR's magic number
    EXPECT_EQ((*bytes)[1], 0x2f);
  }
  passes.depth_m.pop_back();
  EXPECT_EQ(encode_depth(passes).status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace throng::server
