#include "simplify/bake/jobs.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <new>
#include <utility>

#include "simplify/bake/cast_file.hpp"
#include "simplify/import/made_up.hpp"
#include "support/data_dir.hpp"

namespace throng::simplify {
namespace {

using ::testing::HasSubstr;

class JobsTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("throng_jobs_" + std::to_string(::getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
    options_.folder = (folder_ / "cast").string();
    options_.say = [this](const std::string& line) { said_ += line + "\n"; };
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string cast_json() const {
    std::ifstream file(folder_ / "cast" / "cast.json");
    return {std::istreambuf_iterator<char>(file), {}};
  }

  std::filesystem::path folder_;
  JobOptions options_;
  JobSummary summary_;
  std::string said_;
};

TEST_F(JobsTest, BadInputLeavesTheOthersAlone) {
  const std::string data = throng::test::data_dir();
  if (data.empty()) GTEST_SKIP() << "no data folder; set THRONG_DATA_DIR";
  std::ofstream(folder_ / "bad.glb") << "glTF?";
  options_.inputs = {(folder_ / "bad.glb").string(), data + "/characters/cesium_man.glb",
                     (folder_ / "none.glb").string()};
  options_.jobs = 2;
  ASSERT_TRUE(run_jobs(options_, summary_).ok());
  EXPECT_EQ(summary_.baked, 1);
  EXPECT_EQ(summary_.failed, 2);
  EXPECT_THAT(said_, HasSubstr("bad.glb"));
  EXPECT_THAT(said_, HasSubstr("none.glb"));
  const auto cast = render::read_cast(options_.folder);
  ASSERT_TRUE(cast.ok()) << cast.status();
  EXPECT_EQ(cast->members.size(), 1U);
}

TEST_F(JobsTest, UnchangedInputIsNotBakedAgain) {
  const std::string data = throng::test::data_dir();
  if (data.empty()) GTEST_SKIP() << "no data folder; set THRONG_DATA_DIR";
  options_.inputs = {data + "/characters/simple_skin.gltf"};
  ASSERT_TRUE(run_jobs(options_, summary_).ok());
  EXPECT_EQ(summary_.baked, 1) << said_;
  JobSummary again;
  ASSERT_TRUE(run_jobs(options_, again).ok());
  EXPECT_EQ(again.unchanged, 1);
  EXPECT_EQ(again.baked, 0);
  // other settings, a lost file and --force do bake
  options_.bake.height_m = 1.0F;
  JobSummary changed;
  ASSERT_TRUE(run_jobs(options_, changed).ok());
  EXPECT_EQ(changed.baked, 1);
  std::filesystem::remove(folder_ / "cast" / "simple_skin.throng");
  JobSummary lost;
  ASSERT_TRUE(run_jobs(options_, lost).ok());
  EXPECT_EQ(lost.baked, 1);
  options_.force = true;
  JobSummary forced;
  ASSERT_TRUE(run_jobs(options_, forced).ok());
  EXPECT_EQ(forced.baked, 1);
}

TEST_F(JobsTest, InputThatNeedsTooMuchMemoryLeavesTheOthersAlone) {
  for (const char* name : {"first", "second"}) {
    options_.inputs.push_back((folder_ / name).string() + ".glb");
    test::write_file(options_.inputs.back(), test::bending_post().glb());
  }
  bool has_thrown = false;
  options_.on_progress = [&](float) {
    if (!std::exchange(has_thrown, true)) throw std::bad_alloc();
  };
  ASSERT_TRUE(run_jobs(options_, summary_).ok());
  EXPECT_EQ(summary_.failed, 1);
  EXPECT_EQ(summary_.baked, 1);
  EXPECT_THAT(said_, HasSubstr("first.glb: needs more memory than there is"));
}

TEST_F(JobsTest, CastFileTellsTheFramesThatLevelsWereMadeIn) {
  options_.inputs = {(folder_ / "post.glb").string()};
  test::write_file(options_.inputs[0], test::bending_post().glb());
  ASSERT_TRUE(run_jobs(options_, summary_).ok());
  const auto cast = CastFile::open(options_.folder);
  ASSERT_TRUE(cast.ok()) << cast.status();
  ASSERT_EQ(cast->entries().size(), 1U);
  ASSERT_TRUE(cast->entries()[0].pose_frames.has_value());
  EXPECT_FALSE(cast->entries()[0].pose_frames->empty());
}

TEST_F(JobsTest, FramesThatAreNoNumbersAreTold) {
  std::filesystem::create_directories(options_.folder);
  std::ofstream(folder_ / "cast" / "cast.json")
      << R"({"throng_cast": 1, "characters": [{"file": "a.throng", "pose_frames": [1, -2]}]})";
  const auto cast = CastFile::open(options_.folder);
  EXPECT_EQ(cast.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(cast.status().message()), HasSubstr("pose_frames of -2"));
}

TEST_F(JobsTest, BrokenCastFileIsNotReplaced) {
  std::filesystem::create_directories(options_.folder);
  std::ofstream(folder_ / "cast" / "cast.json") << "{ my notes";
  options_.inputs = {"whatever.glb"};
  EXPECT_EQ(run_jobs(options_, summary_).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(cast_json(), "{ my notes");
}

TEST_F(JobsTest, FolderThatIsAFileIsUnavailable) {
  std::ofstream(options_.folder) << "a file";
  EXPECT_EQ(run_jobs(options_, summary_).code(), absl::StatusCode::kUnavailable);
}

TEST_F(JobsTest, CastFileKeepsWhatUsersWrote) {
  std::filesystem::create_directories(options_.folder);
  std::ofstream(folder_ / "cast" / "cast.json")
      << R"({"throng_cast": 1, "about": "ours", "characters": [
      {"name": "zoe", "file": "zoe.throng", "weight": 3, "clips": {"w": {"kind": "walk"}}}]})";
  auto cast = CastFile::open(options_.folder);
  ASSERT_TRUE(cast.ok()) << cast.status();
  cast->put({"adam", "adam.throng", "hash", "tool"});
  cast->put({"zoe", "zoe.throng", "new hash", "tool"});
  ASSERT_TRUE(cast->save().ok());
  const std::string json = cast_json();
  EXPECT_THAT(json, HasSubstr("\"about\": \"ours\""));
  EXPECT_THAT(json, HasSubstr("\"weight\": 3"));
  EXPECT_THAT(json, HasSubstr("\"kind\": \"walk\""));
  EXPECT_THAT(json, HasSubstr("new hash"));
  EXPECT_LT(json.find("adam"), json.find("zoe"));
}

}  // namespace
}  // namespace throng::simplify
