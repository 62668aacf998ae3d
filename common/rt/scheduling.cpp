#include "rt/scheduling.hpp"

#include <fmt/format.h>
#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace subworld {

Scheduling claim_realtime(int priority) {
  Scheduling got;
  sched_param parameter{};
  parameter.sched_priority = priority;
  got.fifo = sched_setscheduler(0, SCHED_FIFO, &parameter) == 0;
  const int fifo_error = errno;
  // Under a limit, locking what is still to come would turn a later allocation into a failure.
  rlimit limit{};
  const bool unlimited = geteuid() == 0 || (getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY);
  got.memory_locked = mlockall(unlimited ? MCL_CURRENT | MCL_FUTURE : MCL_CURRENT) == 0;
  const int lock_error = errno;
  // Freed memory stays with the process: giving it back would page-fault in the loop.
  mallopt(M_TRIM_THRESHOLD, -1);
  mallopt(M_MMAP_MAX, 0);
  got.text = got.fifo ? fmt::format("SCHED_FIFO {}", priority)
                      : fmt::format("default scheduling ({}; cure: run as root, or allow rtprio in limits.conf)",
                                    std::strerror(fifo_error));
  got.text += got.memory_locked ? ", memory locked"
                                : fmt::format(", memory not locked ({}; cure: raise memlock in limits.conf)",
                                              std::strerror(lock_error));
  return got;
}

bool keep_to_core(int core) noexcept {
  if (core < 0 || core >= CPU_SETSIZE) return false;
  cpu_set_t cores;
  CPU_ZERO(&cores);
  CPU_SET(core, &cores);
  return sched_setaffinity(0, sizeof cores, &cores) == 0;
}

void leave_realtime() noexcept {
  const sched_param parameter{};
  sched_setscheduler(0, SCHED_OTHER, &parameter);
}

}  // namespace subworld
