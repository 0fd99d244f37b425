#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "simplify/bake/bake.hpp"
#include "simplify/source_character.hpp"

namespace throng::simplify {

/// Says which program baked with which settings, so that another one bakes again.
std::string tool_version(const BakeOptions& options);

/// Hash of a file's bytes and of those of the buffers and images a .gltf names, in hexadecimal.
/// NotFound names the file.
absl::StatusOr<std::string> hash_input(const std::string& path);

/// Hash of everything in a character, in hexadecimal.
std::string hash_character(const SourceCharacter& character);

}  // namespace throng::simplify
