#include "launch.hpp"

#include "ends.hpp"
#include "explain.hpp"
#include "file_lock.hpp"
#include "gates.hpp"
#include "io/ending.hpp"
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
#include "wire/bus.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <optional>
#include <regex>
#include <vector>

namespace subworld {

namespace {

// Domains that a run chooses by itself, the last first. Their ports start at 7400 + 250 times the domain and lie below
// 32768: above, Linux gives ports to any socket, which could occupy one of them.
constexpr int kFirstDomain = 60;
constexpr int kLastDomain = 100;

/// A domain that no other run on this machine holds, while the lock lives.
int claim_domain(int wanted, FileLock& lock) {
  const auto claim = [&](int domain) { return lock.take(fmt::format("subworld-domain-{}", domain)); };
  if (wanted >= 0) {
    if (claim(wanted)) return wanted;
    throw Error(ExitCode::middleware,
                fmt::format("domain {} is in use by another run on this machine; choose another --domain, or omit it: "
                            "the first free one is taken",
                            wanted));
  }
  for (int domain = kLastDomain; domain >= kFirstDomain; --domain) {
    if (claim(domain)) return domain;
  }
  throw Error(ExitCode::middleware,
              fmt::format("all domains from {} to {} are in use by other runs; name one with --domain", kFirstDomain,
                          kLastDomain));
}

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
    if (options.budget_limit_ratio)
      flags.insert(flags.end(), {"--budget-limit", fmt::format("{}", *options.budget_limit_ratio)});
    const std::string label = user < 0 ? program : fmt::format("{}_{}", program, user);
    const std::string part = essential ? part_file(options.out, program, user) : "";
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

/// ISO 8601 with the zone.
std::string iso_date(std::time_t time) {
  const std::string text = fmt::format("{:%Y-%m-%dT%H:%M:%S%z}", fmt::localtime(time));
  return text.substr(0, text.size() - 2) + ":" + text.substr(text.size() - 2);  // the minutes of the zone
}

/// Takes a tenth of the run, at most a second, before any program of the run starts.
Calibration measure_machine(const Settings& settings) {
  const double duration_s = std::clamp(0.1 * settings.duration_s, 0.2, 1.0);
  fmt::print("subworld: measuring for {:.1f} s how late this machine wakes a loop without work\n", duration_s);
  std::fflush(stdout);
  const int cores = std::max(1, static_cast<int>(allowed_cores().size()));
  const Calibration found = calibrate(std::min(settings.users, cores), settings.h_s, duration_s);
  const Histogram& late = found.lateness;
  fmt::print(
      "subworld: this machine wakes {} at {:.0f} Hz p99 {:.3f} ms late, at most {:.3f} ms, {} of {} times later than a "
      "period\n",
      found.loops == 1 ? "a bare loop" : fmt::format("{} bare loops", found.loops), 1.0 / found.period_s,
      1e3 * late.quantile_s(0.99), 1e3 * late.max_s(), late.count_above(found.period_s), late.count());
  if (!found.granted.fifo || !found.granted.memory_locked) {
    fmt::print("subworld: warning: without all real-time rights deadlines may be missed: {}\n", found.granted.text);
  }
  std::fflush(stdout);
  return found;
}

/// Lowers the users' budgets to what the cores have left, where they are the scene's.
void share_cores(Options& options, Scene& scene) {
  if (options.budget_ratio || options.budget_limit_ratio) return;
  const std::size_t cores = allowed_cores().size();
  options.budget_limit_ratio = budget_limit_ratio(scene, cores);
  if (limit_budgets(scene, *options.budget_limit_ratio) == 0) return;
  fmt::print("subworld: {} users share {} core{}: budget_ratio at most {:.2g} (--budget and --budget-limit set it)\n",
             scene.users.size(), cores, cores == 1 ? "" : "s", *options.budget_limit_ratio);
}

/// How the programs ended.
struct Ended {
  std::optional<Supervisor::Failure> failure;
  Watchdog::Stall stall;
  int signal = 0;                  ///< that stopped the run; 0: none
  std::string display;             ///< how it died, although that ends no run; empty: it did not
  std::vector<std::string> parts;  ///< files of the results
};

/// Starts the programs, shows how they advance, and stops what is left of them.
Ended run_programs(const RunRequest& request, const Options& options, int domain, RunResults& run) {
  const Scene& scene = run.scene;
  const TimePoint begin = Clock::now();
  const MachineUse use = machine_use();
  Supervisor programs;
  // Of several runs at a time only the first is placed: two worlds must not share one core.
  FileLock first_run;
  if (request.place && first_run.take("subworld-cores")) run.placement = place(scene, allowed_cores());
  start_programs(programs, request, options, scene.settings.users, domain, run.placement);
  Ended ended;
  Watchdog watchdog;
  {
    Network network = options.network;
    network.dds = vendor_of(request.dds, 0);
    network.domain = domain;
    Progress progress(network, scene, watchdog);
    ended.failure = programs.watch(
        [&] { progress(); },
        [&](const Supervisor::Child& child) { return early_end(child.part, scene.settings.duration_s); });
  }
  programs.stop();
  ended.stall = watchdog.longest();
  ended.signal = stop_signal();
  for (const Supervisor::Child& child : programs.children()) {
    if (!child.part.empty()) ended.parts.push_back(child.part);
    if (!child.essential && exit_code_of(child) != 0) ended.display = child.label + " " + end_of(child);
  }
  run.wall_s = to_seconds(Clock::now() - begin);
  run.load = core_load(use, machine_use(), run.wall_s, run.cores);
  collect_trace(programs, options);
  return ended;
}

/// Reads the parts of the results and removes them. False where some are missing after a failure or a signal.
bool collect_parts(RunResults& run, const Options& options, const Ended& ended,
                   const std::optional<Calibration>& calibration) {
  try {
    read_parts(run, options.out, calibration);
  } catch (const Error& wrong) {
    if (ended.signal == 0 && !ended.failure) throw;
  }
  for (const std::string& part : ended.parts) std::filesystem::remove(part);
  return !run.haptic.empty();
}

int report_failure(const Supervisor::Failure& failure, const std::string& folder, RunResults& run) {
  const Supervisor::Child& failed = failure.child;
  const int code = exit_code_of(failed);
  const std::string reason = fmt::format("{} {}", failed.label, failure.reason);
  const std::string error = last_line(failed.log, "error:");
  fmt::print(stderr, "subworld: error: {}; everything else was stopped\n  {}\n  its log: {}\n", reason,
             error.empty() ? last_line(failed.log) : error, failed.log);
  run.verdict = fmt::format("failed: {}{}{}", reason, error.empty() ? "" : ": ", error);
  write_json(folder + "/summary.json", run);
  fmt::print("verdict: {}\n", run.verdict);
  return code >= 1 && code <= 4 ? code : static_cast<int>(ExitCode::failed);
}

/// Prints the missed gates and sets the verdict. Returns why the run is not valid; empty: it is.
std::vector<std::string> judge(RunResults& run, const Ended& ended) {
  const Settings& settings = run.scene.settings;
  run.gates = gates(run);
  for (const Gate& gate : run.gates) {
    if (!gate.ok()) fmt::print("  {}\n", gate.line());
  }
  fmt::print("  {} of {} gates ok (details: `gates` in summary.json)\n", std::ranges::count_if(run.gates, &Gate::ok),
             run.gates.size());
  run.verdict = verdict_of(run.gates, run);
  if (run.simulated_s < settings.duration_s - settings.longest_cycle_s()) {
    const bool ok = std::ranges::none_of(run.gates, &Gate::spoils_verdict);
    run.verdict =
        fmt::format("stopped by {} at t = {:.3f} s{}", ended.signal == 0 ? "control" : name_of_signal(ended.signal),
                    run.simulated_s, ok ? "" : "; until then: " + run.verdict);
  }
  std::vector<std::string> faults = ended.signal == 0 ? faults_of(run) : std::vector<std::string>{};
  if (ended.stall.for_s > 0.0 && run.realtime()) {
    faults.push_back(fmt::format("{} did not advance from t = {:.3f} s for {:.0f} s, although the run was not paused",
                                 ended.stall.label, ended.stall.at_s, ended.stall.for_s));
  }
  if (!faults.empty()) run.verdict = fmt::format("failed: {}", fmt::join(faults, "; "));
  return faults;
}

/// Prints the results of a complete run, judges and writes them. Returns the exit code.
int report(RunResults& run, const Ended& ended, const RunRequest& request, const std::string& folder) {
  print_summary(run);
  const std::vector<std::string> faults = judge(run, ended);
  const std::string picture = folder + "/picture.png";
  const bool pictured = std::filesystem::exists(picture);
  if (!ended.display.empty()) run.display = ended.display;
  write_json(folder + "/summary.json", run);
  fmt::print(
      "state hash {}\nverdict: {}{}\nsummary: {}/summary.json\n", run.state_hash, run.verdict,
      run.display ? fmt::format("; the display failed ({}){}", *run.display, pictured ? "" : ": no picture") : "",
      folder);
  if (request.gui)
    fmt::print("{}\n", pictured ? "picture: " + picture : "no picture: see " + folder + "/logs/gui_headless.log");
  if (request.explain) {
    const bool checkout = std::filesystem::exists("deploy/subworld");
    fmt::print("{}", explanation(run, folder, pictured, checkout ? "deploy/subworld" : "subworld"));
  }
  if (!faults.empty()) return static_cast<int>(ExitCode::failed);
  const std::vector<std::string> strict = request.strict ? missed_strictly(run.gates) : std::vector<std::string>{};
  if (strict.empty() || ended.signal != 0) return static_cast<int>(ExitCode::done);
  fmt::print("subworld: exit code 4: --strict counts {}\n", fmt::join(strict, ", "));
  return static_cast<int>(ExitCode::quality);
}

}  // namespace

std::string program_folder() { return std::filesystem::read_symlink("/proc/self/exe").parent_path().string(); }

int run(const RunRequest& request) {
  end_at_stop_signals();
  Options options = request.options;
  RunResults run;
  run.scene = load_scene(options);
  const Settings& settings = run.scene.settings;
  check_request(run.scene, request);
  for (const int position : {0, 1}) {  // with mixed, both vendors
    Network network = options.network;
    network.dds = vendor_of(request.dds, position);
    check_network(network);
  }
  FileLock folder, domain_lock;
  claim_folder(options.out, run.scene.name, folder);
  if (!options.trace.empty()) {
    merge_traces({}, options.trace);  // an unwritable file is an error before anything runs
    make_folder(options.out + "/trace");
  }
  const int domain = claim_domain(request.domain, domain_lock);
  fmt::print("subworld: {} in {}, {} s, domain {}, results in {}\n", run.scene.file,
             run.realtime() ? "real time" : "lock-step", settings.duration_s, domain, options.out);
  if (settings.users > 1) fmt::print("subworld: {} users; {}\n", settings.users, user_limit(domain));
  if (run.realtime()) share_cores(options, run.scene);
  run.command_line = request.command_line;
  run.date = iso_date(std::time(nullptr));
  run.dds = request.dds;
  std::optional<Calibration> calibration;
  if (run.realtime()) calibration = measure_machine(settings);

  watch_stop_signals();
  const Ended ended = run_programs(request, options, domain, run);
  const bool complete = collect_parts(run, options, ended, calibration);
  if (ended.failure) return report_failure(*ended.failure, options.out, run);
  if (complete) return report(run, ended, request, options.out);
  run.verdict = "stopped by " + name_of_signal(ended.signal);
  write_json(options.out + "/summary.json", run);
  fmt::print("subworld: {}; results so far in {}\n", run.verdict, options.out);
  return static_cast<int>(ExitCode::done);
}

}  // namespace subworld
