#include "simplify/import/file.hpp"

#include <absl/strings/escaping.h>
#include <absl/strings/str_cat.h>

#include <cstdio>
#include <filesystem>
#include <memory>

namespace throng::simplify::gltf {
namespace {

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

std::string decode_percent(std::string_view uri) {
  std::string text;
  text.reserve(uri.size());
  for (std::size_t i = 0; i < uri.size(); ++i) {
    if (uri[i] == '%' && i + 2 < uri.size()) {
      const int high = hex_digit(uri[i + 1]);
      const int low = hex_digit(uri[i + 2]);
      if (high >= 0 && low >= 0) {
        text.push_back(static_cast<char>(high * 16 + low));
        i += 2;
        continue;
      }
    }
    text.push_back(uri[i]);
  }
  return text;
}

}  // namespace

absl::StatusOr<Bytes> read_file(const std::string& path, std::uint64_t limit_bytes) {
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (!std::filesystem::exists(status)) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": no such file"));
  }
  if (!std::filesystem::is_regular_file(status)) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": not a plain file"));
  }
  const std::uint64_t size_bytes = std::filesystem::file_size(path, error);
  if (error || size_bytes > limit_bytes) {
    return absl::InvalidArgumentError(absl::StrCat(
        path, error ? ": its size can't be read"
                    : absl::StrCat(": has ", size_bytes, " bytes, the limit is ", limit_bytes)));
  }
  std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::fopen(path.c_str(), "rb"),
                                                       &std::fclose);
  if (file == nullptr) return absl::InvalidArgumentError(absl::StrCat(path, ": can't be opened"));
  Bytes bytes(size_bytes);
  if (std::fread(bytes.data(), 1, bytes.size(), file.get()) != bytes.size()) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": can't be read to its end"));
  }
  return bytes;
}

absl::StatusOr<Bytes> read_uri(const std::string& uri, const std::string& folder,
                               std::uint64_t limit_bytes) {
  if (uri.starts_with("data:")) {
    const std::size_t comma = uri.find(',');
    if (comma == std::string::npos ||
        !std::string_view(uri).substr(0, comma).ends_with(";base64")) {
      return absl::InvalidArgumentError("data uri is not base64");
    }
    std::string decoded;
    if (!absl::Base64Unescape(absl::string_view(uri).substr(comma + 1), &decoded)) {
      return absl::InvalidArgumentError("data uri has characters that are not base64");
    }
    return Bytes(decoded.begin(), decoded.end());
  }
  const std::string name = decode_percent(uri);
  if (name.empty() || name.find("://") != std::string::npos ||
      name.find('\0') != std::string::npos || std::filesystem::path(name).is_absolute()) {
    return absl::InvalidArgumentError(
        absl::StrCat("uri '", uri.substr(0, 100), "' is not a file beside this one"));
  }
  return read_file((std::filesystem::path(folder) / name).string(), limit_bytes);
}

}  // namespace throng::simplify::gltf
