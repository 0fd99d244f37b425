#pragma once

#include <array>
#include <cstdint>
#include <cstring>

#include "throng/render/asset.hpp"

namespace throng::render {

/// The fewest vertices with which a character is off by at most so much, for errors from 2^-16 m to
/// 2^4 m in steps of an eighth of an octave (of the float's bits, so nearly).
struct ErrorTable {
  static constexpr std::uint32_t kSteps = 20 * 8;
  static constexpr std::uint32_t kFirstBits = (127 - 16) << 3;  // exponent and 3 bits of fraction
  std::array<std::uint32_t, kSteps> vertex_count{};             // legal

  /// The step of the largest error in the table that is not over `error_m`; step 0 below it.
  static std::uint32_t step_of(float error_m) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &error_m, sizeof bits);
    bits >>= 20;
    if (!(error_m > 0.0F) || bits < kFirstBits) return 0;
    const std::uint32_t step = bits - kFirstBits;
    return step < kSteps ? step : kSteps - 1;
  }

  /// The same for a figure that may share its mesh, of at most `most` vertices: no more than those
  /// where they are off by at most an octave more. One of its own takes several times as long.
  std::uint32_t shared_count(std::uint32_t step, std::uint32_t most) const {
    constexpr std::uint32_t kOctave = 8;
    const std::uint32_t wanted = vertex_count[step];
    const std::uint32_t coarser = step + kOctave < kSteps ? step + kOctave : kSteps - 1;
    return wanted > most && vertex_count[coarser] <= most ? most : wanted;
  }
};

ErrorTable make_error_table(const Character& character);

}  // namespace throng::render
