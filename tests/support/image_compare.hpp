#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <span>

namespace throng::test {

/// Differences of two pictures of r g b x rows; the fourth byte is left out.
struct ImageDifference {
  int max = 255;              // largest of one component, 0 to 255
  double mean = 255.0;        // of all components
  double psnr_db = 0.0;       // infinity when equal
  double share_over_8 = 1.0;  // of the pixels that differ by more than 8 in some component
};

/// The worst values when the sizes differ.
inline ImageDifference compare_images(std::span<const std::uint8_t> a,
                                      std::span<const std::uint8_t> b) {
  ImageDifference difference;
  if (a.size() != b.size() || a.empty()) return difference;
  std::uint64_t sum = 0, squares = 0, over = 0;
  int largest = 0;
  for (std::size_t i = 0; i + 3 < a.size(); i += 4) {
    int worst = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const int d = std::abs(int{a[i + k]} - int{b[i + k]});
      sum += static_cast<std::uint64_t>(d);
      squares += static_cast<std::uint64_t>(d * d);
      worst = std::max(worst, d);
    }
    largest = std::max(largest, worst);
    if (worst > 8) ++over;
  }
  const double components = 3.0 * static_cast<double>(a.size() / 4);
  difference.max = largest;
  difference.mean = static_cast<double>(sum) / components;
  difference.share_over_8 = static_cast<double>(over) / static_cast<double>(a.size() / 4);
  difference.psnr_db =
      squares == 0 ? std::numeric_limits<double>::infinity()
                   : 10.0 * std::log10(255.0 * 255.0 / (static_cast<double>(squares) / components));
  return difference;
}

}  // namespace throng::test
