#include "run/supervise.hpp"

#include "io/ending.hpp"
#include "io/verdict_link.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"
#include "wire/last_messages.hpp"
#include "wire/recording_memory.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <thread>

namespace subworld {

namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kPoll{20};
constexpr std::chrono::milliseconds kHalted{1000};      ///< longest halt of a program
constexpr std::chrono::milliseconds kWorldAlone{3000};  ///< the world ends in order
constexpr std::chrono::milliseconds kLastFrame{400};    ///< and then the others, of its last frame
constexpr std::chrono::milliseconds kFinish{30000};     ///< for the others, once the world has ended
constexpr std::chrono::milliseconds kDisplay{2000};     ///< a display, before it gets a signal
constexpr std::chrono::milliseconds kAll{10000};        ///< then SIGKILL: on a busy machine, writing takes time
constexpr std::chrono::milliseconds kFirstPause{50};    ///< before the second restart; doubled for each that follows
constexpr int kMostRestarts = 8;                        ///< of a program, in a row
constexpr const char* kReturns = "joins again, as planned";
constexpr std::chrono::seconds kLived{1};  ///< one that ran for so long has begun well

double seconds_of(std::chrono::milliseconds time) { return std::chrono::duration<double>(time).count(); }

[[noreturn]] void become(const Supervisor::Child& child, int log, int verdict_link, pid_t parent) {
  const std::string& program = child.program;
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) _exit(1);
  setpgid(0, 0);  // a terminal's Ctrl-C reaches the launcher alone, which stops all in order
  dup2(log, STDOUT_FILENO);
  dup2(log, STDERR_FILENO);
  std::vector<char*> argv{const_cast<char*>(program.c_str())};
  for (const std::string& argument : child.arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  if (!child.messages.empty()) setenv(MessageMemory::kVariable, child.messages.c_str(), 1);
  if (!child.recording.empty()) setenv(RecordingMemory::kVariable, child.recording.c_str(), 1);
  if (verdict_link >= 0 && fcntl(verdict_link, F_SETFD, 0) == 0)
    setenv(kVerdictLink, std::to_string(verdict_link).c_str(), 1);
  if (child.enter && !child.enter()) {
    dprintf(STDERR_FILENO, "%s: error: cannot enter the network namespace of its host\n", program.c_str());
    _exit(1);
  }
  execvp(program.c_str(), argv.data());
  dprintf(STDERR_FILENO, "%s: %s\n", program.c_str(), std::strerror(errno));
  _exit(127);
}

/// Whether the launcher waits for its end.
bool is_running(const Supervisor::Child& child) { return child.pid > 0 && !child.awaits_verdict; }

/// Whether a world is at the end of its run: it has written its results here, or its log says so. The log of one on
/// another host is here too, and says so also where the results cannot be written.
bool is_over(const Supervisor::Child& world) {
  if (std::filesystem::exists(world.part)) return true;
  std::ifstream log(world.log);
  log.seekg(world.log_begin);
  const std::string text((std::istreambuf_iterator<char>(log)), std::istreambuf_iterator<char>());
  return text.find(kRunIsOver) != std::string::npos;
}

}  // namespace

Supervisor::~Supervisor() {
  for (Child& child : children_) {
    if (child.verdict_link >= 0) close(child.verdict_link);
    child.verdict_link = -1;
    child.awaits_verdict = false;
  }
  stop();
}

void Supervisor::start(Child child, const std::string& program, const std::vector<std::string>& arguments,
                       const std::function<bool()>& enter) {
  child.program = program;
  child.arguments = arguments;
  child.enter = enter;
  launch(child, O_TRUNC);
  children_.push_back(std::move(child));
}

void Supervisor::launch(Child& child, int flags) {
  const auto open_log = [&] { return open(child.log.c_str(), O_WRONLY | O_CREAT | O_CLOEXEC | flags, 0644); };
  int file = open_log();
  if (file < 0 && errno == ENOENT) {  // the folder was removed
    make_folder(std::filesystem::path(child.log).parent_path());
    file = open_log();
  }
  if (file < 0) {
    throw Error(ExitCode::failed,
                fmt::format("{}: {}; choose another folder with --out", child.log, std::strerror(errno)));
  }
  child.log_begin = lseek(file, 0, SEEK_END);
  const pid_t parent = getpid();
  std::array<int, 2> link{-1, -1};
  if (child.shows_verdict) link = make_verdict_link();
  child.started_at = Clock::now();
  child.pid = fork();
  if (child.pid == 0) become(child, file, link[1], parent);
  close(file);
  if (link[1] >= 0) close(link[1]);
  child.verdict_link = link[0];
  if (child.pid < 0)
    throw Error(ExitCode::failed, fmt::format("cannot start {}: {}", child.program, std::strerror(errno)));
  keeper_.add(child.pid);
}

