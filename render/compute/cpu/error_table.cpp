#include "render/compute/cpu/error_table.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace throng::render {

ErrorTable make_error_table(const Character& character) {
  ErrorTable table;
  // where it is not known, as of points spread over a surface
  const bool is_known =
      std::any_of(character.collapse_error_m.begin(), character.collapse_error_m.end(),
                  [](float error_m) { return error_m > 0.0F; });
  const auto error_of = [&](std::uint32_t vertex) {
    return is_known ? character.collapse_error_m[vertex]
                    : 0.25F * character.height_m / std::sqrt(static_cast<float>(vertex));
  };
  // off with n vertices: the largest error of those that are gone
  std::uint32_t n = character.vertex_count();
  float gone_m = 0.0F;
  for (std::uint32_t step = 0; step < ErrorTable::kSteps; ++step) {
    const std::uint32_t bits = (element::kFirstErrorBits + step) << 20;
    float error_m = 0.0F;
    std::memcpy(&error_m, &bits, sizeof error_m);
    while (n > character.coarsest_count) {
      const float next_m = std::max(gone_m, error_of(n - 1));
      if (next_m > error_m) break;
      gone_m = next_m;
      --n;
    }
    // the next legal count that is no smaller
    std::uint32_t legal = n;
    while (legal < character.vertex_count() && character.legal_count[legal] != legal) ++legal;
    table.vertex_count[step] = std::max(legal, character.coarsest_count);
  }
  return table;
}

}  // namespace throng::render
