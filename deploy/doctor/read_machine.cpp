#include "doctor/facts.hpp"
#include "io/results/output.hpp"
#include "io/version.hpp"
#include "model/error.hpp"
#include "model/places.hpp"
#include "physics/engine.hpp"
#include "physics/plugin.hpp"
#include "rt/calibration.hpp"
#include "tools.hpp"
#include "wire/plugin.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <set>
#include <sstream>

extern char** environ;

namespace subworld::doctor {

namespace {

namespace files = std::filesystem;

bool has_capability(int number) {
  std::istringstream lines(file_text("/proc/self/status"));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("CapEff:")) return ((std::strtoull(line.c_str() + 7, nullptr, 16) >> number) & 1U) != 0;
  }
  return false;
}

void read_number(const std::string& file, std::int64_t& number) {
  if (const std::string text = file_text(file); !text.empty()) number = std::strtoll(text.c_str(), nullptr, 10);
}

std::string line_in(const std::string& file) {
  const std::string text = file_text(file);
  return text.substr(0, text.find('\n'));
}

void read_kernel(Machine& machine) {
  machine.cores = static_cast<int>(sysconf(_SC_NPROCESSORS_ONLN));
  machine.allowed_cores = static_cast<int>(allowed_cores().size());
  machine.quota = cpu_quota();
  const std::string frequency = "/sys/devices/system/cpu/cpu0/cpufreq/";
  machine.governor = line_in(frequency + "scaling_governor");
  machine.governor_driver = line_in(frequency + "scaling_driver");
  read_number("/proc/sys/kernel/sched_rt_runtime_us", machine.real_time_runtime_us);
  read_number("/proc/sys/kernel/sched_rt_period_us", machine.real_time_period_us);
  read_number("/proc/sys/net/core/rmem_max", machine.receive_buffer_bytes);
  read_number("/proc/sys/net/core/wmem_max", machine.send_buffer_bytes);
  std::istringstream range(file_text("/proc/sys/net/ipv4/ip_local_port_range"));
  range >> machine.ephemeral_ports.first >> machine.ephemeral_ports.second;
}

/// Runs bare loops, with the rights of those of a run.
void measure_lateness(const Needs& needs, Machine& machine) {
  constexpr int kIpcLock = 14, kSysResource = 24;
  constexpr double kPeriod_s = 0.001, kDuration_s = 0.25;
  machine.root = geteuid() == 0;
  machine.may_raise_limits = !machine.root || has_capability(kSysResource);
  const int loops = std::clamp(needs.users, 1, std::max(1, machine.allowed_cores));
  const Calibration found = calibrate(loops, kPeriod_s, kDuration_s);
  rlimit memory{};
  getrlimit(RLIMIT_MEMLOCK, &memory);
  machine.fifo = found.granted.fifo;
  machine.locks_memory = found.granted.memory_locked && (memory.rlim_cur == RLIM_INFINITY || has_capability(kIpcLock));
  machine.lateness_p99_s = found.lateness.quantile_s(0.99);
  machine.lateness_max_s = found.lateness.max_s();
}

/// Whether a process has locked this file, also one of another container.
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

/// Of the files of another user's process nothing is known.
void read_shared_memory(Machine& machine) {
  const std::set<std::string> used = files_in_use("/dev/shm");
  std::error_code ignored;
  for (const auto& entry : files::directory_iterator("/dev/shm", ignored)) {
    const std::string name = entry.path().filename();
    struct stat file {};
    const bool of_vendor =
        std::ranges::any_of(std::array{"fastrtps_", "fast_datasharing_", "sem.fastrtps_", "sem.fast_datasharing_"},
                            [&](const char* start) { return name.starts_with(start); });
    const bool ours = stat(entry.path().c_str(), &file) == 0 && (file.st_uid == geteuid() || machine.root);
    if (of_vendor && ours && !used.contains(entry.path()) && !is_segment_locked(entry.path()))
      machine.shared_memory.push_back(entry.path());
  }
  std::ranges::sort(machine.shared_memory);
}

