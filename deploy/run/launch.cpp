#include "run/launch.hpp"

#include "io/trace.hpp"
#include "judge/ends.hpp"
#include "judge/report.hpp"
#include "judge/summary.hpp"
#include "model/error.hpp"
#include "plan/limits.hpp"
#include "record/recording.hpp"
#include "rt/calibration.hpp"
#include "rt/cyclic.hpp"
#include "rt/kernel_share.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "run/claim.hpp"
#include "run/file_lock.hpp"
#include "run/keeper.hpp"
#include "run/page.hpp"
#include "run/placement.hpp"
#include "run/supervise.hpp"
#include "tools.hpp"
#include "watch/progress.hpp"
#include "watch/watchdog.hpp"
#include "wire/bus.hpp"
#include "wire/last_messages.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <filesystem>
#include <iterator>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

namespace subworld {

namespace {

constexpr std::size_t kSummary_bytes = 1 << 16, kUser_bytes = 1 << 14;  // at most, about

/// File of a program's part of the trace, until the parts are merged.
std::string trace_part(const std::string& folder, const std::string& label) {
  return fmt::format("{}/trace/{}.json", folder, label);
}

/// Makes one trace of all programs' parts.
void collect_trace(const Options& options) {
  if (options.trace.empty()) return;
  std::vector<std::string> parts;
  for (const auto& entry : std::filesystem::directory_iterator(options.out + "/trace")) parts.push_back(entry.path());
  std::ranges::sort(parts);
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

void start_programs(Supervisor& programs, const RunRequest& request, const Options& options, const Settings& settings,
                    int domain, const Placement& placement, const MessageMemory& messages, const Recording* recording) {
  const std::string folder = program_folder();
  int position = 0;
  const auto start = [&](const std::string& program, int user, bool essential) {
    std::vector<std::string> flags = flags_of(options);
    flags.insert(flags.end(), {"--domain", std::to_string(domain), "--dds", vendor_of(request.dds, position++)});
    const std::string label = user < 0 ? program : fmt::format("{}_{}", program, user);
    const std::string part = essential ? part_file(options.out, program, user) : "";
    if (user >= 0) flags.insert(flags.end(), {"--user", std::to_string(user)});
    if (!options.trace.empty() && program != "gui_headless")
      flags.insert(flags.end(), {"--trace", trace_part(options.out, label)});
    if (request.gui && program == "world_sim") flags.emplace_back("--await-display");
    std::ranges::move(own_flags_of(options, program, user), std::back_inserter(flags));
    if (const std::vector<int>& cores = placement.of(program); !cores.empty() && !is_placed_by_hand(program))
      flags.insert(flags.end(), {"--core", to_text(cores)});
    // A world that is started again goes on from its own newest checkpoint, as soon as there is one.
    const auto again = [flags, options] { return resumed(flags, options.out, options.resume); };
    if (program == "world_sim" && !options.resume.empty()) flags.insert(flags.end(), {"--resume", options.resume});
    const int place = place_of_messages(program, user);
    programs.start(
        {.label = label,
         .log = fmt::format("{}/logs/{}.log", options.out, label),
         .recording = recording == nullptr ? "" : recording->memory().place_of(static_cast<std::size_t>(place)),
         .messages = messages.place_of(place),
         .part = part,
         .essential = essential,
         .shows_verdict = program == "gui_headless" && options.live.port.has_value(),
         .arguments_again = program == "world_sim" ? std::function(again) : nullptr,
         .may_restart = may_restart(settings, user),
         .returns = user < 0 ? 0 : returns(settings.presence, user)},
        folder + "/" + program, flags);
  };
  start("world_sim", -1, true);
  const int users = settings.users;
  for (int u = 0; u < users; ++u) {
    if (std::ranges::find(options.without, u) == options.without.end()) {
      start("haptic_sim", u, true);
      start("device_sim", u, true);
    } else {
      position += 2;
    }
    if (users > 1) ++position;  // with mixed, users have different pairs of vendors
  }
  if (request.gui) start("gui_headless", -1, false);
}

std::string viewers_text(const LiveOptions& live) {
  if (*live.port == 0) return "logs/gui_headless.log has the address";
  const bool v6 = live.address.find(':') != std::string::npos;
  return fmt::format("open ws://{}:{} in Lichtblick or Foxglove", v6 ? "[" + live.address + "]" : live.address,
                     *live.port);
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

/// A run replaces the results in its folder: not those that it goes on from.
void check_resume(const Options& options) {
  if (options.resume.empty()) return;
  std::error_code none;
  const std::filesystem::path from = options.resume;
  if (!std::filesystem::exists(from, none))
    throw Error(ExitCode::usage, fmt::format("--resume {}: does not exist; name a folder of results, or a checkpoint "
                                             "in it",
                                             options.resume));
  const std::filesystem::path folder =
      std::filesystem::is_directory(from, none) ? from : from.parent_path() / std::filesystem::path(".");
  if (options.out.empty() || !std::filesystem::equivalent(folder, options.out, none)) return;
  throw Error(ExitCode::usage, fmt::format("--out {}: holds the run that --resume goes on from, and would be replaced; "
                                           "choose another folder",
                                           options.out));
}

/// Lowers the users' budgets to what the cores have left, where they are the scene's.
void share_cores(Options& options, Scene& scene) {
  if (!flag_of(options, "users.budget_ratio").empty()) return;
  const std::size_t cores = allowed_cores().size();
  const double most = budget_limit_ratio(scene, cores);
  for (std::size_t u = 0; u < scene.users.size(); ++u) {
    UserSpec& user = scene.users[u];
    if (user.selection != Selection::budget || user.budget_ratio <= most) continue;
    user.budget_ratio = most;
    change(options, fmt::format("users[{}].budget_ratio", u), fmt::format("{}", most));
  }
  if (flag_of(options, "users.budget_ratio").empty()) return;
  fmt::print("subworld: {} users share {} core{}: budget_ratio at most {:.2g} (--set users.budget_ratio sets it)\n",
             scene.users.size(), cores, cores == 1 ? "" : "s", most);
}

/// What is measured of the programs from outside, since the begin.
struct Outside {
  TimePoint begin = Clock::now();
  MachineUse use = machine_use();

  void measure(RunResults& run) const {
    run.wall_s = to_seconds(Clock::now() - begin);
    run.load = core_load(use, machine_use(), run.wall_s, run.cores);
  }
};

/// Starts the programs, shows how they advance, and stops what is left of them. A display may wait for the verdict.
Ended run_programs(Supervisor& programs, const RunRequest& request, const Options& options, int domain, RunResults& run,
                   const MessageMemory& messages, const Recording* recording) {
  const Scene& scene = run.scene;
  start_programs(programs, request, options, scene.settings, domain, run.placement, messages, recording);
  std::optional<Supervisor::Failure> failure;
  Watchdog watchdog;
  PageOpener open_page(options.live, request.page);
  {
    Network network = options.network;
    network.dds = vendor_of(request.dds, 0);
    network.domain = domain;
    Progress progress(network, scene, watchdog);
    failure = programs.watch(
        [&] {
          progress();
          open_page();
        },
        [&](const Supervisor::Child& child) { return early_end(child.part, scene.settings.duration_s); });
  }
  const Ended ended = end(programs, std::move(failure), watchdog);
  run.restarts = programs.restarts();
  return ended;
}

}  // namespace

std::string vendor_of(const std::string& dds, int position) {
  if (dds != "mixed") return dds;
  return position % 2 == 0 ? "fastdds" : "cyclonedds";
}

std::vector<std::string> resumed(std::vector<std::string> flags, const std::string& folder,
                                 const std::string& otherwise) {
  const auto there = [&](int number) {
    return std::filesystem::exists(fmt::format("{}/world_{}.checkpoint", folder, number));
  };
  const std::string from = there(0) || there(1) ? folder : otherwise;
  if (!from.empty()) flags.insert(flags.end(), {"--resume", from});
  return flags;
}

int run(const RunRequest& request) {
  end_at_stop_signals();
  raise_open_files();
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
  check_resume(options);
  check_without(options, run.scene);
  if (request.page) choose_page_port(options.live);
  FileLock folder, domain_lock;
  claim_folder(options.out, run.scene.name, folder);
  const ReservedFile space(options.out + "/summary.json", kSummary_bytes + kUser_bytes * run.scene.users.size());
  if (!options.trace.empty()) {
    merge_traces({}, options.trace);  // an unwritable file is an error before anything runs
    make_folder(options.out + "/trace");
  }
  std::unique_ptr<Recording> recording;
  if (!options.record.empty()) {
    recording =
        std::make_unique<Recording>(options.record, run.scene, settings_flags_of(options), request.dds, request.gui);
  }
  const int domain = claim_domain(request.domain, domain_lock);
  fmt::print("subworld: {} in {}, {} s, domain {}, results in {}\n", run.scene.file,
             run.realtime() ? "real time" : "lock-step", settings.duration_s, domain, options.out);
  if (request.page) fmt::print("subworld: page: {}\n", page_address(options.live));
  if (options.live.port) fmt::print("subworld: viewers: {}\n", viewers_text(options.live));
  if (settings.users > 1) fmt::print("subworld: {} users; {}\n", settings.users, user_limit(domain));
  if (run.realtime()) share_cores(options, run.scene);
  run.command_line = request.command_line;
  run.date = date_of_now();
  run.dds = request.dds;
  std::optional<Calibration> calibration;
  if (run.realtime()) calibration = measure_machine(settings);

  // Of several runs at a time only the first is placed: two worlds must not share one core.
  FileLock first_run;
  if (request.place && first_run.take("subworld-cores") == 0) run.placement = place(run.scene, allowed_cores());
  watch_stop_signals();
  const Outside outside;
  const MessageMemory messages(places_of_messages(settings.users));
  const Keeper keeper([&](const std::vector<Restarted>& restarts) {
    run.restarts = restarts;
    outside.measure(run);
    collect_trace(options);
    conclude_orphaned(run, request, options.out, calibration);
    write_last_messages(run, messages, options.out);
  });
  if (recording) recording->start();
  Supervisor programs(request.restart, keeper);
  const Ended ended = run_programs(programs, request, options, domain, run, messages, recording.get());
  if (recording) run.recording = recording->drain();
  outside.measure(run);
  collect_trace(options);
  const int code = conclude_run(run, ended, request, options.out, calibration);
  programs.announce_verdict();
  write_last_messages(run, messages, options.out);
  if (recording) recording->finish(options.out + "/summary.json");
  return code;
}

}  // namespace subworld
