#pragma once

#include "model/error.hpp"

#include <fmt/core.h>
#include <netdb.h>
#include <netinet/in.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <string>

namespace subworld::live {

/// Throws `Error` (failed) where it cannot listen.
inline int listening_socket(const std::string& address, int port) {
  addrinfo hints{};
  hints.ai_flags = AI_NUMERICHOST;
  hints.ai_socktype = SOCK_STREAM;
  addrinfo* at = nullptr;
  const int unknown = getaddrinfo(address.c_str(), std::to_string(port).c_str(), &hints, &at);
  const std::unique_ptr<addrinfo, decltype(&freeaddrinfo)> freed(at, &freeaddrinfo);
  const int listener = at != nullptr ? socket(at->ai_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0) : -1;
  constexpr int kOn = 1;
  if (listener >= 0 && setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &kOn, sizeof kOn) == 0 &&
      bind(listener, at->ai_addr, at->ai_addrlen) == 0 && listen(listener, SOMAXCONN) == 0)
    return listener;
  throw Error(ExitCode::failed,
              fmt::format("cannot serve viewers on {} port {}: {}; choose another --live PORT or --listen ADDRESS",
                          address, port, at != nullptr ? std::strerror(errno) : gai_strerror(unknown)));
}

/// "127.0.0.1:8765"
inline std::string address_of(const std::string& host, int listener) {
  sockaddr_in6 own{};  // an IPv4 address has its port in the same place
  socklen_t size = sizeof own;
  getsockname(listener, reinterpret_cast<sockaddr*>(&own), &size);
  return fmt::format("{}:{}", host.find(':') != std::string::npos ? "[" + host + "]" : host, ntohs(own.sin6_port));
}

}  // namespace subworld::live
