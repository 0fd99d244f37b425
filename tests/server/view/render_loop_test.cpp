#include "server/view/render_loop.hpp"

#include <gtest/gtest.h>

#include <condition_variable>
#include <mutex>
#include <span>
#include <utility>
#include <vector>

#include "server/view/painter.hpp"
#include "throng/render/encode.hpp"

namespace throng::server {
namespace {

constexpr std::chrono::seconds kDeadline{30};

/// A viewer with a connection that takes everything and acknowledges at once, unless it is told not
/// to.
class Client {
 public:
  explicit Client(ViewRequest request, bool acks = true)
      : viewer(std::make_shared<Viewer>(
            std::move(request), 3, [] { return Clock::now(); }, [this] { on_frame(); },
            [this](absl::Status status) {
              const std::lock_guard lock(mutex);
              ended = std::move(status);
              changed.notify_all();
            })),
        acks_(acks) {}

  template <typename Condition>
  bool wait(Condition condition) {
    std::unique_lock lock(mutex);
    return changed.wait_for(lock, kDeadline, condition);
  }
  bool wait_frames(std::size_t count) {
    return wait([&] { return frames.size() >= count; });
  }

  /// The newest frame that is not the second one of a picture at rest.
  EncodedFrame hurried() {
    const std::lock_guard lock(mutex);
    for (auto outgoing = frames.rbegin(); outgoing != frames.rend(); ++outgoing) {
      if (!outgoing->frame->in_full) return *outgoing->frame;
    }
    return {};
  }

  RenderLoop* loop = nullptr;
  std::mutex mutex;
  std::condition_variable changed;
  std::vector<OutgoingFrame> frames;
  absl::Status ended;
  std::shared_ptr<Viewer> viewer;

 private:
  void on_frame() {
    while (const auto outgoing = viewer->take()) {
      if (acks_) {
        EXPECT_TRUE(viewer->ack(outgoing->frame_index).ok());
      }
      const std::lock_guard lock(mutex);
      frames.push_back(*outgoing);
      changed.notify_all();
    }
    if (acks_ && loop != nullptr) loop->wake();
  }
  bool acks_;
};

class RenderLoopTest : public testing::Test {
 protected:
  void SetUp() override {
    StartRequest start;
    start.crowd_name = "crowd";
    publication_ = *registry_.start(std::move(start), [] {});
    crowd_ = *registry_.find("crowd");
    auto made = RenderLoop::start(test::painter(log_), {});
    ASSERT_TRUE(made.ok()) << made.status();
    loop_ = *std::move(made);
  }

  ViewRequest request_of(double red) const {
    ViewRequest request;
    request.crowd = crowd_;
    request.camera.emplace();
    request.camera->eye_world = {red, 50.0, 50.0};
    request.viewport = {32, 16};
    request.max_rate_hz = 200.0;
    return request;
  }

  void push(std::int64_t time_us, float east_m = 0.0F) {
    auto membership = std::make_shared<render::Membership>();
    membership->epoch = 1;
    membership->ids = {1};
    render::AgentFrame frame;
    frame.time_us = time_us;
    frame.membership = membership;
    frame.position_m = {{east_m, 0, 0}};
    ASSERT_TRUE(publication_->push(std::move(frame)).ok());
  }

