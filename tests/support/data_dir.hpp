#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

namespace throng::test {

/// Folder of real characters and trajectories: THRONG_DATA_DIR, else ../shared/data beside the
/// source tree. Empty when it is not there; tests that need it then skip.
inline std::string data_dir() {
  const char* set = std::getenv("THRONG_DATA_DIR");
  const std::filesystem::path path =
      set != nullptr ? std::filesystem::path(set)
                     : std::filesystem::path(THRONG_SOURCE_DIR) / ".." / "shared" / "data";
  std::error_code error;
  return std::filesystem::is_directory(path, error) ? path.lexically_normal().string()
                                                    : std::string();
}

}  // namespace throng::test
