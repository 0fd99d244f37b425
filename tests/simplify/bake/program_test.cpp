#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>

#include "simplify/import/made_up.hpp"
#include "support/data_dir.hpp"
#include "support/run_program.hpp"
#include "support/tiny_character.hpp"

namespace throng::simplify {
namespace {

using ::testing::HasSubstr;

using throng::test::ProgramRun;

ProgramRun throng_bake(const std::string& arguments) {
  return throng::test::run_program(std::string(THRONG_BINARY_DIR) + "/bin/throng-bake " +
                                   arguments);
}

class ProgramTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = (std::filesystem::temp_directory_path() /
               ("throng_bake_" + std::to_string(::getpid()) + "_" +
                ::testing::UnitTest::GetInstance()->current_test_info()->name()))
                  .string();
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string folder_;
};

TEST_F(ProgramTest, HelpShowsExamplesAndExitCodes) {
  const ProgramRun run = throng_bake("--help");
  EXPECT_EQ(run.code, 0);
  EXPECT_THAT(run.output, HasSubstr("Examples:"));
  EXPECT_THAT(run.output, HasSubstr("Exit codes:"));
}

TEST_F(ProgramTest, WrongUsageIsTwo) {
  EXPECT_EQ(throng_bake("").code, 2);
  EXPECT_EQ(throng_bake("--builtin").code, 2);
  EXPECT_EQ(throng_bake("--nonsense").code, 2);
  EXPECT_EQ(throng_bake("a.glb -o x --criterion magic").code, 2);
  EXPECT_EQ(throng_bake("a.glb -o x --jobs 0").code, 2);
}

TEST_F(ProgramTest, BadInputIsThreeAndNamed) {
  const ProgramRun run = throng_bake(folder_ + "/missing.glb -o " + folder_ + "/cast");
  EXPECT_EQ(run.code, 3);
  EXPECT_THAT(run.output, HasSubstr("missing.glb"));
  EXPECT_EQ(throng_bake("inspect " + folder_ + "/missing.throng").code, 3);
  const std::string good = folder_ + "/post.glb";
  test::write_file(good, test::bending_post().glb());
  const ProgramRun mixed =
      throng_bake(folder_ + "/missing.glb " + good + " -o " + folder_ + "/cast");
  EXPECT_EQ(mixed.code, 3);
  EXPECT_THAT(mixed.output, HasSubstr("1 baked, 0 unchanged, 1 failed"));
}

TEST_F(ProgramTest, UnwritableIsFive) {
  std::ofstream(folder_ + "/file") << "x";
  EXPECT_EQ(throng_bake("a.glb -o " + folder_ + "/file/cast").code, 5);
}

TEST_F(ProgramTest, InspectsAndExports) {
  const std::string path = folder_ + "/tiny.throng";
  ASSERT_TRUE(
      render::write_character(*render::make_character(throng::test::make_tiny_character()), path)
          .ok());
  EXPECT_THAT(throng_bake("inspect " + path).output, HasSubstr("64 triangles"));
  EXPECT_THAT(throng_bake("inspect --json " + path).output, HasSubstr("\"triangles\": 64"));
  EXPECT_EQ(throng_bake("export " + path + " --vertices 20 -o " + folder_ + "/lod.obj").code, 0);
  EXPECT_TRUE(std::filesystem::exists(folder_ + "/lod.obj"));
  EXPECT_EQ(throng_bake("export " + path + " -o " + folder_ + "/none/lod.obj").code, 5);
}

TEST_F(ProgramTest, DamagedFileIsThree) {
  const std::string path = folder_ + "/tiny.throng";
  ASSERT_TRUE(
      render::write_character(*render::make_character(throng::test::make_tiny_character()), path)
          .ok());
  std::filesystem::resize_file(path, 1000);
  const ProgramRun run = throng_bake("inspect " + path);
  EXPECT_EQ(run.code, 3);
  EXPECT_THAT(run.output, HasSubstr("must have"));
}

}  // namespace
}  // namespace throng::simplify
