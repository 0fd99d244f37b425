#include <gtest/gtest.h>

#include "client/desktop/view_link.hpp"
#include "client/desktop/viewer.hpp"

namespace throng::client {
namespace {

TEST(MergeOptionsTest, ACameraAtTheOriginReplacesTheOneBefore) {
  v1::ViewOptions options, change;
  options.mutable_camera()->mutable_eye()->set_x(5.0);
  options.mutable_camera()->set_ortho_height_m(3.0);
  change.mutable_camera()->mutable_eye();  // 0, 0, 0
  merge_options(change, options);
  EXPECT_EQ(options.camera().eye().x(), 0.0);
  EXPECT_NE(options.camera().projection_case(), v1::Camera::kOrthoHeightM);
}

TEST(MergeOptionsTest, CameraAndOverviewNeverTravelTogether) {
  v1::ViewOptions options, camera, overview;
  camera.mutable_camera()->mutable_eye()->set_x(1.0);
  overview.set_overview(true);
  merge_options(camera, options);
  merge_options(overview, options);
  EXPECT_FALSE(options.has_camera());
  EXPECT_TRUE(options.overview());
  merge_options(camera, options);
  EXPECT_TRUE(options.has_camera());
  EXPECT_FALSE(options.overview());
}

TEST(MergeOptionsTest, EachStepCountsAndTheRestStays) {
  v1::ViewOptions options, step;
  options.set_crowd_name("station");
  step.mutable_playback()->set_step_frames(1);
  merge_options(step, options);
  merge_options(step, options);
  EXPECT_EQ(options.playback().step_frames(), 2);
  EXPECT_EQ(options.crowd_name(), "station");
  v1::ViewOptions live;
  live.mutable_playback()->set_live(true);
  merge_options(live, options);
  EXPECT_TRUE(options.playback().live());
  EXPECT_EQ(options.playback().step_frames(), 0);
}

TEST(FormatTest, TimesAreWrittenAsOnThePage) {
  EXPECT_EQ(format_time(0), "0:00.0");
  EXPECT_EQ(format_time(59'960'000), "1:00.0");
  EXPECT_EQ(format_time(3'723'400'000), "1:02:03.4");
  EXPECT_EQ(format_time(-1'500'000), "-0:01.5");
}

}  // namespace
}  // namespace throng::client
