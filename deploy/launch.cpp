#include "launch.hpp"

#include "ends.hpp"
#include "explain.hpp"
#include "file_lock.hpp"
#include "gates.hpp"
#include "io/results.hpp"
#include "io/trace.hpp"
#include "limits.hpp"
#include "model/error.hpp"
#include "placement.hpp"
#include "progress.hpp"
#include "rt/calibration.hpp"
#include "rt/cyclic.hpp"
#include "rt/kernel_share.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "summary.hpp"
#include "supervise.hpp"
#include "watchdog.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <regex>
#include <thread>
#include <vector>

namespace subworld {

namespace {

// Domains that a run chooses by itself, the last first. Their ports start at 7400 + 250 times the domain and lie below
// 32768: above, Linux gives ports to any socket, which could occupy one of them.
constexpr int kFirstDomain = 60;
constexpr int kLastDomain = 100;

/// A domain that no other run on this machine holds, for the life of this object.
class DomainClaim {
 public:
  explicit DomainClaim(int wanted) {
    if (wanted >= 0) {
      if (!claim(wanted)) {
        throw Error(ExitCode::middleware,
                    fmt::format("domain {} is in use by another run on this machine; choose another --domain, or omit "
                                "it: the first free one is taken",
                                wanted));
      }
      return;
    }
    for (int domain = kLastDomain; domain >= kFirstDomain; --domain) {
      if (claim(domain)) return;
    }
    throw Error(ExitCode::middleware,
                fmt::format("all domains from {} to {} are in use by other runs; name one with --domain", kFirstDomain,
                            kLastDomain));
  }
  [[nodiscard]] int domain() const noexcept { return domain_; }

 private:
  bool claim(int domain) {
    if (!lock_.take(fmt::format("subworld-domain-{}", domain))) return false;
    domain_ = domain;
    return true;
  }

  FileLock lock_;
  int domain_ = -1;
};

std::string vendor_of(const std::string& dds, int position) {
  if (dds != "mixed") return dds;
  return position % 2 == 0 ? "fastdds" : "cyclonedds";
}

std::string last_line(const std::string& path, std::string_view holding = {}) {
  std::ifstream file(path);
  std::string line, last;
  while (std::getline(file, line)) {
    if (!line.empty() && line.find(holding) != std::string::npos) last = line.substr(line.rfind('\r') + 1);
  }
  return last;
}

/// File of a program's part of the trace, until the parts are merged.
std::string trace_part(const std::string& folder, const std::string& label) {
  return fmt::format("{}/trace/{}.json", folder, label);
}

/// Makes one trace of all programs' parts.
void collect_trace(const Supervisor& programs, const Options& options) {
  if (options.trace.empty()) return;
  std::vector<std::string> parts;
  for (const Supervisor::Child& child : programs.children()) parts.push_back(trace_part(options.out, child.label));
  merge_traces(parts, options.trace);
  std::filesystem::remove_all(options.out + "/trace");
  fmt::print("subworld: trace in {}; open it with ui.perfetto.dev, chrome://tracing or speedscope\n", options.trace);
}

/// File of a program's part of the results; the launcher makes one summary of them.
std::string part_of(const std::string& folder, std::string_view program, int user) {
  const std::string_view name = program.substr(0, program.find('_'));
  return user < 0 ? fmt::format("{}/{}.json", folder, name) : fmt::format("{}/{}_{}.json", folder, name, user);
}

/// Whether the environment chooses the cores of a program.
bool is_placed_by_hand(const std::string& program) {
  std::string variable = "SUBWORLD_" + program + "_CORE";
  std::ranges::transform(variable, variable.begin(), [](unsigned char c) { return std::toupper(c); });
  return std::getenv(variable.c_str()) != nullptr;
}

void start_programs(Supervisor& programs, const RunRequest& request, const Options& options, int users, int domain,
                    const Placement& placement) {
  const std::string folder = program_folder();
  int position = 0;
  const auto start = [&](const std::string& program, int user, bool essential) {
    std::vector<std::string> flags = flags_of(options);
    flags.insert(flags.end(), {"--domain", std::to_string(domain), "--dds", vendor_of(request.dds, position++)});
    const std::string label = user < 0 ? program : fmt::format("{}_{}", program, user);
    const std::string part = essential ? part_of(options.out, program, user) : "";
    if (user >= 0) flags.insert(flags.end(), {"--user", std::to_string(user)});
    if (!options.trace.empty() && program != "gui_headless")
      flags.insert(flags.end(), {"--trace", trace_part(options.out, label)});
    if (request.gui && program == "world_sim") flags.emplace_back("--await-display");
    if (options.bodies && program == "world_sim") flags.insert(flags.end(), {"--bodies", *options.bodies});
    if (options.bodies_rate_hz && program == "world_sim")
      flags.insert(flags.end(), {"--bodies-rate", fmt::format("{}", *options.bodies_rate_hz)});
    if (const std::vector<int>& cores = placement.of(program); !cores.empty() && !is_placed_by_hand(program))
      flags.insert(flags.end(), {"--core", to_text(cores)});
    programs.start({.label = label,
                    .log = fmt::format("{}/logs/{}.log", options.out, label),
                    .part = part,
                    .essential = essential},
                   folder + "/" + program, flags);
  };
  start("world_sim", -1, true);
  for (int u = 0; u < users; ++u) {
    start("haptic_sim", u, true);
    start("device_sim", u, true);
    if (users > 1) ++position;  // with mixed, users have different pairs of vendors
  }
  if (request.gui) start("gui_headless", -1, false);
}

void remove_parts(const std::string& folder, int users) {
  std::filesystem::remove(part_of(folder, "world_sim", -1));
  for (int u = 0; u < users; ++u) {
    for (const char* program : {"haptic_sim", "device_sim"}) std::filesystem::remove(part_of(folder, program, u));
  }
}

/// Reserves the folder that the user named for this run, and deletes the results of an earlier one; or makes a new one.
void claim_folder(std::string& folder, const std::string& scene, FileLock& lock) {
  if (folder.empty()) {
    const std::string wanted = fmt::format("out/{}-{:%Y%m%d-%H%M%S}", scene, fmt::localtime(std::time(nullptr)));
    make_folder("out");
    folder = wanted;
    for (int n = 2; !std::filesystem::create_directory(folder); ++n) folder = fmt::format("{}-{}", wanted, n);
  }
  make_folder(folder + "/logs");
  if (!lock.take_folder(folder)) {
    throw Error(ExitCode::usage, fmt::format("--out {}: another run writes its results there; choose another folder, "
                                             "or omit it: a new one is made",
                                             folder));
  }
  const std::regex ours(R"((summary|world|haptic_\d+|device_\d+)\.(json|csv)|bodies\.csv|picture\.png)");
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    // Results go through a link that the user made.
    if (!entry.is_symlink() && std::regex_match(entry.path().filename().string(), ours))
      std::filesystem::remove(entry.path());
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder + "/logs")) {
    if (entry.path().extension() == ".log") std::filesystem::remove(entry.path());
  }
}

