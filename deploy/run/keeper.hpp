#pragma once

#include "run/restart.hpp"

#include <sys/types.h>

#include <functional>
#include <vector>

namespace subworld {

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
