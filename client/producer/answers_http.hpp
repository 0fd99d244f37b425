#pragma once

#include <string>

namespace throng::client {

/// Whether something at HOST:PORT speaks HTTP/1, as the page's door does and a gRPC server does
/// not. Takes at most two seconds, and some for the name.
bool answers_http(const std::string& address);

}  // namespace throng::client
