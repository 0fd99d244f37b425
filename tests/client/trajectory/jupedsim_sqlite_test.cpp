#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "fixture.hpp"

namespace throng::trajectory {
namespace {

using test::expect_error;
using test::FileTest;
using test::read_all;
using test::Reading;
using ::testing::ElementsAre;

class JupedsimSqliteTest : public FileTest {
 protected:
  std::string database(const std::string& sql, const std::string& name = "a.sqlite") const {
    std::filesystem::remove(path(name));
    test::write_sqlite(path(name), sql);
    return path(name);
  }
};

constexpr const char* kMeta =
    "CREATE TABLE metadata(key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL);";
constexpr const char* kV1 =
    "CREATE TABLE trajectory_data(frame INTEGER NOT NULL, id INTEGER NOT NULL, pos_x REAL NOT NULL,"
    " pos_y REAL NOT NULL, ori_x REAL NOT NULL, ori_y REAL NOT NULL);"
    "CREATE TABLE metadata(key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL);"
    "CREATE TABLE geometry(wkt TEXT NOT NULL);"
    "CREATE INDEX frame_id_idx ON trajectory_data(frame, id);"
    "INSERT INTO metadata VALUES('version','1'),('fps','10.0');"
    "INSERT INTO geometry VALUES('POLYGON ((0 0, 9 0, 9 9, 0 0))');"
    "INSERT INTO trajectory_data VALUES(0,1,1,2,0,1),(0,2,3,4,0,0),(1,1,1,2.1,0,1),(5,3,1,1,1,0);";
constexpr const char* kV3 =
    "CREATE TABLE trajectory_data(frame INTEGER NOT NULL, id INTEGER NOT NULL, pos_x REAL NOT NULL,"
    " pos_y REAL NOT NULL);"
    "CREATE TABLE metadata(key TEXT NOT NULL UNIQUE PRIMARY KEY, value TEXT NOT NULL);"
    "CREATE TABLE geometry(hash INTEGER NOT NULL, wkt TEXT NOT NULL);"
    "CREATE TABLE frame_data(frame INTEGER NOT NULL, geometry_hash INTEGER NOT NULL);"
    "INSERT INTO metadata VALUES('version','3'),('fps','25.0');"
    "INSERT INTO geometry VALUES(-5,'POLYGON ((1 1, 9 0, 9 9, 1 1))'),(7,'POLYGON ((0 0, 9 0, 9 9, "
    "0 0))');"
    "INSERT INTO frame_data VALUES(0,7),(1,7),(2,-5),(3,-5);"
    "INSERT INTO trajectory_data VALUES(1,8,1,2),(1,3,3,4),(2,8,1,2.1);";

TEST_F(JupedsimSqliteTest, Version1HasOrientationsAndGapsAreEmpty) {
  const Reading reading = read_all(database(kV1));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.fps, 10.0);
  EXPECT_EQ(reading.info.walkable_area_wkt, "POLYGON ((0 0, 9 0, 9 9, 0 0))");
  ASSERT_EQ(reading.frames.size(), 4u);
  EXPECT_NEAR(reading.frames[0].heading_rad[0], M_PI / 2, 1e-6);
  EXPECT_TRUE(std::isnan(reading.frames[0].heading_rad[1])) << "a zero orientation is missing";
  EXPECT_TRUE(reading.frames[2].ids.empty());
  EXPECT_EQ(reading.frames[2].time_us, 200000);
  EXPECT_EQ(reading.frames[3].time_us, 500000);
  EXPECT_EQ(reading.inserted, 1);
}

TEST_F(JupedsimSqliteTest, Version3ListsFramesWithNobody) {
  const Reading reading = read_all(database(kV3));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  ASSERT_EQ(reading.frames.size(), 4u);
  EXPECT_TRUE(reading.frames[0].ids.empty());
  EXPECT_THAT(reading.frames[1].ids, ElementsAre(3u, 8u));
  EXPECT_TRUE(reading.frames[1].heading_rad.empty());
  EXPECT_TRUE(reading.frames[3].ids.empty());
  EXPECT_EQ(reading.frames[3].time_us, 120000);
  EXPECT_EQ(reading.info.walkable_area_wkt, "POLYGON ((0 0, 9 0, 9 9, 0 0))")
      << "that of the first frame";
  EXPECT_THAT(reading.info.notes, ::testing::Contains(::testing::HasSubstr("geometry changes")));
}

TEST_F(JupedsimSqliteTest, Version3UpgradedFromVersion2KeepsItsOrientations) {
  const Reading reading =
      read_all(database(std::string(kV1) + "UPDATE metadata SET value='3' WHERE key='version'"));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_FALSE(reading.frames[0].heading_rad.empty());
}

TEST_F(JupedsimSqliteTest, FileIsNotTouched) {
  const std::string file = database(kV3, "a #1?.sqlite");
  const auto before = std::filesystem::last_write_time(file);
  std::filesystem::permissions(file, std::filesystem::perms::owner_read);
  ASSERT_TRUE(read_all(file).status.ok());
  EXPECT_EQ(std::filesystem::last_write_time(file), before);
  EXPECT_FALSE(std::filesystem::exists(file + "-wal"));
  EXPECT_FALSE(std::filesystem::exists(file + "-journal"));
}

TEST_F(JupedsimSqliteTest, ContradictionsAreErrors) {
  const std::string file = database(kV3);
  expect_error(read_all(file, test::with_fps(30)).status, {file, "--source-fps", "30", "25"});
  expect_error(read_all(file, test::with_unit(0.01)).status, {file, "--source-unit", "metres"});
}

TEST_F(JupedsimSqliteTest, MissingRateNamesTheOption) {
  const std::string file = database(std::string(kV3) + "DELETE FROM metadata WHERE key='fps'");
  expect_error(read_all(file).status, {file, "--source-fps"});
  EXPECT_TRUE(read_all(file, test::with_fps(25)).status.ok());
}

TEST_F(JupedsimSqliteTest, BrokenRowsAreNamed) {
  const std::string loose = std::string(kMeta) +
                            "CREATE TABLE trajectory_data(frame, id, pos_x, pos_y);"
                            "INSERT INTO metadata VALUES('fps','25');";
  expect_error(
      read_all(database(loose + "INSERT INTO trajectory_data VALUES(0,1,'left',2)")).status,
      {"trajectory_data, row 1", "pos_x"});
  expect_error(read_all(database(loose + "INSERT INTO trajectory_data VALUES(0,1,1,NULL)")).status,
               {"pos_y", "empty"});
  expect_error(read_all(database(loose + "INSERT INTO trajectory_data VALUES('a',1,1,1)")).status,
               {"frame"});
  expect_error(read_all(database(loose + "INSERT INTO trajectory_data VALUES(0,-4,1,1)")).status,
               {"id"});
  expect_error(read_all(database(loose + "INSERT INTO trajectory_data VALUES(0,1,9e999,1)")).status,
               {"pos_x", "inf"});
  expect_error(
      read_all(database(loose + "INSERT INTO trajectory_data VALUES(0,1,1,1),(0,1,1,1)")).status,
      {"row 2", "twice"});
  expect_error(read_all(database(loose)).status, {"no rows"});
  expect_error(read_all(database(loose + "UPDATE metadata SET value='fast'")).status,
               {"fps", "'fast'"});
}

TEST_F(JupedsimSqliteTest, TruncatedFileIsAnError) {
  std::string sql = kV3;
  for (int i = 10; i < 3000; ++i)
    sql += "INSERT INTO trajectory_data VALUES(" + std::to_string(i) + ",1,1,1);";
  const std::string file = database("BEGIN;" + sql + "COMMIT;");
  const auto size = std::filesystem::file_size(file);
  for (const auto kept : {size / 2, size - 4096, std::uintmax_t{100}}) {
    std::filesystem::copy_file(file, path("cut.sqlite"),
                               std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(path("cut.sqlite"), kept);
    expect_error(read_all(path("cut.sqlite")).status, {path("cut.sqlite"), "cut short"});
  }
}

TEST_F(JupedsimSqliteTest, ViewsInPlaceOfTablesAreRefused) {
  expect_error(
      read_all(
          database(
              "CREATE VIEW trajectory_data AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL "
              "SELECT i+1 FROM n) SELECT i AS frame, 1 AS id, 0.0 AS pos_x, 0.0 AS pos_y FROM n"))
          .status,
      {"no table trajectory_data"});
  expect_error(read_all(database("CREATE TABLE trajectory_data(frame, id, pos_x)")).status,
               {"pos_y"});
}

TEST_F(JupedsimSqliteTest, MutatedFilesNeverCrash) {
  test::survive_mutations(database(kV3), path("m.sqlite"), 1500);
  test::survive_mutations(database(kV1), path("m.sqlite"), 1500);
}

}  // namespace
}  // namespace throng::trajectory
