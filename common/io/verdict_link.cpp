#include "io/verdict_link.hpp"

#include <poll.h>
#include <sys/socket.h>

#include <cstdlib>

namespace subworld {

std::array<int, 2> make_verdict_link() noexcept {
  std::array<int, 2> ends{-1, -1};
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()) != 0) return {-1, -1};
  return ends;
}

int verdict_link_of_display() noexcept {
  const char* const text = std::getenv(kVerdictLink);
  return text == nullptr ? -1 : std::atoi(text);
}

void send_verdict_message(int link, VerdictMessage message) noexcept {
  [[maybe_unused]] const auto sent = send(link, &message, sizeof message, MSG_NOSIGNAL | MSG_DONTWAIT);
}

std::optional<VerdictMessage> receive_verdict_message(int link, std::chrono::milliseconds within) noexcept {
  pollfd one{.fd = link, .events = POLLIN, .revents = 0};
  if (poll(&one, 1, static_cast<int>(within.count())) <= 0) return std::nullopt;
  VerdictMessage message{};
  return recv(link, &message, sizeof message, MSG_DONTWAIT) > 0 ? message : VerdictMessage::closed;
}

}  // namespace subworld
