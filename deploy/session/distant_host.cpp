#include "session/distant_host.hpp"

#include "model/error.hpp"
#include "rt/cyclic.hpp"
#include "rt/wall_clock.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <utility>

namespace subworld {

namespace {

/// Without questions, and with an end where a host does not answer.
constexpr std::array kSshOptions{"-o", "BatchMode=yes", "-o", "ConnectTimeout=10"};

/// A word for a shell.
std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char c : word) text += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return text + "'";
}

/// A shell command that answers lines. The destructor ends it.
class Dialogue {
 public:
  explicit Dialogue(const std::string& command) {
    int ends[2];
    if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) return;
    child_ = fork();
    if (child_ == 0) {
      dup2(ends[1], STDIN_FILENO);
      dup2(ends[1], STDOUT_FILENO);
      execl("/bin/sh", "sh", "-c", command.c_str(), nullptr);
      _exit(127);
    }
    close(ends[1]);
    end_ = ends[0];
  }
  ~Dialogue() {
    if (end_ >= 0) close(end_);
    if (child_ <= 0) return;
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
  }
  Dialogue(const Dialogue&) = delete;
  Dialogue& operator=(const Dialogue&) = delete;

  /// Sends an empty line. The answer within the time; nothing where none comes.
  [[nodiscard]] std::optional<std::string> ask(int patience_ms) const {
    if (child_ <= 0 || send(end_, "\n", 1, MSG_NOSIGNAL) != 1) return std::nullopt;
    std::string line;
    for (char c = 0;;) {
      pollfd answer{.fd = end_, .events = POLLIN, .revents = 0};
      if (poll(&answer, 1, patience_ms) != 1 || read(end_, &c, 1) != 1) return std::nullopt;
      if (c == '\n') return line;
      line += c;
    }
  }

 private:
  pid_t child_ = -1;
  int end_ = -1;
};

}  // namespace

DistantHost::DistantHost(const SessionHost& host, std::string ssh, const std::string& results)
    : host_(host),
      ssh_(std::move(ssh)),
      checkout_(host.folder.empty() ? "subworld" : host.folder),
      folder_(fmt::format("out/sessions/{}/{}", results, host.name)) {}

std::string DistantHost::by_ssh(const std::string& command) const {
  return fmt::format("{} {} {} {}", quoted(ssh_), fmt::join(kSshOptions, " "), quoted(host_.ssh), quoted(command));
}

void DistantHost::check(const std::string& session_file) const {
  const std::string world = "build/release/bin/world_sim";
  const std::string command = by_ssh(fmt::format("cd {} && test -x {}", quoted(checkout_), world));
  const int status = std::system(command.c_str());
  if (status == 0) return;
  if (WIFEXITED(status) && WEXITSTATUS(status) != kSshFailed) {
    throw Error(ExitCode::failed,
                fmt::format("host {}: {} has no {} in the folder \"{}\"; build there: deploy/build, or name the folder "
                            "of the checkout: `folder` of the host in {}",
                            host_.name, host_.ssh, world, checkout_, session_file));
  }
  throw Error(ExitCode::failed, fmt::format("host {}: no connection to {}; this must work without a question: {}",
                                            host_.name, host_.ssh, by_ssh("true")));
}

HostClock DistantHost::clock() const {
  constexpr int kExchanges = 10, kPatience_ms = 10'000;
  HostClock best{.host = host_.name};
  const Dialogue there(by_ssh("while read -r line; do date +%s%N; done"));
  for (int i = 0; i < kExchanges; ++i) {
    const std::int64_t asked_ns = wall_ns();
    const std::optional<std::string> answer = there.ask(kPatience_ms);
    const std::int64_t answered_ns = wall_ns();
    if (!answer) break;
    const double uncertainty_s = 0.5e-9 * static_cast<double>(answered_ns - asked_ns);
    if (best.uncertainty_s && *best.uncertainty_s <= uncertainty_s) continue;
    best.uncertainty_s = uncertainty_s;
    best.offset_s = 1e-9 * static_cast<double>(std::strtoll(answer->c_str(), nullptr, 10) - asked_ns) - uncertainty_s;
  }
  return best;
}

std::vector<std::string> DistantHost::words_of(const std::string& program, const std::vector<std::string>& words,
                                               Resume resume) const {
  std::string command = fmt::format("cd {} && ", quoted(checkout_));
  if (resume == Resume::where_it_can) {
    // A world that has written its results is at its end. The launcher does not start it again after this exit code.
    command += fmt::format("if test -e {}/world.json; then exit {}; fi && ", quoted(folder_),
                           static_cast<int>(ExitCode::usage));
    command +=
        fmt::format("if ls {0}/world_?.checkpoint > /dev/null 2>&1; then set -- --resume {0}; fi && ", quoted(folder_));
  }
  if (resume == Resume::no && program == "world_sim")
    command += fmt::format("rm -f {}/world.json && ", quoted(folder_));  // of an earlier run
  command += "exec build/release/bin/" + program;
  for (const std::string& word : words) command += " " + quoted(word);
  if (resume == Resume::where_it_can) command += " \"$@\"";
  // With a terminal, the program there gets SIGHUP where this one ends.
  std::vector<std::string> ssh{"-tt"};
  ssh.insert(ssh.end(), kSshOptions.begin(), kSshOptions.end());
  ssh.insert(ssh.end(), {host_.ssh, command});
  return ssh;
}

void DistantHost::fetch(const std::string& folder_here) const {
  const std::string there = fmt::format("cd {}/{} && tar c .", quoted(checkout_), quoted(folder_));
  const std::string command = fmt::format("{} | tar x -C {}", by_ssh(there), quoted(folder_here));
  if (std::system(command.c_str()) != 0)
    fmt::print(stderr, "subworld: warning: no results from host {}; try: {}\n", host_.name, command);
}

}  // namespace subworld
