#pragma once

#include <sys/types.h>

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// The programs of one run. When this object goes, so do they.
class Supervisor {
 public:
  struct Child {
    std::string label;
    std::string log;        ///< file that holds what it prints
    std::string part;       ///< file in which it says at its end how that came; empty: it does not
    bool essential = true;  ///< its end before the run's is a failure
    pid_t pid = -1;         ///< -1: ended
    int status = 0;         ///< as waitpid() gives it
    bool halted = false;    ///< by SIGSTOP or the like
    double halted_s = 0.0;  ///< in the launcher's own time
    bool judged = false;    ///< has ended with 0, and `early` says whether before its time
    std::string early = {};
  };
  /// Who made a run fail.
  struct Failure {
    Child child;
    std::string reason;  ///< "killed by SIGKILL"
  };

  Supervisor() = default;
  ~Supervisor();
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  /// Starts a program; its output goes to `child.log`. It ends with this process, whatever ends that.
  void start(Child child, const std::string& program, const std::vector<std::string>& arguments);

  /// Watches until all have ended, an essential one failed, or a signal asks to stop; calls `tick` ten times a second.
  /// A program fails that ends with another code than 0, is halted for a second, does not end within 30 s of the
  /// first child (the world), or of which `early` says, in words, that it ended before its time. The cause counts, not
  /// who noticed it: one that was killed or is halted before one that gave up.
  [[nodiscard]] std::optional<Failure> watch(const std::function<void()>& tick,
                                             const std::function<std::string(const Child&)>& early);

  /// Ends what still runs within two seconds: the first child (the world, which tells the others), then all, then by
  /// force.
  void stop();

  [[nodiscard]] const std::vector<Child>& children() const noexcept { return children_; }

 private:
  void reap();
  [[nodiscard]] std::optional<Failure> failure(const std::function<std::string(const Child&)>& early);
  void signal_all(int signal);
  [[nodiscard]] bool any_running(bool essential_only) const;

  std::vector<Child> children_;
};

/// Exit code of an ended child; 1 for one that a signal killed.
[[nodiscard]] int exit_code_of(const Supervisor::Child& child);
/// "exited with 3" or "killed by SIGKILL".
[[nodiscard]] std::string end_of(const Supervisor::Child& child);

}  // namespace subworld
