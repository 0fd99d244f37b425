#include "server/view/viewer.hpp"

#include <gtest/gtest.h>

namespace throng::server {
namespace {

using std::chrono::milliseconds;

class ViewerTest : public testing::Test {
 protected:
  static ViewRequest request_of(double rate_hz) {
    ViewRequest request;
    request.max_rate_hz = rate_hz;
    return request;
  }

  /// Renders one frame for the viewer, as the loop does; its index.
  std::uint64_t show() {
    const std::uint64_t index = viewer.begin_frame(now);
    viewer.deliver(index, std::make_shared<EncodedFrame>());
    return index;
  }

  Clock::time_point now{std::chrono::hours(1)};
  int told = 0;
  absl::Status ended;
  Viewer viewer{request_of(10.0), 2, [this] { return now; }, [this] { ++told; },
                [this](absl::Status status) { ended = std::move(status); }};
};

TEST_F(ViewerTest, WantsItsFirstFrameAtOnce) {
  ASSERT_TRUE(viewer.due().has_value());
  EXPECT_LE(*viewer.due(), now);
  EXPECT_FALSE(viewer.take().has_value());
}

TEST_F(ViewerTest, KeepsToItsRate) {
  EXPECT_EQ(show(), 1U);
  EXPECT_EQ(told, 1);
  EXPECT_EQ(viewer.take()->frame_index, 1U);
  EXPECT_EQ(*viewer.due(), now + milliseconds(100));
}

TEST_F(ViewerTest, HasNoRoomBeyondItsCredits) {
  show();
  viewer.take();
  now += milliseconds(100);
  show();
  viewer.take();
  EXPECT_FALSE(viewer.due().has_value());
  EXPECT_TRUE(viewer.ack(1).ok());
  EXPECT_TRUE(viewer.due().has_value());
}

TEST_F(ViewerTest, SkipsWhatCameDueWhileItWasSlowAndSaysHowMany) {
  show();
  viewer.take();
  now += milliseconds(100);
  show();
  viewer.take();
  now += milliseconds(1'000);
  ASSERT_TRUE(viewer.ack(2).ok());
  EXPECT_LE(*viewer.due(), now);
  const std::uint64_t index = show();
  const auto outgoing = viewer.take();
  // due at 200, 300 ... 1000 ms after the first: nine skipped, the tenth is shown
  EXPECT_EQ(outgoing->skipped_frames, 9U);
  EXPECT_EQ(index, 3U + 9U);
}

TEST_F(ViewerTest, ASlowServerIsNotTheViewersFault) {
  show();
  viewer.take();
  ASSERT_TRUE(viewer.ack(1).ok());
  now += milliseconds(900);
  show();
  EXPECT_EQ(viewer.take()->skipped_frames, 0U);
}

TEST_F(ViewerTest, NewestFrameReplacesOneThatWaitsTooLong) {
  show();
  viewer.take();
  now += milliseconds(100);
  show();
  EXPECT_FALSE(viewer.due() == now);  // the slot is taken: wait
  now += milliseconds(300);
  ASSERT_TRUE(viewer.due().has_value());
  EXPECT_LE(*viewer.due(), now);
  EXPECT_EQ(show(), 3U);
  const auto outgoing = viewer.take();
  EXPECT_EQ(outgoing->frame_index, 3U);
  EXPECT_EQ(outgoing->skipped_frames, 1U);
}

TEST_F(ViewerTest, RefusesAnAckOfAFrameThatWasNeverSent) {
  show();
  EXPECT_EQ(viewer.ack(1).code(), absl::StatusCode::kInvalidArgument);
  viewer.take();
  EXPECT_TRUE(viewer.ack(1).ok());
  EXPECT_TRUE(viewer.ack(1).ok());  // again does no harm
}

TEST_F(ViewerTest, AFrameThatWasOvertakenIsDropped) {
  const std::uint64_t first = viewer.begin_frame(now);
  const std::uint64_t second = viewer.begin_frame(now);
  viewer.deliver(second, std::make_shared<EncodedFrame>());
  viewer.deliver(first, std::make_shared<EncodedFrame>());
  EXPECT_EQ(viewer.take()->frame_index, second);
  EXPECT_FALSE(viewer.take().has_value());
}

TEST_F(ViewerTest, EndsOnce) {
  viewer.end(absl::NotFoundError("first"));
  viewer.end(absl::InternalError("second"));
  EXPECT_EQ(ended.code(), absl::StatusCode::kNotFound);
  EXPECT_FALSE(viewer.due().has_value());
}

}  // namespace
}  // namespace throng::server
