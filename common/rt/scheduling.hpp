#pragma once

#include <span>
#include <string>
#include <vector>

namespace subworld {

/// What the operating system granted.
struct Scheduling {
  bool fifo = false;
  bool memory_locked = false;
  std::string text;  ///< in words, with the cure where something was refused
};

/// SCHED_FIFO priorities, highest first. The middleware's threads rank above the world's loop: one that the world held
/// up while it has a reader's lock would hold up a haptic loop.
namespace priority {
inline constexpr int kHaptic = 80;
inline constexpr int kDevice = 75;
inline constexpr int kMiddleware = 70;
inline constexpr int kWorld = 60;
}  // namespace priority

/// Asks for SCHED_FIFO at `priority` for the calling thread and the threads that it makes from now on, and for locked
/// memory.
Scheduling claim_realtime(int priority);

/// Keeps the calling thread and the threads that it makes from now on to these cores. False where one of them does not
/// exist or is not allowed.
bool keep_to_cores(std::span<const int> cores) noexcept;

/// Cores that this process may use, ascending.
[[nodiscard]] std::vector<int> allowed_cores();

/// Takes the calling thread back to the default scheduling: for what may wait.
void leave_realtime() noexcept;

}  // namespace subworld
