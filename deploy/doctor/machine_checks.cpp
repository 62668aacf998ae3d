#include "doctor/checks.hpp"
#include "model/joined.hpp"
#include "rt/scheduling.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace subworld::doctor {

namespace {

using Findings = std::vector<Finding>;

/// A program has about so many threads and open files.
constexpr int kThreadsOfProgram = 25;
constexpr std::uint64_t kFilesOfProgram = 64, kFilesOfLauncher = 64, kFilesOfUser = 8;

std::string number_of(std::uint64_t limit) { return limit == Limit::kUnlimited ? "unlimited" : std::to_string(limit); }

void judge_rights(const Facts& facts, Findings& out) {
  const Machine& machine = facts.machine;
  if (machine.fifo || !facts.needs.realtime) return;
  out.push_back({.what = fmt::format("the loops may not use SCHED_FIFO (RLIMIT_RTPRIO is {}, they need {})",
                                     number_of(machine.real_time_priority.soft), priority::kHaptic),
                 .why = "any other program delays the haptic loop by milliseconds, and deadlines are missed",
                 .cure = raise_limit(facts, "rtprio", std::to_string(priority::kHaptic))});
}

void judge_memory_lock(const Facts& facts, Findings& out) {
  if (facts.machine.locks_memory || !facts.needs.realtime) return;
  const std::uint64_t soft = facts.machine.memory_lock.soft;
  out.push_back({.what = fmt::format("memory may not be locked (RLIMIT_MEMLOCK is {})",
                                     soft == Limit::kUnlimited ? "unlimited, but the kernel refuses"
                                                               : fmt::format("{} kB", soft / 1024)),
                 .why = "a page that the kernel has moved away delays a step by milliseconds",
                 .cure = raise_limit(facts, "memlock", "unlimited")});
}

void judge_throttling(const Facts& facts, Findings& out) {
  const Machine& machine = facts.machine;
  const auto period = static_cast<double>(machine.real_time_period_us);
  constexpr double kLeastShare = 0.9;
  const auto runtime = static_cast<double>(machine.real_time_runtime_us);
  if (runtime < 0.0 || period <= 0.0 || runtime >= kLeastShare * period) return;
  out.push_back(
      {.what = fmt::format("the kernel gives real-time loops {:.0f} % of a core only", 100.0 * runtime / period),
       .why = "when they have used it, it halts all loops until the next second",
       .cure = fmt::format("{}sysctl -w kernel.sched_rt_runtime_us={:.0f}", as_root(facts), 0.95 * period)});
}

void judge_cores(const Facts& facts, Findings& out) {
  const Machine& machine = facts.machine;
  if (machine.allowed_cores >= 2 || machine.cores < 2 || !facts.needs.realtime) return;
  out.push_back({.what = fmt::format("this shell may use {} of {} cores", machine.allowed_cores, machine.cores),
                 .why = "world and haptic loops share the core, and the world runs slower than real time",
                 .cure = fmt::format("taskset --cpu-list --pid 0-{} $$", machine.cores - 1)});
}

void judge_governor(const Facts& facts, Findings& out) {
  const Machine& machine = facts.machine;
  // Under these drivers the hardware chooses the frequency, and the name means a preference only.
  const bool hardware =
      machine.governor_driver.starts_with("intel_pstate") || machine.governor_driver.starts_with("amd-pstate");
  if (hardware || (machine.governor != "powersave" && machine.governor != "conservative")) return;
  out.push_back({.what = fmt::format("the cores' frequency is chosen by \"{}\"", machine.governor),
                 .why = "a core that has slept starts slowly, and steps take longer than the budget allows for",
                 .cure = fmt::format("echo performance | {}tee /sys/devices/system/cpu/cpu*/cpufreq/scaling_governor",
                                     as_root(facts))});
}

/// Whether a program delays the haptic loops. One of equal priority (SCHED_FIFO) pre-empts nothing: a loop waits at
/// most until that program sleeps, which matters only where it seldom does. One that uses little of a core delays a
/// loop seldom.
bool is_rival(const Rival& rival) {
  constexpr double kRivalCores = 0.02, kBlockingCores = 0.5;
  return rival.cores >= (rival.priority > priority::kHaptic ? kRivalCores : kBlockingCores);
}

void judge_rivals(const Facts& facts, Findings& out) {
  std::vector<pid_t> processes;
  for (const Rival& rival : facts.machine.rivals) {
    if (is_rival(rival)) processes.push_back(rival.pid);
  }
  const std::string lower = fmt::format("{}chrt --other --all-tasks --pid 0", as_root(facts));
  for (const Rival& rival : facts.machine.rivals) {
    if (!is_rival(rival)) continue;
    out.push_back({.what = fmt::format("{} (process {}) runs with real-time priority {} and uses {:.0f} % of a core",
                                       rival.name, rival.pid, rival.priority, 100.0 * rival.cores),
                   .why = rival.priority > priority::kHaptic
                              ? fmt::format("it pre-empts the haptic loops, whose priority is {}", priority::kHaptic)
                              : "the haptic loops have the same priority, and wait until it sleeps",
                   .cure = processes.size() == 1 ? fmt::format("{} {}", lower, rival.pid)
                                                 : fmt::format("for process in {}; do {} $process; done",
                                                               joined(processes, " "), lower)});
  }
}

/// Where the rights are missing or a rival runs, the lateness is its effect.
void judge_lateness(const Facts& facts, Findings& out) {
  const Machine& machine = facts.machine;
  const double bound_s = 0.5 * machine.period_s;
  const bool explained = !machine.fifo || std::ranges::any_of(machine.rivals, is_rival);
  if (explained || machine.lateness_p99_s <= bound_s || !facts.needs.realtime) return;
  out.push_back(
      {.what = fmt::format("a loop without work wakes late: p99 {:.3f} ms > {:.3f} ms, {} of {} times by more than a "
                           "period",
                           1e3 * machine.lateness_p99_s, 1e3 * bound_s, machine.late_wake_ups, machine.wake_ups),
       .why = "the operating system or the hypervisor delays loops, and the run misses deadlines for it",
       .cure = "ps -eo pid,cls,rtprio,pcpu,args --sort=-pcpu | head  # end what uses the cores, then measure again"});
}

void judge_open_files(const Facts& facts, Findings& out) {
  const std::uint64_t needed =
      std::max(kFilesOfProgram, kFilesOfLauncher + kFilesOfUser * static_cast<std::uint64_t>(facts.needs.users));
  const Limit& limit = facts.machine.open_files;
  if (limit.soft >= needed) return;
  constexpr std::uint64_t kUsual = 1024;
  const bool within = limit.hard >= kUsual;
  out.push_back({.what = fmt::format("a process may open {} files; a run needs {}", limit.soft, needed),
                 .why = "sockets and results cannot be opened, and programs end at their start",
                 .cure = within ? fmt::format("ulimit -n {}", kUsual)
                                : raise_limit(facts, "nofile", fmt::format("{0}:{0}", kUsual))});
}

void judge_processes(const Facts& facts, Findings& out) {
  const Machine& machine = facts.machine;
  const auto needed =
      static_cast<std::uint64_t>(machine.own_threads + kThreadsOfProgram * participants_of(facts.needs.users));
  const Limit& limit = machine.processes;
  if (!machine.process_limit_holds || limit.soft >= needed) return;
  const std::uint64_t wanted = std::max<std::uint64_t>(4096, 2 * needed);
  out.push_back({.what = fmt::format("this user may have {} threads and has {}; a run needs {} more", limit.soft,
                                     machine.own_threads, needed - static_cast<std::uint64_t>(machine.own_threads)),
                 .why = "programs cannot start their threads and end",
                 .cure = limit.hard >= wanted ? fmt::format("ulimit -u {}", wanted)
                                              : raise_limit(facts, "nproc", fmt::format("{0}:{0}", wanted))});
}

void judge_shared_memory(const Facts& facts, Findings& out) {
  std::vector<std::string> left;
  for (const LeftFile& file : facts.machine.shared_memory) {
    if (!file.in_use) left.push_back(file.path);
  }
  if (left.empty()) return;
  out.push_back({.what = fmt::format("{} files of ended Fast DDS programs are left in /dev/shm, the first is {}",
                                     left.size(), left.front()),
                 .why = "they take memory until the machine restarts, and another program may wait for their locks; no "
                        "process has them open",
                 .cure = fmt::format("rm -f -- {}", joined(left, " "))});
}

void judge_lock_files(const Facts& facts, Findings& out) {
  std::vector<std::string> left;
  for (const LeftFile& file : facts.machine.lock_files) {
    if (!file.can_open && !file.in_use) left.push_back(file.path);
  }
  if (left.empty()) return;
  out.push_back({.what = left.size() == 1 ? fmt::format("{} cannot be opened by this user", left.front())
                                          : fmt::format("{} lock files cannot be opened by this user, the first is {}",
                                                        left.size(), left.front()),
                 .why = "a run takes the domain of such a file for one in use; other users' runs have left them",
                 .cure = fmt::format("{}rm -rf -- {}", as_root(facts), joined(left, " "))});
}

void judge_temporary_folder(const Facts& facts, Findings& out) {
  const Machine& machine = facts.machine;
  if (machine.temporary_folder_usable) return;
  const bool given = std::ranges::find(machine.environment, "TMPDIR", &std::pair<std::string, std::string>::first) !=
                     machine.environment.end();
  out.push_back(
      {.what = fmt::format("the temporary folder {} is missing or cannot be written", machine.temporary_folder),
       .why = "runs lock their domains there, and start without that folder on no domain",
       .cure = given ? "unset TMPDIR"
                     : fmt::format("{0}mkdir -p {1} && {0}chmod 1777 {1}", as_root(facts), machine.temporary_folder)});
}

/// A minute of a run with one user at 1 kHz writes about 20 MB.
constexpr std::uint64_t kLeastFreeBytes = 100'000'000;

void judge_out(const Facts& facts, Findings& out) {
  const Machine& machine = facts.machine;
  std::string what;
  if (!machine.out_is_folder) {
    what = fmt::format("--out {}: {} is a file", machine.out, machine.out_existing);
  } else if (!machine.out_writable) {
    what = fmt::format("--out {}: {} cannot be written by this user", machine.out, machine.out_existing);
  } else if (machine.out_free_bytes < kLeastFreeBytes) {
    what = fmt::format("--out {}: {} has {} MB left, a minute with one user takes about 20 MB", machine.out,
                       machine.out_existing, machine.out_free_bytes / 1'000'000);
  }
  if (what.empty()) return;
  Request elsewhere = facts.request;
  elsewhere.out = machine.temporary_folder + "/subworld-out";
  out.push_back({.what = what, .why = "the run fails when it writes its results", .cure = command_of(elsewhere)});
}

constexpr std::array kMachineChecks{
    Check{"realtime_rights", "the loops may use SCHED_FIFO", judge_rights},
    Check{"memory_lock", "memory may be locked", judge_memory_lock},
    Check{"realtime_throttling", "the kernel lets real-time loops use at least 90 % of a core", judge_throttling},
    Check{"cores", "this shell may use at least two of the cores", judge_cores},
    Check{"governor", "the frequency governor is not a saving one", judge_governor},
    Check{"rivals",
          "no other program with a higher real-time priority, or a busy one with an equal one, uses the cores",
          judge_rivals},
    Check{"lateness", "bare loops at 1 kHz wake at most half a period late (p99)", judge_lateness},
    Check{"open_files", "`ulimit -n` is large enough for the users of the scene", judge_open_files},
    Check{"processes", "`ulimit -u` is large enough for the users of the scene", judge_processes},
    Check{"shared_memory", "no files of ended Fast DDS programs are in /dev/shm", judge_shared_memory},
    Check{"lock_files", "the lock files of domains can be opened", judge_lock_files},
    Check{"temporary_folder", "the temporary folder exists and can be written", judge_temporary_folder},
    Check{"results_folder", "the folder of --out can be written and has 100 MB left", judge_out}};

}  // namespace

std::span<const Check> machine_checks() { return kMachineChecks; }

}  // namespace subworld::doctor
