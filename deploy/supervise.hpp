#pragma once

#include <sys/types.h>

#include <functional>
#include <string>
#include <vector>

namespace subworld {

/// The programs of one run. When this object goes, so do they.
class Supervisor {
 public:
  struct Child {
    std::string label;
    std::string log;        ///< file that holds what it prints
    pid_t pid = -1;         ///< -1: ended
    int status = 0;         ///< as waitpid() gives it
    bool essential = true;  ///< its end before the run's is a failure
  };

  Supervisor() = default;
  ~Supervisor();
  Supervisor(const Supervisor&) = delete;
  Supervisor& operator=(const Supervisor&) = delete;

  /// Starts a program; its output goes to `log`. It ends with this process, whatever ends that.
  void start(const std::string& label, const std::string& program, const std::vector<std::string>& arguments,
             const std::string& log, bool essential);

  /// Watches until all have ended, one failed, or a signal asks to stop; calls `tick` ten times a second.
  /// Returns the child that failed, or null.
  [[nodiscard]] const Child* watch(const std::function<void()>& tick);

  /// Ends what still runs within two seconds: the first child (the world, which tells the others), then all, then by
  /// force.
  void stop();

  [[nodiscard]] const std::vector<Child>& children() const noexcept { return children_; }

 private:
  void reap();
  void signal_all(int signal);
  [[nodiscard]] bool any_running(bool essential_only) const;

  std::vector<Child> children_;
};

/// Exit code of an ended child; 1 for one that a signal killed.
[[nodiscard]] int exit_code_of(const Supervisor::Child& child);
/// "exited with 3" or "killed by SIGKILL".
[[nodiscard]] std::string end_of(const Supervisor::Child& child);

}  // namespace subworld