  std::shared_ptr<test::PainterLog> log_ = std::make_shared<test::PainterLog>();
  Registry registry_{test::nobody_cast(), Limits()};
  std::unique_ptr<Publication> publication_;
  std::shared_ptr<NamedCrowd> crowd_;
  std::unique_ptr<RenderLoop> loop_;
};

TEST_F(RenderLoopTest, SaysWhyThereIsNoRenderer) {
  const auto loop = RenderLoop::start(
      []() -> absl::StatusOr<std::unique_ptr<FrameRenderer>> {
        return absl::UnavailableError("no EGL here");
      },
      {});
  EXPECT_EQ(loop.status(), absl::UnavailableError("no EGL here"));
}

TEST_F(RenderLoopTest, ShowsEachViewerItsOwnCamera) {
  Client red(request_of(200.0)), dark(request_of(10.0));
  red.loop = dark.loop = loop_.get();
  loop_->add(red.viewer);
  loop_->add(dark.viewer);
  ASSERT_TRUE(red.wait_frames(2));
  ASSERT_TRUE(dark.wait_frames(2));
  loop_.reset();
  const auto color = [](const Client& client) {
    const std::string& jpeg = client.frames[0].frame->image;
    const auto image =
        render::decode_jpeg({reinterpret_cast<const std::uint8_t*>(jpeg.data()), jpeg.size()});
    return image->rgbx.at(0);
  };
  EXPECT_NEAR(color(red), 200, 4);
  EXPECT_NEAR(color(dark), 10, 4);
}

TEST_F(RenderLoopTest, DrawsAPictureThatDoesNotChangeOnlyOnce) {
  Client one(request_of(1.0)), other(request_of(1.0));
  one.loop = other.loop = loop_.get();
  loop_->add(one.viewer);
  loop_->add(other.viewer);
  ASSERT_TRUE(one.wait_frames(10));
  ASSERT_TRUE(other.wait_frames(10));
  const RenderLoopCounters counters = loop_->counters();
  loop_.reset();
  EXPECT_EQ(counters.rendered_frames, 1U);
  EXPECT_GT(counters.shared_frames, 9U);
}

TEST_F(RenderLoopTest, AViewerWithoutCreditsCostsNothing) {
  Client slow(request_of(1.0), false), fast(request_of(2.0));
  slow.loop = fast.loop = loop_.get();
  loop_->add(slow.viewer);
  loop_->add(fast.viewer);
  ASSERT_TRUE(slow.wait_frames(3));
  ASSERT_TRUE(fast.wait_frames(30));
  EXPECT_EQ(slow.frames.size(), 3U);
  // It reads again: what it gets is the present, and it is told what it missed.
  EXPECT_TRUE(slow.viewer->ack(3).ok());
  loop_->wake();
  ASSERT_TRUE(slow.wait_frames(4));
  loop_.reset();
  EXPECT_GT(slow.frames[3].skipped_frames, 0U);
  EXPECT_EQ(slow.frames[3].frame_index, 4 + slow.frames[3].skipped_frames);
}

TEST_F(RenderLoopTest, SlowFramesCostDetailOfViewsThatAskForNoBudget) {
  RenderLoopOptions options;
  options.target_ms = 10.0;
  options.default_vertex_budget = 1'000'000;
  log_->raster_ms = 100.0;
  loop_ = *RenderLoop::start(test::painter(log_), options);
  Client client(request_of(0.0));
  client.loop = loop_.get();
  loop_->add(client.viewer);
  // Looks from elsewhere, or the picture would not be drawn again, until that is what it gets.
  const auto budget_from = [&](double red, std::uint64_t asked = 0) {
    ViewRequest request = request_of(red);
    request.vertex_budget = asked;
    client.viewer->set_request(request);
    loop_->wake();
    EXPECT_TRUE(client.wait([&] {
      return !client.frames.empty() && client.frames.back().frame->camera.eye_world.x == red;
    }));
    return client.hurried().vertex_budget;
  };
  EXPECT_EQ(budget_from(0.0), 1'000'000U);
  const std::uint64_t before = budget_from(1.0);
  EXPECT_LT(before, 1'000'000U);
  EXPECT_EQ(budget_from(3.0, 777'777), 777'777U);
  log_->raster_ms = 1.0;
  for (const double red : {4.0, 5.0, 6.0}) budget_from(red);  // one fast frame may be chance
  EXPECT_GT(budget_from(7.0), before);
  loop_.reset();
}

TEST_F(RenderLoopTest, WhatADeviceTellsLateIsOfTheFrameBefore) {
  RenderLoopOptions options;
  options.target_ms = 10.0;
  options.default_vertex_budget = 1'000'000;
  log_->on_device = true;
  log_->raster_ms = 100.0;  // of which nobody waits for more than half a millisecond
  loop_ = *RenderLoop::start(test::painter(log_), options);
  Client client(request_of(0.0));
  client.loop = loop_.get();
  loop_->add(client.viewer);
  const auto budget_from = [&](double red) {
    client.viewer->set_request(request_of(red));
    loop_->wake();
    EXPECT_TRUE(client.wait([&] {
      return !client.frames.empty() && client.frames.back().frame->camera.eye_world.x == red;
    }));
    return client.hurried().vertex_budget;
  };
  EXPECT_EQ(budget_from(0.0), 1'000'000U);
  budget_from(1.0);  // in which the first one's time is told
  EXPECT_LT(budget_from(2.0), 1'000'000U);
  loop_.reset();
}

TEST_F(RenderLoopTest, TwoViewsShareTheTimeThatOneHad) {
  RenderLoopOptions options;
  options.target_ms = 10.0;
  options.default_vertex_budget = 1'000'000;
  log_->ms_per_million = 10.0;
  loop_ = *RenderLoop::start(test::painter(log_), options);
  Client one(request_of(0.0)), other(request_of(0.5));
  one.loop = other.loop = loop_.get();
  const auto settled_budget = [&](Client& client, double red) {
    for (int i = 0; i < 12; ++i) {
      red += 1.0;
      client.viewer->set_request(request_of(red));
      other.viewer->set_request(request_of(red + 0.5));
      loop_->wake();
      EXPECT_TRUE(client.wait([&] {
        return !client.frames.empty() && client.frames.back().frame->camera.eye_world.x == red;
      }));
    }
    return static_cast<double>(client.hurried().vertex_budget);
  };
  loop_->add(one.viewer);
  const double alone = settled_budget(one, 0.0);
  EXPECT_NEAR(alone, 1e6, 0.1e6);
  loop_->add(other.viewer);
  EXPECT_NEAR(settled_budget(one, 100.0), 0.5 * alone, 0.1 * alone);
  loop_.reset();
}

TEST_F(RenderLoopTest, AStillPictureIsDrawnOnceMoreInFull) {
  RenderLoopOptions options;
  options.target_ms = 10.0;
  log_->raster_ms = 100.0;
  log_->compute = "cpu";
  loop_ = *RenderLoop::start(test::painter(log_), options);
  Client client(request_of(5.0)), late(request_of(5.0));
  client.loop = late.loop = loop_.get();
  loop_->add(client.viewer);
  ASSERT_TRUE(client.wait([&] { return !client.frames.empty(); }));
  EXPECT_FALSE(client.frames.front().frame->in_full);
  EXPECT_EQ(client.frames.front().frame->oversampling, 1U);
  EXPECT_EQ(client.frames.front().frame->target_ms, 10.0);
  ASSERT_TRUE(client.wait([&] { return client.frames.back().frame->in_full; }));
  // Then nothing: what is sent on is that picture, also to who comes later.
  std::size_t frames = 0;
  {
    const std::lock_guard lock(client.mutex);
    frames = client.frames.size();
  }
  ASSERT_TRUE(client.wait_frames(frames + 40));
  loop_->add(late.viewer);
  ASSERT_TRUE(late.wait_frames(1));
  EXPECT_EQ(loop_->counters().rendered_frames, 2U);
  const std::shared_ptr<const EncodedFrame> still = late.frames.front().frame;
  EXPECT_TRUE(still->in_full);
  EXPECT_EQ(still->oversampling, 2U);
  EXPECT_EQ(still->target_ms, 0.0);

  // It is what a picture out of turn is.
  std::shared_ptr<const EncodedFrame> picture;
  PictureRequest request;
  request.view = request_of(5.0);
  ASSERT_TRUE(loop_
                  ->picture(request,
                            [&](auto frame) {
                              ASSERT_TRUE(frame.ok());
                              const std::lock_guard lock(client.mutex);
                              picture = *frame;
                              client.changed.notify_all();
                            })
                  .ok());
  ASSERT_TRUE(client.wait([&] { return picture != nullptr; }));
  EXPECT_EQ(picture->image, still->image);

  // The next move is drawn in a hurry again, by what the frames before the still one taught.
  client.viewer->set_request(request_of(6.0));
  loop_->wake();
  ASSERT_TRUE(client.wait([&] { return client.frames.back().frame->camera.eye_world.x == 6.0; }));
  loop_.reset();
  EXPECT_LT(log_->rendered.load(), 6);
}

TEST_F(RenderLoopTest, AStillPictureThatCannotBeDrawnInFullStaysAsItWas) {
  RenderLoopOptions options;
  options.target_ms = 10.0;
  log_->fails_in_full = true;
  loop_ = *RenderLoop::start(test::painter(log_), options);
  Client client(request_of(5.0));
  client.loop = loop_.get();
  loop_->add(client.viewer);
  ASSERT_TRUE(client.wait_frames(120));
  const RenderLoopCounters counters = loop_->counters();
  loop_.reset();
  EXPECT_EQ(counters.rendered_frames, 1U);
  EXPECT_LE(counters.failed_frames, 1U);
  EXPECT_TRUE(client.ended.ok());
}

TEST_F(RenderLoopTest, AStillPictureStaysWhileOthersMove) {
  RenderLoopOptions options;
  options.target_ms = 10.0;
  loop_ = *RenderLoop::start(test::painter(log_), options);
  Client resting(request_of(5.0)), moving(request_of(100.0));
  resting.loop = moving.loop = loop_.get();
  loop_->add(resting.viewer);
  ASSERT_TRUE(resting.wait(
      [&] { return !resting.frames.empty() && resting.frames.back().frame->in_full; }));
  std::size_t before = 0;
  {
    const std::lock_guard lock(resting.mutex);
    before = resting.frames.size();
  }
  loop_->add(moving.viewer);
  for (int i = 1; i <= 20; ++i) {
    moving.viewer->set_request(request_of(100.0 + i));
    loop_->wake();
    ASSERT_TRUE(moving.wait([&] {
      return !moving.frames.empty() && moving.frames.back().frame->camera.eye_world.x == 100.0 + i;
    }));
  }
  ASSERT_TRUE(resting.wait_frames(before + 20));
  loop_.reset();
  for (std::size_t i = before; i < resting.frames.size(); ++i) {
    EXPECT_TRUE(resting.frames[i].frame->in_full);
  }
}

TEST_F(RenderLoopTest, TellsViewersOfADeletedCrowd) {
  Client client(request_of(1.0));
  loop_->add(client.viewer);
  publication_.reset();
  ASSERT_TRUE(registry_.remove("crowd").ok());
  loop_->wake();
  EXPECT_TRUE(client.wait([&] { return !client.ended.ok(); }));
  EXPECT_EQ(client.ended.code(), absl::StatusCode::kNotFound);
  loop_.reset();
}

TEST_F(RenderLoopTest, AFailedFrameEndsItsViewersAndNobodyElse) {
  log_->fails = true;
  Client unlucky(request_of(1.0));
  loop_->add(unlucky.viewer);
  ASSERT_TRUE(unlucky.wait([&] { return !unlucky.ended.ok(); }));
  EXPECT_EQ(unlucky.ended.code(), absl::StatusCode::kInternal);
  log_->fails = false;
  Client lucky(request_of(2.0));
  lucky.loop = loop_.get();
  loop_->add(lucky.viewer);
  EXPECT_TRUE(lucky.wait_frames(2));
  loop_.reset();
}

TEST_F(RenderLoopTest, PictureAtAGivenTimeAsPng) {
  push(1'000'000);
  push(2'000'000);
  std::mutex mutex;
  std::condition_variable changed;
  std::shared_ptr<const EncodedFrame> got;
  PictureRequest request;
  request.view = request_of(77.0);
  request.format = ImageFormat::kPng;
  request.scene_time_us = 1'500'000;
  ASSERT_TRUE(loop_
                  ->picture(request,
                            [&](auto frame) {
                              ASSERT_TRUE(frame.ok());
                              const std::lock_guard lock(mutex);
                              got = *frame;
                              changed.notify_all();
                            })
                  .ok());
  std::unique_lock lock(mutex);
  ASSERT_TRUE(changed.wait_for(lock, kDeadline, [&] { return got != nullptr; }));
  EXPECT_EQ(got->scene_time_us, 1'500'000);
  const auto image = render::decode_png(
      {reinterpret_cast<const std::uint8_t*>(got->image.data()), got->image.size()});
  ASSERT_TRUE(image.ok());
  EXPECT_EQ(image->rgbx.at(0), 77);
}

TEST_F(RenderLoopTest, AnOverviewOfThePastShowsThoseWhoWereThere) {
  for (int i = 0; i < 20; ++i) push(1'000'000 + 100'000 * i, 100.0F * static_cast<float>(i));
  Client client([&] {
    ViewRequest request = request_of(0.0);
    request.camera.reset();
    request.playhead.paused = true;
    request.playhead.go_to(1'000'000, Clock::now());
    return request;
  }());
  client.loop = loop_.get();
  loop_->add(client.viewer);
  ASSERT_TRUE(client.wait_frames(1));
  const EncodedFrame& past = *client.frames.front().frame;
  EXPECT_LT(past.overview.low.x, 0.0);
  EXPECT_GT(past.overview.high.x, 0.0);
  EXPECT_LT(past.overview.high.x, 300.0) << "where the agents are now";
  EXPECT_NEAR(past.camera.target_world.x, 0.0, 150.0);
  loop_->remove(client.viewer.get());
}

TEST_F(RenderLoopTest, StillPicturesDoNotStopTheStreams) {
  PictureRequest request;
  request.view = request_of(3.0);
  Client viewer(request_of(1.0));
  std::mutex mutex;
  std::condition_variable changed;
  int answered = 0;
  std::size_t frames_before_second = 0;
  const auto done = [&](auto) {
    const std::lock_guard lock(mutex);
    if (++answered == 2) {
      const std::lock_guard frames_lock(viewer.mutex);
      frames_before_second = viewer.frames.size();
    }
    changed.notify_all();
  };
  log_->hold(true);
  ASSERT_TRUE(loop_->picture(request, done).ok());
  loop_->add(viewer.viewer);
  ASSERT_TRUE(loop_->picture(request, done).ok());
  log_->hold(false);
  std::unique_lock lock(mutex);
  EXPECT_TRUE(changed.wait_for(lock, kDeadline, [&] { return answered == 2; }));
  // One encoder answers in the order of rendering: picture, viewer, picture.
  EXPECT_GE(frames_before_second, 1U);
  lock.unlock();
  loop_.reset();
}

TEST_F(RenderLoopTest, PicturesThatWaitAreBoundedAndAllAnswered) {
  log_->hold(true);
  std::atomic<int> answered{0};
  int accepted = 0, refused = 0;
  for (int i = 0; i < 40; ++i) {
    PictureRequest request;
    request.view = request_of(i);
    const absl::Status status = loop_->picture(request, [&](auto) { ++answered; });
    if (status.ok()) {
      ++accepted;
    } else {
      ++refused;
      EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted);
    }
  }
  EXPECT_GE(refused, 22);
  log_->hold(false);
  loop_.reset();
  EXPECT_EQ(answered.load(), accepted);
}

}  // namespace
}  // namespace throng::server
