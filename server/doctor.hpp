#pragma once

#include <string>

namespace throng::server {

/// What this machine can draw with and why not, as readable lines or as JSON. `cast` is the folder
/// that the server would use, empty if there is none.
std::string doctor_report(const std::string& cast, bool json);

}  // namespace throng::server
