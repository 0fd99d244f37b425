#include "bench/experiments/table.hpp"

#include <absl/strings/str_format.h>

#include <algorithm>
#include <cmath>

namespace throng::bench {
namespace {

/// Letters as they are shown, not bytes.
std::size_t width_of(const std::string& text) {
  return static_cast<std::size_t>(std::count_if(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) & 0xc0) != 0x80;
  }));
}

}  // namespace

std::string Table::text() const {
  std::vector<std::size_t> width;
  for (const auto& row : rows_) {
    width.resize(std::max(width.size(), row.size()), 1);
    for (std::size_t i = 0; i < row.size(); ++i) width[i] = std::max(width[i], width_of(row[i]));
  }
  std::string out;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    out += '|';
    for (std::size_t i = 0; i < width.size(); ++i) {
      const std::string cell = i < rows_[r].size() ? rows_[r][i] : "";
      const std::string space(width[i] - width_of(cell), ' ');
      out += i == 0 ? " " + cell + space + " |" : " " + space + cell + " |";
    }
    out += '\n';
    if (r > 0) continue;
    out += '|';
    for (std::size_t i = 0; i < width.size(); ++i) {
      out += i == 0 ? std::string(width[i] + 2, '-') : std::string(width[i] + 1, '-') + ":";
      out += '|';
    }
    out += '\n';
  }
  return out;
}

std::string fixed(double value, int digits) {
  return std::isnan(value) ? "-" : absl::StrFormat("%.*f", digits, value);
}

std::string grouped(double count) {
  const std::string digits = absl::StrFormat("%.0f", count);
  std::string out;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) out += ',';
    out += digits[i];
  }
  return out;
}

}  // namespace throng::bench
