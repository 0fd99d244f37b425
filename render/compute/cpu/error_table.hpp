#pragma once

#include <array>
#include <cstdint>

#include "render/compute/element/forms.hpp"
#include "throng/render/asset.hpp"

namespace throng::render {

/// The fewest vertices with which a character is off by so much (element::error_step), by the law
/// through the errors that were recorded when it was baked.
struct ErrorTable {
  static constexpr std::uint32_t kSteps = element::kErrorSteps;
  std::array<std::uint32_t, kSteps> vertex_count{};  // legal

  static std::uint32_t step_of(float error_m) { return element::error_step(error_m); }
  std::uint32_t shared_count(std::uint32_t step, std::uint32_t most) const {
    return element::shared_step_count(vertex_count.data(), step, most);
  }
};

ErrorTable make_error_table(const Character& character);

}  // namespace throng::render
