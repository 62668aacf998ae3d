#include "doctor/facts.hpp"
#include "io/version.hpp"
#include "model/error.hpp"
#include "physics/engine.hpp"
#include "physics/plugin.hpp"
#include "rt/calibration.hpp"
#include "tools.hpp"
#include "wire/plugin.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sched.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <sstream>

extern char** environ;

namespace subworld::doctor {

namespace {

namespace files = std::filesystem;

constexpr double kWatch_s = 0.25;  ///< length of the calibration, in which rivals are watched too

Limit limit_of(decltype(RLIMIT_NOFILE) resource) {
  rlimit limit{};
  getrlimit(resource, &limit);
  const auto value = [](rlim_t one) { return one == RLIM_INFINITY ? Limit::kUnlimited : std::uint64_t{one}; };
  return {value(limit.rlim_cur), value(limit.rlim_max)};
}

bool has_capability(int number) {
  std::istringstream lines(file_text("/proc/self/status"));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("CapEff:")) return ((std::strtoull(line.c_str() + 7, nullptr, 16) >> number) & 1U) != 0;
  }
  return false;
}

std::int64_t number_in(const std::string& file, std::int64_t otherwise) {
  const std::string text = file_text(file);
  return text.empty() ? otherwise : std::strtoll(text.c_str(), nullptr, 10);
}

std::string line_in(const std::string& file) {
  std::string text = file_text(file);
  while (text.ends_with('\n')) text.pop_back();
  return text;
}

struct ProcessTimes {
  pid_t pid = 0;
  std::string name;
  double cpu_s = 0.0;
  int threads = 1;
  int priority = 0;  ///< real-time one; 0: none
  bool kernel = false;
};

std::vector<ProcessTimes> process_times() {
  std::vector<ProcessTimes> all;
  const auto tick_s = 1.0 / static_cast<double>(sysconf(_SC_CLK_TCK));
  std::error_code ignored;
  for (const auto& entry : files::directory_iterator("/proc", ignored)) {
    const std::string text = file_text(entry.path() / "stat");
    const std::size_t open = text.find('('), close = text.rfind(')');
    const std::string name = entry.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos || close == std::string::npos) continue;
    std::istringstream fields(text.substr(close + 1));
    std::vector<std::string> values;
    for (std::string value; fields >> value;) values.push_back(value);
    // proc(5), counted from the state: parent 1, user and kernel time 11 and 12, threads 17, real-time priority 37
    if (values.size() < 38) continue;
    ProcessTimes one{.pid = std::atoi(name.c_str()), .name = text.substr(open + 1, close - open - 1)};
    one.cpu_s = tick_s * (std::atof(values[11].c_str()) + std::atof(values[12].c_str()));
    one.threads = std::atoi(values[17].c_str());
    one.priority = std::atoi(values[37].c_str());
    one.kernel = values[1] == "2" || one.pid == 2;
    all.push_back(std::move(one));
  }
  return all;
}

/// Programs of the haptic loops' priority or above that used a core between two instants; none of Subworld's or the
/// kernel's.
std::vector<Rival> rivals_between(const std::vector<ProcessTimes>& before, const std::vector<ProcessTimes>& after,
                                  double passed_s) {
  std::vector<Rival> found;
  for (const ProcessTimes& now : after) {
    if (now.priority < priority::kHaptic || now.kernel || now.pid == getpid()) continue;
    const auto then = std::ranges::find(before, now.pid, &ProcessTimes::pid);
    if (then == before.end() || now.name == "haptic_sim") continue;
    found.push_back({now.pid, now.name, now.priority, (now.cpu_s - then->cpu_s) / passed_s});
  }
  return found;
}

void read_limits(Machine& machine) {
  machine.root = geteuid() == 0;
  machine.memory_lock = limit_of(RLIMIT_MEMLOCK);
  machine.real_time_priority = limit_of(RLIMIT_RTPRIO);
  machine.open_files = limit_of(RLIMIT_NOFILE);
  machine.processes = limit_of(RLIMIT_NPROC);
  constexpr int kSysAdmin = 21, kSysResource = 24;
  machine.may_raise_limits = !machine.root || has_capability(kSysResource);
  machine.process_limit_holds = getuid() != 0 && !has_capability(kSysAdmin) && !has_capability(kSysResource);
  for (const ProcessTimes& one : process_times()) {
    struct stat owner {};
    if (stat(fmt::format("/proc/{}", one.pid).c_str(), &owner) == 0 && owner.st_uid == getuid())
      machine.own_threads += one.threads;
  }
}

