#include "server/batch/camera_path.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "render/compute/crowd_fixture.hpp"

namespace throng::server {
namespace {

const Site kSite{{0, 0, 0}, {40, 20, 2}, {1280, 720}};

using ::testing::HasSubstr;

/// Agent 7 walks from (0, 0) along +Y for four seconds; agent 8 stands.
std::unique_ptr<render::Crowd> walkers() {
  auto crowd = std::make_unique<render::Crowd>(test::tiny_cast(), render::CrowdSettings());
  const auto both = test::members({7, 8});
  for (int i = 0; i <= 40; ++i) {
    EXPECT_TRUE(crowd
                    ->push(test::frame_at(i * 100'000, both,
                                          {{0.0F, 0.13F * static_cast<float>(i), 0.0F}, {9, 9, 0}},
                                          {0.0F, 1.5707963F}))
                    .ok());
  }
  return crowd;
}

const render::Crowd* nobody() {
  static const render::Crowd crowd(test::tiny_cast(), render::CrowdSettings());
  return &crowd;
}

std::string write(const std::string& text) {
  const std::string path = ::testing::TempDir() + "camera_path_test.json";
  std::ofstream(path) << text;
  return path;
}

TEST(CameraPathTest, OneCameraStandsStill) {
  const auto path =
      CameraPath::parse(write(R"({"eye":[1,2,3],"target":[4,5,6],"fov_y_deg":90})"), kSite);
  ASSERT_TRUE(path.ok()) << path.status();
  for (const double time_s : {-1.0, 0.0, 100.0}) {
    EXPECT_EQ(path->at(time_s, *nobody()).eye_world, glm::dvec3(1, 2, 3));
    EXPECT_EQ(path->at(time_s, *nobody()).target_world, glm::dvec3(4, 5, 6));
    EXPECT_NEAR(path->at(time_s, *nobody()).fov_y_rad, 1.5707963, 1e-6);
  }
}

TEST(CameraPathTest, EyeAndTargetAreSpelledAsInTheViewer) {
  const auto path = CameraPath::parse("1,-2.5,3:4,5,1e1", kSite);
  ASSERT_TRUE(path.ok()) << path.status();
  EXPECT_EQ(path->name(), "camera");
  EXPECT_EQ(path->at(7.0, *nobody()).eye_world, glm::dvec3(1, -2.5, 3));
  EXPECT_EQ(path->at(7.0, *nobody()).target_world, glm::dvec3(4, 5, 10));
  for (const char* bad :
       {"1,2,3:4,5", "1,2:3,4,5,6", "1,2,3:4,5,nan", "1,2,3:1,2,3", "1,2,3;4,5,6"}) {
    const auto refused = CameraPath::parse(bad, kSite);
    ASSERT_FALSE(refused.ok()) << bad;
    EXPECT_THAT(std::string(refused.status().message()), HasSubstr("--camera: '")) << bad;
  }
  EXPECT_EQ(*client::parse_range("0:2.5"), std::pair(0.0, 2.5));
  EXPECT_EQ(*client::parse_range("3:-1"), std::pair(3.0, -1.0));
  for (const char* bad : {"", "1", "1:1", "a:2", "1:inf", "1:2:3"}) {
    EXPECT_FALSE(client::parse_range(bad).ok()) << bad;
  }
}

TEST(CameraPathTest, SeveralOfEyeAndTargetAreNumbered) {
  std::vector<client::CameraScript> cameras;
  for (const char* text : {"1,2,3:4,5,6", "top", "3,2,3:4,5,6"}) {
    cameras.push_back(*client::CameraScript::parse(text));
  }
  client::number_cameras({cameras.data(), 2});
  EXPECT_EQ(cameras[0].name(), "camera");
  client::number_cameras(cameras);
  EXPECT_EQ(cameras[0].name(), "camera-1");
  EXPECT_EQ(cameras[1].name(), "top");
  EXPECT_EQ(cameras[2].name(), "camera-2");
}

TEST(CameraPathTest, KeysAreMetExactlyAndHeldOutside) {
  const auto path = CameraPath::parse(write(R"({"keys":[{"time_s":0,"eye":[0,0,5],"target":[9,0,0]},
                        {"time_s":1,"eye":[1,0,5],"target":[9,1,0]},
                        {"time_s":4,"eye":[4,0,5],"target":[9,4,0]}]})"),
                                      kSite);
  ASSERT_TRUE(path.ok()) << path.status();
  EXPECT_EQ(path->at(-1, *nobody()).eye_world.x, 0.0);
  EXPECT_EQ(path->at(9, *nobody()).eye_world.x, 4.0);
  EXPECT_NEAR(path->at(1, *nobody()).eye_world.x, 1.0, 1e-12);
  // keys on a line at even speed: the spline is that line, whatever the spacing
  for (double t = 0; t <= 4; t += 0.125)
    EXPECT_NEAR(path->at(t, *nobody()).eye_world.x, t, 1e-12) << t;
}

