#pragma once

#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <vector>

#include "throng/trajectory/trajectory.hpp"

namespace throng::trajectory::test {

/// Files in a folder of their own that goes away with the test.
class FileTest : public ::testing::Test {
 protected:
  FileTest();
  ~FileTest() override;
  std::string path(const std::string& name) const { return folder_ + "/" + name; }
  /// Writes bytes as a file and gives its path.
  std::string write(const std::string& name, std::string_view bytes) const;
  std::string write_gz(const std::string& name, std::string_view bytes) const;

 private:
  std::string folder_;
};

/// All frames of a file. An error ends it; it is in `status`.
struct Reading {
  absl::Status status;
  Info info;  // after the last frame
  std::vector<Frame> frames;
  std::int64_t inserted = 0;
};
Reading read_all(const std::string& path, const ReadOptions& options = {});

/// Expects an InvalidArgument whose message has every one of these pieces.
void expect_error(const absl::Status& status, const std::vector<std::string>& pieces);

ReadOptions with_fps(double fps);
ReadOptions with_unit(double metres);
ReadOptions with_fps_and_unit(double fps, double metres);

/// Runs SQL on a new database.
void write_sqlite(const std::string& path, const std::string& sql);

/// Opens and reads damaged copies of a good file to their ends, whatever they say: cut, with bytes
/// flipped, with pieces doubled or dropped. Nothing may crash; errors must name the file.
/// What is checked of every frame that still comes: equal columns, finite positions, rising times.
void survive_mutations(const std::string& good_path, const std::string& scratch_path, int count,
                       const ReadOptions& options = {});

}  // namespace throng::trajectory::test
