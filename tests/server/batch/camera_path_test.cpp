#include "server/batch/camera_path.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

namespace throng::server {
namespace {

using ::testing::HasSubstr;

std::string write(const std::string& text) {
  const std::string path = ::testing::TempDir() + "camera_path_test.json";
  std::ofstream(path) << text;
  return path;
}

TEST(CameraPathTest, OneCameraStandsStill) {
  const auto path = CameraPath::read(write(R"({"eye":[1,2,3],"target":[4,5,6],"fov_y_deg":90})"));
  ASSERT_TRUE(path.ok()) << path.status();
  for (const double time_s : {-1.0, 0.0, 100.0}) {
    EXPECT_EQ(path->at(time_s).eye_world, glm::dvec3(1, 2, 3));
    EXPECT_EQ(path->at(time_s).target_world, glm::dvec3(4, 5, 6));
    EXPECT_NEAR(path->at(time_s).fov_y_rad, 1.5707963, 1e-6);
  }
}

TEST(CameraPathTest, KeysAreMetExactlyAndHeldOutside) {
  const auto path = CameraPath::read(write(R"({"keys":[{"time_s":0,"eye":[0,0,5],"target":[9,0,0]},
                        {"time_s":1,"eye":[1,0,5],"target":[9,1,0]},
                        {"time_s":4,"eye":[4,0,5],"target":[9,4,0]}]})"));
  ASSERT_TRUE(path.ok()) << path.status();
  EXPECT_EQ(path->at(-1).eye_world.x, 0.0);
  EXPECT_EQ(path->at(9).eye_world.x, 4.0);
  EXPECT_NEAR(path->at(1).eye_world.x, 1.0, 1e-12);
  // keys on a line at even speed: the spline is that line, whatever the spacing
  for (double t = 0; t <= 4; t += 0.125) EXPECT_NEAR(path->at(t).eye_world.x, t, 1e-12) << t;
}

TEST(CameraPathTest, WrongFilesNameFileKeyAndLimit) {
  EXPECT_EQ(CameraPath::read("/nonexistent/camera.json").status().code(),
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
    const auto path = CameraPath::read(write(text));
    ASSERT_FALSE(path.ok()) << text;
    EXPECT_THAT(std::string(path.status().message()), HasSubstr(message));
    EXPECT_THAT(std::string(path.status().message()), HasSubstr("camera_path_test.json"));
  }
}

}  // namespace
}  // namespace throng::server
