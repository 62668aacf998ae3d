#include "rt/kernel_share.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <string>

namespace subworld {

namespace {

double seconds(const timeval& t) noexcept {
  return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
}

double cpu_s(const rusage& usage) noexcept { return seconds(usage.ru_utime) + seconds(usage.ru_stime); }

rusage usage_of(int who) noexcept {
  rusage usage{};
  getrusage(static_cast<__rusage_who_t>(who), &usage);
  return usage;
}

}  // namespace

KernelShare KernelShare::since(const KernelShare& before) const noexcept {
  return {cpu_s - before.cpu_s, run_queue_delay_s - before.run_queue_delay_s,
          involuntary_switches - before.involuntary_switches, voluntary_switches - before.voluntary_switches,
          stolen_s - before.stolen_s};
}

KernelShare kernel_share() {
  const rusage usage = usage_of(RUSAGE_THREAD);
  double ran_ns = 0.0, waited_ns = 0.0;
  std::ifstream("/proc/thread-self/schedstat") >> ran_ns >> waited_ns;
  return {cpu_s(usage), 1e-9 * waited_ns, static_cast<std::uint64_t>(usage.ru_nivcsw),
          static_cast<std::uint64_t>(usage.ru_nvcsw), machine_use().stolen_s};
}

MachineUse machine_use() {
  enum { kUser, kNice, kSystem, kIdle, kIoWait, kIrq, kSoftIrq, kSteal, kColumns };
  std::array<double, kColumns> ticks{};
  std::ifstream file("/proc/stat");
  std::string cpu;
  file >> cpu;
  for (double& column : ticks) file >> column;
  const auto tick_s = 1.0 / static_cast<double>(sysconf(_SC_CLK_TCK));
  return {tick_s * (ticks[kUser] + ticks[kNice] + ticks[kSystem] + ticks[kIrq] + ticks[kSoftIrq]),
          tick_s * ticks[kSteal], cpu_s(usage_of(RUSAGE_SELF)) + cpu_s(usage_of(RUSAGE_CHILDREN))};
}

CoreLoad core_load(const MachineUse& from, const MachineUse& to, double wall_s, int cores) noexcept {
  constexpr double kLeastWall_s = 1e-3;
  const double wall = std::max(kLeastWall_s, wall_s);
  const double own_s = to.own_s - from.own_s;
  const double busy_s = to.busy_s - from.busy_s;
  CoreLoad load;
  double left = cores;
  const auto take = [&](double used_s) {
    const double part = std::clamp(used_s / wall, 0.0, left);
    left -= part;
    return part;
  };
  load.own = take(own_s);
  load.stolen = take(to.stolen_s - from.stolen_s);
  load.other = take(busy_s - own_s);
  return load;
}

std::optional<CpuQuota> cpu_quota(const std::string& root) {
  std::optional<CpuQuota> least;
  const auto consider = [&](const std::string& quota_file, const std::string& period_file) {
    double quota_us = 0.0, period_us = 0.0;  // "max 100000" is no number, and -1 no limit
    std::ifstream quota(quota_file), period(period_file);
    if (!(quota >> quota_us) || !((period_file == quota_file ? quota : period) >> period_us)) return;
    if (quota_us <= 0.0 || period_us <= 0.0 || (least && least->cores <= quota_us / period_us)) return;
    least = {quota_us / period_us, quota_file};
  };
  // "0::/user.slice" of the second version, "3:cpu,cpuacct:/user.slice" of the first
  std::ifstream groups(root + "/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    const std::size_t kind = line.find(':') + 1, path = line.find(':', kind) + 1;
    const std::string mount = root + "/sys/fs/cgroup/" + line.substr(kind, path - kind - 1);
    for (std::string group = line.substr(path);; group.resize(group.rfind('/'))) {
      consider(mount + group + "/cpu.max", mount + group + "/cpu.max");
      consider(mount + "unified" + group + "/cpu.max", mount + "unified" + group + "/cpu.max");
      consider(mount + group + "/cpu.cfs_quota_us", mount + group + "/cpu.cfs_period_us");
      if (group.empty()) break;
    }
  }
  return least;
}

}  // namespace subworld
