#pragma once

#include <cstddef>
#include <string>

namespace throng::server {

struct Services;

/// All counters of a server in the text format of Prometheus 0.0.4. No label grows with viewers or
/// agents; crowds are bounded by Limits::max_crowds.
std::string metrics_text(Services& services, std::size_t web_connections);

}  // namespace throng::server
