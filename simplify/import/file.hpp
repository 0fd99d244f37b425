#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace throng::simplify::gltf {

using Bytes = std::vector<std::uint8_t>;

/// A whole file. InvalidArgument naming it when it is missing, not a plain file, or over the limit.
absl::StatusOr<Bytes> read_file(const std::string& path, std::uint64_t limit_bytes);

/// What a buffer's or an image's uri stands for: base64 data inside it, or a file relative to
/// `folder`.
absl::StatusOr<Bytes> read_uri(const std::string& uri, const std::string& folder,
                               std::uint64_t limit_bytes);

}  // namespace throng::simplify::gltf
