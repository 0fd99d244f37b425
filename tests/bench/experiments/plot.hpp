#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

namespace throng::bench {

/// A line of a plot; a NaN in y leaves a gap.
struct Series {
  std::string name;
  std::vector<double> x, y;
};

/// Lines over two axes, as the papers have them.
struct Plot {
  std::string title, x_label, y_label;
  bool log_x = false, log_y = false;
  std::vector<Series> series;
};

/// Draws plots one below the other and writes them as PNG. PermissionDenied when the file can't be
/// written.
absl::Status write_plots(const std::string& file, const std::vector<Plot>& plots);

/// `file` with its ending replaced by `.png`.
std::string plot_file(const std::string& json_file);

}  // namespace throng::bench
