#include "session/host.hpp"

#include "io/results/output.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "record/recording.hpp"
#include "rt/cyclic.hpp"
#include "rt/wall_clock.hpp"
#include "wire/message_memory.hpp"

#include <fmt/core.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <optional>
#include <sstream>
#include <utility>

namespace subworld {

namespace {

/// Without questions, and with an end where a host does not answer.
constexpr std::array kSshOptions{"-o", "BatchMode=yes", "-o", "ConnectTimeout=10"};

}  // namespace

/// A shell command that answers lines. The destructor ends it.
class Dialogue {
 public:
  explicit Dialogue(const std::string& command) {
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
  ~Dialogue() {
    if (end_ >= 0) close(end_);
    if (child_ <= 0) return;
    kill(child_, SIGTERM);
    waitpid(child_, nullptr, 0);
  }
  Dialogue(const Dialogue&) = delete;
  Dialogue& operator=(const Dialogue&) = delete;

  /// Sends an empty line. False where the command has ended.
  [[nodiscard]] bool ask() const { return child_ > 0 && send(end_, "\n", 1, MSG_NOSIGNAL) == 1; }
  /// Its next line; nothing where none comes in time.
  [[nodiscard]] std::optional<std::string> answer(int patience_ms = 10'000) const {
    std::string line;
    for (char c = 0;;) {
      pollfd answer{.fd = end_, .events = POLLIN, .revents = 0};
      if (poll(&answer, 1, patience_ms) != 1 || read(end_, &c, 1) != 1) return std::nullopt;
      if (c == '\n') return line;
      line += c;
    }
  }
  /// Closes its input, and waits until it has ended, at most as long.
  void end() const {
    shutdown(end_, SHUT_WR);
    while (answer()) {
    }
  }

 private:
  pid_t child_ = -1;
  int end_ = -1;
};

DistantHost::~DistantHost() = default;

DistantHost::DistantHost(const SessionHost& plan, const std::string& folder_here, std::string ssh,
                         const std::string& session_file)
    : Host(plan, folder_here),
      ssh_(std::move(ssh)),
      folder_(fmt::format("out/sessions/{}/{}",
                          std::filesystem::absolute(folder_here).parent_path().parent_path().filename().string(),
                          plan.name)) {
  // Prints the working folder, that of the programs, and whether they are there: of a checkout, of an installation, or
  // of the system's.
  const std::string cd = plan.folder.empty() ? "{ cd subworld 2>/dev/null || :; }" : "cd " + shell_word(plan.folder);
  const Dialogue there(by_ssh(
      fmt::format("{{ {} && for p in \"$PWD\"/build/release/bin \"$PWD\"/lib/subworld /usr/local/lib/subworld "
                  "/usr/lib/subworld; do test -x \"$p\"/world_sim && break; done; }}; echo \"$PWD\"; echo \"$p\"; "
                  "test -x \"$p\"/world_sim && echo yes || echo no",
                  cd)));
  constexpr int kLogin_ms = 60'000;
  const std::optional<std::string> work = there.answer(kLogin_ms), programs = there.answer(), found = there.answer();
  if (!found)
    throw Error(ExitCode::failed, fmt::format("host {}: no connection to {}; this must work without a question: {}",
                                              plan.name, plan.ssh, by_ssh("true")));
  if (*found != "yes")
    throw Error(ExitCode::failed,
                fmt::format("host {}: {} has no world_sim in the folder \"{}\"; build there: deploy/build, or install "
                            "the package, or name the folder of the checkout or installation: `folder` of the host in "
                            "{}",
                            plan.name, plan.ssh, plan.folder.empty() ? "subworld" : plan.folder, session_file));
  work_ = *work;
  programs_ = *programs;
}

std::string DistantHost::by_ssh(const std::string& command) const {
  return fmt::format("{} {} {} {}", shell_word(ssh_), joined(kSshOptions, " "), shell_word(plan().ssh),
                     shell_word(command));
}

HostClock DistantHost::clock() const {
  constexpr int kExchanges = 10;
  HostClock best{.host = plan().name};
  const Dialogue there(by_ssh("while read -r line; do date +%s%N; done"));
  for (int i = 0; i < kExchanges; ++i) {
    const std::int64_t asked_ns = wall_ns();
    const std::optional<std::string> answer = there.ask() ? there.answer() : std::nullopt;
    const std::int64_t answered_ns = wall_ns();
    if (!answer) break;
    const double uncertainty_s = 0.5e-9 * static_cast<double>(answered_ns - asked_ns);
    if (best.uncertainty_s && *best.uncertainty_s <= uncertainty_s) continue;
    best.uncertainty_s = uncertainty_s;
    best.offset_s = 1e-9 * static_cast<double>(std::strtoll(answer->c_str(), nullptr, 10) - asked_ns) - uncertainty_s;
  }
  return best;
}

void DistantHost::start_recorder(std::vector<std::string> flags) {
  std::string text = fmt::format("cd {} && mkdir -p {} && exec {}", shell_word(work_), shell_word(folder_),
                                 shell_word(programs_ + "/subworld_recorder"));
  flags.insert(flags.end(), {"--record", folder_ + "/" + kRecordingPart});
  for (const std::string& flag : flags) text += " " + shell_word(flag);
  recorder_ = std::make_unique<Dialogue>(by_ssh(text));
  std::istringstream words(recorder_->answer().value_or(""));
  places_.assign(std::istream_iterator<std::string>(words), {});
  if (!places_.empty()) return;
  throw Error(ExitCode::failed,
              fmt::format("host {}: nothing records there; build the recorder: deploy/build tools", plan().name));
}

/// Opens the memory of the recorder, which has another parent there: "PID", and "FILE:" before what a program knows.
std::string DistantHost::opened_messages(const RunProgram& program) const {
  const auto at = 1 + place_of_messages(program.name, program.user);
  if (at >= places_.size() || places_[at] == "-") return {};
  const std::string& place = places_[at];
  const std::size_t colon = place.find(':');
  return fmt::format("exec 7<>/proc/{}/fd/{} && export {}=7{} && ", places_[0], place.substr(0, colon),
                     MessageMemory::kVariable, place.substr(colon));
}

bool DistantHost::has_ended_world() const {
  const std::string there = fmt::format("test -e {}/{}/world.json", shell_word(work_), shell_word(folder_));
  return std::system(by_ssh(there).c_str()) == 0;
}

Command DistantHost::command(const RunProgram& program, std::vector<std::string> flags, bool again) const {
  std::string text = fmt::format("cd {} && {}", shell_word(work_), opened_messages(program));
  const bool world = program.name == "world_sim";
  if (world && again) {
    text += fmt::format("if ls {0}/world_?.checkpoint > /dev/null 2>&1; then set -- --resume {0}; fi && ",
                        shell_word(folder_));
  } else if (world) {
    text += fmt::format("rm -f {}/world.json && ", shell_word(folder_));  // of an earlier run
  }
  text += "exec " + shell_word(programs_ + "/" + program.name);
  for (const std::string& flag : flags) text += " " + shell_word(flag);
  if (world && again) text += " \"$@\"";
  // With a terminal, the program there gets SIGHUP where this one ends.
  std::vector<std::string> words{"-tt"};
  words.insert(words.end(), kSshOptions.begin(), kSshOptions.end());
  words.insert(words.end(), {plan().ssh, text});
  return {ssh_, words};
}

void DistantHost::fetch() const {
  if (recorder_) recorder_->end();
  const std::string there = fmt::format("cd {}/{} && tar c .", shell_word(work_), shell_word(folder_));
  const std::string command = fmt::format("{} | tar x -C {}", by_ssh(there), shell_word(folder_here()));
  if (std::system(command.c_str()) != 0)
    fmt::print(stderr, "subworld: warning: no results from host {}; try: {}\n", plan().name, command);
}

}  // namespace subworld
