#pragma once

#include <string>
#include <vector>

namespace throng::bench {

/// A table in Markdown with columns of even width, numbers to the right.
class Table {
 public:
  explicit Table(std::vector<std::string> head) : rows_{std::move(head)} {}
  void add(std::vector<std::string> row) { rows_.push_back(std::move(row)); }
  std::string text() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

/// `value` with so many digits after the point; "-" for NaN.
std::string fixed(double value, int digits);

/// A count with thousands apart: 30,000.
std::string grouped(double count);

}  // namespace throng::bench
