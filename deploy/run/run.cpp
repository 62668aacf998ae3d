#include "run/run.hpp"

#include "io/records/trace.hpp"
#include "io/results/output.hpp"
#include "judge/ends.hpp"
#include "judge/report.hpp"
#include "link/network.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "plan/limits.hpp"
#include "record/recording.hpp"
#include "rt/cyclic.hpp"
#include "rt/kernel_share.hpp"
#include "rt/scheduling.hpp"
#include "rt/stop.hpp"
#include "run/claim.hpp"
#include "run/page.hpp"
#include "run/run_plan.hpp"
#include "session/collect.hpp"
#include "watch/progress.hpp"
#include "wire/plugin.hpp"

#include <fmt/core.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

namespace subworld {

namespace {

constexpr std::size_t kSummary_bytes = 1 << 16, kUser_bytes = 1 << 14;  // at most, about

constexpr const char* kCoresLock = "subworld-cores";

std::string viewers_text(const LiveOptions& live) {
  if (*live.port == 0) return "logs/gui_headless.log has the address";
  return fmt::format("open ws://{} in Lichtblick or Foxglove", own_address(live.address, *live.port));
}

/// One run, from its plan to its verdict. Hosts differ only in how a program starts there.
class Run {
 public:
  Run(RunPlan plan, Scene scene) : plan_(std::move(plan)) {
    run_.scene = std::move(scene);
    run_.command_line = request_.command_line;
    run_.date = date_of_now();
    run_.dds = request_.dds;
    run_.session = session_.file;
    run_.between_hosts = session_.hosts.size() > 1;
  }

  /// Returns the exit code.
  int operator()() {
    claim();
    print_heading();
    make_hosts();
    record_hosts();
    if (plan_.all_here() && run_.realtime()) use_machine();
    watch_stop_signals();
    begin_ = Clock::now();
    use_ = machine_use();
    if (plan_.all_here()) run_.quota = cpu_quota();
    const Keeper keeper([&](const std::vector<Restarted>& restarts) {
      run_.restarts = restarts;
      Ended ended;
      ended.orphaned = true;
      (void)conclude(std::move(ended));
    });
    if (recording_) recording_->start();
    Supervisor programs(request_.restart, keeper, reports());
    const int code = conclude(execute(programs));
    programs.await_display();
    if (recording_) recording_->finish(out() + "/summary.json");
    return code;
  }

 private:
  [[nodiscard]] const std::string& out() const { return request_.options.out; }
  [[nodiscard]] const LiveOptions& live() const { return request_.options.live; }

  /// Reserves what no other run may use, and the files of the results.
  void claim() {
    Options& options = request_.options;
    check_outputs(options);
    // Network namespaces have ports of their own, and hosts that are started one by one share the domain.
    const auto distant = [&](const SessionHost& host) { return plan_.is_distant(host); };
    if (!request_.namespaces && request_.host.empty() && !std::ranges::all_of(session_.hosts, distant))
      session_.domain = claim_domain(session_.domain, domain_claim_);
    if (session_.domain == request_.ros_domain)
      throw Error(ExitCode::usage, fmt::format("--ros2 {}: is the domain of the run; choose another for one of the two",
                                               request_.ros_domain));
    claim_folder(options.out, session_.name, folder_claim_);
    std::filesystem::remove_all(out() + "/hosts");
    if (request_.host.empty())
      space_.emplace(out() + "/summary.json", kSummary_bytes + kUser_bytes * run_.scene.users.size());
    // An unwritable file is an error before anything runs. A writable one stays until the end.
    if (!options.trace.empty() && access(options.trace.c_str(), W_OK) != 0) merge_traces({}, options.trace);
    const bool records = !options.record.empty();
    messages_.emplace(sizes_of_messages(run_.scene, request_.gui, records),
                      MessageMemory::Config{.recorded = records, .waits = records && !run_.realtime()});
    if (records) recording_ = std::make_unique<Recording>(options.record, recorded(), *messages_);
  }

