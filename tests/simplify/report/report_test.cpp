#include "simplify/report/report.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>

#include "support/run_program.hpp"
#include "support/temporary_folder.hpp"
#include "support/tiny_character.hpp"
#include "throng/render/encode.hpp"

namespace throng::simplify {
namespace {

using ::testing::HasSubstr;

using throng::test::ProgramRun;

ProgramRun throng_bake(const std::string& arguments) {
  return throng::test::run_program(std::string(THRONG_BAKE) + " " + arguments);
}

std::string read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), {});
}

/// Fields of each line; a quoted one may hold commas.
std::vector<std::vector<std::string>> parse_csv(const std::string& text) {
  std::vector<std::vector<std::string>> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) {
    lines.emplace_back(1);
    bool is_quoted = false;
    for (const char c : line) {
      if (c == '"') {
        is_quoted = !is_quoted;
      } else if (c == ',' && !is_quoted) {
        lines.back().emplace_back();
      } else {
        lines.back().back() += c;
      }
    }
  }
  return lines;
}

class ReportTest : public ::testing::Test {
 protected:
  void write_tiny(const std::string& name, float height_m = 1.8F) {
    test::TinyOptions options;
    options.name = name;
    options.height_m = height_m;
    const auto character = render::make_character(test::make_tiny_character(options));
    ASSERT_TRUE(render::write_character(*character, path(name + ".throng")).ok());
  }
  std::string path(const std::string& name) const { return folder_.file(name); }

  test::TemporaryFolder folder_;
};

TEST_F(ReportTest, ReportsACastWithPicturesAndTables) {
  write_tiny("one");
  write_tiny("two", 1.5F);
  std::ofstream(path("cast.json")) << R"({"throng_cast": 1, "characters": [
      {"name": "one", "file": "one.throng", "bake_s": 0.25, "pose_frames": [0, 12, 20]},
      {"name": "two", "file": "two.throng"}]})";
  const ProgramRun run = throng_bake("report " + path("") + " -o " + path("out") +
                                     " --views 2 --poses 2 --meshoptimizer ''");
  ASSERT_EQ(run.code, 0) << run.output;
  const std::string html = read(path("out/index.html"));
  EXPECT_THAT(html, HasSubstr("<h2 id=\"one\">"));
  EXPECT_THAT(html, HasSubstr("baked in 0.25 s"));
  EXPECT_THAT(html, HasSubstr("bake time not recorded"));
  const auto lines = parse_csv(read(path("out/levels.csv")));
  ASSERT_GE(lines.size(), 1U + 2U * 6U);
  for (const auto& line : lines) EXPECT_EQ(line.size(), lines[0].size());
  EXPECT_EQ(lines[0][0], "character");
  // one is known to be made in three of its 24 frames, of two nothing is known
  EXPECT_THAT(html, HasSubstr("made in the bind pose and 3 of 24 frames"));
  EXPECT_THAT(html, HasSubstr("<th>RMS %"));
  EXPECT_THAT(html, HasSubstr("Not known: no cast.json tells"));
  const auto sampling = parse_csv(read(path("out/sampling.csv")));
  ASSERT_EQ(sampling.size(), 1U + 5U);
  for (const auto& line : sampling) EXPECT_EQ(line.size(), sampling[0].size());
  EXPECT_EQ(sampling[1][0], "one");
  EXPECT_EQ(sampling[1][2], "24");
  EXPECT_EQ(sampling[1][3], "24");
  EXPECT_EQ(sampling[1][4], "3");
  EXPECT_GT(std::stod(sampling[5][7]), 0.0);
  const auto summary = parse_csv(read(path("out/summary.csv")));
  ASSERT_GE(summary.size(), 7U);
  for (const auto& line : summary) EXPECT_EQ(line.size(), summary[0].size());
  for (const char* name : {"one_levels.png", "one_worst.png", "two_levels.png", "two_worst.png"}) {
    const std::string png = read(path("out/") + name);
    EXPECT_TRUE(
        render::decode_png({reinterpret_cast<const std::uint8_t*>(png.data()), png.size()}).ok())
        << name;
    EXPECT_THAT(html, HasSubstr(name));
  }
}

TEST_F(ReportTest, FramesOfAnotherBakeAreTold) {
  write_tiny("one");
  std::ofstream(path("cast.json")) << R"({"throng_cast": 1, "characters": [
      {"name": "one", "file": "one.throng", "pose_frames": [24]}]})";
  const ProgramRun run = throng_bake("report " + path("") + " -o " + path("out") +
                                     " --views 1 --poses 1 --meshoptimizer ''");
  EXPECT_EQ(run.code, 3);
  EXPECT_THAT(run.output, HasSubstr("sampled frame is 24, must be below 24"));
}

TEST_F(ReportTest, TableHasTheRowsOfEachCharacterThatIsDone) {
  write_tiny("one");
  write_tiny("two");
  ReportOptions options;
  options.inputs = {path("one.throng"), path("two.throng")};
  options.folder = path("out");
  options.measure.views = options.measure.poses = 1;
  std::vector<std::set<std::string>> seen;
  options.on_progress = [&](float) {
    seen.emplace_back();
    for (const auto& line : parse_csv(read(path("out/levels.csv")))) seen.back().insert(line[0]);
  };
  ASSERT_TRUE(write_report(options).ok());
  ASSERT_EQ(seen.size(), 2U);
  EXPECT_EQ(seen[0], (std::set<std::string>{"character", "one"}));
  EXPECT_EQ(seen[1], (std::set<std::string>{"character", "one", "two"}));
}

