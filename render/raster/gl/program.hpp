#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <string>

namespace throng::render::gl {

/// A linked program of the bound context, to be deleted by the caller. Internal with what the
/// driver said of which stage; `name` is for that message.
absl::StatusOr<std::uint32_t> make_program(const char* name, const std::string& vertex,
                                           const std::string& fragment);

}  // namespace throng::render::gl
