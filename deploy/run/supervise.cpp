#include "run/supervise.hpp"

#include "io/ending.hpp"
#include "io/options/options.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <thread>

namespace subworld {

namespace {

using Clock = std::chrono::steady_clock;
using Child = Supervisor::Child;

constexpr std::chrono::milliseconds kPoll{20};
constexpr std::chrono::milliseconds kWorldAlone{3000};  ///< the world ends in order
constexpr std::chrono::milliseconds kLastFrame{400};    ///< and then the others, of its last frame
constexpr std::chrono::milliseconds kFinish{30000};     ///< for the others, once the world has ended
constexpr std::chrono::milliseconds kDisplay{2000};     ///< for a display to show the verdict
constexpr std::chrono::milliseconds kWriting{10000};    ///< then SIGKILL: on a busy machine, writing takes time
constexpr std::chrono::milliseconds kFirstPause{50};    ///< before the second restart; doubled for each that follows
constexpr double kHalted_s = 1.0;                       ///< longest halt of a program
constexpr int kMostRestarts = 8;                        ///< of a program, in a row
constexpr const char* kReturns = "joins again, as planned";
constexpr std::chrono::seconds kLived{1};  ///< one that ran for so long has begun well

[[noreturn]] void become(const SupervisedProgram& program, const Command& command, int log, pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(1);
  setpgid(0, 0);  // a terminal's Ctrl-C reaches the launcher alone, which stops all in order
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  std::vector<char*> argv{const_cast<char*>(command.file.c_str())};
  for (const std::string& argument : command.arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  for (const auto& [variable, value] : program.environment) setenv(variable.c_str(), value.c_str(), 1);
  if (command.enter && !command.enter()) {
    dprintf(STDERR_FILENO, "%s: error: cannot enter the network namespace of its host\n", command.file.c_str());
    _exit(1);
  }
  execvp(command.file.c_str(), argv.data());
  dprintf(STDERR_FILENO, "%s: %s\n", command.file.c_str(), std::strerror(errno));
  _exit(127);
}

bool is_to_start(const Child& child) { return child.starts_at != Supervisor::Time{}; }

/// Whether the launcher waits for its end.
bool is_running(const Child& child) { return child.process.pid > 0 && !child.process.awaits_verdict; }

bool is_halted_for_long(const Child& child) { return child.process.halted_s > kHalted_s; }

/// Why a program that ended is to be started again, by its end alone.
std::string reason_of_end(const Child& child, Restart restart) {
  const int code = exit_code_of(child);
  // What was wrong with the scene, the flags or the middleware is wrong again.
  if (code == static_cast<int>(ExitCode::usage) || code == static_cast<int>(ExitCode::middleware)) return {};
  if (code != 0) return end_of(child);
  return restart == Restart::always ? child.process.early : std::string();
}

}  // namespace

Supervisor::~Supervisor() {
  reports_.awaits_verdict = {};
  stop();
}

void Supervisor::start(SupervisedProgram program) {
  Child child{std::move(program)};
  launch(child, false);
  children_.push_back(std::move(child));
}

void Supervisor::launch(Child& child, bool again) {
  const SupervisedProgram& program = child.program;
  const auto open_log = [&] {
    return open(program.log.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | (again ? O_APPEND : O_TRUNC), 0644);
  };
  int file = open_log();
  if (file < 0 && errno == ENOENT) {  // the folder was removed
    make_folder(std::filesystem::path(program.log).parent_path());
    file = open_log();
  }
  if (file < 0) {
    throw Error(ExitCode::failed,
                fmt::format("{}: {}; choose another folder with --out", program.log, std::strerror(errno)));
  }
  const Command command = program.command(again);
  const pid_t parent = getpid(), pid = fork();
  if (pid == 0) become(program, command, file, parent);
  close(file);
  if (pid < 0) throw Error(ExitCode::failed, fmt::format("cannot start {}: {}", command.file, std::strerror(errno)));
  child.process = {.pid = pid, .started_at = Clock::now()};
  keeper_.add(pid);
}

std::string Supervisor::restart_reason(const Child& child) const {
  if (!child.program.essential || child.process.pid > 0) return {};
  const Child& first = children_.front();
  const bool has_world = first.program.label == "world_sim", world = has_world && &child == &first;
  if (has_world && !world && first.process.pid < 0 && !is_to_start(first)) return {};
  // On a host without the world it may have given up because the run is over.
  const bool may_be_over = !has_world && !WIFSIGNALED(child.process.status);
  std::string reason;
  if (child.program.returns > 0 && child.process.status == 0) {
    reason = kReturns;
  } else if (restart_ != Restart::never && child.program.may_restart && child.restarts < kMostRestarts &&
             !may_be_over) {
    reason = reason_of_end(child, restart_);
  }
  const auto is_over = [&] {
    return std::filesystem::exists(first.program.part) || (reports_.run_is_over && reports_.run_is_over());
  };
  return reason.empty() || (has_world && is_over()) ? std::string() : reason;
}

std::optional<Supervisor::Failure> Supervisor::revive() {
  for (Child& child : children_) {
    const Process& process = child.process;
    const bool halted = process.pid > 0 && child.program.essential && is_halted_for_long(child);
    if (halted && restart_ != Restart::never) kill(process.pid, SIGKILL);
    if (!is_to_start(child)) {
      if (process.pid < 0 && Clock::now() - process.started_at > kLived) child.restarts = 0;
      const std::string reason = restart_reason(child);
      if (reason.empty()) continue;
      child.starts_at = Clock::now() + (child.restarts == 0 ? 0 : 1 << child.restarts) * kFirstPause;
      const double after_s = std::chrono::duration<double>(Clock::now() - watched_from_).count();
      restarts_.push_back({child.program.label, after_s, reason});
      keeper_.add(restarts_.back());
      fmt::print(stderr, "subworld: {} {}; it is started again\n", child.program.name(), reason);
    } else if (Clock::now() >= child.starts_at) {
      child.starts_at = {};
      try {
        launch(child, true);
      } catch (const Error& wrong) {
        return Failure{child, fmt::format("{}, and cannot be started again: {}", end_of(child), wrong.what())};
      }
      ++child.restarts;
      child.program.returns = std::max(0, child.program.returns - 1);
    }
  }
  return std::nullopt;
}

void Supervisor::reap() {
  for (Child& child : children_) {
    Process& process = child.process;
    int status = 0;
    while (process.pid > 0 && waitpid(process.pid, &status, WNOHANG | WUNTRACED | WCONTINUED) == process.pid) {
      process.halted = WIFSTOPPED(status);
      if (WIFSTOPPED(status) || WIFCONTINUED(status)) continue;
      process.status = status;
      process.pid = -1;
      if (status == 0 && child.program.essential && reports_.early) process.early = reports_.early(child.program.part);
    }
    const bool may_wait = process.pid > 0 && !child.program.essential && !any_running(true);
    process.awaits_verdict = may_wait && reports_.awaits_verdict && reports_.awaits_verdict();
  }
}

std::optional<Supervisor::Failure> Supervisor::failure() const {
  std::optional<Failure> found;
  for (const Child& child : children_) {
    const Process& process = child.process;
    if (!child.program.essential || is_to_start(child)) continue;
    if (process.pid < 0 && WIFSIGNALED(process.status)) return Failure{child, end_of(child)};
    if (restart_ == Restart::never && is_halted_for_long(child)) {
      return Failure{child,
                     fmt::format("is halted (by SIGSTOP, a debugger or a terminal); its process was {}", process.pid)};
    }
    if (process.pid > 0 || found) continue;
    const std::string reason = exit_code_of(child) != 0 ? end_of(child) : process.early;
    if (!reason.empty()) found = Failure{child, reason};
  }
  // A program may have given up because another one is halted, which is certain a moment later.
  const bool halted =
      std::ranges::any_of(children_, [](const Child& c) { return c.program.essential && c.process.halted; });
  return halted ? std::nullopt : found;
}

bool Supervisor::any_running(bool essential_only) const {
  return std::ranges::any_of(children_, [&](const Child& c) {
    return (is_running(c) || is_to_start(c)) && (c.program.essential || !essential_only);
  });
}

std::optional<Supervisor::Failure> Supervisor::watch(const std::function<void()>& tick) {
  auto next_tick = Clock::now(), world_seen = Clock::now();
  watched_from_ = Clock::now();
  while (stop_signal() == 0) {
    reap();
    if (auto failed = revive()) return failed;
    if (auto failed = failure()) return failed;
    if (!any_running(false)) break;
    const bool only_halted = std::ranges::all_of(
        children_, [](const Child& c) { return c.process.pid < 0 || (!c.program.essential && is_halted_for_long(c)); });
    if (only_halted && !any_running(true)) break;  // a display that will not end
    // After the world the others only finish: one that does not end soon is stuck.
    if (children_.front().process.pid > 0 || is_to_start(children_.front())) world_seen = Clock::now();
    if (Clock::now() - world_seen > kFinish) {
      const auto runs = [](const Child& child) { return child.process.pid > 0 && child.program.essential; };
      const auto child = std::ranges::find_if(children_, runs);
      if (child == children_.end()) return std::nullopt;
      return Failure{*child, "is stuck: it did not end within 30 s of the world"};
    }
    if (Clock::now() >= next_tick) {
      tick();
      next_tick += std::chrono::milliseconds(100);
    }
    std::this_thread::sleep_for(kPoll);
    constexpr double kPoll_s = std::chrono::duration<double>(kPoll).count();
    for (Child& child : children_)
      child.process.halted_s = child.process.halted ? child.process.halted_s + kPoll_s : 0.0;
  }
  return std::nullopt;
}

void Supervisor::wait_while(const std::function<bool()>& runs, std::chrono::milliseconds at_most) {
  for (const auto begin = Clock::now(); runs() && Clock::now() - begin < at_most;) {
    std::this_thread::sleep_for(kPoll);
    reap();
  }
}

void Supervisor::signal_all(bool essential, int signal) const {
  for (const Child& child : children_) {
    if (is_running(child) && child.program.essential == essential) kill(child.process.pid, signal);
  }
}

void Supervisor::stop() {
  for (Child& child : children_) child.starts_at = {};
  reap();
  if (!any_running(false)) return;
  // A halted process reacts to no other signal.
  for (const Child& child : children_) {
    if (child.process.pid > 0 && child.process.halted) kill(child.process.pid, SIGKILL);
  }
  // A running world ends the others with its last frame.
  const Process& world = children_.front().process;
  if (world.pid > 0 && !world.halted) {
    kill(world.pid, SIGTERM);
    wait_while([&] { return world.pid > 0; }, kWorldAlone);
    wait_while([&] { return any_running(false); }, kLastFrame);
  }
  // The display last. SIGINT: the run is over, and the verdict follows.
  for (const bool essential : {true, false}) {
    signal_all(essential, essential ? SIGTERM : SIGINT);
    wait_while([&] { return any_running(essential); }, kWriting);
    signal_all(essential, SIGKILL);
    wait_while([&] { return any_running(essential); }, kWriting);
  }
}

void Supervisor::await_display() {
  wait_while([&] { return std::ranges::any_of(children_, [](const Child& c) { return c.process.pid > 0; }); },
             kDisplay);
}

std::string SupervisedProgram::name() const { return host.empty() ? label : fmt::format("{} on host {}", label, host); }

int exit_code_of(const Supervisor::Child& child) {
  const int status = child.process.status;
  if (WIFEXITED(status)) return WEXITSTATUS(status);
  return WIFSIGNALED(status) ? 1 : 0;
}

std::string end_of(const Supervisor::Child& child) {
  if (WIFSIGNALED(child.process.status)) {
    const int signal = WTERMSIG(child.process.status);
    const bool faulty = signal == SIGSEGV || signal == SIGABRT || signal == SIGBUS;
    return "killed by " + name_of_signal(signal) + (faulty ? memory_limit_text() : "");
  }
  const int code = exit_code_of(child);
  if (!child.program.host.empty() && code == kSshFailed) return "was killed there, or ssh lost the connection to it";
  return fmt::format("exited with {}", code);
}

}  // namespace subworld