int report_failure(const Supervisor::Failure& failure, const std::string& folder, Json& summary) {
  const Supervisor::Child& failed = failure.child;
  const int code = exit_code_of(failed);
  const std::string reason = fmt::format("{} {}", failed.label, failure.reason);
  const std::string error = last_line(failed.log, "error:");
  fmt::print(stderr, "subworld: error: {}; everything else was stopped\n  {}\n  its log: {}\n", reason,
             error.empty() ? last_line(failed.log) : error, failed.log);
  summary["verdict"] = fmt::format("failed: {}{}{}", reason, error.empty() ? "" : ": ", error);
  write_json(folder + "/summary.json", summary);
  fmt::print("verdict: {}\n", summary["verdict"].get<std::string>());
  return code >= 1 && code <= 4 ? code : static_cast<int>(ExitCode::failed);
}

/// ISO 8601 with the zone.
std::string iso_date(std::time_t time) {
  const std::string text = fmt::format("{:%Y-%m-%dT%H:%M:%S%z}", fmt::localtime(time));
  const std::size_t minutes = text.size() - 2;  // of the zone
  return fmt::format("{}:{}", text.substr(0, minutes), text.substr(minutes));
}

/// Takes a tenth of the run, at most a second, before any program of the run starts.
Calibration measure_machine(const Settings& settings) {
  const double duration_s = std::clamp(0.1 * settings.duration_s, 0.2, 1.0);
  fmt::print("subworld: measuring for {:.1f} s how late this machine wakes a loop without work\n", duration_s);
  std::fflush(stdout);
  const int cores = std::max(1, static_cast<int>(allowed_cores().size()));
  const Calibration found = calibrate(std::min(settings.users, cores), settings.h_s, duration_s);
  fmt::print("subworld: {}\n", to_text(found));
  if (!found.granted.fifo || !found.granted.memory_locked) {
    fmt::print("subworld: warning: without all real-time rights deadlines may be missed: {}\n", found.granted.text);
  }
  std::fflush(stdout);
  return found;
}

/// How the display ended, where it did not end by itself; empty otherwise. It ends no run.
std::string lost_display(const Supervisor& programs) {
  for (const Supervisor::Child& child : programs.children()) {
    if (!child.essential && exit_code_of(child) != 0) return fmt::format("{} {}", child.label, end_of(child));
  }
  return {};
}

}  // namespace

std::string program_folder() { return std::filesystem::read_symlink("/proc/self/exe").parent_path().string(); }

