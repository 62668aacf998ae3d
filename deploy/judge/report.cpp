#include "judge/report.hpp"

#include "io/ending.hpp"
#include "io/results/json.hpp"
#include "io/results/output.hpp"
#include "judge/ends.hpp"
#include "judge/explain.hpp"
#include "judge/gates.hpp"
#include "judge/salvage.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "rt/stop.hpp"
#include "wire/last_messages.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <string_view>
#include <utility>

namespace subworld {

namespace {

std::string last_line(const std::string& path, std::string_view holding = {}) {
  std::ifstream file(path);
  std::string line, last;
  while (std::getline(file, line)) {
    if (!line.empty() && line.find(holding) != std::string::npos) last = line.substr(line.rfind('\r') + 1);
  }
  return last;
}

/// Names the parts that do not exist.
std::string missing_text(const std::vector<std::string>& parts) {
  std::vector<std::string> missing;
  for (const std::string& part : parts) {
    if (!std::filesystem::exists(part)) missing.push_back(program_of_part(part));
  }
  return joined(missing, ", ");
}

/// What checkpoints mean for the verdict.
std::string checkpoint_remark(const WorldResult& world) {
  std::string text;
  if (world.resumed_from_s) text += fmt::format("; resumed from t = {:.3f} s", *world.resumed_from_s);
  if (world.checkpoints && world.checkpoints->failed > 0) {
    text += fmt::format("; {} of {} checkpoints could not be written{}{}", world.checkpoints->failed,
                        world.checkpoints->failed + world.checkpoints->written,
                        world.checkpoints->fault.empty() ? "" : ": ", world.checkpoints->fault);
  }
  return text;
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
    run.verdict = fmt::format("stopped by {} at t = {:.3f} s{}",
                              ended.signal != 0                      ? name_of_signal(ended.signal)
                              : run.ending.by.starts_with("control") ? run.ending.by
                                                                     : "control",
                              run.simulated_s, run.verdict == "ok" ? "" : "; until then: " + run.verdict);
  }
  run.verdict += checkpoint_remark(run.world);
  std::vector<std::string> faults = ended.signal == 0 ? faults_of(run) : std::vector<std::string>{};
  if (ended.stall.for_s > 0.0 && run.realtime()) {
    faults.push_back(fmt::format("{} did not advance from t = {:.3f} s for {:.0f} s, although the run was not paused",
                                 ended.stall.label, ended.stall.at_s, ended.stall.for_s));
  }
  if (ended.orphaned && run.ending.by.starts_with("SIG")) {
    faults = {fmt::format("the launcher was killed at t = {:.3f} of {:g} s; its programs ended in order",
                          run.simulated_s, settings.duration_s)};
  }
  if (!faults.empty()) run.verdict = fmt::format("failed: {}", joined(faults, "; "));
  return faults;
}

/// The fault that a program names in its part of the results.
std::string fault_in(const std::string& part) {
  try {
    return part.empty() ? "" : read_json(part).at("ending").get<Ending>().fault;
  } catch (const Error&) {
    return {};
  }
}

/// Writes the summary, and removes the parts of the results that are in it.
void write_summary(const RunResults& run, const Ended& ended, const std::string& folder) {
  write_json(folder + "/summary.json", run);
  for (const std::string& part : ended.parts) {
    std::filesystem::remove(part);
    std::filesystem::remove(part + ".part");  // of a killed program
  }
}

int report_failure(const Ended& ended, const std::string& folder, RunResults& run) {
  const Supervisor::Failure& failure = *ended.failure;
  const Supervisor::Child& failed = failure.child;
  const SupervisedProgram& program = failed.program;
  const std::string reason = fmt::format("{} {}", program.name(), failure.reason);
  // On a full disk the log is not complete.
  const std::string fault = fault_in(program.part);
  const std::string error = fault.empty() ? last_line(program.log, "error:") : fault;
  fmt::print(stderr, "subworld: error: {}; everything else was stopped\n  {}\n  its log: {}\n", reason,
             error.empty() ? last_line(program.log) : error, program.log);
  run.verdict = fmt::format("failed: {}{}{}", reason, error.empty() ? "" : ": ", error);
  fmt::print("verdict: {}\n", run.verdict);
  std::fflush(stdout);
  write_summary(run, ended, folder);
  fmt::print("summary: {}/summary.json, with what was measured until then\n", folder);
  return exit_code_after(failed);
}

int report(RunResults& run, const Ended& ended, const RunRequest& request, const std::string& folder) {
  print_summary(run);
  const std::vector<std::string> faults = judge(run, ended);
  const std::string picture = folder + "/picture.png";
  const bool pictured = std::filesystem::exists(picture);
  if (!ended.display.empty()) run.display = ended.display;
  const bool of_ros = run.display && run.display->starts_with("ros2");
  // The files come last: the disk may be full.
  fmt::print("state hash {}\nverdict: {}{}\n", run.state_hash, run.verdict,
             of_ros        ? fmt::format("; {}: see logs/ros2.log", *run.display)
             : run.display ? fmt::format("; the display failed ({}){}", *run.display, pictured ? "" : ": no picture")
                           : "");
  std::fflush(stdout);
  write_summary(run, ended, folder);
  fmt::print("summary: {}/summary.json\n", folder);
  if (request.gui)
    fmt::print("{}\n", pictured ? "picture: " + picture : "no picture: see " + folder + "/logs/gui_headless.log");
  if (request.explain) {
    const bool checkout = std::filesystem::exists("deploy/subworld");
    fmt::print("{}", explanation(run, folder, pictured, checkout ? "deploy/subworld" : "subworld"));
  }
  if (!faults.empty()) return static_cast<int>(ExitCode::failed);
  const std::vector<std::string> strict = request.strict ? missed_strictly(run.gates) : std::vector<std::string>{};
  if (strict.empty() || ended.signal != 0) return static_cast<int>(ExitCode::done);
  fmt::print("subworld: exit code 4: --strict counts {}\n", joined(strict, ", "));
  return static_cast<int>(ExitCode::quality);
}

/// Reads the parts of the results. False where some are missing or not sound.
bool collect_parts(RunResults& run, const std::string& folder, const std::optional<Calibration>& calibration) {
  try {
    read_parts(run, folder, calibration);
    return true;
  } catch (const std::exception&) {
    static_cast<WorldPart&>(run) = {};
    run.haptic.clear();
    run.device.clear();
    return false;
  }
}

/// A run without an orderly end and without a failed program.
int report_partial(RunResults& run, const Ended& ended, const std::string& folder) {
  run.verdict = ended.signal != 0
                    ? "stopped by " + name_of_signal(ended.signal)
                    : fmt::format("failed: no results of {}: killed, or they could not be written{}",
                                  missing_text(ended.parts), ended.orphaned ? "; the launcher was killed" : "");
  fmt::print("verdict: {}\n", run.verdict);
  std::fflush(stdout);
  write_summary(run, ended, folder);
  fmt::print("subworld: results so far in {}\n", folder);
  return static_cast<int>(ended.signal != 0 ? ExitCode::done : ExitCode::failed);
}

}  // namespace

