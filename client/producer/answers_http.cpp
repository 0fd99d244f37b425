#include "answers_http.hpp"

#include <netdb.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <memory>
#include <string_view>

namespace throng::client {
namespace {

constexpr int kPatienceMs = 700;

struct Socket {
  int fd = -1;
  ~Socket() {
    if (fd >= 0) close(fd);
  }
  bool waits_for(short events) const {
    pollfd one{fd, events, 0};
    return poll(&one, 1, kPatienceMs) == 1;
  }
};

}  // namespace

bool answers_http(const std::string& address) {
  const std::size_t colon = address.rfind(':');
  if (colon == std::string::npos) return false;
  std::string host = address.substr(0, colon);
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  }
  addrinfo hints{};
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(host.c_str(), address.c_str() + colon + 1, &hints, &found) != 0) return false;
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> owner(found, &freeaddrinfo);
  const Socket door{
      socket(found->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, found->ai_protocol)};
  if (door.fd < 0) return false;
  (void)connect(door.fd, found->ai_addr, found->ai_addrlen);
  static constexpr std::string_view kRequest = "HEAD / HTTP/1.0\r\n\r\n", kAnswer = "HTTP/1.";
  if (!door.waits_for(POLLOUT) ||
      send(door.fd, kRequest.data(), kRequest.size(), MSG_NOSIGNAL) !=
          static_cast<ssize_t>(kRequest.size()) ||
      !door.waits_for(POLLIN)) {
    return false;
  }
  char answer[kAnswer.size()];
  return recv(door.fd, answer, sizeof answer, 0) == static_cast<ssize_t>(sizeof answer) &&
         std::string_view(answer, sizeof answer) == kAnswer;
}

}  // namespace throng::client
