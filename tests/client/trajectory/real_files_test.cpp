#include <cmath>
#include <filesystem>

#include "fixture.hpp"
#include "support/data_dir.hpp"

namespace throng::trajectory {
namespace {

struct RealFile {
  const char* name;
  const char* format;
  double source_fps;   // 0: the file says it
  double source_unit;  // 0: likewise
  unsigned agents, most_at_once, frames;
  double fps;
  double min_x, max_x, min_y, max_y;
};

void PrintTo(const RealFile& file, std::ostream* out) { *out << file.name; }

class RealFileTest : public ::testing::TestWithParam<RealFile> {};

/// What the table beside the files says of each.
TEST_P(RealFileTest, SummaryIsWhatItsTableSays) {
  const RealFile& file = GetParam();
  const std::string folder = throng::test::data_dir();
  const std::string path = folder + "/trajectories/" + file.name;
  if (folder.empty() || !std::filesystem::exists(path)) GTEST_SKIP() << "no file " << file.name;
  ReadOptions options;
  if (file.source_fps > 0) options.source_fps = file.source_fps;
  if (file.source_unit > 0) options.source_unit_m = file.source_unit;
  const absl::StatusOr<Summary> summary = summarize(path, options);
  ASSERT_TRUE(summary.ok()) << summary.status();
  EXPECT_EQ(summary->info.format, file.format);
  EXPECT_EQ(summary->agents, file.agents);
  EXPECT_EQ(summary->most_at_once, file.most_at_once);
  EXPECT_EQ(summary->frames, file.frames);
  EXPECT_NEAR(summary->info.fps, file.fps, 0.005 * file.fps);
  const double tolerance = file.source_unit == 0.01 ? 0.0001 : 0.0051;
  EXPECT_NEAR(summary->min_x_m, file.min_x, tolerance);
  EXPECT_NEAR(summary->max_x_m, file.max_x, tolerance);
  EXPECT_NEAR(summary->min_y_m, file.min_y, tolerance);
  EXPECT_NEAR(summary->max_y_m, file.max_y, tolerance);
}

constexpr RealFile kFiles[] = {
    {"juelich_bottleneck_040_c_56_h-.txt", "archive-text", 0, 0, 75, 75, 1657, 25, -2.60, 2.26,
     -1.87, 5.98},
    {"juelich_bidirectional_bi_corr_400_b_03.txt", "archive-text", 0, 0, 480, 50, 3247, 25, -5.6247,
     4.5452, -0.0847, 4.2722},
    {"juelich_corridor_uo-100-180-180.txt", "archive-text", 16, 0.01, 121, 31, 944, 16, -0.2418,
     2.1454, -6.1235, 7.9688},
    {"madras_lyon_festival_1A.txt", "archive-text", 0, 0, 85, 51, 297, 30, -5.56, 3.67, 0.59, 5.69},
    {"ucy_zara01_obsmat.txt", "obsmat", 0, 0, 148, 20, 866, 2.5, -7.35, 6.36, 4.98, 20.73},
    {"jupedsim_demo.sqlite", "jupedsim-sqlite", 0, 0, 30, 30, 491, 25, -7.38, 7.61, 1.79, 8.93},
    {"jupedsim_sib2023_2500_agents.sqlite", "jupedsim-sqlite", 0, 0, 2500, 2500, 41, 2, -2316.23,
     -1677.87, -603.71, 62.52},
    {"pathfinder_room.csv", "pathfinder-csv", 0, 0, 150, 150, 140, 1, -11.10, 13.67, -4.77, 4.77},
    {"crowdit.csv.gz", "crowdit-csv", 0, 0, 20, 20, 69, 2, 29.80, 58.06, 10.09, 40.77},
    // Footsteps: frames are made from them; the table's extent is that of their ends alone.
    {"vadere_bottleneck_postvis.traj", "vadere-traj", 0, 0, 20, 20, 249, 10, 1.166, 6.766, 1.11,
     8.798},
    {"sumo_60_persons.fcd.xml", "sumo-fcd", 0, 0, 60, 53, 240, 2, -5.44, 185.57, -6.07, 185.42},
    {"sumo_grid_4700_persons.fcd.xml.gz", "sumo-fcd", 0, 0, 4793, 4686, 30, 1, -6.72, 726.88, -6.72,
     726.72},
    {"rvo2_blocks_100_agents.txt", "rvo2-text", 0, 0, 100, 100, 800, 4, -95.00, 95.00, -95.00,
     95.00},
    // Extents of every frame; those in the table are of every fifth or tenth.
    {"menge_4square_100_agents_v2.1.scb", "menge-scb", 0, 0, 100, 100, 598, 10, -12.78, 12.90,
     -12.86, 12.87},
    {"menge_tradeshow_1025_agents_v2.1.scb", "menge-scb", 0, 0, 1025, 1025, 200, 10, -24.90, 25.62,
     -31.19, 32.14},
    {"menge_office_48_agents_v1.0.scb", "menge-scb", 10, 0, 48, 48, 398, 10, -38.18, 40.30, -0.03,
     25.39},
};

INSTANTIATE_TEST_SUITE_P(Table, RealFileTest, ::testing::ValuesIn(kFiles), [](const auto& info) {
  std::string name = info.param.name;
  for (char& c : name) c = std::isalnum(static_cast<unsigned char>(c)) ? c : '_';
  return name;
});

}  // namespace
}  // namespace throng::trajectory
