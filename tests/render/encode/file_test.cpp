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

TEST(WriteFileTest, ReplacesFileAndLeavesNothingElse) {
  const test::TemporaryFolder folder;
  const std::vector<std::uint8_t> first{'a', 'b', 'c'}, second{'d'};
  ASSERT_TRUE(write_file(folder.file("x.bin"), first).ok());
  EXPECT_EQ(read(folder.file("x.bin")), "abc");
  ASSERT_TRUE(write_file(folder.file("x.bin"), second).ok());
  EXPECT_EQ(read(folder.file("x.bin")), "d");
  EXPECT_EQ(folder.entry_count(), 1u);
}

TEST(WriteFileTest, NothingToWriteGivesEmptyFile) {
  const test::TemporaryFolder folder;
  ASSERT_TRUE(write_file(folder.file("x.bin"), {}).ok());
  EXPECT_EQ(std::filesystem::file_size(folder.file("x.bin")), 0u);
}

TEST(WriteFileTest, MissingFolderIsUnavailableAndNamesTheFile) {
  const test::TemporaryFolder folder;
  const auto status = write_file(folder.file("none/x.bin"), {});
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("none/x.bin"));
}

TEST(WriteFileTest, FailedRenameRemovesTheTemporaryFile) {
  const test::TemporaryFolder folder;
  std::filesystem::create_directories(folder.file("x.bin/inside"));
  EXPECT_FALSE(write_file(folder.file("x.bin"), {}).ok());
  EXPECT_EQ(folder.entry_count(), 1u);
}

}  // namespace
}  // namespace throng::render
