#include <gmock/gmock.h>

#include "fixture.hpp"

#ifdef THRONG_WITH_HDF5
#include <hdf5.h>

#include <cmath>
#include <filesystem>

namespace throng::trajectory {
namespace {

using test::expect_error;
using test::FileTest;
using test::read_all;
using test::Reading;
using ::testing::ElementsAre;

struct Row {
  std::uint32_t frame, id;
  double x, y, z;
};

class Hdf5Test : public FileTest {
 protected:
  std::string make(const std::string& name, const std::vector<Row>& rows, double fps,
                   const char* x_name = "x", hsize_t promised = 0, hsize_t chunk = 1) const {
    const hid_t file = H5Fcreate(path(name).c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    const hid_t type = H5Tcreate(H5T_COMPOUND, sizeof(Row));
    H5Tinsert(type, "frame", HOFFSET(Row, frame), H5T_NATIVE_UINT32);
    H5Tinsert(type, "id", HOFFSET(Row, id), H5T_NATIVE_UINT32);
    H5Tinsert(type, x_name, HOFFSET(Row, x), H5T_NATIVE_DOUBLE);
    H5Tinsert(type, "y", HOFFSET(Row, y), H5T_NATIVE_DOUBLE);
    H5Tinsert(type, "z", HOFFSET(Row, z), H5T_NATIVE_DOUBLE);
    const hsize_t size = rows.size(), length = promised > 0 ? promised : size;
    const hsize_t any = H5S_UNLIMITED;
    const hid_t space = H5Screate_simple(1, &length, &any);
    const hid_t creation = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_chunk(creation, 1, &chunk);
    const hid_t data =
        H5Dcreate2(file, "trajectory", type, space, H5P_DEFAULT, creation, H5P_DEFAULT);
    const hid_t memory = H5Screate_simple(1, &size, nullptr);
    const hsize_t start = 0;
    H5Sselect_hyperslab(space, H5S_SELECT_SET, &start, nullptr, &size, nullptr);
    H5Dwrite(data, type, memory, space, H5P_DEFAULT, rows.data());
    const hid_t scalar = H5Screate(H5S_SCALAR);
    if (fps > 0) {
      const hid_t attribute =
          H5Acreate2(data, "fps", H5T_NATIVE_DOUBLE, scalar, H5P_DEFAULT, H5P_DEFAULT);
      H5Awrite(attribute, H5T_NATIVE_DOUBLE, &fps);
      H5Aclose(attribute);
    }
    const hid_t text = H5Tcopy(H5T_C_S1);
    H5Tset_size(text, H5T_VARIABLE);
    const char* wkt = "POLYGON ((0 0, 1 0, 1 1, 0 0))";
    const hid_t attribute =
        H5Acreate2(file, "wkt_geometry", text, scalar, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(attribute, text, &wkt);
    H5Aclose(attribute);
    for (const hid_t id : {scalar, space, memory}) H5Sclose(id);
    for (const hid_t id : {type, text}) H5Tclose(id);
    H5Pclose(creation);
    H5Dclose(data);
    H5Fclose(file);
    return path(name);
  }
  const std::vector<Row> rows_ = {{3, 1, 1.5, 2.5, 1.7}, {4, 1, 1.6, 2.5, 1.7}, {4, 9, 3, 4, 1.8}};
};

TEST_F(Hdf5Test, ReadsColumnsByNameAndRateOfItsAttribute) {
  const Reading reading = read_all(make("a.h5", rows_, 25));
  ASSERT_TRUE(reading.status.ok()) << reading.status;
  EXPECT_EQ(reading.info.fps, 25.0);
  EXPECT_EQ(reading.info.walkable_area_wkt, "POLYGON ((0 0, 1 0, 1 1, 0 0))");
  ASSERT_EQ(reading.frames.size(), 2u);
  EXPECT_THAT(reading.frames[1].ids, ElementsAre(1u, 9u));
  EXPECT_THAT(reading.frames[1].x_m, ElementsAre(1.6, 3.0));
  EXPECT_TRUE(reading.frames[1].z_m.empty());
  EXPECT_EQ(reading.frames[1].time_us, 40000);
}

/// As h5py and JuPedSim write tables that grow.
TEST_F(Hdf5Test, TheLastChunkNeedNotBeFull) {
  for (const hsize_t chunk : {2u, 3u, 256u}) {
    const Reading reading = read_all(make("a.h5", rows_, 25, "x", 0, chunk));
    ASSERT_TRUE(reading.status.ok()) << reading.status;
    EXPECT_EQ(reading.frames.size(), 2u);
  }
  expect_error(read_all(make("a.h5", rows_, 25, "x", 257, 256)).status, {"257 rows"});
}

TEST_F(Hdf5Test, ContradictionsAndMissingRateAreErrors) {
  expect_error(read_all(make("a.h5", rows_, 25), test::with_fps(16)).status,
               {"--source-fps", "16", "25"});
  expect_error(read_all(path("a.h5"), test::with_unit(0.01)).status, {"--source-unit"});
  expect_error(read_all(make("b.h5", rows_, 0)).status, {"fps", "--source-fps"});
}

TEST_F(Hdf5Test, TruncatedFileIsAnError) {
  const std::string file = make("a.h5", rows_, 25);
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  expect_error(read_all(file).status, {file, "cut short"});
}

TEST_F(Hdf5Test, HostileFilesAreRefused) {
  expect_error(read_all(make("a.h5", rows_, 25, "east")).status, {"named x"});
  expect_error(read_all(make("b.h5", rows_, 25, "x", hsize_t{1} << 40)).status,
               {"1099511627776", "cut short"});
  expect_error(read_all(make("c.h5", {{0, 1, std::nan(""), 0, 0}}, 25)).status, {"x is"});
  const hid_t file = H5Fcreate(path("d.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
  H5Lcreate_external("/etc/passwd", "/trajectory", file, "trajectory", H5P_DEFAULT, H5P_DEFAULT);
  H5Fclose(file);
  expect_error(read_all(path("d.h5")).status, {"no dataset /trajectory"});
}

}  // namespace
}  // namespace throng::trajectory
#endif