TEST_F(ReportTest, JsonSummaryGoesToStandardOutput) {
  write_tiny("one");
  const ProgramRun run = throng_bake("report " + path("one.throng") + " -o " + path("out") +
                                     " --views 1 --poses 1 --meshoptimizer '' --json 2>/dev/null");
  EXPECT_EQ(run.code, 0);
  EXPECT_THAT(run.output, HasSubstr("\"overlap\": 1.0"));
}

TEST_F(ReportTest, OnlyNamedCharactersAreReported) {
  write_tiny("one");
  write_tiny("two");
  const std::string both = path("one.throng") + " " + path("two.throng");
  ASSERT_EQ(throng_bake("report " + both + " -o " + path("out") +
                        " --views 1 --poses 1 --meshoptimizer '' --characters two")
                .code,
            0);
  EXPECT_FALSE(std::filesystem::exists(path("out/one_levels.png")));
  EXPECT_TRUE(std::filesystem::exists(path("out/two_levels.png")));
  const ProgramRun run =
      throng_bake("report " + both + " -o " + path("out") + " --characters three");
  EXPECT_EQ(run.code, 3);
  EXPECT_THAT(run.output, HasSubstr("three: no such character"));
}

TEST_F(ReportTest, BadInputIsThreeAndTheOthersAreReported) {
  write_tiny("one");
  write_tiny("broken");
  std::filesystem::resize_file(path("broken.throng"), 1000);
  const ProgramRun run =
      throng_bake("report " + path("broken.throng") + " " + path("one.throng") + " -o " +
                  path("out") + " --views 1 --poses 1 --meshoptimizer ''");
  EXPECT_EQ(run.code, 3);
  EXPECT_THAT(run.output, HasSubstr("broken.throng"));
  EXPECT_THAT(read(path("out/index.html")), HasSubstr("Not reported"));
  EXPECT_TRUE(std::filesystem::exists(path("out/one_levels.png")));
}

TEST_F(ReportTest, MissingInputsAndUnwritableFoldersAreTold) {
  EXPECT_EQ(throng_bake("report " + path("none") + " -o " + path("out")).code, 3);
  const ProgramRun run = throng_bake("report " + path("") + " -o " + path("out"));
  EXPECT_EQ(run.code, 3);
  EXPECT_THAT(run.output, HasSubstr("has no cast.json"));
  write_tiny("one");
  EXPECT_EQ(throng_bake("report " + path("one.throng") + " -o " + path("one.throng") + "/out").code,
            5);
  EXPECT_EQ(throng_bake("report " + path("one.throng")).code, 2);
}

TEST_F(ReportTest, SheetShowsEverybody) {
  write_tiny("short", 1.2F);
  write_tiny("tall", 1.9F);
  write_tiny("giant", 40.0F);  // a row of its own
  const std::string all =
      path("short.throng") + " " + path("tall.throng") + " " + path("giant.throng");
  ASSERT_EQ(throng_bake("sheet " + all + " -o " + path("sheet.png") + " --figure-px 100").code, 0);
  const std::string png = read(path("sheet.png"));
  const auto image =
      render::decode_png({reinterpret_cast<const std::uint8_t*>(png.data()), png.size()});
  ASSERT_TRUE(image.ok());
  EXPECT_GT(image->height_px, 2U * 100U);
  EXPECT_EQ(throng_bake("sheet " + path("none.throng") + " -o " + path("sheet.png")).code, 3);
}

TEST_F(ReportTest, InspectComparesACastWithTable1) {
  write_tiny("one");
  write_tiny("two");
  const ProgramRun run = throng_bake("inspect " + path("one.throng") + " " + path("two.throng"));
  EXPECT_EQ(run.code, 0);
  EXPECT_THAT(run.output, HasSubstr("table 1"));
  EXPECT_THAT(run.output, HasSubstr("two"));
}

TEST(SummaryTest, ComparesAtTheCountThatBothGetDownTo) {
  CharacterReport a, b;
  a.height_m = b.height_m = 2.0F;
  const auto level = [](Method method, double ssim, std::uint32_t triangles) {
    LevelReport row;
    row.method = method;
    row.level = 1;
    row.triangles = triangles;
    row.ssim.median = row.ssim.worst_pose = ssim;
    row.hausdorff_m = 0.02F;
    return row;
  };
  a.levels = {level(Method::kThrong, 0.9, 100), level(Method::kPlain, 0.8, 100)};
  b.levels = {level(Method::kThrong, 0.7, 100), level(Method::kPlain, 0.8, 300),
              level(Method::kAtPlain, 0.95, 298)};
  const auto rows = summarize({a, b});
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_DOUBLE_EQ(rows[0].median.ssim, 0.8);
  EXPECT_DOUBLE_EQ(rows[0].worst.ssim, 0.7);
  EXPECT_NEAR(rows[0].median.hausdorff_percent, 1.0, 1e-5);
  EXPECT_EQ(rows[1].method, Method::kPlain);
  EXPECT_DOUBLE_EQ(rows[1].triangle_ratio, 2.0);
  const auto compared = compare({a, b});
  ASSERT_EQ(compared.size(), 1U);
  EXPECT_EQ(compared[0].characters, 2U);
  EXPECT_EQ(compared[0].stuck, 1U);
  EXPECT_EQ(compared[0].no_worse, 2U);
  EXPECT_DOUBLE_EQ(compared[0].throng_median.ssim, 0.925);
  EXPECT_DOUBLE_EQ(compared[0].rival_median.ssim, 0.8);
}

}  // namespace
}  // namespace throng::simplify