  void print_heading() const {
    const Settings& settings = run_.scene.settings;
    const bool one_host = !session_.has_file();
    fmt::print("subworld: {}{} in {}, {} s, {}domain {}, results in {}\n",
               one_host ? "" : fmt::format("session {}: ", session_.name), run_.scene.file,
               run_.realtime() ? "real time" : "lock-step", settings.duration_s,
               one_host ? "" : fmt::format("{} hosts, ", session_.hosts.size()), session_.domain, out());
    if (request_.page) fmt::print("subworld: page: {}\n", page_address(live()));
    if (request_.ros_domain >= 0)
      fmt::print("subworld: ROS 2: domain {}, its log is {}/logs/ros2.log{}\n", request_.ros_domain, out(),
                 request_.options.network.secure.empty() ? "" : "; what is published there has no keys");
    if (live().port && one_host) fmt::print("subworld: viewers: {}\n", viewers_text(live()));
    if (settings.users > 1 && one_host)
      fmt::print("subworld: {} users; {}\n", settings.users, user_limit(session_.domain));
  }

  void make_hosts() {
    if (request_.namespaces) network_ = make_namespaces(session_, request_, run_.link.emplace());
    // As the programs have it, from their --peers.
    const auto remote = [](const SessionHost& one) { return is_remote(one.address); };
    if (run_.between_hosts) run_.scene.settings.remote = std::ranges::any_of(session_.hosts, remote);
    if (run_.scene.settings.remote && request_.options.network.secure.empty())
      fmt::print(
          "subworld: not secured: whoever reaches the network can stop this run and move its devices; see "
          "--secure\n");
    for (std::size_t i = 0; i < session_.hosts.size(); ++i) {
      const SessionHost& host = session_.hosts[i];
      if (!request_.host.empty() && host.name != request_.host) continue;
      const std::string folder = session_.has_file() ? out() + "/hosts/" + host.name : out();
      make_folder(folder);
      if (plan_.is_distant(host)) {
        hosts_.push_back(std::make_unique<DistantHost>(host, folder, request_.ssh, session_.file));
      } else {
        hosts_.push_back(
            std::make_unique<Host>(host, folder, network_ ? &network_->host(static_cast<int>(i)) : nullptr));
      }
      if (session_.has_file()) run_.hosts.push_back(hosts_.back()->clock());
    }
  }

  [[nodiscard]] RecordedRun recorded() const {
    return {run_.scene, settings_flags_of(request_.options), request_.dds, request_.gui, json_text(run_, 2), out()};
  }
  /// The programs of this machine inherit the memory of the recording. Other hosts record theirs.
  void record_hosts() {
    if (!recording_ || plan_.all_here()) return;
    recording_->divide(out() + "/hosts/" + kRecordingPart, recorded());
    std::vector<std::string> flags = settings_flags_of(request_.options);
    if (request_.gui) flags.emplace_back("--gui");
    for (const auto& host : hosts_) host->start_recorder(flags);
  }
  void collect_recording() {
    std::vector<RecordingPart> parts;
    for (std::size_t i = 0; i < hosts_.size(); ++i) {
      if (!hosts_[i]->is_here())
        parts.push_back({hosts_[i]->plan().name, hosts_[i]->folder_here() + "/" + kRecordingPart,
                         run_.hosts[i].offset_s.value_or(0.0)});
    }
    run_.recording = recording_->drain(parts);
    for (const RecordingPart& part : parts) std::filesystem::remove(part.file);
    std::filesystem::remove(out() + "/hosts/" + kRecordingPart);
  }

