#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

namespace throng::simplify {

struct SheetOptions {
  std::vector<std::string> inputs;      // folders of casts, .throng files
  std::vector<std::string> characters;  // only these names; empty: all
  std::string path;                     // PNG to write
  std::uint32_t figure_px = 460;        // height of the tallest figure of a row
};

/// One picture of everybody, the tallest first: rows of figures of like height on a neutral ground,
/// each row with lines at round heights, names and heights below. Errors as `write_report`, but a
/// character that can't be read stops it.
absl::Status write_sheet(const SheetOptions& options);

}  // namespace throng::simplify
