#include "doctor/checks.hpp"
#include "model/joined.hpp"
#include "model/shapes/nearest.hpp"
#include "rt/scheduling.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>

namespace subworld::doctor {

namespace {

/// One command raises all limits of the shell that are missing; of a container, the one that starts another.
std::string command_for_limits(const Facts& facts) {
  const Machine& machine = facts.machine;
  const bool raise = machine.may_raise_limits;
  std::string command = raise ? fmt::format("{}prlimit --pid $$", as_root(facts))
                              : "exit  # and start the container with --cap-add SYS_NICE --cap-add IPC_LOCK";
  if (!machine.fifo) command += fmt::format(" --{}rtprio={}", raise ? "" : "ulimit ", priority::kHaptic);
  if (!machine.locks_memory) command += raise ? " --memlock=unlimited" : " --ulimit memlock=-1";
  return command;
}

void judge_rights(const Facts& facts, Findings& out) {
  if (facts.machine.fifo || !facts.needs.realtime) return;
  out.push_back({.what = fmt::format("the loops may not use SCHED_FIFO {} (`ulimit -r`)", priority::kHaptic),
                 .why = "any other program delays the haptic loop by milliseconds, and deadlines are missed",
                 .cure = command_for_limits(facts)});
}

void judge_memory_lock(const Facts& facts, Findings& out) {
  if (facts.machine.locks_memory || !facts.needs.realtime) return;
  out.push_back({.what = "memory may not be locked (`ulimit -l`)",
                 .why = "a page that the kernel has moved away delays a step by milliseconds",
                 .cure = command_for_limits(facts)});
}

void judge_throttling(const Facts& facts, Findings& out) {
  const auto period = static_cast<double>(facts.machine.real_time_period_us);
  const auto runtime = static_cast<double>(facts.machine.real_time_runtime_us);
  constexpr double kLeastShare = 0.9;
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

void judge_quota(const Facts& facts, Findings& out) {
  const auto& quota = facts.machine.quota;
  if (!quota || quota->cores >= std::min(2, facts.machine.allowed_cores) || !facts.needs.realtime) return;
  const bool first_version = quota->file.ends_with("quota_us");
  out.push_back({.what = fmt::format("a control group grants the programs {:.2g} cores", quota->cores),
                 .why = "when they have used them, the kernel halts all loops without real-time priority for the rest "
                        "of the period",
                 .cure = fmt::format("echo {} | {}tee {}  # of a container: the option --cpus, at its start",
                                     first_version ? "-1" : "max", as_root(facts), quota->file)});
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

/// Where the rights are missing, the lateness is their effect.
void judge_lateness(const Facts& facts, Findings& out) {
  const Machine& machine = facts.machine;
  constexpr double kMost_s = 0.0005;
  if (!machine.fifo || machine.lateness_p99_s <= kMost_s || !facts.needs.realtime) return;
  out.push_back(
      {.what = fmt::format("a loop without work wakes late: p99 {:.3f} ms > {:.3f} ms, at most {:.3f} ms",
                           1e3 * machine.lateness_p99_s, 1e3 * kMost_s, 1e3 * machine.lateness_max_s),
       .why = "the operating system, the hypervisor or a program of higher priority delays loops, and the run misses "
              "deadlines for it",
       .cure = fmt::format("ps -eo pid,cls,rtprio,pcpu,args --sort=-pcpu | head  # end what uses the cores, above all "
                           "with RTPRIO of {} or more, then measure again",
                           priority::kHaptic)});
}

void judge_shared_memory(const Facts& facts, Findings& out) {
  const std::vector<std::string>& left = facts.machine.shared_memory;
  if (left.empty()) return;
  out.push_back({.what = fmt::format("{} files of ended Fast DDS programs are left in /dev/shm, the first is {}",
                                     left.size(), left.front()),
                 .why = "they take memory until the machine restarts, and another program may wait for their locks; no "
                        "process has them open",
                 .cure = fmt::format("rm -f -- {}", joined(left, " "))});
}

void judge_temporary_folder(const Facts& facts, Findings& out) {
  const std::string& folder = facts.machine.bad_temporary_folder;
  if (folder.empty()) return;
  out.push_back({.what = fmt::format("the temporary folder {} is missing or cannot be written", folder),
                 .why = "/tmp takes its place",
                 .cure = variable(facts, "TMPDIR") != nullptr
                             ? "unset TMPDIR"
                             : fmt::format("{0}mkdir -p {1} && {0}chmod 1777 {1}", as_root(facts), folder)});
}

/// One finding for the parts that the same command installs.
void judge_installation(const Facts& facts, Findings& out) {
  for (const InstalledPart& part : facts.machine.parts) {
    if (part.fault.empty()) continue;
    if (!out.empty() && out.back().cure == part.cure) {
      out.back().what += "; " + part.fault;
    } else {
      out.push_back({.what = part.fault, .why = "a run needs it, and ends at its start", .cure = part.cure});
    }
  }
}

/// After "SUBWORLD_".
constexpr std::array<std::string_view, 16> kVariables{"DDS",
                                                      "DEVICES",
                                                      "TOKEN",
                                                      "DOMAIN",
                                                      "PLUGIN_DIR",
                                                      "ENGINES",
                                                      "ENGINES_ALL",
                                                      "PLACEMENT",
                                                      "WORLD_SIM_CORE",
                                                      "WORLD_SIM_SPIN_S",
                                                      "HAPTIC_SIM_CORE",
                                                      "HAPTIC_SIM_SPIN_S",
                                                      "DEVICE_SIM_CORE",
                                                      "DEVICE_SIM_SPIN_S",
                                                      "GUI_HEADLESS_CORE",
                                                      "GUI_HEADLESS_SPIN_S"};

void judge_variable_names(const Facts& facts, Findings& out) {
  constexpr std::string_view kPrefix = "SUBWORLD_";
  for (const auto& [name, value] : facts.machine.environment) {
    if (!name.starts_with(kPrefix)) continue;
    const std::string word = name.substr(kPrefix.size());
    if (std::ranges::find(kVariables, word) != kVariables.end()) continue;
    const std::string_view near = nearest(word, {kVariables.begin(), kVariables.end()});
    out.push_back({.what = fmt::format("the environment variable {} is none of Subworld's{}", name,
                                       near.empty() ? "" : fmt::format("; {}{} is", kPrefix, near)),
                   .why = "it has no effect, and the default holds",
                   .cure = near.empty()
                               ? fmt::format("unset {}", name)
                               : fmt::format("unset {}; export {}{}={}", name, kPrefix, near, shell_word(value))});
  }
}

/// `--qos` wins over the variable.
void judge_vendor_variables(const Facts& facts, Findings& out) {
  const Request& request = facts.request;
  for (const auto& [name, vendor] : wire::kVendorVariables) {
    const std::string* value = variable(facts, name);
    if (value == nullptr || value->empty()) continue;
    if (!vendor) {
      out.push_back({.what = fmt::format("{}={} is set, and Subworld ignores it", name, *value),
                     .why = "programs of ROS and of the DDS vendors use it, those of Subworld find each other by "
                            "--peers, or by the settings of --qos",
                     .cure = fmt::format("unset {}", name)});
      continue;
    }
    if (!request.network.qos_file.empty() || (request.dds != name_of(*vendor) && request.dds != "mixed")) continue;
    out.push_back({.what = fmt::format("{}={} takes the place of Subworld's settings of the vendor", name, *value),
                   .why = "interface, peers, buffers and discovery may be those of another system, and differ between "
                          "shells and hosts",
                   .cure = fmt::format("unset {}", name)});
  }
}

constexpr std::array kMachineChecks{
    Check{"realtime_rights", "the loops may use SCHED_FIFO", judge_rights},
    Check{"memory_lock", "memory may be locked", judge_memory_lock},
    Check{"realtime_throttling", "the kernel lets real-time loops use at least 90 % of a core", judge_throttling},
    Check{"cores", "this shell may use at least two of the cores", judge_cores},
    Check{"cpu_quota", "no control group grants less than the cores of this shell, or two", judge_quota},
    Check{"governor", "the frequency governor is not a saving one", judge_governor},
    Check{"lateness", "bare loops at 1 kHz wake at most half a period late (p99)", judge_lateness},
    Check{"shared_memory", "no files of ended Fast DDS programs are in /dev/shm", judge_shared_memory},
    Check{"temporary_folder", "the temporary folder exists and can be written", judge_temporary_folder},
    Check{"installation",
          "the programs beside `subworld` are of its version, and the DDS vendor and the engines of the scene can be "
          "loaded",
          judge_installation},
    Check{"variable_names", "each variable `SUBWORLD_...` is one of Subworld's", judge_variable_names},
    Check{"vendor_variables", "no variable of a DDS vendor or of ROS replaces Subworld's settings, or is ignored",
          judge_vendor_variables}};

}  // namespace

std::span<const Check> machine_checks() { return kMachineChecks; }

}  // namespace subworld::doctor
