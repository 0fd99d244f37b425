#pragma once

#include <functional>
#include <string_view>

namespace throng::server {

/// DejaVu Sans at one size, built into the program. UTF-8; what the font lacks is drawn as a box.
class Font {
 public:
  /// @param size_px  from the highest ascender to the lowest descender.
  explicit Font(double size_px) : size_px_(size_px) {}

  int width(std::string_view text) const;  // px, rounded up

  /// Calls `put` (x, y, coverage in (0, 1]) for every pixel that the text touches.
  void draw(std::string_view text, int x, int baseline,
            const std::function<void(int, int, double)>& put) const;

 private:
  double size_px_;
};

}  // namespace throng::server
