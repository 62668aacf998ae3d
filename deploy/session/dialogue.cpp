#include "session/dialogue.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>

namespace subworld {

Dialogue::Dialogue(const std::string& command) {
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) return;
  child_ = fork();
  if (child_ == 0) {
    setpgid(0, 0);  // a terminal's Ctrl-C reaches the launcher alone
    dup2(ends[1], STDIN_FILENO);
    dup2(ends[1], STDOUT_FILENO);
    execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
    _exit(127);
  }
  close(ends[1]);
  end_ = ends[0];
}

Dialogue::~Dialogue() {
  if (end_ >= 0) close(end_);
  if (child_ <= 0) return;
  kill(child_, SIGTERM);
  waitpid(child_, nullptr, 0);
}

bool Dialogue::ask() const { return child_ > 0 && send(end_, "\n", 1, MSG_NOSIGNAL) == 1; }

std::optional<std::string> Dialogue::answer() const {
  constexpr int kPatience_ms = 10'000;
  std::string line;
  for (char c = 0;;) {
    pollfd answer{.fd = end_, .events = POLLIN, .revents = 0};
    if (poll(&answer, 1, kPatience_ms) != 1 || read(end_, &c, 1) != 1) return std::nullopt;
    if (c == '\n') return line;
    line += c;
  }
}

void Dialogue::end() const {
  shutdown(end_, SHUT_WR);
  while (answer()) {
  }
}

}  // namespace subworld
