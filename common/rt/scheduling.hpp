#pragma once

#include <string>

namespace subworld {

/// What the operating system granted.
struct Scheduling {
  bool fifo = false;
  bool memory_locked = false;
  std::string text;  ///< in words, with the cure where something was refused
};

/// Asks for SCHED_FIFO at `priority` for the calling thread and for locked memory. Threads that exist already keep
/// theirs.
[[nodiscard]] Scheduling claim_realtime(int priority);

}  // namespace subworld
