#pragma once

#include <sys/types.h>

#include <set>
#include <span>
#include <string>
#include <vector>

namespace subworld {

/// Scheduling that the operating system granted.
struct Scheduling {
  bool fifo = false;
  bool memory_locked = false;
  std::string text;  ///< description, with the cure if a request was refused
};

/// SCHED_FIFO priorities, highest first. The middleware's threads rank above the world's loop: a middleware thread that
/// the world delays while it holds a reader's lock would delay a haptic loop.
namespace priority {
inline constexpr int kHaptic = 80;
inline constexpr int kDevice = 75;
inline constexpr int kMiddleware = 70;
inline constexpr int kWorld = 60;
}  // namespace priority

/// Requests SCHED_FIFO at `priority` for the calling thread and the threads that it creates from now on, and locks
/// memory.
Scheduling claim_realtime(int priority);

/// Locks memory, present and future. Takes milliseconds: call it before real-time priority. Returns 0 or errno.
int lock_memory() noexcept;

/// The threads of this process, by their numbers.
[[nodiscard]] std::set<pid_t> own_threads();

/// Gives SCHED_FIFO at `priority` to the threads of this process that have been started since `before` and have default
/// scheduling: those of a middleware. It is opened with default scheduling, because that takes longer than the loops of
/// other programs can wait.
void raise_threads_since(const std::set<pid_t>& before, int priority);

/// Restricts the calling thread, and the threads that it creates from now on, to these cores. False if one of them does
/// not exist or is not allowed.
bool keep_to_cores(std::span<const int> cores) noexcept;

/// Cores that this process may use, in ascending order.
[[nodiscard]] std::vector<int> allowed_cores();

/// Returns the calling thread to the default scheduling.
void leave_realtime() noexcept;

}  // namespace subworld
