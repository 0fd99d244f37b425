#include "server/web/web_rules.hpp"

#include <absl/strings/ascii.h>
#include <absl/strings/str_cat.h>
#include <arpa/inet.h>

#include <algorithm>

#include "server/rpc/bind_rules.hpp"

namespace throng::server {
namespace {

bool is_address(const std::string& host) {
  in_addr v4{};
  in6_addr v6{};
  return inet_pton(AF_INET, host.c_str(), &v4) == 1 || inet_pton(AF_INET6, host.c_str(), &v6) == 1;
}

/// What a browser would show: no control characters, not long.
std::string shown(std::string_view text) {
  std::string result(text.substr(0, 100));
  for (char& c : result) {
    if (static_cast<unsigned char>(c) < 0x20 || static_cast<unsigned char>(c) >= 0x7f) c = '?';
  }
  return result;
}

}  // namespace

std::string host_name(std::string_view host_and_port) {
  std::string_view name = host_and_port;
  if (!name.empty() && name.front() == '[') {
    const std::size_t end = name.find(']');
    if (end == std::string_view::npos) return {};
    name = name.substr(1, end - 1);
  } else {
    name = name.substr(0, name.find(':'));
  }
  return absl::AsciiStrToLower(std::string(name));
}

absl::Status WebRules::check(std::string_view host, std::string_view origin) const {
  const std::string name = host_name(host);
  bool known = std::find(hosts.begin(), hosts.end(), name) != hosts.end();
  if (is_loopback(bound_host)) {
    known = known || is_loopback(name);
  } else {
    // Only a name can be rebound to another address.
    known = known || name == bound_host || is_loopback(name) || is_address(name);
  }
  if (!known) {
    return absl::PermissionDeniedError(absl::StrCat(
        "Host: '", shown(host), "' is not this server; --http-host NAME allows another name"));
  }
  if (origin.empty()) return absl::OkStatus();
  const std::string own = absl::AsciiStrToLower(std::string(host));
  const std::string from = absl::AsciiStrToLower(std::string(origin));
  if (from != "http://" + own && from != "https://" + own) {
    return absl::PermissionDeniedError(
        absl::StrCat("Origin: '", shown(origin), "' is another site than '", shown(host), "'"));
  }
  return absl::OkStatus();
}

std::optional<std::string> asset_name(std::string_view target) {
  const std::string_view path = target.substr(0, target.find_first_of("?#"));
  if (path.empty() || path.front() != '/' || path.size() > 200) return std::nullopt;
  if (path == "/") return "index.html";
  char before = '/';
  for (const char c : path.substr(1)) {
    const bool good = absl::ascii_isalnum(static_cast<unsigned char>(c)) || c == '_' || c == '-' ||
                      c == '.' || c == '/';
    // No empty, hidden or climbing part.
    if (!good || (before == '/' && (c == '.' || c == '/'))) return std::nullopt;
    before = c;
  }
  if (before == '/') return std::nullopt;
  return std::string(path.substr(1));
}

std::string_view content_type(std::string_view name) {
  struct Type {
    std::string_view ending, type;
  };
  constexpr Type kTypes[] = {
      {".html", "text/html; charset=utf-8"},
      {".css", "text/css; charset=utf-8"},
      {".js", "text/javascript; charset=utf-8"},
      {".svg", "image/svg+xml"},
      {".png", "image/png"},
      {".json", "application/json"},
      {".webmanifest", "application/manifest+json"},
  };
  for (const Type& type : kTypes) {
    if (name.ends_with(type.ending)) return type.type;
  }
  return "application/octet-stream";
}

}  // namespace throng::server