Ended end(Supervisor& programs, std::optional<Supervisor::Failure> failure, const Watchdog& watchdog) {
  // A display that has not ended by itself did not fail.
  Ended ended;
  for (const Supervisor::Child& child : programs.children()) {
    if (child.program.essential) continue;
    if (child.process.pid < 0 && exit_code_of(child) != 0) ended.display = child.program.name() + " " + end_of(child);
    if (child.process.pid > 0 && child.process.halted) ended.display = child.program.name() + " is halted";
  }
  programs.stop();
  ended.failure = std::move(failure);
  ended.stall = watchdog.longest();
  ended.signal = stop_signal();
  return ended;
}

int exit_code_after(const Supervisor::Child& failed) {
  const int code = exit_code_of(failed);
  return code >= 1 && code <= 4 ? code : static_cast<int>(ExitCode::failed);
}

int conclude_run(RunResults& run, const Ended& ended, const RunRequest& request, const std::string& folder,
                 const std::optional<Calibration>& calibration) {
  const bool complete = collect_parts(run, folder, calibration);
  run.partial = !complete || ended.failure;
  if (!complete) run.salvaged = salvage(folder, run.scene.settings.users);
  if (ended.failure) return report_failure(ended, folder, run);
  return complete ? report(run, ended, request, folder) : report_partial(run, ended, folder);
}

std::vector<std::string> parts_of(const std::string& folder, int users) {
  std::vector<std::string> parts{part_file(folder, "world_sim", -1)};
  for (int user = 0; user < users; ++user) {
    for (const char* program : {"haptic_sim", "device_sim"}) parts.push_back(part_file(folder, program, user));
  }
  return parts;
}

void write_last_messages(const RunResults& run, const MessageMemory& messages, const std::string& folder) {
  if (!run.verdict.starts_with("failed")) return;
  const auto write = [&](const std::string& program, int user) {
    const std::string label = user < 0 ? program : fmt::format("{}_{}", program, user);
    const std::string fault = write_last_messages(messages.last_of(place_of_messages(program, user)),
                                                  fmt::format("{}/logs/last_{}.csv", folder, label));
    if (!fault.empty()) fmt::print(stderr, "subworld: warning: no last messages of {}: {}\n", label, fault);
  };
  for (const char* program : {"world_sim", "gui_headless"}) write(program, -1);
  for (int user = 0; user < run.scene.settings.users; ++user) {
    for (const char* program : {"haptic_sim", "device_sim"}) write(program, user);
  }
  fmt::print("subworld: the last messages of each program: {}/logs/last_*.csv\n", folder);
}

std::string date_of_now() {
  const std::string text = local_time("%Y-%m-%dT%H:%M:%S%z");
  return text.substr(0, text.size() - 2) + ":" + text.substr(text.size() - 2);  // the minutes of the zone
}

}  // namespace subworld
