#include "run/keeper.hpp"

#include "model/error.hpp"

#include <fcntl.h>
#include <fmt/core.h>
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
#include <utility>
#include <vector>

namespace subworld {

namespace {

using Clock = std::chrono::steady_clock;

constexpr pid_t kConcluded = 0;                   ///< in the pipe, in the place of a process: the run is concluded
constexpr std::chrono::milliseconds kAll{10000};  ///< from the launcher's death on; then SIGKILL

void signal_all(const std::vector<pollfd>& programs, int signal) {
  for (const pollfd& one : programs) syscall(SYS_pidfd_send_signal, one.fd, signal, nullptr, 0);
}

/// They have SIGTERM from the kernel. A halted one reacts to it once it is continued.
void await_end(std::vector<pollfd>& programs) {
  const auto end = Clock::now() + kAll;
  signal_all(programs, SIGCONT);
  bool forced = false;
  while (!programs.empty()) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now());
    if (left.count() <= 0 && !std::exchange(forced, true)) signal_all(programs, SIGKILL);
    if (poll(programs.data(), programs.size(), forced ? -1 : static_cast<int>(left.count())) > 0)
      std::erase_if(programs, [](const pollfd& one) { return one.revents != 0; });
  }
}

[[noreturn]] void keep(int started, const std::function<void()>& conclude) {
  prctl(PR_SET_NAME, "subworld-keeper");
  setsid();  // what a terminal sends to the launcher does not concern it
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) std::signal(signal, SIG_IGN);
  std::vector<pollfd> programs;
  for (pid_t pid = 0; read(started, &pid, sizeof pid) == sizeof pid;) {
    if (pid == kConcluded) _exit(0);
    if (const auto program = static_cast<int>(syscall(SYS_pidfd_open, pid, 0)); program >= 0)
      programs.push_back({.fd = program, .events = POLLIN, .revents = 0});
  }
  fmt::print(stderr, "\nsubworld: error: the launcher was killed; its programs end, and the summary is written\n");
  await_end(programs);
  int code = 0;
  try {
    conclude();
  } catch (const std::exception& error) {
    fmt::print(stderr, "subworld: error: {}\n", error.what());
    code = 1;
  }
  std::fflush(nullptr);
  _exit(code);
}

}  // namespace

Keeper::Keeper(const std::function<void()>& conclude) {
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
  add(kConcluded);
  close(pipe_);
  waitpid(pid_, nullptr, 0);
}

/// Fails where the keeper was killed.
void Keeper::add(pid_t program) const { [[maybe_unused]] const auto sent = write(pipe_, &program, sizeof program); }

}  // namespace subworld