int run(const RunRequest& request) {
  end_at_stop_signals();
  Options options = request.options;
  const Scene scene = load_scene(options);
  check_request(scene, request);
  warn_of_limits(scene);
  FileLock folder;
  claim_folder(options.out, scene.name, folder);
  if (!options.trace.empty()) {
    merge_traces({}, options.trace);  // an unwritable file is an error before anything runs
    make_folder(options.out + "/trace");
  }
  const DomainClaim claim(request.domain);
  fmt::print("subworld: {} in {}, {} s, domain {}, results in {}\n", scene.file,
             scene.settings.mode == Mode::realtime ? "real time" : "lock-step", scene.settings.duration_s,
             claim.domain(), options.out);

  RunRecord record;
  record.command_line = request.command_line;
  record.date = iso_date(std::time(nullptr));
  record.dds = request.dds;
  if (scene.settings.mode == Mode::realtime) record.calibration = measure_machine(scene.settings);

  watch_stop_signals();
  const TimePoint begin = Clock::now();
  const MachineUse use = machine_use();
  Supervisor programs;
  // Of several runs at a time only the first is placed: two worlds must not share one core.
  FileLock first_run;
  const bool is_first = request.place && first_run.take("subworld-cores");
  record.placement = is_first ? place(scene, allowed_cores()) : Placement{};
  start_programs(programs, request, options, scene.settings.users, claim.domain(), record.placement);
  std::optional<Supervisor::Failure> failure;
  Watchdog watchdog;
  {
    Network network = options.network;
    network.dds = vendor_of(request.dds, 0);
    network.domain = claim.domain();
    Progress progress(network, scene, watchdog);
    failure = programs.watch(
        [&] { progress(); },
        [&](const Supervisor::Child& child) { return early_end(child.part, scene.settings.duration_s); });
  }
  programs.stop();
  record.wall_s = to_seconds(Clock::now() - begin);
  record.load = core_load(use, machine_use(), record.wall_s, machine_cores());
  collect_trace(programs, options);

  Json summary = describe_run(scene, record);
  const int signal = stop_signal();
  const std::string stopped = signal == 0 ? "" : fmt::format("stopped by SIG{}", sigabbrev_np(signal));
  bool complete = true;
  try {
    add_parts(summary, scene, record, options.out);
  } catch (const Error& wrong) {
    if (signal == 0 && !failure) throw;
    complete = false;
  }
  remove_parts(options.out, scene.settings.users);
  if (failure) return report_failure(*failure, options.out, summary);
  if (!complete) {
    summary["verdict"] = stopped;
    write_json(options.out + "/summary.json", summary);
    fmt::print("subworld: {}; results so far in {}\n", stopped, options.out);
    return static_cast<int>(ExitCode::done);
  }

  print_summary(summary);
  const std::vector<Gate> held = gates(summary);
  std::size_t fine = 0;
  for (const Gate& gate : held) {
    summary["gates"].push_back(to_json(gate));
    fine += gate.ok();
    if (!gate.ok()) fmt::print("  {}\n", gate.line());
  }
  fmt::print("  {} of {} gates ok (details: `gates` in summary.json)\n", fine, held.size());
  summary["verdict"] = verdict_of(held, summary);
  const bool ok = std::ranges::none_of(held, &Gate::spoils_verdict);
  const std::vector<std::string> strict = request.strict ? missed_strictly(held) : std::vector<std::string>{};
  const double simulated_s = summary["simulated_s"].get<double>();
  if (simulated_s < scene.settings.duration_s - scene.settings.longest_cycle_s()) {
    summary["verdict"] = fmt::format("{} at t = {:.3f} s{}", signal == 0 ? "stopped by control" : stopped, simulated_s,
                                     ok ? "" : "; until then: " + summary["verdict"].get<std::string>());
  }
  std::vector<std::string> faults = signal == 0 ? faults_of(summary) : std::vector<std::string>{};
  if (const Watchdog::Stall& stall = watchdog.longest(); stall.for_s > 0.0 && scene.settings.mode == Mode::realtime) {
    faults.push_back(fmt::format("{} did not advance from t = {:.3f} s for {:.0f} s, although the run was not paused",
                                 stall.label, stall.at_s, stall.for_s));
  }
  if (!faults.empty()) summary["verdict"] = fmt::format("failed: {}", fmt::join(faults, "; "));
  const std::string lost = lost_display(programs);
  const std::string picture = options.out + "/picture.png";
  const bool pictured = std::filesystem::exists(picture);
  if (!lost.empty()) summary["display"] = lost;
  write_json(options.out + "/summary.json", summary);
  fmt::print("state hash {}\nverdict: {}{}\nsummary: {}/summary.json\n", summary["state_hash"].get<std::string>(),
             summary["verdict"].get<std::string>(),
             lost.empty() ? "" : fmt::format("; the display failed ({}){}", lost, pictured ? "" : ": no picture"),
             options.out);
  if (request.gui) {
    fmt::print("{}\n", pictured ? "picture: " + picture : "no picture: see " + options.out + "/logs/gui_headless.log");
  }
  if (request.explain) {
    const bool checkout = std::filesystem::exists("deploy/subworld");
    fmt::print("{}", explanation(summary, options.out, pictured, checkout ? "deploy/subworld" : "subworld"));
  }
  if (!faults.empty()) return static_cast<int>(ExitCode::failed);
  if (strict.empty() || signal != 0) return static_cast<int>(ExitCode::done);
  fmt::print("subworld: exit code 4: --strict counts {}\n", fmt::join(strict, ", "));
  return static_cast<int>(ExitCode::quality);
}

}  // namespace subworld