  void use_machine() {
    share_cores(request_.options, run_.scene);
    calibration_ = measure_machine(run_.scene.settings);
    // Of several runs at a time only the first is placed: two worlds must not share one core.
    const int error = request_.place ? cores_claim_.take_file(kCoresLock) : EWOULDBLOCK;
    const double keys_s = request_.options.network.secure.empty() ? 0.0
                          : request_.dds == "fastdds"             ? kFastKeys_s
                                                                  : kCycloneKeys_s;
    if (error == 0) plan_.placement = run_.placement = place(run_.scene, allowed_cores(), keys_s);
    share_steps(request_.options, run_.scene, run_.placement);
    if (error != 0 && error != EWOULDBLOCK)
      fmt::print(
          "subworld: warning: the programs get no cores of their own: {}/{}.lock: {}; set TMPDIR to a folder of "
          "your own\n",
          temporary_folder(), kCoresLock, std::strerror(error));
  }

  [[nodiscard]] ProgramReports reports() {
    return {.early = [&](const auto& part) { return early_end(part, run_.scene.settings.duration_s); },
            .run_is_over = [&] { return run_is_over(); },
            .awaits_verdict = [&] { return progress_ && progress_->awaits_verdict(); }};
  }

  /// By the word of the world, or by its results.
  [[nodiscard]] bool run_is_over() const {
    const auto ended = [](const auto& host) { return host->plan().runs({"world_sim"}) && host->has_ended_world(); };
    return progress_ ? progress_->run_is_over() : std::ranges::any_of(hosts_, ended);
  }

  /// Starts the programs, shows how they advance, and stops what is left of them. A display may wait for the verdict.
  Ended execute(Supervisor& programs) {
    plan_.each_program([&](const RunProgram& program, const std::string& vendor) {
      for (const auto& host : hosts_) {
        if (host->plan().runs(program) && plan_.starts(program))
          programs.start(supervised(*host, program, host->plan().dds.empty() ? vendor : host->plan().dds));
      }
    });
    if (request_.ros_domain >= 0) {
      const auto command = [&](bool) { return plan_.ros2(); };
      programs.start({.label = "ros2", .log = out() + "/logs/ros2.log", .command = command, .essential = false});
    }
    Watchdog watchdog;
    show_progress(watchdog);
    PageOpener open_page(live(), request_.page);
    auto failure = programs.watch([&] {
      if (progress_) (*progress_)();
      open_page();
    });
    Ended ended = end(programs, std::move(failure), watchdog);
    progress_.reset();
    run_.restarts = programs.restarts();
    return ended;
  }

  [[nodiscard]] SupervisedProgram supervised(const Host& host, const RunProgram& program, const std::string& vendor) {
    const bool display = program.name == "gui_headless";
    const auto command = [&host, program, flags = plan_.flags_of(host, program, vendor)](bool again) {
      return host.command(program, flags, again);
    };
    SupervisedProgram one{.label = program.label(),
                          .host = host.plan().name,
                          .log = fmt::format("{}/logs/{}.log", out(), program.label()),
                          .part = display ? "" : part_file(host.folder_here(), program.name, program.user),
                          .command = command,
                          .essential = !display,
                          .may_restart = program.user >= 0 || run_.realtime(),
                          .returns = program.user < 0 ? 0 : returns(run_.scene.settings.presence, program.user)};
    const auto set = [&](const char* variable, const std::string& value) {
      if (!value.empty()) one.environment[variable] = value;
    };
    set(MessageMemory::kVariable, messages_->place_of(place_of_messages(program.name, program.user)));
    if (display && live().port && request_.host.empty()) set(kVerdictVariable, out() + "/summary.json");
    // On its command line others could read the token.
    if (display) set(kTokenVariable, live().token);
    return one;
  }

  /// Live progress needs a host on this machine.
  void show_progress(Watchdog& watchdog) {
    const auto here = std::ranges::find_if(hosts_, [](const auto& host) { return host->is_here(); });
    if (here == hosts_.end()) {
      fmt::print("subworld: no host of the session is on this machine: no live progress\n");
      return;
    }
    const Network network = plan_.network_of((*here)->plan());
    (*here)->inside([&] { progress_ = std::make_unique<Progress>(network, run_.scene, watchdog); });
  }

