#include "simplify/import/accessor.hpp"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cstring>

#include "simplify/import/limits.hpp"

namespace throng::simplify::gltf {
namespace {

enum Component : std::uint32_t {
  kByte = 5120,
  kUnsignedByte = 5121,
  kShort = 5122,
  kUnsignedShort = 5123,
  kUnsignedInt = 5125,
  kFloat = 5126,
};

std::uint32_t size_of(std::uint32_t component) {
  switch (component) {
    case kByte:
    case kUnsignedByte:
      return 1;
    case kShort:
    case kUnsignedShort:
      return 2;
    case kUnsignedInt:
    case kFloat:
      return 4;
    default:
      return 0;
  }
}

template <typename T>
T load(const std::uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof(value));  // glTF doesn't promise what the buffer's address is
  return value;
}

float to_float(const std::uint8_t* at, std::uint32_t component, bool normalized) {
  // divisors of glTF 2.0 section 3.11
  switch (component) {
    case kByte: {
      const float value = load<std::int8_t>(at);
      return normalized ? std::max(value / 127.0F, -1.0F) : value;
    }
    case kUnsignedByte: {
      const float value = load<std::uint8_t>(at);
      return normalized ? value / 255.0F : value;
    }
    case kShort: {
      const float value = load<std::int16_t>(at);
      return normalized ? std::max(value / 32767.0F, -1.0F) : value;
    }
    case kUnsignedShort: {
      const float value = load<std::uint16_t>(at);
      return normalized ? value / 65535.0F : value;
    }
    case kUnsignedInt: {
      const float value = static_cast<float>(load<std::uint32_t>(at));
      return normalized ? value / 4294967295.0F : value;
    }
    default:
      return load<float>(at);
  }
}

std::uint32_t to_integer(const std::uint8_t* at, std::uint32_t component) {
  switch (component) {
    case kUnsignedByte:
      return load<std::uint8_t>(at);
    case kUnsignedShort:
      return load<std::uint16_t>(at);
    default:
      return load<std::uint32_t>(at);
  }
}

struct Rows {
  const std::uint8_t* data = nullptr;
  std::uint64_t stride = 0;
};

/// Where `count` rows of `row_bytes` lie in a view.
absl::StatusOr<Rows> rows_of(const Document& document, std::int32_t view_index,
                             std::uint64_t offset, std::uint64_t count, std::uint64_t row_bytes) {
  const BufferView& view = document.views[static_cast<std::size_t>(view_index)];
  const std::span<const std::uint8_t> bytes = document.bytes(view);
  const std::uint64_t stride = view.stride == 0 ? row_bytes : view.stride;
  if (stride < row_bytes) {
    return absl::InvalidArgumentError(absl::StrCat("rows have ", row_bytes, " bytes, bufferView ",
                                                   view_index, " has stride ", stride));
  }
  // ordered so that nothing overflows
  const bool fits = offset <= bytes.size() && row_bytes <= bytes.size() - offset &&
                    (count - 1) <= (bytes.size() - offset - row_bytes) / stride;
  if (count > 0 && !fits) {
    return absl::InvalidArgumentError(absl::StrCat("has ", count, " rows of ", row_bytes,
                                                   " bytes from byte ", offset, ", bufferView ",
                                                   view_index, " has ", bytes.size(), " bytes"));
  }
  return Rows{bytes.data() + offset, stride};
}

template <typename T, typename Convert>
absl::StatusOr<Table<T>> read(const Document& document, std::uint32_t index, Convert convert) {
  const Accessor& accessor = document.accessors[index];
  const auto fail = [&](const auto&... what) {
    return absl::InvalidArgumentError(absl::StrCat("accessor ", index, " ", what...));
  };
  const std::uint32_t component_bytes = size_of(accessor.component);
  if (component_bytes == 0) return fail("componentType is ", accessor.component);
  const std::uint64_t row_bytes = std::uint64_t{component_bytes} * accessor.components;
  if (accessor.count > kMaxVertices * 6) {
    return fail("count is ", accessor.count, ", the limit is ", kMaxVertices * 6);
  }

  Table<T> table;
  table.components = accessor.components;
  table.count = accessor.count;
  const auto read_row = [&](const std::uint8_t* from, T* to) {
    for (std::uint32_t c = 0; c < accessor.components; ++c) {
      to[c] = convert(from + std::size_t{c} * component_bytes, accessor.component);
    }
  };
  if (accessor.view != kNone) {
    const absl::StatusOr<Rows> rows =
        rows_of(document, accessor.view, accessor.offset, accessor.count, row_bytes);
    if (!rows.ok()) return fail(rows.status().message());
    table.values.resize(table.count * table.components);
    for (std::uint64_t i = 0; i < table.count; ++i) {
      read_row(rows->data + i * rows->stride, table.values.data() + i * table.components);
    }
  } else {
    // nothing in the file pays for these zeros, so their number is bounded on its own
    if (table.count * table.components > kMaxVertices * 4) {
      return fail("has no bufferView and ", table.count, " rows, the limit is ",
                  kMaxVertices * 4 / table.components);
    }
    table.values.resize(table.count * table.components);
  }

  const SparsePart& sparse = accessor.sparse;
  if (sparse.count == 0) return table;
  if (sparse.count > accessor.count) {
    return fail("sparse count is ", sparse.count, ", must be at most ", accessor.count);
  }
  const std::uint32_t index_bytes = size_of(sparse.index_component);
  if (sparse.index_component != kUnsignedByte && sparse.index_component != kUnsignedShort &&
      sparse.index_component != kUnsignedInt) {
    return fail("sparse indices componentType is ", sparse.index_component);
  }
  const absl::StatusOr<Rows> at =
      rows_of(document, sparse.index_view, sparse.index_offset, sparse.count, index_bytes);
  if (!at.ok()) return fail("sparse indices ", at.status().message());
  const absl::StatusOr<Rows> value =
      rows_of(document, sparse.value_view, sparse.value_offset, sparse.count, row_bytes);
  if (!value.ok()) return fail("sparse values ", value.status().message());
  for (std::uint64_t i = 0; i < sparse.count; ++i) {
    const std::uint32_t row = to_integer(at->data + i * at->stride, sparse.index_component);
    if (row >= table.count) return fail("sparse index ", row, " must be below ", table.count);
    read_row(value->data + i * value->stride,
             table.values.data() + std::size_t{row} * table.components);
  }
  return table;
}

}  // namespace

absl::StatusOr<Table<float>> read_floats(const Document& document, std::uint32_t accessor,
                                         bool force_normalized) {
  const bool normalized = document.accessors[accessor].normalized || force_normalized;
  return read<float>(document, accessor,
                     [normalized](const std::uint8_t* at, std::uint32_t component) {
                       return to_float(at, component, normalized);
                     });
}

absl::StatusOr<Table<std::uint32_t>> read_integers(const Document& document,
                                                   std::uint32_t accessor) {
  const std::uint32_t component = document.accessors[accessor].component;
  if (component != kUnsignedByte && component != kUnsignedShort && component != kUnsignedInt) {
    return absl::InvalidArgumentError(
        absl::StrCat("accessor ", accessor, " componentType is ", component, ", must be unsigned"));
  }
  return read<std::uint32_t>(document, accessor, [](const std::uint8_t* at, std::uint32_t type) {
    return to_integer(at, type);
  });
}

}  // namespace throng::simplify::gltf
