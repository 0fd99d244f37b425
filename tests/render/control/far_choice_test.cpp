#include "render/control/far_choice.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "throng/render/control.hpp"

namespace throng::render {
namespace {

TEST(FarChoiceTest, ComesNearerWhileThatLessensTheErrorAndGoesBackWhenThereIsTime) {
  FarChoice choice;
  EXPECT_EQ(choice.least_px(), FarChoice::kLeastPx);
  for (int i = 0; i < 1000; ++i) choice.record(8.0F * FarChoice::kLeastPx / choice.least_px());
  EXPECT_EQ(choice.least_px(), FarChoice::kMostPx);
  for (int i = 0; i < 100; ++i) choice.record(0.7F);
  EXPECT_EQ(choice.least_px(), FarChoice::kMostPx) << "neither too much nor too little";
  for (int i = 0; i < 1000; ++i) choice.record(0.2F);
  EXPECT_EQ(choice.least_px(), FarChoice::kLeastPx);
}

TEST(FarChoiceTest, TakesBackWhatWinsNothingAndTriesAgainLessOften) {
  FarChoice choice;
  int changes = 0;
  float last_px = choice.least_px();
  for (int i = 0; i < 3000; ++i) {
    choice.record(6.0F);
    if (choice.least_px() != last_px) ++changes;
    last_px = choice.least_px();
    EXPECT_LE(last_px, FarChoice::kStep * FarChoice::kLeastPx);
  }
  EXPECT_GE(changes, 4);
  EXPECT_LE(changes, 16);
}

TEST(FarChoiceTest, WhatIsNotKnownChangesNothing) {
  FarChoice choice;
  for (int i = 0; i < 500; ++i) choice.record(i % 2 == 0 ? 0.0F : NAN);
  EXPECT_EQ(choice.least_px(), FarChoice::kLeastPx);
}

TEST(FarChoiceTest, EachControllerSaysWhereItsFarCrowdBegins) {
  const auto fixed = make_controller({.kind = ControllerKind::kFixed});
  const auto predictive = make_controller({.kind = ControllerKind::kPredictive});
  const auto sfsm = make_controller({.kind = ControllerKind::kSfsm});
  FramePlan plan = fixed->next_plan(30.0);
  EXPECT_EQ(plan.far_least_px, 0.0F);
  EXPECT_EQ(plan.far_distance_m, 0.0F) << "as the user has it";
  EXPECT_EQ(predictive->next_plan(30.0).far_least_px, FarChoice::kLeastPx);
  EXPECT_EQ(sfsm->next_plan(30.0).far_distance_m, 0.0F) << "State 0 draws the original models";
  sfsm->record({.frame_ms = 90.0, .visible = 1000, .vertices = 1'000'000, .farthest_m = 300.0});
  plan = sfsm->next_plan(30.0);
  EXPECT_EQ(plan.state, 1);
  EXPECT_FLOAT_EQ(plan.far_distance_m, plan.motion_distance_m);
  EXPECT_FLOAT_EQ(plan.far_distance_m, 250.0F);
}

}  // namespace
}  // namespace throng::render
