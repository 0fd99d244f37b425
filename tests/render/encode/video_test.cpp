#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "support/temporary_folder.hpp"
#include "throng/render/encode.hpp"

namespace throng::render {
namespace {

std::string read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<std::uint8_t> frame(std::uint32_t width, std::uint32_t height, int number) {
  std::vector<std::uint8_t> rgbx;
  for (std::uint32_t i = 0; i < width * height; ++i) {
    const auto value =
        static_cast<std::uint8_t>((i % width) * 3 + static_cast<std::uint32_t>(number) * 5);
    rgbx.insert(rgbx.end(), {value, static_cast<std::uint8_t>(255 - value), 128, 255});
  }
  return rgbx;
}

std::uint32_t big_endian(const std::string& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<std::uint8_t>(bytes[at + i]);
  return value;
}

TEST(VideoTest, WritesPlayableFileWithIndexInFront) {
  const test::TemporaryFolder folder;
  auto video = open_video(folder.file("x.mp4"), 64, 48, 25.0);
  ASSERT_TRUE(video.ok()) << video.status();
  EXPECT_FALSE((*video)->codec().empty());
  for (int i = 0; i < 50; ++i)
    ASSERT_TRUE((*video)->add(frame(64, 48, i), 7'000'000 + i * 40'000).ok());
  EXPECT_FALSE(std::filesystem::exists(folder.file("x.mp4")));  // not before it is whole
  ASSERT_TRUE((*video)->finish().ok());
  const std::string bytes = read(folder.file("x.mp4"));
  EXPECT_EQ(bytes.substr(4, 4), "ftyp");
  EXPECT_LT(bytes.find("moov"), bytes.find("mdat"));
  const std::size_t header = bytes.find("mvhd");
  ASSERT_NE(header, std::string::npos);
  // version and flags, two times, then ticks a second and length
  EXPECT_NEAR(static_cast<double>(big_endian(bytes, header + 20)) / big_endian(bytes, header + 16),
              2.0, 0.05);
  EXPECT_EQ(folder.entry_count(), 1u);
}

TEST(VideoTest, OddSizeIsRoundedDown) {
  const test::TemporaryFolder folder;
  auto video = open_video(folder.file("x.mp4"), 65, 47, 30.0);
  ASSERT_TRUE(video.ok()) << video.status();
  ASSERT_TRUE((*video)->add(frame(65, 47, 0), 0).ok());
  EXPECT_EQ((*video)->add(frame(64, 46, 0), 40'000).code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE((*video)->finish().ok());
}

TEST(VideoTest, TimeThatDoesNotGrowIsRejectedAndTheRestGoesOn) {
  const test::TemporaryFolder folder;
  auto video = open_video(folder.file("x.mp4"), 32, 32, 30.0);
  ASSERT_TRUE(video.ok()) << video.status();
  ASSERT_TRUE((*video)->add(frame(32, 32, 0), 1000).ok());
  EXPECT_THAT(std::string((*video)->add(frame(32, 32, 0), 1000).message()),
              ::testing::HasSubstr("must be after 1000"));
  ASSERT_TRUE((*video)->add(frame(32, 32, 1), 50'000).ok());
  EXPECT_TRUE((*video)->finish().ok());
  EXPECT_EQ((*video)->finish().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ((*video)->add(frame(32, 32, 2), 90'000).code(), absl::StatusCode::kFailedPrecondition);
}

TEST(VideoTest, UnfinishedVideoIsRemoved) {
  const test::TemporaryFolder folder;
  {
    auto video = open_video(folder.file("x.mp4"), 32, 32, 30.0);
    ASSERT_TRUE(video.ok()) << video.status();
    ASSERT_TRUE((*video)->add(frame(32, 32, 0), 0).ok());
  }
  EXPECT_EQ(folder.entry_count(), 0u);
}

TEST(VideoTest, OpenRejectsWrongSizeRateAndPath) {
  const test::TemporaryFolder folder;
  EXPECT_EQ(open_video(folder.file("x.mp4"), 1, 32, 30.0).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(open_video(folder.file("x.mp4"), 32, 16385, 30.0).status().code(),
            absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(open_video(folder.file("x.mp4"), 32, 32, 0.0).status().code(),
            absl::StatusCode::kInvalidArgument);
  const auto missing = open_video(folder.file("none/x.mp4"), 32, 32, 30.0).status();
  EXPECT_EQ(missing.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(missing.message()), ::testing::HasSubstr("none/x.mp4"));
}

}  // namespace
}  // namespace throng::render
