#pragma once

#include <sys/types.h>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace subworld {

/// When a program that ends before its run is started again.
enum class Restart : std::uint8_t {
  never,
  on_failure,  ///< killed, halted for a second, or with exit code 1
  always       ///< also one that was asked to end
};

/// A program that was started again.
struct Restarted {
  std::string program;   ///< "haptic_sim_0"
  double after_s = 0.0;  ///< since the launcher began to watch
  std::string reason;    ///< "killed by SIGKILL"
};

/// A process that outlives the launcher where that is killed. The programs of the run then get SIGTERM; the keeper ends
/// those by force that do not end of it, and then concludes the run in the launcher's place. It has the launcher's
/// memory as it was when this object was made, and no other thread than its own.
class Keeper {
 public:
  /// `conclude` is called in the keeper's process, with the programs that the launcher had started again. Throws
  /// `Error` (failed) where no process can be made.
  explicit Keeper(const std::function<void(const std::vector<Restarted>&)>& conclude);
  /// The launcher has concluded the run: the keeper ends.
  ~Keeper();
  Keeper(const Keeper&) = delete;
  Keeper& operator=(const Keeper&) = delete;

  /// The launcher has started this process.
  void add(pid_t program) const;
  void add(const Restarted& restarted) const;

 private:
  int pipe_ = -1;
  pid_t pid_ = -1;
};

}  // namespace subworld
