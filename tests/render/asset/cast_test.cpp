#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "support/tiny_character.hpp"
#include "throng/render/asset.hpp"

namespace throng::render {
namespace {

using ::testing::HasSubstr;

class CastTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("throng_cast_" + std::to_string(::getpid()) + "_" +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
    for (const char* name : {"ada", "bob"}) {
      test::TinyOptions options;
      options.name = name;
      const Character character = make_character(test::make_tiny_character(options)).value();
      ASSERT_TRUE(
          write_character(character, (folder_ / (std::string(name) + ".throng")).string()).ok());
    }
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  absl::StatusOr<Cast> read(const std::string& json) const {
    std::ofstream(folder_ / "cast.json") << json;
    return read_cast(folder_.string());
  }
  std::string message(const std::string& json) const {
    return std::string(read(json).status().message());
  }

  std::filesystem::path folder_;
};

TEST_F(CastTest, ReadsMembersInOrder) {
  const auto cast = read(R"({"throng_cast": 1, "characters": [
      {"name": "bob", "file": "bob.throng", "weight": 2.5}, {"name": "ada", "file": "ada.throng"}]})");
  ASSERT_TRUE(cast.ok()) << cast.status();
  ASSERT_EQ(cast->members.size(), 2U);
  EXPECT_EQ(cast->members[0].character.name, "bob");
  EXPECT_EQ(cast->members[0].weight, 2.5F);
  EXPECT_EQ(cast->members[1].weight, 1.0F);
  EXPECT_EQ(cast->folder, folder_.string());
}

TEST_F(CastTest, OverridesKindAndStrideOfAClip) {
  const auto cast = read(R"({"throng_cast": 1, "characters": [
      {"file": "ada.throng", "clips": {"walk": {"kind": "run", "stride_m": 2.0}}}]})");
  ASSERT_TRUE(cast.ok()) << cast.status();
  const Clip& clip = cast->members[0].character.clips[1];
  EXPECT_EQ(clip.kind, ClipKind::kRun);
  EXPECT_EQ(clip.stride_m, 2.0F);
  EXPECT_EQ(clip.speed_mps, 2.0F);  // 16 frames at 16 Hz
}

TEST_F(CastTest, MissingFileSaysHowToMakeOne) {
  const auto cast = read_cast((folder_ / "none").string());
  EXPECT_EQ(cast.status().code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(cast.status().message()), HasSubstr("throng-bake"));
}

TEST_F(CastTest, BadJsonIsNamed) {
  EXPECT_THAT(message("{"), HasSubstr("not a JSON object"));
  EXPECT_THAT(message("[]"), HasSubstr("not a JSON object"));
  EXPECT_THAT(message("{}"), HasSubstr("throng_cast"));
  EXPECT_EQ(read(R"({"throng_cast": 2, "characters": []})").status().code(),
            absl::StatusCode::kFailedPrecondition);
  EXPECT_THAT(message(R"({"throng_cast": 1, "characters": []})"), HasSubstr("list of 1"));
  EXPECT_THAT(message(R"({"throng_cast": 1, "characters": [7]})"), HasSubstr("characters[0]"));
  EXPECT_THAT(message(R"({"throng_cast": 1, "characters": [{"file": 7}]})"),
              HasSubstr("file is missing"));
  EXPECT_THAT(
      message(R"({"throng_cast": 1, "characters": [{"file": "ada.throng", "weight": -1}]})"),
      HasSubstr("weight is -1"));
  EXPECT_THAT(message(R"({"throng_cast": 1, "characters": [{"file": "ada.throng", "weight": 0}]})"),
              HasSubstr("all weights are 0"));
  EXPECT_THAT(
      message(
          R"({"throng_cast": 1, "characters": [{"file": "ada.throng"}, {"file": "ada.throng"}]})"),
      HasSubstr("second character named ada"));
  EXPECT_THAT(
      message(
          R"({"throng_cast": 1, "characters": [{"file": "ada.throng", "clips": {"fly": {}}}]})"),
      HasSubstr("no clip fly"));
  EXPECT_THAT(
      message(
          R"({"throng_cast": 1, "characters": [{"file": "ada.throng", "clips": {"walk": {"kind": "fly"}}}]})"),
      HasSubstr("kind is \"fly\""));
}

TEST_F(CastTest, FilesOutsideTheFolderAreRefused) {
  for (const char* file : {"../ada.throng", "/etc/passwd", "", "..", "sub/ada.throng"}) {
    EXPECT_THAT(
        message(std::string(R"({"throng_cast": 1, "characters": [{"file": ")") + file + R"("}]})"),
        HasSubstr("own folder"))
        << file;
  }
}

TEST_F(CastTest, DamagedMemberIsNamed) {
  std::ofstream(folder_ / "bob.throng") << "no character";
  const std::string text = message(
      R"({"throng_cast": 1, "characters": [{"file": "ada.throng"}, {"file": "bob.throng"}]})");
  EXPECT_THAT(text, HasSubstr("characters[1]"));
  EXPECT_THAT(text, HasSubstr("bob.throng"));
}

}  // namespace
}  // namespace throng::render
