#include "run/page.hpp"

#include "model/error.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <netdb.h>
#include <netinet/in.h>
#include <spawn.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <memory>

namespace subworld {
namespace {

using Address = std::unique_ptr<addrinfo, decltype([](addrinfo* one) { freeaddrinfo(one); })>;

/// Of an IPv4 or IPv6 address in digits.
Address socket_address(const std::string& text, int port) {
  addrinfo wanted{};
  wanted.ai_flags = AI_NUMERICHOST | AI_NUMERICSERV;
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (getaddrinfo(text.c_str(), std::to_string(port).c_str(), &wanted, &found) != 0)
    throw Error(ExitCode::usage, fmt::format("--listen {}: is no IP address", text));
  return Address(found);
}

/// A socket that closes itself.
class Socket {
 public:
  explicit Socket(const Address& address) : fd_(socket(address->ai_family, SOCK_STREAM | SOCK_CLOEXEC, 0)) {}
  ~Socket() {
    if (fd_ >= 0) close(fd_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  [[nodiscard]] int fd() const noexcept { return fd_; }

 private:
  int fd_;
};

/// Where a browser on this machine finds what listens on `address`.
std::string host_of(const std::string& address) {
  if (address == "0.0.0.0") return "127.0.0.1";
  if (address == "::") return "::1";
  return address;
}

bool accepts(const LiveOptions& live) {
  const Address address = socket_address(host_of(live.address), *live.port);
  const Socket one(address);
  return connect(one.fd(), address->ai_addr, address->ai_addrlen) == 0;
}

bool has_desktop() { return std::getenv("DISPLAY") != nullptr || std::getenv("WAYLAND_DISPLAY") != nullptr; }

/// Without xdg-open there is nothing to do: the address has been printed.
void open_in_browser(const std::string& address) {
  std::string program = "xdg-open", argument = address;
  const std::array<char*, 3> words{program.data(), argument.data(), nullptr};
  posix_spawn_file_actions_t quiet;
  posix_spawn_file_actions_init(&quiet);
  for (const int fd : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    posix_spawn_file_actions_addopen(&quiet, fd, "/dev/null", O_RDWR, 0);
  pid_t ignored = 0;
  posix_spawnp(&ignored, program.c_str(), &quiet, nullptr, words.data(), environ);
  posix_spawn_file_actions_destroy(&quiet);
}

}  // namespace

void choose_page_port(LiveOptions& live) {
  if (live.port && *live.port != 0) return;
  const Address address = socket_address(live.address, 0);
  const Socket one(address);
  if (bind(one.fd(), address->ai_addr, address->ai_addrlen) != 0 ||
      getsockname(one.fd(), address->ai_addr, &address->ai_addrlen) != 0) {
    throw Error(ExitCode::failed, fmt::format("--page: no port of {} is free: {}; choose another --listen ADDRESS",
                                              live.address, std::strerror(errno)));
  }
  // Both families have the port at the same place.
  live.port = ntohs(reinterpret_cast<const sockaddr_in*>(address->ai_addr)->sin_port);
}

std::string page_address(const LiveOptions& live) {
  const std::string host = host_of(live.address);
  return fmt::format("http://{}:{}/{}", host.find(':') == std::string::npos ? host : "[" + host + "]", *live.port,
                     live.token.empty() ? "" : "?token=TOKEN");
}

PageOpener::PageOpener(const LiveOptions& live, bool wanted)
    : live_(live), waiting_(wanted && live.token.empty() && has_desktop()) {  // other users can read command lines
  if (waiting_) address_ = page_address(live);
}

void PageOpener::operator()() {
  if (!waiting_ || !accepts(live_)) return;
  waiting_ = false;
  open_in_browser(address_);
}

}  // namespace subworld