void read_cores(Machine& machine) {
  machine.cores = static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN));
  machine.allowed_cores = static_cast<int>(allowed_cores().size());
  const std::string frequency = "/sys/devices/system/cpu/cpu0/cpufreq/";
  machine.governor = line_in(frequency + "scaling_governor");
  machine.governor_driver = line_in(frequency + "scaling_driver");
  machine.real_time_runtime_us = number_in("/proc/sys/kernel/sched_rt_runtime_us", machine.real_time_runtime_us);
  machine.real_time_period_us = number_in("/proc/sys/kernel/sched_rt_period_us", machine.real_time_period_us);
}

/// Runs bare loops, and watches programs of other kinds meanwhile.
void measure_lateness(const Needs& needs, Machine& machine) {
  const std::vector<ProcessTimes> before = process_times();
  const Calibration found =
      calibrate(std::clamp(needs.users, 1, std::max(1, machine.allowed_cores)), machine.period_s, kWatch_s);
  machine.rivals = rivals_between(before, process_times(), kWatch_s);
  machine.fifo = found.granted.fifo;
  constexpr int kIpcLock = 14;
  machine.locks_memory =
      found.granted.memory_locked && (machine.memory_lock.soft == Limit::kUnlimited || has_capability(kIpcLock));
  machine.lateness_p99_s = found.lateness.quantile_s(0.99);
  machine.lateness_max_s = found.lateness.max_s();
  machine.wake_ups = found.lateness.count();
  machine.late_wake_ups = found.lateness.count_above(machine.period_s);
}

