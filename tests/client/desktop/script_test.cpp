#include "client/desktop/script.hpp"

#include <gtest/gtest.h>

namespace throng::client {
namespace {

using Kind = ScriptStep::Kind;

TEST(ScriptTest, LinesBecomeSteps) {
  const auto steps = parse_script(
      "# a tour\n\nclick 10 20  # there\r\nkey Shift+W\nwait frames>2\nwheel -3 5 6\nsize 800 600\n"
      "screenshot a.png\n");
  ASSERT_TRUE(steps.ok()) << steps.status();
  const Kind expected[] = {Kind::kMove,  Kind::kDown,      Kind::kUp,   Kind::kKeyDown,
                           Kind::kKeyUp, Kind::kWait,      Kind::kMove, Kind::kWheel,
                           Kind::kSize,  Kind::kScreenshot};
  ASSERT_EQ(steps->size(), std::size(expected));
  for (std::size_t i = 0; i < steps->size(); ++i) EXPECT_EQ((*steps)[i].kind, expected[i]) << i;
  EXPECT_EQ((*steps)[3].text, "W");
  EXPECT_TRUE((*steps)[3].shift);
  EXPECT_EQ((*steps)[7].x, -3.0);
}

TEST(ScriptTest, ADragWithTheRightButtonEndsWhereItShould) {
  const auto steps = parse_script("drag 0 0 40 20 right");
  ASSERT_TRUE(steps.ok());
  EXPECT_EQ((*steps)[1].button, 3);
  EXPECT_EQ(steps->back().kind, Kind::kUp);
  EXPECT_EQ(steps->back().x, 40.0);
}

TEST(ScriptTest, WhatIsNotUnderstoodIsNamedWithItsLine) {
  for (const char* line : {"jump 1 2", "click 1", "click a b", "drag 1 2 3 4 left", "size 1 1",
                           "click nan 1", "wheel 1 2", "wait", "size 1e9 800", "key A B"}) {
    const auto steps = parse_script(std::string("key T\n") + line);
    ASSERT_FALSE(steps.ok()) << line;
    EXPECT_NE(steps.status().message().find("line 2"), std::string_view::npos);
  }
}

TEST(ScriptTest, ConditionsAreThoseOfTheState) {
  const std::string state = R"({"frames": 12, "live": true, "crowd": "a=b", "list": ["x"]})";
  for (const char* yes : {"frames>11", "frames<13", "frames=12", "live=true", "live!=false",
                          "crowd=a=b", "list=[\"x\"]"}) {
    const auto held = holds(yes, state);
    ASSERT_TRUE(held.ok()) << held.status();
    EXPECT_TRUE(*held) << yes;
  }
  EXPECT_FALSE(*holds("frames>12", state));
  for (const char* wrong : {"", "frames", "=1", "frame>1", "live>1", "frames>x", "frames!1"}) {
    EXPECT_FALSE(holds(wrong, state).ok()) << wrong;
  }
  EXPECT_FALSE(holds("a=1", "no JSON").ok());
}

}  // namespace
}  // namespace throng::client
