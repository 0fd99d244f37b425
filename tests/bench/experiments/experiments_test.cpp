#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "bench/experiments/numbers.hpp"
#include "bench/experiments/quality.hpp"
#include "bench/experiments/table.hpp"
#include "bench/experiments/walkthrough.hpp"
#include "support/temporary_folder.hpp"
#include "throng/render/compute.hpp"
#include "throng/render/encode.hpp"

namespace throng::bench {
namespace {

using ::testing::DoubleNear;
using ::testing::HasSubstr;

const std::string kCast = std::string(THRONG_BINARY_DIR) + "/cast";
const std::string kProgram = std::string(THRONG_BINARY_DIR) + "/bin/throng-bench";

bool is_there(const std::string& path) { return std::filesystem::exists(path); }

TEST(NumbersTest, LineThroughPointsOfALineIsThatLine) {
  const Line line = fit_line({1, 5, 10, 20}, {18, 26, 36, 56});
  EXPECT_THAT(line.a, DoubleNear(16.0, 1e-9));
  EXPECT_THAT(line.b, DoubleNear(2.0, 1e-9));
}

TEST(NumbersTest, LineThroughOnePointIsLevel) {
  const Line line = fit_line({3}, {7});
  EXPECT_EQ(line.a, 7.0);
  EXPECT_EQ(line.b, 0.0);
}

TEST(NumbersTest, MedianOfEvenCountIsBetweenTheTwoInTheMiddle) {
  EXPECT_EQ(median({4, 1, 3, 2}), 2.5);
  EXPECT_EQ(median({3, 1, 2}), 2.0);
}

TEST(TableTest, CountsHaveThousandsApart) {
  EXPECT_EQ(grouped(29967), "29,967");
  EXPECT_EQ(grouped(999), "999");
  EXPECT_EQ(grouped(1000), "1,000");
}

TEST(QuarterTest, MeansAreTakenInLinearLight) {
  render::Picture picture{4, 4, std::vector<std::uint8_t>(64, 0)};
  for (std::size_t i = 0; i < 32; ++i) picture.rgbx[i] = 255;  // half white, half black
  const auto small = quarter(picture);
  ASSERT_TRUE(small.ok());
  ASSERT_EQ(small->rgbx.size(), 4u);
  EXPECT_EQ(small->rgbx[0], 188);  // sRGB of 0.5
  EXPECT_EQ(small->rgbx[3], 255);
}

TEST(QuarterTest, RefusesSidesThatAreNoMultiplesOfFour) {
  EXPECT_TRUE(absl::IsInvalidArgument(
      quarter(render::Picture{6, 4, std::vector<std::uint8_t>(96)}).status()));
}

// The published counts of visible instances over the walkthrough, by culling alone.
TEST(WalkthroughTest, VisibleCountsAreWithinATenthOfThePublishedOnes) {
  auto cast = render::read_cast(kCast);
  if (!cast.ok()) GTEST_SKIP() << "no built-in cast in the build folder";
  const auto shared = std::make_shared<const render::Cast>(*std::move(cast));
  auto walkthrough = Walkthrough::make(shared, Walkthrough::kAgents);
  ASSERT_TRUE(walkthrough.ok()) << walkthrough.status();
  auto backend = render::make_backend(render::BackendKind::kCpu);
  ASSERT_TRUE(backend.ok());
  ASSERT_TRUE((*backend)->upload(shared).ok());
  auto view = (*backend)->make_view();
  ASSERT_TRUE(view.ok());
  Range visible;
  constexpr std::uint32_t kEvery = 10;  // of the 1,000 frames
  for (std::uint32_t frame = 0; frame < Walkthrough::kFrames; frame += kEvery) {
    ASSERT_TRUE(walkthrough->advance_to(frame).ok());
    const std::int64_t time_us = Walkthrough::time_us(frame);
    const render::Bracket bracket = walkthrough->crowd().bracket(time_us);
    ASSERT_NE(bracket.older, nullptr);
    EXPECT_LE(bracket.older->time_us, time_us);
    EXPECT_GT(bracket.newer->time_us, time_us);
    auto older = (*backend)->upload(bracket.older);
    auto newer = (*backend)->upload(bracket.newer);
    ASSERT_TRUE(older.ok() && newer.ok());
    auto instances =
        (*backend)->advance(**older, **newer, time_us, walkthrough->crowd().settings(), -1, {});
    ASSERT_TRUE(instances.ok());
    ASSERT_TRUE((*backend)->cull(**view, *instances, walkthrough->camera(frame), {1280, 720}).ok());
    visible.add((*backend)->counters(**view).visible);
  }
  std::printf("visible: min %.0f, avg %.0f, max %.0f\n", visible.min, visible.mean(), visible.max);
  EXPECT_THAT(visible.min, DoubleNear(5038, 504));
  EXPECT_THAT(visible.mean(), DoubleNear(15771, 1577));
  EXPECT_THAT(visible.max, DoubleNear(29967, 2997));
}

TEST(WalkthroughTest, SmallerCrowdIsSeenFromNearer) {
  render::Camera camera;
  camera.eye_world = {-200, 100, 41.7};
  camera.target_world = {0, 0, 1.0};
  const render::Camera nearer = scale_camera(camera, Walkthrough::kAgents / 4);
  EXPECT_EQ(nearer.eye_world, glm::dvec3(-100, 50, 21.7));
  EXPECT_EQ(nearer.target_world, glm::dvec3(0, 0, 1.0));  // nobody looks into the ground
}

TEST(WalkthroughTest, CameraFileThatIsNotThereIsNotFound) {
  const auto walkthrough = Walkthrough::make(nullptr, 10, "no/such.json");
  EXPECT_TRUE(absl::IsNotFound(walkthrough.status()));
}

/// Runs the program; its exit code, and what it wrote to both streams.
struct Ran {
  int code = -1;
  std::string output;
};
Ran run(const std::string& arguments) {
  Ran ran;
  FILE* pipe = popen((kProgram + " " + arguments + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return ran;
  char buffer[4096];
  while (std::fgets(buffer, sizeof(buffer), pipe) != nullptr) ran.output += buffer;
  const int status = pclose(pipe);
  ran.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return ran;
}

TEST(ProgramTest, RefusesBadFlagsByName) {
  if (!is_there(kProgram)) GTEST_SKIP() << "throng-bench is not built";
  for (const char* bad : {"--frames 0", "--size 10", "--size 0x5", "--raster soft", "--budgets x",
                          "--agents -3", "--lod none", "--geometry loose", "--pose none",
                          "--geometry fused --raster gl", "--no-such-flag"}) {
    const Ran ran = run(std::string("paper ") + bad);
    EXPECT_EQ(ran.code, 2) << bad << ": " << ran.output;
    EXPECT_THAT(ran.output, HasSubstr(std::string(bad).substr(0, std::string(bad).find(' '))));
  }
  EXPECT_EQ(run("").code, 2);
  EXPECT_EQ(run("--help").code, 0);
}

TEST(ProgramTest, OutputThatCantBeWrittenHasItsOwnCode) {
  if (!is_there(kProgram) || !is_there(kCast + "/cast.json")) {
    GTEST_SKIP() << "throng-bench or the built-in cast is not built";
  }
  const Ran ran = run("paper --frames 1 --agents 5 --budgets 0.01 --size 64x64 --json /dev/null/x");
  EXPECT_EQ(ran.code, 5) << ran.output;
  EXPECT_THAT(ran.output, HasSubstr("/dev/null/x"));
}

TEST(ProgramTest, PaperWritesEveryColumn) {
  if (!is_there(kProgram) || !is_there(kCast + "/cast.json")) {
    GTEST_SKIP() << "throng-bench or the built-in cast is not built";
  }
  const test::TemporaryFolder folder;
  const std::string file = folder.file("paper.json");
  const Ran ran = run("paper --frames 2 --agents 500 --budgets 0.05 --size 320x180 --json " + file);
  ASSERT_EQ(ran.code, 0) << ran.output;
  EXPECT_THAT(ran.output, HasSubstr("cull+select"));
  std::ifstream stream(file);
  const nlohmann::json json = nlohmann::json::parse(stream, nullptr, false);
  ASSERT_FALSE(json.is_discarded());
  for (const char* key : {"processor", "cores", "instructions", "commit"}) {
    EXPECT_TRUE(json["machine"].contains(key)) << key;
  }
  ASSERT_EQ(json["rows"].size(), 2u);
  EXPECT_EQ(json["rows"][0]["geometry"], "fused, shared");
  EXPECT_EQ(json["rows"][1]["geometry"], "batched, exact");
  const nlohmann::json& row = json["rows"][0];
  EXPECT_EQ(row["budget_million"], 0.05);
  EXPECT_EQ(row["frames"], 2);
  for (const char* key : {"fps", "visible", "vertices", "triangles", "frame_wall_ms",
                          "frame_cpu_ms", "stage_wall_ms", "stage_cpu_ms", "encode_cpu_ms"}) {
    EXPECT_TRUE(row.contains(key)) << key;
  }
  for (const char* key : {"advance", "cull", "select", "allocate", "generate", "raster"}) {
    EXPECT_TRUE(row["stage_wall_ms"].contains(key)) << key;
  }
  EXPECT_GT(row["triangles"]["mean"], 0);
  EXPECT_GT(row["frame_cpu_ms"]["mean"], 0);
}

TEST(ProgramTest, Figure5IsTwoRowsOfPictures) {
  if (!is_there(kProgram) || !is_there(kCast + "/cast.json")) {
    GTEST_SKIP() << "throng-bench or the built-in cast is not built";
  }
  const test::TemporaryFolder folder;
  std::ofstream(folder.file("chooser.json")) << R"({"eye": [0, -90, 40], "target": [0, 0, 0]})";
  const std::string picture = folder.file("figure5.png");
  const Ran ran = run("paper --agents 40 --size 64x36 --budgets 0.002,0.02 --selection-camera " +
                      folder.file("chooser.json") + " -o " + picture);
  ASSERT_EQ(ran.code, 0) << ran.output;
  std::ifstream stream(picture, std::ios::binary);
  const std::vector<std::uint8_t> bytes{std::istreambuf_iterator<char>(stream), {}};
  const auto image = render::decode_png(bytes);
  ASSERT_TRUE(image.ok()) << image.status();
  EXPECT_EQ(image->width_px, 128u);
  EXPECT_EQ(image->height_px, 72u);
  EXPECT_EQ(run("paper --selection-camera no/such.json").code, 3);
}

TEST(ProgramTest, Figure7AndPeng2011CompareWithInstancing) {
  if (!is_there(kProgram) || !is_there(kCast + "/cast.json")) {
    GTEST_SKIP() << "throng-bench or the built-in cast is not built";
  }
  const test::TemporaryFolder folder;
  const std::string file = folder.file("figure7.json");
  const Ran ran = run("paper --figure 7 --counts 3 --frames 1 --size 64x36 --json " + file);
  if (ran.code == 4) GTEST_SKIP() << "no OpenGL: " << ran.output;
  ASSERT_EQ(ran.code, 0) << ran.output;
  std::ifstream stream(file);
  const nlohmann::json json = nlohmann::json::parse(stream, nullptr, false);
  ASSERT_EQ(json["rows"].size(), 1u);
  const nlohmann::json& row = json["rows"][0];
  // three agents are drawn at full detail by either
  EXPECT_EQ(row["full detail, gl pseudo-instancing"]["triangles"],
            row["full detail, visibility"]["triangles"]);

  const std::string peng = folder.file("peng2011.json");
  const Ran published = run("peng2011 --most 32 --frames 1 --size 64x36 --json " + peng);
  ASSERT_EQ(published.code, 0) << published.output;
  std::ifstream peng_stream(peng);
  const nlohmann::json peng_json = nlohmann::json::parse(peng_stream, nullptr, false);
  EXPECT_EQ(peng_json["triangles"], 2620);
  ASSERT_EQ(peng_json["rows"].size(), 1u);
  // as many triangles as published, within a hundredth
  EXPECT_THAT(peng_json["rows"][0]["visibility"]["triangles"]["mean"].get<double>(),
              DoubleNear(40056, 400));
}

TEST(ProgramTest, QualityRisesWithTheBudget) {
  if (!is_there(kProgram) || !is_there(kCast + "/cast.json")) {
    GTEST_SKIP() << "throng-bench or the built-in cast is not built";
  }
  const test::TemporaryFolder folder;
  const std::string file = folder.file("quality.json");
  const Ran ran =
      run("quality --agents 20 --budgets 0.001 --places 1 --size 160x90 --geometry fused --json " +
          file);
  ASSERT_EQ(ran.code, 0) << ran.output;
  std::ifstream stream(file);
  const nlohmann::json json = nlohmann::json::parse(stream, nullptr, false);
  ASSERT_EQ(json["rows"].size(), 2u);
  const nlohmann::json coarse = json["rows"][0]["quality"], full = json["rows"][1]["quality"];
  EXPECT_GT(full["near_ssim"], coarse["near_ssim"]);
  EXPECT_GT(full["near_psnr_db"], coarse["near_psnr_db"]);
  EXPECT_LE(coarse["near_ssim"], coarse["frame_ssim"]);  // what is far from agents is alike
  EXPECT_GT(full["flicker"], 0);
}

TEST(ProgramTest, RasterComparesSevenCases) {
  if (!is_there(kProgram) || !is_there(kCast + "/cast.json")) {
    GTEST_SKIP() << "throng-bench or the built-in cast is not built";
  }
  const test::TemporaryFolder folder;
  const std::string file = folder.file("raster.json");
  const Ran ran = run("raster --pairs 1 --scale 0.002 --size 640x360 --json " + file);
  if (ran.code == 4) GTEST_SKIP() << "no OpenGL: " << ran.output;
  ASSERT_EQ(ran.code, 0) << ran.output;
  std::ifstream stream(file);
  const nlohmann::json json = nlohmann::json::parse(stream, nullptr, false);
  ASSERT_FALSE(json.is_discarded());
  EXPECT_TRUE(json["limits_kept"]);
  ASSERT_EQ(json["rows"].size(), 7u);
  EXPECT_EQ(json["rows"][0]["triangles"], 84);
  EXPECT_EQ(json["rows"][6]["triangles"], 4512);
  for (const nlohmann::json& row : json["rows"]) {
    EXPECT_GT(row["ratio"]["median"], 0);
    EXPECT_GT(row["coverage_gl"], 0);
  }
}

}  // namespace
}  // namespace throng::bench
