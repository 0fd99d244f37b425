#include "server/web/page.hpp"

#include <absl/strings/str_cat.h>

#include <filesystem>
#include <fstream>
#include <iterator>

namespace throng::server {

absl::StatusOr<std::string> read_page(const std::string& root, const std::string& name) {
  if (root.empty()) {
    const PageFile file = built_in_page(name);
    if (file.bytes.data() != nullptr) return std::string(file.bytes);
    return absl::NotFoundError(absl::StrCat("there is no ", name));
  }
  const std::filesystem::path path = std::filesystem::path(root) / name;
  std::error_code error;
  constexpr std::uintmax_t kLargest = 16u << 20;
  if (!std::filesystem::is_regular_file(path, error) ||
      std::filesystem::file_size(path, error) > kLargest || error) {
    return absl::NotFoundError(absl::StrCat("there is no ", name));
  }
  std::ifstream file(path, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
}

}  // namespace throng::server
