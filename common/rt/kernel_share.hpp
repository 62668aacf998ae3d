#pragma once

#include <cstdint>

namespace subworld {

/// CPU time that the kernel gave to a thread and time that it withheld, from the kernel's own statistics. Reads files:
/// not for a loop.
struct KernelShare {
  double cpu_s = 0.0;
  double run_queue_delay_s = 0.0;          ///< runnable, but without a core
  std::uint64_t involuntary_switches = 0;  ///< pre-emptions
  std::uint64_t voluntary_switches = 0;
  double stolen_s = 0.0;  ///< by the hypervisor, from all cores

  [[nodiscard]] KernelShare since(const KernelShare& before) const noexcept;
};
/// Of the calling thread since it started.
[[nodiscard]] KernelShare kernel_share();

/// Times of all cores together since the machine started, s.
struct CoreTimes {
  double busy_s = 0.0;
  double stolen_s = 0.0;  ///< by the hypervisor
};
[[nodiscard]] CoreTimes core_times();

/// CPU time of the processes that this one started and that have ended, s.
[[nodiscard]] double children_cpu_s() noexcept;

}  // namespace subworld
