#pragma once

#include "run/keeper.hpp"

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace subworld {

/// How a program starts.
struct Command {
  std::string file;
  std::vector<std::string> arguments;
  /// Called in the new process before the program begins, and may not allocate: it moves the process to another
  /// namespace. Empty: nothing is called.
  std::function<bool()> enter = {};
};

/// A program that is to run.
struct SupervisedProgram {
  std::string label;      ///< "haptic_sim_0"
  std::string host = {};  ///< of a session; empty: a run on one machine
  std::string log;        ///< file of its output
  std::string part = {};  ///< file in which it writes at its end how it ended; empty: none
  /// For its first start, and for a restart.
  std::function<Command(bool again)> command = {};
  std::map<std::string, std::string> environment = {};
  bool essential = true;  ///< its early end is a failure. Else a display: it may wait for the verdict after the others
  bool may_restart = true;  ///< where the run restarts programs
  int returns = 0;          ///< that are planned, after it has ended in order

  /// "haptic_sim_0", or "haptic_sim_0 on host left".
  [[nodiscard]] std::string name() const;
};

/// What the programs report beside their exit codes. Empty: nothing.
struct ProgramReports {
  /// Why one that exited with 0 ended early, by its part of the results; empty: it did not.
  std::function<std::string(const std::string& part)> early = {};
  /// Whether the world has reached the end of the run.
  std::function<bool()> run_is_over = {};
  /// Whether the display has done all but to show the verdict, for which it waits.
  std::function<bool()> awaits_verdict = {};
};

/// The programs of one run. They end with this object.
class Supervisor {
 public:
  /// `keeper` ends them where this process is killed.
  Supervisor(Restart restart, const Keeper& keeper, ProgramReports reports)
      : restart_(restart), keeper_(keeper), reports_(std::move(reports)) {}

  using Time = std::chrono::steady_clock::time_point;
  /// The newest process of a program.
  struct Process {
    pid_t pid = -1;  ///< -1: ended
    int status = 0;  ///< as waitpid() gives it
    Time started_at = {};
    std::string early = {};  ///< why it ended early although it exited with 0
    bool awaits_verdict = false;
    bool halted = false;    ///< by SIGSTOP or the like
    double halted_s = 0.0;  ///< measured by the launcher
  };
  struct Child {
    SupervisedProgram program;
    Process process = {};
    int restarts = 0;     ///< in a row
    Time starts_at = {};  ///< while it waits to be started again
  };
  /// The cause of a failed run.
  struct Failure {
    Child child;
    std::string reason;  ///< "killed by SIGKILL"
  };

  ~Supervisor();
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  /// Starts a program; its output goes to its log. It ends with this process, however that ends.
  void start(SupervisedProgram program);

  /// Watches until all have ended or wait for the verdict, an essential one failed, or a signal asks to stop; calls
  /// `tick` ten times a second. A program fails that ends early, is halted for a second, or does not end within 30 s of
  /// the first child (the world). The cause is returned, not its effect: a program that was killed or is halted before
  /// one that gave up.
  [[nodiscard]] std::optional<Failure> watch(const std::function<void()>& tick);

  /// Ends what still runs: the first child (the world, which ends the others), then all, then by SIGKILL. A display
  /// that waits for the verdict goes on.
  void stop();

  /// The summary is written: waits until the display has shown the verdict.
  void await_display();

  [[nodiscard]] const std::vector<Child>& children() const noexcept { return children_; }
  [[nodiscard]] const std::vector<Restarted>& restarts() const noexcept { return restarts_; }

 private:
  void launch(Child& child, bool again);
  void reap();
  /// Starts again what is to be started again, each time after a longer pause, and at most kMostRestarts times.
  /// Returns one that cannot be.
  std::optional<Failure> revive();
  /// Why an ended program is to be started again; empty: it is not.
  [[nodiscard]] std::string restart_reason(const Child& child) const;
  [[nodiscard]] std::optional<Failure> failure() const;
  void signal_all(bool essential, int signal) const;
  void wait_while(const std::function<bool()>& runs, std::chrono::milliseconds at_most);
  [[nodiscard]] bool any_running(bool essential_only) const;

  Restart restart_;
  const Keeper& keeper_;
  ProgramReports reports_;
  std::vector<Child> children_;
  std::vector<Restarted> restarts_;
  Time watched_from_ = {};
};

/// Exit code of ssh for its own failure, or where a signal ended the program there.
inline constexpr int kSshFailed = 255;

/// Exit code of an ended child; 1 for one that a signal killed.
[[nodiscard]] int exit_code_of(const Supervisor::Child& child);
/// "exited with 3" or "killed by SIGKILL".
[[nodiscard]] std::string end_of(const Supervisor::Child& child);

}  // namespace subworld
