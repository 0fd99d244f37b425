#include "server/batch/frame_numbers.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

namespace throng::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

std::vector<std::uint32_t> parsed(const std::string& spec, std::uint32_t last) {
  const auto numbers = parse_frame_numbers(spec, last);
  EXPECT_TRUE(numbers.ok()) << numbers.status();
  return numbers.ok() ? *numbers : std::vector<std::uint32_t>();
}

TEST(FrameNumbersTest, EmptySpecIsEveryFrame) { EXPECT_THAT(parsed("", 3), ElementsAre(1, 2, 3)); }

TEST(FrameNumbersTest, RangesStepsAndListsAreSortedAndUnique) {
  EXPECT_THAT(parsed("7,1-5x2,5..6,3:3", 100), ElementsAre(1, 3, 5, 6, 7));
}

TEST(FrameNumbersTest, RangeBeyondTheEndIsCut) {
  EXPECT_THAT(parsed("4-9", 5), ElementsAre(4, 5));
  EXPECT_THAT(parsed("8", 5), IsEmpty());
  EXPECT_THAT(parsed("99999999-100000000", 5), IsEmpty());
}

TEST(FrameNumbersTest, WrongSpecNamesThePart) {
  for (const char* spec : {"0", "x", "5-2", "1-2-3", "1-5x0", "3x2", "-4", "1,,2", "1-", "1e3",
                           "99999999999999999999", "1-100000001"}) {
    const auto numbers = parse_frame_numbers(spec, 10);
    ASSERT_FALSE(numbers.ok()) << spec;
    EXPECT_THAT(std::string(numbers.status().message()), HasSubstr("--frames: '")) << spec;
  }
}

TEST(FrameNumbersTest, ShardsCoverEverythingOnceInOrder) {
  for (std::uint32_t total : {0U, 1U, 2U, 7U, 100U}) {
    std::vector<std::uint32_t> all;
    for (std::uint32_t i = 1; i <= total; ++i) all.push_back(i);
    for (std::uint32_t count : {1U, 2U, 3U, 8U}) {
      std::vector<std::uint32_t> joined;
      for (std::uint32_t index = 0; index < count; ++index) {
        const auto part = shard_of(all, index, count);
        EXPECT_LE(part.size(), total / count + 1);
        joined.insert(joined.end(), part.begin(), part.end());
      }
      EXPECT_EQ(joined, all);
    }
  }
}

TEST(FrameNumbersTest, ShardIsIOfN) {
  const auto shard = parse_shard("2/3");
  ASSERT_TRUE(shard.ok());
  EXPECT_EQ(shard->index, 1U);
  EXPECT_EQ(shard->count, 3U);
  for (const char* text : {"0/3", "4/3", "1", "a/b", "1/0", "1/2/3", ""}) {
    EXPECT_FALSE(parse_shard(text).ok()) << text;
  }
}

TEST(FrameNumbersTest, AutoShardReadsSlurmAndKubernetes) {
  for (const char* name : {"SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"}) unsetenv(name);
  EXPECT_EQ(parse_shard("auto")->count, 1U);
  setenv("SLURM_ARRAY_TASK_ID", "20", 1);
  setenv("SLURM_ARRAY_TASK_MIN", "10", 1);
  setenv("SLURM_ARRAY_TASK_COUNT", "3", 1);
  setenv("SLURM_ARRAY_TASK_STEP", "5", 1);
  EXPECT_EQ(parse_shard("auto")->index, 2U);
  EXPECT_EQ(parse_shard("auto")->count, 3U);
  setenv("SLURM_ARRAY_TASK_ID", "40", 1);
  EXPECT_FALSE(parse_shard("auto").ok());
  unsetenv("SLURM_ARRAY_TASK_ID");
  setenv("JOB_COMPLETION_INDEX", "1", 1);
  unsetenv("JOB_COMPLETION_COUNT");
  EXPECT_FALSE(parse_shard("auto").ok());
  setenv("JOB_COMPLETION_COUNT", "2", 1);
  EXPECT_EQ(parse_shard("auto")->index, 1U);
  unsetenv("JOB_COMPLETION_INDEX");
}

TEST(NumberedPathTest, EveryStyleOfPlaceholder) {
  EXPECT_EQ(NumberedPath::parse("out/####.png")->at(7), "out/0007.png");
  EXPECT_EQ(NumberedPath::parse("out/#.png")->at(123), "out/123.png");
  EXPECT_EQ(NumberedPath::parse("a%05d.jpg")->at(7), "a00007.jpg");
  EXPECT_EQ(NumberedPath::parse("a%d.jpg")->at(7), "a7.jpg");
  EXPECT_EQ(NumberedPath::parse("x.$F4.png")->at(7), "x.0007.png");
  EXPECT_EQ(NumberedPath::parse("x.##.png")->at(12345), "x.12345.png");
}

TEST(NumberedPathTest, NoPlaceNamesOnePicture) {
  EXPECT_FALSE(NumberedPath::parse("out.png")->numbered());
  EXPECT_EQ(NumberedPath::parse("out.png")->at(7), "out.png");
  EXPECT_TRUE(NumberedPath::parse("#.png")->numbered());
}

TEST(NumberedPathTest, TwoPlacesOrAnUnknownOneIsAnError) {
  for (const char* pattern : {"##_##.png", "a%dz#.png", "a%s.png", "a%"}) {
    EXPECT_FALSE(NumberedPath::parse(pattern).ok()) << pattern;
  }
}

}  // namespace
}  // namespace throng::server
