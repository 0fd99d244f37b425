#pragma once

namespace throng::simplify {

/// Hash of the libraries that bake; made by the build.
extern const char* const kBakeCode;

}  // namespace throng::simplify
