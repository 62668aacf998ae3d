#include "run/keeper.hpp"

#include "model/error.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <sstream>
#include <string>

namespace subworld {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kAll{10000};  ///< from the launcher's death on; then SIGKILL
constexpr char kProgram = 'p', kRestarted = 'r', kDone = 'd';

/// The keeper's side.
class Watch {
 public:
  explicit Watch(int messages) : messages_(messages) {}

  /// Returns whether the launcher was killed.
  bool until_the_launcher_ends() {
    std::string line;
    char buffer[512];
    for (;;) {
      const ssize_t size = read(messages_, buffer, sizeof buffer);
      if (size < 0 && errno == EINTR) continue;
      if (size <= 0) return true;
      for (const char* at = buffer; at != buffer + size; ++at) {
        if (*at != '\n') {
          line += *at;
          continue;
        }
        if (line.front() == kDone) return false;
        take(line);
        line.clear();
      }
    }
  }
  /// They have SIGTERM from the kernel. A halted one reacts to it once it is continued.
  void until_all_have_ended() {
    const auto begin = Clock::now();
    for (const pollfd& one : programs_) syscall(SYS_pidfd_send_signal, one.fd, SIGCONT, nullptr, 0);
    bool forced = false;
    while (!programs_.empty()) {
      const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(kAll - (Clock::now() - begin));
      if (left.count() <= 0 && !forced) {
        for (const pollfd& one : programs_) syscall(SYS_pidfd_send_signal, one.fd, SIGKILL, nullptr, 0);
        forced = true;
      }
      if (poll(programs_.data(), programs_.size(), forced ? -1 : static_cast<int>(left.count())) > 0) {
        std::erase_if(programs_, [](const pollfd& one) {
          if (one.revents == 0) return false;
          close(one.fd);
          return true;
        });
      }
    }
  }
  [[nodiscard]] const std::vector<Restarted>& restarts() const { return restarts_; }

 private:
  void take(const std::string& line) {
    std::istringstream words(line.substr(1));
    if (line.front() == kProgram) {
      pid_t pid = 0;
      words >> pid;
      const int program = static_cast<int>(syscall(SYS_pidfd_open, pid, 0));
      if (program >= 0) programs_.push_back({.fd = program, .events = POLLIN, .revents = 0});
    } else if (line.front() == kRestarted) {
      Restarted one;
      words >> one.program >> one.after_s >> std::ws;
      std::getline(words, one.reason);
      restarts_.push_back(std::move(one));
    }
  }

  int messages_;
  std::vector<pollfd> programs_;
  std::vector<Restarted> restarts_;
};

[[noreturn]] void keep(int messages, const std::function<void(const std::vector<Restarted>&)>& conclude) {
  prctl(PR_SET_NAME, "subworld-keeper");
  setsid();  // what a terminal sends to the launcher does not concern it
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) std::signal(signal, SIG_IGN);
  Watch watch(messages);
  if (!watch.until_the_launcher_ends()) _exit(0);
  fmt::print(stderr, "\nsubworld: error: the launcher was killed; its programs end, and the summary is written\n");
  watch.until_all_have_ended();
  int code = 0;
  try {
    conclude(watch.restarts());
  } catch (const std::exception& error) {
    fmt::print(stderr, "subworld: error: {}\n", error.what());
    code = 1;
  }
  std::fflush(nullptr);
  _exit(code);
}

}  // namespace

Keeper::Keeper(const std::function<void(const std::vector<Restarted>&)>& conclude) {
  int ends[2];
  std::fflush(nullptr);  // else both processes print what waits
  if (pipe2(ends, O_CLOEXEC) == 0) {
    pid_ = fork();
    if (pid_ == 0) {
      close(ends[1]);
      keep(ends[0], conclude);
    }
    close(ends[0]);
    pipe_ = ends[1];
  }
  if (pid_ < 0) throw Error(ExitCode::failed, fmt::format("cannot start a process: {}", std::strerror(errno)));
}

Keeper::~Keeper() {
  send({kDone});
  close(pipe_);
  waitpid(pid_, nullptr, 0);
}

void Keeper::add(pid_t program) const { send(fmt::format("{}{}", kProgram, program)); }

void Keeper::add(const Restarted& restarted) const {
  send(fmt::format("{}{} {:.3f} {}", kRestarted, restarted.program, restarted.after_s, restarted.reason));
}

void Keeper::send(const std::string& line) const {
  const std::string text = line + '\n';
  [[maybe_unused]] const auto sent = write(pipe_, text.data(), text.size());  // fails where the keeper was killed
}

}  // namespace subworld
