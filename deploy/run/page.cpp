#include "run/page.hpp"

#include "model/error.hpp"

#include <fmt/core.h>
#include <netdb.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <functional>

namespace subworld {
namespace {

/// What `act` returns for a socket, and for this IPv4 or IPv6 address in digits.
bool with_socket(const std::string& text, int port, const std::function<bool(int socket, addrinfo& address)>& act) {
  addrinfo wanted{};
  wanted.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(text.c_str(), std::to_string(port).c_str(), &wanted, &found) != 0)
    throw Error(ExitCode::usage, fmt::format("--listen {}: is no IP address", text));
  const int fd = socket(found->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0);
  constexpr int kOn = 1;  // as the display listens: also beside the closed connections of an earlier run
  if (fd >= 0) setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &kOn, sizeof kOn);
  const bool result = act(fd, *found);
  if (fd >= 0) close(fd);
  freeaddrinfo(found);
  return result;
}

/// Where a browser on this machine finds what listens on `address`.
std::string host_of(const std::string& address) {
  if (address == "0.0.0.0") return "127.0.0.1";
  if (address == "::") return "::1";
  return address;
}

bool accepts(const LiveOptions& live) {
  return with_socket(host_of(live.address), *live.port, [](int socket, const addrinfo& address) {
    return connect(socket, address.ai_addr, address.ai_addrlen) == 0;
  });
}

bool has_desktop() { return std::getenv("DISPLAY") != nullptr || std::getenv("WAYLAND_DISPLAY") != nullptr; }

}  // namespace

void choose_live_port(LiveOptions& live, bool page) {
  const int given = live.port.value_or(0);
  if (given == 0 && !page) return;
  const bool bound = with_socket(live.address, given, [&](int socket, addrinfo& address) {
    if (bind(socket, address.ai_addr, address.ai_addrlen) != 0 ||
        getsockname(socket, address.ai_addr, &address.ai_addrlen) != 0)
      return false;
    // Both families have the port at the same place.
    live.port = ntohs(reinterpret_cast<const sockaddr_in*>(address.ai_addr)->sin_port);
    return true;
  });
  if (!bound) {
    const std::string reason = std::strerror(errno);
    throw Error(ExitCode::failed,
                given == 0 ? fmt::format("--page: no port of {} is free: {}; choose another --listen ADDRESS",
                                         live.address, reason)
                           : fmt::format("--live {}: the port cannot be served on {}: {}; choose another, or 0: a free "
                                         "one is taken",
                                         given, live.address, reason));
  }
}

std::string own_address(const std::string& host, int port) {
  return fmt::format("{}:{}", host.find(':') == std::string::npos ? host : "[" + host + "]", port);
}

std::string page_address(const LiveOptions& live) {
  return fmt::format("http://{}/{}", own_address(host_of(live.address), *live.port),
                     live.token.empty() ? "" : "?token=TOKEN");
}

PageOpener::PageOpener(const LiveOptions& live, bool wanted)
    : live_(live), waiting_(wanted && live.token.empty() && has_desktop()) {}  // other users can read command lines

void PageOpener::operator()() {
  if (!waiting_ || !accepts(live_)) return;
  waiting_ = false;
  // Without xdg-open there is nothing to do: the address has been printed.
  [[maybe_unused]] const int ignored =
      std::system(fmt::format("xdg-open '{}' < /dev/null > /dev/null 2>&1 &", page_address(live_)).c_str());
}

}  // namespace subworld
