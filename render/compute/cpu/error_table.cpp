#include "render/compute/cpu/error_table.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace throng::render {
namespace {

/// What a character is off by with n vertices: e = e^a n^b.
struct ErrorLaw {
  double a = 0.0, b = 0.0;  // b: 0 where there is none
  float operator()(std::uint32_t vertex) const {
    return static_cast<float>(std::exp(a + b * std::log(static_cast<double>(vertex))));
  }
};

/// The law through the recorded errors of the coarser half, by least squares of their logarithms,
/// evenly by octaves. OURS: what is recorded is the largest error of any one collapse, so that a
/// single bad one hides how fast all others grow; the finer half follows the same law, as figures
/// so near are better whole than spared. Agents of many characters that are given vertices
/// by it come as near to the full mesh with a sixth fewer (10,000 from above, by SSIM).
ErrorLaw fit_errors(const Character& character) {
  constexpr double kStep = 0.05;                    // of the logarithm
  constexpr std::uint32_t kLeast = 40, kTwice = 4;  // from so many vertices on, two octaves of them
  ErrorLaw law;
  const std::uint32_t from = std::max(kLeast, character.coarsest_count);
  const std::uint32_t to = character.vertex_count() / 2;
  if (to < kTwice * from) return law;
  double n = 0.0, x1 = 0.0, y1 = 0.0, xx = 0.0, xy = 0.0;
  for (double x = std::log(from); x < std::log(to); x += kStep) {
    const float error_m = character.collapse_error_m[static_cast<std::uint32_t>(std::exp(x))];
    if (!(error_m > 0.0F)) return law;
    const double y = std::log(error_m);
    n += 1.0, x1 += x, y1 += y, xx += x * x, xy += x * y;
  }
  const double b = (n * xy - x1 * y1) / (n * xx - x1 * x1);
  if (!(b < 0.0)) return law;
  return {(y1 - b * x1) / n, b};
}

}  // namespace

ErrorTable make_error_table(const Character& character) {
  ErrorTable table;
  // where it is not known, as of points spread over a surface
  const bool is_known =
      std::any_of(character.collapse_error_m.begin(), character.collapse_error_m.end(),
                  [](float error_m) { return error_m > 0.0F; });
  const ErrorLaw law = is_known ? fit_errors(character) : ErrorLaw{};
  const auto error_of = [&](std::uint32_t vertex) {
    if (!is_known) return 0.25F * character.height_m / std::sqrt(static_cast<float>(vertex));
    return law.b < 0.0 ? law(vertex) : character.collapse_error_m[vertex];
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
