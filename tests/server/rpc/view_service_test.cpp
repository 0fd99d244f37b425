#include <gmock/gmock.h>

#include <functional>
#include <limits>

#include "server/rpc/test_server.hpp"
#include "throng/render/encode.hpp"

namespace throng::test {
namespace {

using testing::HasSubstr;

/// A server with a crowd of two that has one frame.
class ViewServiceTest : public testing::Test {
 protected:
  void open(server::ServerOptions options = {}) {
    server.emplace(std::move(options));
    publishing.emplace(server->channel());
    ASSERT_TRUE(publishing->start("station"));
    ASSERT_TRUE(publishing->membership(1, {1, 2}));
    ASSERT_TRUE(publishing->chunk(1, 1, 0, 2));
    ASSERT_EQ(publishing->outcome(), v1::FrameAck::OUTCOME_APPLIED);
  }

  static int red_of(const v1::StreamViewResponse& frame) {
    const auto image = render::decode_jpeg(
        {reinterpret_cast<const std::uint8_t*>(frame.image().data()), frame.image().size()});
    EXPECT_TRUE(image.ok()) << image.status();
    return image.ok() ? image->rgbx.at(0) : -1;
  }

  std::optional<TestServer> server;
  std::optional<Publishing> publishing;
};

TEST_F(ViewServiceTest, TwoViewersWithDifferentCamerasOnOneCrowd) {
  open();
  Viewing bright(server->channel()), dark(server->channel());
  ASSERT_TRUE(bright.send(Viewing::options("station", 220.0)));
  ASSERT_TRUE(dark.send(Viewing::options("station", 10.0)));
  for (int i = 0; i < 5; ++i) {
    const auto one = bright.next();
    const auto other = dark.next();
    ASSERT_TRUE(one.has_value() && other.has_value());
    EXPECT_NEAR(red_of(*one), 220, 4);
    EXPECT_NEAR(red_of(*other), 10, 4);
    EXPECT_EQ(one->width_px(), 32U);
    EXPECT_EQ(one->stats().agents(), 2U);
    EXPECT_TRUE(one->live());
    EXPECT_DOUBLE_EQ(one->camera().eye().x(), 220.0);
  }
  EXPECT_EQ(server->crowd("station").viewers(), 2U);
  EXPECT_TRUE(bright.finish().ok());
  EXPECT_TRUE(dark.finish().ok());
  EXPECT_EQ(server->crowd("station").viewers(), 0U);
}

TEST_F(ViewServiceTest, FirstFrameHasIndexOne) {
  open();
  Viewing viewing(server->channel());
  ASSERT_TRUE(viewing.send(Viewing::options("station", 1.0)));
  EXPECT_EQ(viewing.next()->frame_index(), 1U);
}

TEST_F(ViewServiceTest, LaterMessagesChangeWhatTheyCarryAndLeaveTheRest) {
  open();
  Viewing viewing(server->channel());
  ASSERT_TRUE(viewing.send(Viewing::options("station", 200.0)));
  ASSERT_TRUE(viewing.next().has_value());
  v1::ViewOptions change;
  change.set_width_px(64);
  ASSERT_TRUE(viewing.send(change));
  std::optional<v1::StreamViewResponse> frame;
  do {
    frame = viewing.next();
    ASSERT_TRUE(frame.has_value());
  } while (frame->width_px() != 64);
  EXPECT_EQ(frame->height_px(), 16U);
  EXPECT_NEAR(red_of(*frame), 200, 4);
  // back to the overview
  v1::ViewOptions overview;
  overview.set_overview(true);
  ASSERT_TRUE(viewing.send(overview));
  do {
    frame = viewing.next();
    ASSERT_TRUE(frame.has_value());
  } while (frame->camera().eye().x() == 200.0);
}

TEST_F(ViewServiceTest, SlowReaderSkipsFramesInsteadOfLagging) {
  open();
  Viewing slow(server->channel()), quick(server->channel());
  ASSERT_TRUE(slow.send(Viewing::options("station", 1.0)));
  ASSERT_TRUE(quick.send(Viewing::options("station", 2.0)));
  // As many as are allowed in flight, and not acknowledged.
  std::optional<v1::StreamViewResponse> last;
  for (int i = 0; i < 3; ++i) {
    last = slow.read();
    ASSERT_TRUE(last.has_value());
  }
  // Time passes: the other viewer sees a good many frames, and the crowd moves on.
  for (int i = 0; i < 30; ++i) ASSERT_TRUE(quick.next().has_value());
  ASSERT_TRUE(publishing->chunk(90, 1, 0, 2));
  ASSERT_EQ(publishing->outcome(), v1::FrameAck::OUTCOME_APPLIED);
  ASSERT_TRUE(slow.ack(last->frame_index()));
  const auto frame = slow.read();
  ASSERT_TRUE(frame.has_value());
  // A busy machine may have skipped one before.
  const std::uint64_t skipped = frame->skipped_frames() - last->skipped_frames();
  EXPECT_GT(skipped, 5U);
  EXPECT_EQ(frame->frame_index(), last->frame_index() + 1 + skipped);
  EXPECT_EQ(frame->capture_time_us(), 9'000'000) << "the frame shows the past";
}

TEST_F(ViewServiceTest, RefusesWhatIsOutOfRangeAndServesOthers) {
  open();
  struct Case {
    const char* text;
    std::function<void(v1::ViewOptions&)> spoil;
    grpc::StatusCode code = grpc::StatusCode::INVALID_ARGUMENT;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<Case> cases = {
      {"crowd_name", [](auto& o) { o.clear_crowd_name(); }},
      {"crowd_name", [](auto& o) { o.set_crowd_name(std::string(5000, 'a')); }},
      {"nowhere", [](auto& o) { o.set_crowd_name("nowhere"); }, grpc::StatusCode::NOT_FOUND},
      {"width_px", [](auto& o) { o.set_width_px(0); }},
      {"width_px", [](auto& o) { o.set_width_px(1'000'000); }},
      {"height_px", [](auto& o) { o.set_height_px(0xffffffffU); }},
      {"jpeg_quality", [](auto& o) { o.set_jpeg_quality(0); }},
      {"jpeg_quality", [](auto& o) { o.set_jpeg_quality(101); }},
      {"max_rate_hz", [](auto& o) { o.set_max_rate_hz(0.0); }},
      {"max_rate_hz", [nan](auto& o) { o.set_max_rate_hz(nan); }},
      {"vertex_budget", [](auto& o) { o.set_vertex_budget(~std::uint64_t{0}); }},
      {"channel", [](auto& o) { o.set_channel("mood"); }},
      {"channel_low", [nan](auto& o) { o.set_channel_low(nan); }},
      {"channel_low", [](auto& o) { o.set_channel_low(5.0); }},
      {"camera.eye.x", [nan](auto& o) { o.mutable_camera()->mutable_eye()->set_x(nan); }},
      {"camera.target", [](auto& o) { *o.mutable_camera()->mutable_target() = o.camera().eye(); }},
      {"camera.up", [](auto& o) { o.mutable_camera()->mutable_up(); }},
      {"fov_y_deg", [](auto& o) { o.mutable_camera()->set_fov_y_deg(180.0); }},
      {"ortho_height_m", [](auto& o) { o.mutable_camera()->set_ortho_height_m(-1.0); }},
      {"overview", [](auto& o) { o.set_overview(true); }},
  };
  Viewing honest(server->channel());
  ASSERT_TRUE(honest.send(Viewing::options("station", 1.0)));
  for (const Case& test : cases) {
    SCOPED_TRACE(test.text);
    v1::ViewOptions options = Viewing::options("station", 9.0);
    test.spoil(options);
    Viewing hostile(server->channel());
    hostile.send(options);
    const grpc::Status status = hostile.end();
    EXPECT_EQ(status.error_code(), test.code) << status.error_message();
    EXPECT_THAT(status.error_message(), HasSubstr(test.text));
    EXPECT_TRUE(honest.next().has_value());
  }
}

TEST_F(ViewServiceTest, RefusesAnAckOfTheFuture) {
  open();
  Viewing viewing(server->channel());
  ASSERT_TRUE(viewing.send(Viewing::options("station", 1.0)));
  ASSERT_TRUE(viewing.read().has_value());
  viewing.ack(1'000'000);
  EXPECT_EQ(viewing.end().error_code(), grpc::StatusCode::INVALID_ARGUMENT);
}

TEST_F(ViewServiceTest, RefusesOneViewerTooManyUntilOneLeaves) {
  server::ServerOptions options;
  options.limits.max_viewers = 1;
  open(options);
  {
    Viewing first(server->channel());
    ASSERT_TRUE(first.send(Viewing::options("station", 1.0)));
    ASSERT_TRUE(first.next().has_value());
    Viewing second(server->channel());
    second.send(Viewing::options("station", 1.0));
    EXPECT_EQ(second.end().error_code(), grpc::StatusCode::RESOURCE_EXHAUSTED);
    EXPECT_TRUE(first.finish().ok());
  }
  Viewing third(server->channel());
  ASSERT_TRUE(third.send(Viewing::options("station", 1.0)));
  EXPECT_TRUE(third.next().has_value());
}

TEST_F(ViewServiceTest, EndsViewsOfACrowdThatIsDeleted) {
  open();
  ASSERT_TRUE(publishing->finish().ok());
  Viewing viewing(server->channel());
  ASSERT_TRUE(viewing.send(Viewing::options("station", 1.0)));
  ASSERT_TRUE(viewing.next().has_value());
  grpc::ClientContext context;
  prepare(context);
  v1::DeleteCrowdRequest request;
  request.set_crowd_name("station");
  v1::DeleteCrowdResponse response;
  ASSERT_TRUE(
      v1::CrowdService::NewStub(server->channel())->DeleteCrowd(&context, request, &response).ok());
  EXPECT_EQ(viewing.end().error_code(), grpc::StatusCode::NOT_FOUND);
}

TEST_F(ViewServiceTest, StillPictureAsJpegAndPng) {
  open();
  const auto stub = v1::ViewService::NewStub(server->channel());
  const auto ask = [&](v1::GetPictureRequest::Format format, v1::GetPictureResponse& response,
                       std::int64_t scene_time_us = 100'000) {
    grpc::ClientContext context;
    prepare(context);
    v1::GetPictureRequest request;
    *request.mutable_options() = Viewing::options("station", 99.0);
    request.set_format(format);
    request.set_scene_time_us(scene_time_us);
    return stub->GetPicture(&context, request, &response);
  };
  v1::GetPictureResponse response;
  ASSERT_TRUE(ask(v1::GetPictureRequest::FORMAT_PNG, response).ok());
  const auto png = render::decode_png(
      {reinterpret_cast<const std::uint8_t*>(response.image().data()), response.image().size()});
  ASSERT_TRUE(png.ok());
  EXPECT_EQ(png->rgbx.at(0), 99);
  EXPECT_EQ(response.scene_time_us(), 100'000);
  ASSERT_TRUE(ask(v1::GetPictureRequest::FORMAT_JPEG, response).ok());
  EXPECT_EQ(ask(v1::GetPictureRequest::FORMAT_UNSPECIFIED, response).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  for (const std::int64_t time_us : {std::int64_t{-1}, std::int64_t{5'000'000'000}}) {
    const grpc::Status status = ask(v1::GetPictureRequest::FORMAT_PNG, response, time_us);
    EXPECT_EQ(status.error_code(), grpc::StatusCode::OUT_OF_RANGE);
    EXPECT_THAT(status.error_message(),
                HasSubstr("of crowd 'station': its history goes from 0.10 to 0.10 s"));
  }
}

TEST_F(ViewServiceTest, AFailedFrameIsToldAsInternal) {
  open();
  server->log->fails = true;
  Viewing viewing(server->channel());
  viewing.send(Viewing::options("station", 1.0));
  const grpc::Status status = viewing.end();
  EXPECT_EQ(status.error_code(), grpc::StatusCode::INTERNAL);
  EXPECT_THAT(status.error_message(), HasSubstr("out of paint"));
}

}  // namespace
}  // namespace throng::test
