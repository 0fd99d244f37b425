#include "server/scene/environment_builder.hpp"

#include <gtest/gtest.h>

#include "server/view/painter.hpp"
#include "throng/render/environment.hpp"

namespace throng::server {
namespace {

constexpr char kRoom[] = "POLYGON ((0 0, 9 0, 9 9, 0 9, 0 0))";

class EnvironmentBuilderTest : public testing::Test {
 protected:
  std::shared_ptr<render::Crowd> crowd_ =
      std::make_shared<render::Crowd>(test::nobody_cast(), render::CrowdSettings());
  EnvironmentBuilder builder_;
};

TEST_F(EnvironmentBuilderTest, CrowdGetsItsWallsAndLosesThem) {
  ASSERT_TRUE(builder_.build("hall", crowd_, kRoom).ok());
  builder_.wait_idle();
  ASSERT_NE(crowd_->environment(), nullptr);
  EXPECT_GT(crowd_->environment()->triangles, 0U);
  EXPECT_TRUE(builder_.build("hall", crowd_, "").ok());
  EXPECT_EQ(crowd_->environment(), nullptr);
}

TEST_F(EnvironmentBuilderTest, WhatIsNoAreaIsRefusedAtOnceAndLeavesTheWalls) {
  ASSERT_TRUE(builder_.build("hall", crowd_, kRoom).ok());
  builder_.wait_idle();
  const auto before = crowd_->environment();
  EXPECT_EQ(builder_.build("hall", crowd_, "POLYGON ((").code(),
            absl::StatusCode::kInvalidArgument);
  builder_.wait_idle();
  EXPECT_EQ(crowd_->environment(), before);
}

TEST_F(EnvironmentBuilderTest, CrowdThatIsGoneIsNotWaitedFor) {
  for (int i = 0; i < 20; ++i) {
    auto gone = std::make_shared<render::Crowd>(test::nobody_cast(), render::CrowdSettings());
    ASSERT_TRUE(builder_.build("gone", gone, kRoom).ok());
  }
  ASSERT_TRUE(builder_.build("hall", crowd_, kRoom).ok());
  builder_.wait_idle();
  EXPECT_NE(crowd_->environment(), nullptr);
}

}  // namespace
}  // namespace throng::server
