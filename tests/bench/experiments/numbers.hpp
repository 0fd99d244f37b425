#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <vector>

namespace throng::bench {

/// Least, most and mean of what was added.
struct Range {
  double min = std::numeric_limits<double>::infinity();
  double max = -std::numeric_limits<double>::infinity();
  double sum = 0;
  std::uint64_t count = 0;

  void add(double value) {
    min = std::min(min, value);
    max = std::max(max, value);
    sum += value;
    ++count;
  }
  void add(const Range& other) {
    min = std::min(min, other.min);
    max = std::max(max, other.max);
    sum += other.sum;
    count += other.count;
  }
  double mean() const { return count == 0 ? 0.0 : sum / static_cast<double>(count); }
};

/// y = a + b x with the least sum of squared errors. With fewer than two different x, b is 0.
struct Line {
  double a = 0, b = 0;
};
Line fit_line(const std::vector<double>& x, const std::vector<double>& y);

double median(std::vector<double> values);

}  // namespace throng::bench
