#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "simplify/bake/bake.hpp"
#include "simplify/impostor/relief.hpp"

namespace throng::simplify {

/// Says which code (by the hash of the libraries that bake, the built-in cast among them) bakes
/// with which settings: another one bakes again.
std::string tool_version(const BakeOptions& options, const ReliefOptions& relief);

/// Hash of a file's bytes and of those of the buffers and images a .gltf names, in hexadecimal.
/// NotFound names the file.
absl::StatusOr<std::string> hash_input(const std::string& path);

}  // namespace throng::simplify