TEST(CameraPathTest, WordsShowTheSite) {
  const auto top = CameraPath::parse("top", kSite);
  ASSERT_TRUE(top.ok()) << top.status();
  EXPECT_EQ(top->name(), "top");
  const render::Camera down = top->at(0, *nobody());
  EXPECT_EQ(glm::dvec2(down.eye_world), glm::dvec2(20, 10));
  EXPECT_GE(down.ortho_height_m * 1280 / 720, 40.0);
  const auto orbit = CameraPath::parse("orbit", kSite);
  ASSERT_TRUE(orbit.ok()) << orbit.status();
  for (const double time_s : {0.0, 3.0, 17.0}) {
    const render::Camera camera = orbit->at(time_s, *nobody());
    EXPECT_EQ(camera.target_world, glm::dvec3(20, 10, 1));
    EXPECT_NEAR(glm::length(glm::dvec2(camera.eye_world - camera.target_world)),
                0.75 * std::hypot(40, 20), 1e-9);
  }
  EXPECT_NE(orbit->at(0, *nobody()).eye_world, orbit->at(1, *nobody()).eye_world);
}

TEST(CameraPathTest, OrbitIsWhereTheFileSays) {
  const auto path = CameraPath::parse(
      write(
          R"({"orbit":{"center":[1,2,3],"radius_m":10,"height_m":4,"period_s":8,"start_deg":0}})"),
      kSite);
  ASSERT_TRUE(path.ok()) << path.status();
  EXPECT_EQ(path->name(), "camera_path_test");
  EXPECT_NEAR(glm::distance(path->at(0, *nobody()).eye_world, glm::dvec3(11, 2, 7)), 0, 1e-9);
  EXPECT_NEAR(glm::distance(path->at(2, *nobody()).eye_world, glm::dvec3(1, 12, 7)), 0, 1e-9);
}

TEST(CameraPathTest, FollowStaysBehindWhoWalksAndWhoStands) {
  const auto crowd = walkers();
  const auto walks = CameraPath::parse("follow:7", kSite);
  ASSERT_TRUE(walks.ok()) << walks.status();
  EXPECT_EQ(walks->name(), "follow-7");
  for (const double time_s : {2.0, 2.05, 3.7}) {  // it came along +Y, whatever its heading says
    EXPECT_NEAR(
        glm::distance(walks->at(time_s, *crowd).eye_world, glm::dvec3(0, 1.3 * time_s - 5.0, 2.6)),
        0, 1e-3)
        << time_s;
  }
  const auto stands = CameraPath::parse(write(R"({"follow":{"agent":8,"behind_m":3}})"), kSite);
  ASSERT_TRUE(stands.ok()) << stands.status();
  EXPECT_NEAR(glm::distance(stands->at(2, *crowd).eye_world, glm::dvec3(9, 6, 2.6)), 0, 1e-3);
}

TEST(CameraPathTest, FollowOfSomebodyAbsentIsTheOverview) {
  const auto overview = CameraPath::parse("overview", kSite);
  const auto follow = CameraPath::parse("follow:99", kSite);
  ASSERT_TRUE(overview.ok() && follow.ok());
  EXPECT_EQ(follow->at(1, *walkers()).eye_world, overview->at(1, *nobody()).eye_world);
  EXPECT_TRUE(CameraPath::parse("follow:person_3", kSite).ok());  // names are ids, too
  EXPECT_FALSE(CameraPath::parse("follow:", kSite).ok());
}

TEST(CameraPathTest, WrongFilesNameFileKeyAndLimit) {
  EXPECT_EQ(CameraPath::parse("/nonexistent/camera.json", kSite).status().code(),
            absl::StatusCode::kNotFound);
  const std::pair<const char*, const char*> cases[] = {
      {"not json", "is not JSON"},
      {"[]", "must be an object"},
      {R"({"eye":[0,0,0]})", "'target' is missing"},
      {R"({"eye":[0,0],"target":[1,1,1]})", "'eye' must be three numbers"},
      {R"({"eye":[0,0,"a"],"target":[1,1,1]})", "'eye'[2]"},
      {R"({"eye":[0,0,1e300],"target":[1,1,1]})", "'eye'[2]"},
      {R"({"eye":[1,1,1],"target":[1,1,1]})", "the same point"},
      {R"({"eye":[0,0,0],"target":[1,1,1],"up":[0,0,0]})", "no length"},
      {R"({"eye":[0,0,0],"target":[1,1,1],"fov_y_deg":180})", "'fov_y_deg' is 180"},
      {R"({"orbit":{"radius_m":0}})", "orbit: 'radius_m' is 0"},
      {R"({"orbit":3})", "orbit: must be an object"},
      {R"({"follow":{}})", "'agent' is missing"},
      {R"({"follow":{"agent":-3}})", "'agent' is missing or neither"},
      {R"({"keys":[]})", "at least one"},
      {R"({"keys":[{"eye":[0,0,0],"target":[1,1,1]}]})", "'time_s' is missing"},
      {R"({"keys":[{"time_s":-1e308,"eye":[0,0,0],"target":[1,1,1]}]})",
       "keys[0]: 'time_s' is -1e+308"},
      {R"({"keys":[{"time_s":1,"eye":[0,0,0],"target":[1,1,1]},
                   {"time_s":1,"eye":[0,0,0],"target":[1,1,1]}]})",
       "keys[1]: 'time_s' is 1"},
      {R"({"keys":[{"time_s":1,"eye":[0,0,0],"target":[1,1,1]},
                   {"time_s":2,"eye":[0,0,0],"target":[1,1,1],"ortho_height_m":5}]})",
       "can't be mixed"},
  };
  for (const auto& [text, message] : cases) {
    const auto path = CameraPath::parse(write(text), kSite);
    ASSERT_FALSE(path.ok()) << text;
    EXPECT_THAT(std::string(path.status().message()), HasSubstr(message));
    EXPECT_THAT(std::string(path.status().message()), HasSubstr("camera_path_test.json"));
  }
}

}  // namespace
}  // namespace throng::server