std::string Supervisor::restart_reason(const Child& child,
                                       const std::function<std::string(const Child&)>& early) const {
  if (!child.essential || child.pid > 0) return {};
  const Child& first = children_.front();
  const bool has_world = first.label == "world_sim", world = has_world && &child == &first;
  if (has_world && !world && first.pid < 0 && first.starts_at == Clock::time_point{}) return {};
  if (has_world && is_over(first)) return {};
  if (child.returns > 0 && child.status == 0) return kReturns;
  if (restart_ == Restart::never || !child.may_restart || child.restarts >= kMostRestarts) return {};
  // On a host without the world it may have given up because the run is over.
  if (!has_world && !WIFSIGNALED(child.status)) return {};
  const int code = exit_code_of(child);
  // What was wrong with the scene, the flags or the middleware is wrong again.
  if (code == static_cast<int>(ExitCode::usage) || code == static_cast<int>(ExitCode::middleware)) return {};
  if (code != 0 || WIFSIGNALED(child.status)) return end_of(child);
  return restart_ == Restart::always ? early(child) : std::string();
}

std::optional<Supervisor::Failure> Supervisor::revive(const std::function<std::string(const Child&)>& early) {
  for (Child& child : children_) {
    const bool halted = child.pid > 0 && child.essential && child.halted_s > seconds_of(kHalted);
    if (halted && restart_ != Restart::never) kill(child.pid, SIGKILL);
    if (child.starts_at == Clock::time_point{}) {
      if (child.pid < 0 && Clock::now() - child.started_at > kLived) child.restarts = 0;
      const std::string reason = restart_reason(child, early);
      if (reason.empty()) continue;
      child.starts_at = Clock::now() + (child.restarts == 0 ? 0 : 1 << child.restarts) * kFirstPause;
      restarts_.push_back({child.label, std::chrono::duration<double>(Clock::now() - watched_from_).count(), reason});
      keeper_.add(restarts_.back());
      fmt::print(stderr, "subworld: {} {}; it is started again\n", child.name(), reason);
    } else if (Clock::now() >= child.starts_at) {
      child.starts_at = {};
      if (child.arguments_again) child.arguments = child.arguments_again();
      try {
        launch(child, O_APPEND);
      } catch (const Error& wrong) {
        return Failure{child, fmt::format("{}, and cannot be started again: {}", end_of(child), wrong.what())};
      }
      child.status = 0;
      child.halted = child.judged = false;
      child.halted_s = 0.0;
      ++child.restarts;
      child.returns = std::max(0, child.returns - 1);
    }
  }
  return std::nullopt;
}

void Supervisor::reap() {
  for (Child& child : children_) {
    int status = 0;
    while (child.pid > 0 && waitpid(child.pid, &status, WNOHANG | WUNTRACED | WCONTINUED) == child.pid) {
      child.halted = WIFSTOPPED(status);
      if (WIFSTOPPED(status) || WIFCONTINUED(status)) continue;
      child.status = status;
      child.pid = -1;
      child.awaits_verdict = false;
    }
    if (child.verdict_link < 0 || child.pid < 0) continue;
    if (receive_verdict_message(child.verdict_link) == VerdictMessage::awaited) child.awaits_verdict = true;
  }
}

std::optional<Supervisor::Failure> Supervisor::failure(const std::function<std::string(const Child&)>& early) {
  std::optional<Failure> found;
  for (Child& child : children_) {
    if (!child.essential || child.starts_at != Clock::time_point{}) continue;
    if (child.pid < 0 && WIFSIGNALED(child.status)) return Failure{child, end_of(child)};
    if (restart_ == Restart::never && child.halted_s > seconds_of(kHalted)) {
      return Failure{child,
                     fmt::format("is halted (by SIGSTOP, a debugger or a terminal); its process was {}", child.pid)};
    }
    if (child.pid > 0 || found) continue;
    if (exit_code_of(child) != 0) {
      found = Failure{child, end_of(child)};
    } else {
      if (!child.judged) child.early = early(child);
      child.judged = true;
      if (!child.early.empty()) found = Failure{child, child.early};
    }
  }
  // A program may have given up because another one is halted, which is certain a moment later.
  const bool halted =
      std::any_of(children_.begin(), children_.end(), [](const Child& c) { return c.essential && c.halted; });
  return halted ? std::nullopt : found;
}