/// Whether a process holds this file's lock, also one of another container.
bool is_locked(const std::string& path) {
  const int file = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (file < 0) return false;
  const bool locked = flock(file, LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  close(file);
  return locked;
}

/// Fast DDS locks the files NAME_el and NAME_sl while it uses the segment NAME.
bool is_segment_locked(std::string path) {
  for (const char* ending : {"_el", "_sl"}) {
    if (path.ends_with(ending)) path.resize(path.size() - 3);
  }
  return is_locked(path + "_el") || is_locked(path + "_sl");
}

void read_left_files(Machine& machine) {
  const std::set<std::string> used = files_in_use("/dev/shm");
  std::error_code ignored;
  for (const auto& entry : files::directory_iterator("/dev/shm", ignored)) {
    const std::string name = entry.path().filename();
    for (const char* start : {"fastrtps_", "fast_datasharing_", "sem.fastrtps_", "sem.fast_datasharing_"}) {
      if (!name.starts_with(start)) continue;
      struct stat file {};
      const bool ours = stat(entry.path().c_str(), &file) == 0 && (file.st_uid == geteuid() || machine.root);
      // The files of another user's process are not visible: nothing is known of them.
      machine.shared_memory.push_back(
          {.path = entry.path(), .in_use = !ours || used.contains(entry.path()) || is_segment_locked(entry.path())});
    }
  }
  std::ranges::sort(machine.shared_memory, {}, &LeftFile::path);
  const char* given = std::getenv("TMPDIR");
  machine.temporary_folder = given != nullptr && *given != '\0' ? given : "/tmp";
  machine.temporary_folder_usable = files::is_directory(machine.temporary_folder, ignored) &&
                                    access(machine.temporary_folder.c_str(), W_OK | X_OK) == 0;
  const std::vector<ClaimedDomain> claimed = claimed_domains();
  for (const auto& entry : files::directory_iterator(machine.temporary_folder, ignored)) {
    const std::string name = entry.path().filename();
    if (!name.starts_with("subworld-") || !name.ends_with(".lock")) continue;
    // With the flags of a run: the kernel may refuse O_CREAT for another user's file in a shared folder.
    const int opened = open(entry.path().c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    const bool held = std::ranges::any_of(
        claimed, [&](const ClaimedDomain& one) { return name == fmt::format("subworld-domain-{}.lock", one.domain); });
    machine.lock_files.push_back({.path = entry.path(), .in_use = held, .can_open = opened >= 0});
    if (opened >= 0) close(opened);
  }
  std::ranges::sort(machine.lock_files, {}, &LeftFile::path);
}

void read_out(const Request& request, Machine& machine) {
  machine.out = request.out.empty() ? "out" : request.out;
  std::error_code ignored;
  files::path folder = files::absolute(machine.out, ignored);
  while (!files::exists(folder, ignored) && folder.has_relative_path()) folder = folder.parent_path();
  machine.out_existing = folder;
  machine.out_is_folder = files::is_directory(folder, ignored);
  machine.out_writable = access(folder.c_str(), W_OK | (machine.out_is_folder ? X_OK : 0)) == 0;
  const files::space_info space = files::space(folder, ignored);
  if (!ignored) machine.out_free_bytes = space.available;
}

/// First line that a command prints; empty where it fails.
std::string first_line_of(const std::string& command) {
  const std::unique_ptr<std::FILE, decltype([](std::FILE* pipe) { pclose(pipe); })> pipe(popen(command.c_str(), "re"));
  std::array<char, 256> line{};
  if (!pipe || std::fgets(line.data(), line.size(), pipe.get()) == nullptr) return {};
  std::string text = line.data();
  while (text.ends_with('\n')) text.pop_back();
  return text;
}

void read_programs(Machine& machine) {
  for (const char* name : {"world_sim", "haptic_sim", "device_sim"}) {
    const std::string file = program_folder() + "/" + name;
    InstalledPart part{.name = name, .version = {}, .fault = {}};
    if (access(file.c_str(), X_OK) != 0) {
      part.fault = fmt::format("{} does not exist or is no program", file);
    } else {
      part.version = first_line_of(fmt::format("'{}' --version 2>&1", file));
      if (!part.version.ends_with(version_text())) {
        part.fault = part.version.empty()
                         ? fmt::format("{} does not start", file)
                         : fmt::format("{} is \"{}\", and subworld is {}", file, part.version, version_text());
      }
    }
    machine.parts.push_back(std::move(part));
  }
}

void read_plugins(const Request& request, const Needs& needs, Machine& machine) {
  std::vector<std::string> vendors{request.dds};
  if (request.dds == "mixed") vendors = {"fastdds", "cyclonedds"};
  for (const std::string& name : vendors) {
    const Vendor vendor = parse_vendor(name);
    InstalledPart part{.name = "DDS " + name, .version = wire::installed_version(vendor), .fault = {}};
    if (part.version.empty()) {
      try {
        (void)wire::load_plugin(vendor);
        part.fault = "the plug-in has no version: it is of another version of Subworld";
      } catch (const Error& wrong) {
        part.fault = wrong.what();
      }
    }
    machine.parts.push_back(std::move(part));
  }
  for (const std::string& name : needs.engines) {
    InstalledPart part{.name = "engine " + name, .version = {}, .fault = {}};
    try {
      part.version = engine_plugin(name).version;
    } catch (const Error& wrong) {
      part.fault = wrong.what();
    }
    machine.parts.push_back(std::move(part));
  }
}

void read_environment(Machine& machine) {
  for (char** one = environ; *one != nullptr; ++one) {
    const std::string variable = *one;
    const std::size_t equals = variable.find('=');
    if (equals == std::string::npos) continue;
    const std::string name = variable.substr(0, equals);
    for (const char* start : {"SUBWORLD_", "CYCLONEDDS_", "FASTRTPS_", "FASTDDS_", "ROS_DOMAIN_ID", "TMPDIR"}) {
      if (name.starts_with(start)) machine.environment.emplace_back(name, variable.substr(equals + 1));
    }
  }
  std::ranges::sort(machine.environment);
}

void read_kernel_network(Machine& machine) {
  const auto bytes = [](const char* name, std::uint64_t otherwise) {
    return static_cast<std::uint64_t>(
        number_in(fmt::format("/proc/sys/net/core/{}", name), static_cast<std::int64_t>(otherwise)));
  };
  machine.receive_buffer_bytes = bytes("rmem_max", machine.receive_buffer_bytes);
  machine.send_buffer_bytes = bytes("wmem_max", machine.send_buffer_bytes);
  std::istringstream range(file_text("/proc/sys/net/ipv4/ip_local_port_range"));
  range >> machine.ephemeral_ports.first >> machine.ephemeral_ports.second;
}

}  // namespace

void read_machine(const Request& request, const Needs& needs, Machine& machine) {
  read_cores(machine);
  read_limits(machine);
  measure_lateness(needs, machine);
  read_left_files(machine);
  read_out(request, machine);
  read_programs(machine);
  read_plugins(request, needs, machine);
  read_environment(machine);
  read_kernel_network(machine);
}

}  // namespace subworld::doctor
