#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <vector>

#include "simplify/import/document.hpp"

namespace throng::simplify::gltf {

/// An accessor's numbers, row by row: [count][components].
template <typename T>
struct Table {
  std::uint32_t components = 0;
  std::uint64_t count = 0;
  std::vector<T> values;
  const T* row(std::uint64_t i) const { return values.data() + i * components; }
};

/// Reads an accessor with its sparse part. Normalised integers become [0, 1] or [-1, 1]
/// (`force_normalized` for weights and colours whose flag was forgotten).
/// InvalidArgument when it reaches beyond its view or is larger than the limits.
absl::StatusOr<Table<float>> read_floats(const Document& document, std::uint32_t accessor,
                                         bool force_normalized = false);

/// As `read_floats` for unsigned integers: indices and joints.
absl::StatusOr<Table<std::uint32_t>> read_integers(const Document& document,
                                                   std::uint32_t accessor);

}  // namespace throng::simplify::gltf