bool Supervisor::any_running(bool essential_only) const {
  return std::any_of(children_.begin(), children_.end(), [&](const Child& c) {
    return (is_running(c) || c.starts_at != Clock::time_point{}) && (c.essential || !essential_only);
  });
}

std::optional<Supervisor::Failure> Supervisor::watch(const std::function<void()>& tick,
                                                     const std::function<std::string(const Child&)>& early) {
  auto next_tick = Clock::now();
  auto world_seen = Clock::now();
  watched_from_ = Clock::now();
  while (stop_signal() == 0) {
    reap();
    if (auto failed = revive(early)) return failed;
    if (auto failed = failure(early)) return failed;
    if (!any_running(false)) break;
    const bool only_halted = std::ranges::all_of(
        children_, [](const Child& c) { return c.pid < 0 || (!c.essential && c.halted_s > seconds_of(kHalted)); });
    if (only_halted && !any_running(true)) break;  // a display that will not end
    // After the world the others only finish: one that does not end soon is stuck.
    if (children_.front().pid > 0 || children_.front().starts_at != Clock::time_point{}) world_seen = Clock::now();
    if (Clock::now() - world_seen > kFinish) {
      for (const Child& child : children_) {
        if (child.pid > 0 && child.essential)
          return Failure{child, "is stuck: it did not end within 30 s of the world"};
      }
      break;
    }
    if (Clock::now() >= next_tick) {
      tick();
      next_tick += std::chrono::milliseconds(100);
    }
    std::this_thread::sleep_for(kPoll);
    for (Child& child : children_) child.halted_s = child.halted ? child.halted_s + seconds_of(kPoll) : 0.0;
  }
  return std::nullopt;
}

void Supervisor::wait_while(const std::function<bool()>& runs, std::chrono::milliseconds at_most) {
  for (const auto begin = Clock::now(); runs() && Clock::now() - begin < at_most;) {
    std::this_thread::sleep_for(kPoll);
    reap();
  }
}

void Supervisor::stop() {
  reap();
  for (Child& child : children_) child.starts_at = {};
  if (!any_running(false)) return;
  // A halted process reacts to no other signal.
  for (const Child& child : children_) {
    if (child.pid > 0 && child.halted) kill(child.pid, SIGKILL);
  }
  // A running world ends the others with its last frame.
  const Child& world = children_.front();
  if (world.pid > 0 && !world.halted) {
    kill(world.pid, SIGTERM);
    wait_while([&] { return world.pid > 0; }, kWorldAlone);
    wait_while([&] { return any_running(false); }, kLastFrame);
  }
  // A display that gets a signal ends without the verdict.
  const auto is_display = [](const Child& c) { return is_running(c) && c.verdict_link >= 0; };
  for (const Child& child : children_) {
    if (is_display(child)) {
      send_verdict_message(child.verdict_link, VerdictMessage::over);
    } else if (is_running(child)) {
      kill(child.pid, SIGTERM);
    }
  }
  wait_while([&] { return std::ranges::any_of(children_, is_display); }, kDisplay);
  for (const Child& child : children_) {
    if (is_display(child)) kill(child.pid, SIGTERM);
  }
  wait_while([&] { return any_running(false); }, kAll);
  for (Child& child : children_) {
    if (!is_running(child)) continue;
    kill(child.pid, SIGKILL);
    waitpid(child.pid, &child.status, 0);
    child.pid = -1;
  }
}

void Supervisor::announce_verdict() {
  for (Child& child : children_) {
    if (!child.awaits_verdict) continue;
    send_verdict_message(child.verdict_link, VerdictMessage::written);
    child.awaits_verdict = false;
  }
  wait_while([&] { return any_running(false); }, kDisplay);
}

std::string Supervisor::Child::name() const { return host.empty() ? label : fmt::format("{} on host {}", label, host); }

int exit_code_of(const Supervisor::Child& child) {
  if (WIFEXITED(child.status)) return WEXITSTATUS(child.status);
  return WIFSIGNALED(child.status) ? 1 : 0;
}

std::string end_of(const Supervisor::Child& child) {
  if (WIFSIGNALED(child.status)) return "killed by " + name_of_signal(WTERMSIG(child.status));
  constexpr int kSshFailed = 255;  // its own failure, or a signal ended the program there
  const int code = exit_code_of(child);
  if (!child.host.empty() && code == kSshFailed) return "was killed there, or ssh lost the connection to it";
  return fmt::format("exited with {}", code);
}

}  // namespace subworld
