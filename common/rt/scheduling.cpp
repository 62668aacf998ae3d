#include "rt/scheduling.hpp"

#include <fmt/core.h>
#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>

namespace subworld {

Scheduling claim_realtime(int priority) {
  Scheduling got;
  sched_param parameter{};
  parameter.sched_priority = priority;
  got.fifo = sched_setscheduler(0, SCHED_FIFO, &parameter) == 0;
  const int fifo_error = errno;
  const int lock_error = lock_memory();
  got.memory_locked = lock_error == 0;
  got.text = got.fifo ? fmt::format("SCHED_FIFO {}", priority)
                      : fmt::format("default scheduling ({}; cure: run as root, or allow rtprio in limits.conf)",
                                    std::strerror(fifo_error));
  got.text += got.memory_locked ? ", memory locked"
                                : fmt::format(", memory not locked ({}; cure: raise memlock in limits.conf)",
                                              std::strerror(lock_error));
  return got;
}

int lock_memory() noexcept {
  // Under a limit, locking future memory would make a later allocation fail.
  rlimit limit{};
  const bool unlimited = geteuid() == 0 || (getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY);
  const int error = mlockall(unlimited ? MCL_CURRENT | MCL_FUTURE : MCL_CURRENT) == 0 ? 0 : errno;
  // The process does not return freed memory: a later allocation would page-fault in the loop.
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  return error;
}

std::set<pid_t> own_threads() {
  std::set<pid_t> threads;
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/task", ignored))
    threads.insert(std::atoi(entry.path().filename().c_str()));
  return threads;
}

void raise_threads_since(const std::set<pid_t>& before, int priority) {
  sched_param parameter{};
  parameter.sched_priority = priority;
  for (const pid_t thread : own_threads()) {
    if (!before.contains(thread) && sched_getscheduler(thread) == SCHED_OTHER)
      sched_setscheduler(thread, SCHED_FIFO, &parameter);
  }
}

bool keep_to_cores(std::span<const int> cores) noexcept {
  cpu_set_t allowed, wanted;
  CPU_ZERO(&wanted);
  if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) return false;
  for (const int core : cores) {
    if (core < 0 || core >= CPU_SETSIZE || !CPU_ISSET(core, &allowed)) return false;
    CPU_SET(core, &wanted);
  }
  return sched_setaffinity(0, sizeof wanted, &wanted) == 0;
}

std::vector<int> allowed_cores() {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  if (sched_getaffinity(0, sizeof allowed, &allowed) != 0) return {};
  std::vector<int> cores;
  for (int core = 0; core < CPU_SETSIZE; ++core) {
    if (CPU_ISSET(core, &allowed)) cores.push_back(core);
  }
  return cores;
}

void leave_realtime() noexcept {
  const sched_param parameter{};
  sched_setscheduler(0, SCHED_OTHER, &parameter);
}

}  // namespace subworld
