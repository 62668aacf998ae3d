#include "rt/lateness.hpp"

#include <sys/resource.h>

#include <ctime>

namespace subworld {

ThreadUse thread_use() noexcept {
  timespec cpu{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &cpu);
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  return {std::chrono::seconds(cpu.tv_sec) + std::chrono::nanoseconds(cpu.tv_nsec),
          static_cast<std::uint64_t>(usage.ru_nvcsw)};
}

}  // namespace subworld