void read_temporary_folder(Machine& machine) {
  const char* given = std::getenv("TMPDIR");
  const std::string folder = given != nullptr && *given != '\0' ? given : "/tmp";
  std::error_code ignored;
  if (!files::is_directory(folder, ignored) || access(folder.c_str(), W_OK | X_OK) != 0)
    machine.bad_temporary_folder = folder;
}

/// A command of a checkout, as a cure there or of an installation.
std::string built_by(const std::string& command) {
  const bool is_build = files::exists(program_folder().parent_path() / "CMakeCache.txt");
  return is_build ? command : fmt::format("# install Subworld again, from a checkout after: {}", command);
}

InstalledPart program_part(const std::string& name) {
  const std::string file = (program_folder() / name).string();
  InstalledPart part{.name = name, .version = {}, .fault = {}, .cure = built_by("deploy/build demo")};
  if (access(file.c_str(), X_OK) == 0) part.version = first_line_of(shell_word(file) + " --version 2>&1");
  if (part.version.empty()) {
    part.fault = fmt::format("{} does not exist or does not start", file);
  } else if (!part.version.ends_with(version_text())) {
    part.fault = fmt::format("{} is \"{}\", and subworld is {}", file, part.version, version_text());
  }
  return part;
}

/// A part that `read` loads: it returns the version. The variable may name a folder that lacks it.
template <class Read>
InstalledPart loaded_part(const std::string& name, const char* variable, const std::string& install, Read read) {
  InstalledPart part{.name = name};
  part.cure = std::getenv(variable) != nullptr ? fmt::format("unset {}", variable) : built_by(install);
  try {
    part.version = read();
  } catch (const Error& wrong) {
    part.fault = fmt::format("{}: {}", name, wrong.what());
  }
  return part;
}

void read_parts(const Request& request, const Needs& needs, Machine& machine) {
  for (const char* name : {"world_sim", "haptic_sim", "device_sim"}) machine.parts.push_back(program_part(name));
  for (const char* name : {"fastdds", "cyclonedds"}) {
    if (request.dds != name && request.dds != "mixed") continue;
    machine.parts.push_back(loaded_part(std::string("DDS ") + name, "SUBWORLD_PLUGIN_DIR", "deploy/build", [&] {
      (void)wire::load_plugin(parse_vendor(name));
      return wire::installed_version(parse_vendor(name));
    }));
  }
  for (const std::string& name : std::set(needs.engines.begin(), needs.engines.end())) {
    const bool npm = name == "havok" || name == "physx" || name == "rapier";
    machine.parts.push_back(loaded_part("engine " + name, "SUBWORLD_ENGINES",
                                        fmt::format("{}deploy/build {}", npm ? "SUBWORLD_ENGINES_ALL=1 " : "", name),
                                        [&] { return std::string(engine_plugin(name).version); }));
  }
}

void read_environment(Machine& machine) {
  for (char** one = environ; *one != nullptr; ++one) {
    const std::string text = *one;
    const std::size_t equals = text.find('=');
    if (equals == std::string::npos) continue;
    const std::string name = text.substr(0, equals);
    if (name.starts_with("SUBWORLD_") || name == "ROS_DOMAIN_ID" || name == "TMPDIR" ||
        std::ranges::any_of(wire::kVendorVariables, [&](const auto& known) { return name == known.name; }))
      machine.environment.emplace_back(name, text.substr(equals + 1));
  }
  std::ranges::sort(machine.environment);
}

}  // namespace

void read_machine(const Request& request, const Needs& needs, Machine& machine) {
  read_kernel(machine);
  measure_lateness(needs, machine);
  read_shared_memory(machine);
  read_temporary_folder(machine);
  read_environment(machine);  // before a vendor's library is loaded, which removes the variables that are ignored
  read_parts(request, needs, machine);
}

}  // namespace subworld::doctor