  /// Brings all results together and judges them. Returns the exit code.
  int conclude(Ended ended) {
    run_.wall_s = to_seconds(Clock::now() - begin_);
    if (plan_.all_here()) run_.load = core_load(use_, machine_use(), run_.wall_s, run_.cores);
    for (const auto& host : hosts_) host->fetch();
    collect_trace();
    if (recording_ && !ended.orphaned) collect_recording();
    if (!request_.host.empty()) return ended.orphaned ? 0 : report_share(ended);
    if (session_.has_file()) merge_results({out() + "/hosts"}, out());
    if (ended.orphaned && std::filesystem::exists(out() + "/summary.json")) return 0;
    ended.parts = plan_.parts();
    const int code = conclude_run(run_, ended, request_, out(), calibration_);
    write_last_messages(run_, *messages_, out());
    return code;
  }

  /// Makes one trace of all programs' parts.
  void collect_trace() const {
    const std::string& file = request_.options.trace;
    if (file.empty()) return;
    std::vector<TracePart> parts;
    for (std::size_t i = 0; i < hosts_.size(); ++i) {
      const std::optional<double> ahead_s = hosts_[i]->is_here() ? std::nullopt : run_.hosts[i].offset_s;
      for (const RunProgram& program : hosts_[i]->plan().programs)
        parts.push_back({trace_part(hosts_[i]->folder_here(), program), ahead_s});
    }
    merge_traces(parts, file);
    for (const TracePart& part : parts) std::filesystem::remove(part.file);
    fmt::print("subworld: trace in {}; open it with ui.perfetto.dev, chrome://tracing or speedscope\n", file);
  }

  /// Of one host there is no verdict.
  [[nodiscard]] int report_share(const Ended& ended) const {
    if (ended.failure) {
      const Supervisor::Child& failed = ended.failure->child;
      fmt::print(stderr, "subworld: error: {} {}; its log: {}\n", failed.program.name(), ended.failure->reason,
                 failed.program.log);
      return exit_code_after(failed);
    }
    fmt::print(
        "results of host {}: {}\nthe verdict needs those of all hosts: copy them to one machine, then run\n"
        "  subworld collect DIR...\n",
        request_.host, hosts_.front()->folder_here());
    return static_cast<int>(ExitCode::done);
  }

  RunPlan plan_;
  RunRequest& request_ = plan_.request;
  Session& session_ = plan_.session;
  RunResults run_;
  Claim folder_claim_, domain_claim_, cores_claim_;
  std::optional<ReservedFile> space_;
  std::unique_ptr<EmulatedNetwork> network_;  ///< with --namespaces
  std::vector<std::unique_ptr<Host>> hosts_;
  std::optional<MessageMemory> messages_;
  std::unique_ptr<Recording> recording_;
  std::optional<Calibration> calibration_;
  std::unique_ptr<Progress> progress_;
  TimePoint begin_;
  MachineUse use_;
};

/// Throws `Error` (failed) where the limit of the shell is too low for any run. Its libraries would fail by a signal.
void check_memory() {
  constexpr rlim_t kLeast = 200U << 20U;
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) == 0 && limit.rlim_cur < kLeast)
    throw Error(ExitCode::failed, "there is too little memory" + memory_limit_text());
}

}  // namespace

int run(const RunRequest& request) {
  end_at_stop_signals();
  raise_open_files();
  check_memory();
  if (const auto ignored = wire::ignore_variables(); !ignored.empty())
    fmt::print("subworld: ignored: {}; the programs find each other by --peers, or by the settings of --qos\n",
               joined(ignored, ", "));
  Scene scene;
  RunPlan plan = plan_run(request, scene);
  return Run(std::move(plan), std::move(scene))();
}

}  // namespace subworld
