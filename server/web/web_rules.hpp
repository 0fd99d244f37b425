#pragma once

#include <absl/status/status.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace throng::server {

/// Who may talk to the web door. A page of another site that somebody has open in a browser can
/// reach loopback too, so a request must name this server (a name that was rebound to its address
/// does not) and, when a page made it, come from this server's own page.
struct WebRules {
  std::string bound_host;          // as in --http
  std::vector<std::string> hosts;  // names beside it (a proxy's, a tunnel's)

  /// PermissionDenied names the header. `origin`: empty when there is none (not a browser).
  absl::Status check(std::string_view host, std::string_view origin) const;
};

/// The part of HOST:PORT or [IPv6]:PORT before the port, without brackets; lower case.
std::string host_name(std::string_view host_and_port);

/// File of the page for a request path, below its folder: "/" is index.html, a query is left out.
/// None for what cannot be one: other characters than A-Z a-z 0-9 _ - . /, dot files, "..".
std::optional<std::string> asset_name(std::string_view target);

/// Content type by the ending of a file name.
std::string_view content_type(std::string_view name);

}  // namespace throng::server
