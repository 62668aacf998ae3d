#include "run/keeper.hpp"

#include "model/error.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <exception>
#include <string>
#include <utility>
#include <vector>

namespace subworld {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kAll{10000};  ///< from the launcher's death on; then SIGKILL

/// What the launcher writes into the pipe, at once. Texts that are too long are cut.
struct Note {
  bool done = false;  ///< the run is concluded
  pid_t program = 0;  ///< the launcher has started it; else it reports a restart
  double after_s = 0.0;
  std::array<char, 64> label{};
  std::array<char, 256> reason{};
};

template <std::size_t Size>
void put(std::array<char, Size>& field, const std::string& text) {
  text.copy(field.data(), Size - 1);
}

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

[[noreturn]] void keep(int notes, const std::function<void(const std::vector<Restarted>&)>& conclude) {
  prctl(PR_SET_NAME, "subworld-keeper");
  setsid();  // what a terminal sends to the launcher does not concern it
  for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGPIPE}) std::signal(signal, SIG_IGN);
  std::vector<pollfd> programs;
  std::vector<Restarted> restarts;
  for (Note note; read(notes, &note, sizeof note) == sizeof note;) {
    if (note.done) _exit(0);
    const int program = note.program == 0 ? -1 : static_cast<int>(syscall(SYS_pidfd_open, note.program, 0));
    if (program >= 0) programs.push_back({.fd = program, .events = POLLIN, .revents = 0});
    if (note.program == 0) restarts.push_back({note.label.data(), note.after_s, note.reason.data()});
  }
  fmt::print(stderr, "\nsubworld: error: the launcher was killed; its programs end, and the summary is written\n");
  await_end(programs);
  int code = 0;
  try {
    conclude(restarts);
  } catch (const std::exception& error) {
    fmt::print(stderr, "subworld: error: {}\n", error.what());
    code = 1;
  }
  std::fflush(nullptr);
  _exit(code);
}

/// Fails where the keeper was killed.
void send_note(int pipe, const Note& note) { [[maybe_unused]] const auto sent = write(pipe, &note, sizeof note); }

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
  send_note(pipe_, {.done = true});
  close(pipe_);
  waitpid(pid_, nullptr, 0);
}

void Keeper::add(pid_t program) const { send_note(pipe_, {.program = program}); }

void Keeper::add(const Restarted& restarted) const {
  Note note{.after_s = restarted.after_s};
  put(note.label, restarted.program);
  put(note.reason, restarted.reason);
  send_note(pipe_, note);
}

}  // namespace subworld
