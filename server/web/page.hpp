#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <string_view>

namespace throng::server {

/// A file of the viewer's page.
struct PageFile {
  std::string_view name;
  std::string_view bytes;
};

/// A file that was compiled in from client/browser; null bytes when there is none of that name.
PageFile built_in_page(std::string_view name);

/// A file of the page: below `root` when that is given (so that an edit shows at once), else built
/// in. NotFound.
absl::StatusOr<std::string> read_page(const std::string& root, const std::string& name);

}  // namespace throng::server
