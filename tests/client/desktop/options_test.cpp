#include <gtest/gtest.h>

#include "client/desktop/view_link.hpp"
#include "client/desktop/view_text.hpp"
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

TEST(ViewTextTest, IsThePagesAddress) {
  const std::string text =
      "crowd=main%20hall&cam=1.5,2,0,15,-60,30,ortho&follow=17&t=3.2&speed=0.5&color=a%2Cb,0,2.5&"
      "map=magma"
      "&show=grid,time";
  const auto view = parse_view_text("http://127.0.0.1:7480/#" + text);
  ASSERT_TRUE(view.ok()) << view.status();
  EXPECT_EQ(view->crowd, "main hall");
  EXPECT_DOUBLE_EQ(view->camera->distance_m, 15.0);
  EXPECT_TRUE(view->camera->ortho);
  EXPECT_EQ(view->follow, 17U);
  EXPECT_EQ(view->time_us, 3'200'000);
  EXPECT_EQ(view->channel, "a,b");
  EXPECT_EQ(view->range, std::pair(0.0, 2.5));
  EXPECT_EQ(format_view_text(*view), text);
  EXPECT_EQ(format_view_text(*parse_view_text("")), "");
  const std::string far = "cam=691234.567,5335123.25,0.1,1234567.5,-60.25,30&t=123456.789";
  EXPECT_EQ(format_view_text(*parse_view_text(far)), far) << "all digits of UTM and of long runs";
  for (const char* bad :
       {"cam=1,2", "cam=1,2,3,-4,5,6", "cam=nan,0,0,1,0,0", "t=x", "t=1e12", "follow=-1", "speed=0",
        "speed=99", "color=a,2,1", "map=jet", "nonsense", "%", "crowd=%4"}) {
    const auto refused = parse_view_text(bad);
    ASSERT_FALSE(refused.ok()) << bad;
    EXPECT_NE(refused.status().message().find(bad), absl::string_view::npos);
  }
}

}  // namespace
}  // namespace throng::client
