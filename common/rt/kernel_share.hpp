#pragma once

#include <cstdint>
#include <optional>
#include <string>

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

/// The machine's and the run's CPU time at one instant, s.
struct MachineUse {
  double busy_s = 0.0;    ///< of all cores together since the machine started
  double stolen_s = 0.0;  ///< by the hypervisor, likewise
  /// Of this process and of those that it started and that have ended. The kernel counts it per process id, also across
  /// execve(): only differences have a meaning.
  double own_s = 0.0;
};
[[nodiscard]] MachineUse machine_use();

/// Mean number of cores in use.
struct CoreLoad {
  double own = 0.0;     ///< by the run
  double other = 0.0;   ///< by other programs
  double stolen = 0.0;  ///< by the hypervisor
};
/// Of the `wall_s` between two instants on a machine of `cores` cores. No part is negative, and the sum is at most
/// `cores`: the kernel counts the cores in ticks and the programs exactly, and its stolen time may jump.
[[nodiscard]] CoreLoad core_load(const MachineUse& from, const MachineUse& to, double wall_s, int cores) noexcept;

/// What the control groups of this process grant it.
struct CpuQuota {
  double cores = 0.0;     ///< mean number
  std::string file = {};  ///< that sets it
};
/// The smallest one of its own and the outer groups; none: no limit. `root`: for tests.
[[nodiscard]] std::optional<CpuQuota> cpu_quota(const std::string& root = "");

}  // namespace subworld
