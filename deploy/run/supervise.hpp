#pragma once

#include "model/scene.hpp"
#include "run/keeper.hpp"
#include "run/restart.hpp"

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// Whether a program of a run can be started again; `user`: -1 where it has none. A world in lock-step begins at t = 0.
[[nodiscard]] inline bool may_restart(const Settings& settings, int user) noexcept {
  return user >= 0 || settings.mode == Mode::realtime;
}

/// The programs of one run. They end with this object.
class Supervisor {
 public:
  /// `keeper` ends them where this process is killed.
  Supervisor(Restart restart, const Keeper& keeper) : restart_(restart), keeper_(keeper) {}
  struct Child {
    std::string label;
    std::string log;             ///< file of its output
    std::string recording = {};  ///< place of its messages on their way to a recorder, as RecordingMemory gives it
    std::string messages = {};   ///< place of its last messages, as MessageMemory gives it
    std::string part;            ///< file in which it writes at its end how it ended; empty: none
    bool essential = true;       ///< its early end is a failure
    bool shows_verdict = false;  ///< the display: it may wait for the verdict when the others have ended
    pid_t pid = -1;              ///< -1: ended
    int status = 0;              ///< as waitpid() gives it
    int verdict_link = -1;       ///< to one that shows the verdict
    bool awaits_verdict = false;
    bool halted = false;    ///< by SIGSTOP or the like
    double halted_s = 0.0;  ///< measured by the launcher
    bool judged = false;    ///< has ended with 0, and `early` is set
    std::string early = {};
    std::string host = {};  ///< of a session; empty: a run on one machine
    std::string program = {};
    std::vector<std::string> arguments = {};
    std::function<std::vector<std::string>()> arguments_again = {};  ///< of a restart; empty: the same
    std::function<bool()> enter = {};
    bool may_restart = true;
    int returns = 0;      ///< that are planned, after it has ended in order
    off_t log_begin = 0;  ///< where the output of this process begins in `log`
    int restarts = 0;     ///< in a row
    std::chrono::steady_clock::time_point started_at = {};
    std::chrono::steady_clock::time_point starts_at = {};  ///< while it waits to be started again

    /// "haptic_sim_0", or "haptic_sim_0 on host left".
    [[nodiscard]] std::string name() const;
  };
  /// The cause of a failed run.
  struct Failure {
    Child child;
    std::string reason;  ///< "killed by SIGKILL"
  };

  ~Supervisor();
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  /// Starts a program; its output goes to `child.log`. It ends with this process, however that ends. `enter` is called
  /// in the new process before the program begins, and may not allocate: it moves the process to another namespace.
  void start(Child child, const std::string& program, const std::vector<std::string>& arguments,
             const std::function<bool()>& enter = {});

  /// Watches until all have ended or wait for the verdict, an essential one failed, or a signal asks to stop; calls
  /// `tick` ten times a second. A program fails that ends with another code than 0, is halted for a second, does not
  /// end within 30 s of the first child (the world), or for which `early` gives a reason. The cause is returned, not
  /// its effect: a program that was killed or is halted before one that gave up.
  [[nodiscard]] std::optional<Failure> watch(const std::function<void()>& tick,
                                             const std::function<std::string(const Child&)>& early);

  /// Ends what still runs within two seconds: the first child (the world, which ends the others), then all, then by
  /// SIGKILL. One that waits for the verdict goes on.
  void stop();

  /// The summary is written: those that wait for the verdict show it, and end.
  void announce_verdict();

  [[nodiscard]] const std::vector<Child>& children() const noexcept { return children_; }
  [[nodiscard]] const std::vector<Restarted>& restarts() const noexcept { return restarts_; }

 private:
  void launch(Child& child, int flags);
  void reap();
  /// Starts again what is to be started again, each time after a longer pause, and at most kMostRestarts times.
  /// Returns one that cannot be.
  std::optional<Failure> revive(const std::function<std::string(const Child&)>& early);
  /// Why an ended program is to be started again; empty: it is not.
  [[nodiscard]] std::string restart_reason(const Child& child,
                                           const std::function<std::string(const Child&)>& early) const;
  [[nodiscard]] std::optional<Failure> failure(const std::function<std::string(const Child&)>& early);
  void wait_while(const std::function<bool()>& runs, std::chrono::milliseconds at_most);
  [[nodiscard]] bool any_running(bool essential_only) const;

  Restart restart_;
  const Keeper& keeper_;
  std::vector<Child> children_;
  std::vector<Restarted> restarts_;
  std::chrono::steady_clock::time_point watched_from_ = {};
};

/// Exit code of an ended child; 1 for one that a signal killed.
[[nodiscard]] int exit_code_of(const Supervisor::Child& child);
/// "exited with 3" or "killed by SIGKILL".
[[nodiscard]] std::string end_of(const Supervisor::Child& child);

}  // namespace subworld
