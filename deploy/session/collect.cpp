#include "session/collect.hpp"

#include "io/results/json.hpp"
#include "judge/report.hpp"
#include "model/error.hpp"
#include "run/claim.hpp"

#include <fmt/core.h>
#include <fnmatch.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>

namespace subworld {

namespace fs = std::filesystem;

namespace {

constexpr const char* kResults = "@(@(world|haptic_+([0-9])|device_+([0-9])).@(json|csv)|bodies.csv|picture.png)";

/// The vendor that all programs used, or "mixed".
std::string vendors_of(const std::string& folder, int users) {
  std::set<std::string> vendors;
  for (const std::string& part : parts_of(folder, users)) {
    if (!fs::exists(part)) continue;
    const Json json = read_json(part);
    const std::string text = (json.contains("world") ? json.at("world") : json).at("dds");
    vendors.insert(text.find("cyclonedds") == std::string::npos ? "fastdds" : "cyclonedds");
  }
  if (vendors.empty()) return "unknown";
  return vendors.size() == 1 ? *vendors.begin() : "mixed";
}

/// The number of the run that a part belongs to; 0: its program has written none.
std::uint64_t run_of(const std::string& part) {
  return fs::exists(part) ? read_json(part).at("ending").get<Ending>().session : 0;
}

/// Throws `Error` (usage) where a program of the run has left nothing, or results of another run. A program that was
/// killed has left its history only.
void check_parts(const RunResults& run, const std::string& folder) {
  std::uint64_t number = 0;
  for (const std::string& part : parts_of(folder, run.scene.settings.users)) {
    const std::string label = program_of_part(part);
    if (!fs::exists(part) && !fs::exists(fs::path(part).replace_extension(".csv"))) {
      throw Error(ExitCode::usage,
                  fmt::format("no results of {}: name the folder that it wrote to with --out, too", label));
    }
    const std::uint64_t its = run_of(part);
    if (number == 0) number = its;
    if (its != 0 && its != number) {
      throw Error(
          ExitCode::usage,
          fmt::format("the results of {} belong to another run than the others; name folders of one run", label));
    }
  }
}

/// The scene and the settings with which the world ran.
Options options_of(const std::vector<std::string>& arguments, const std::string& scene) {
  std::vector<std::string> words{"world_sim"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  if (!scene.empty() && words.size() > 1) words[1] = scene;
  std::vector<const char*> argv;
  for (const std::string& word : words) argv.push_back(word.c_str());
  Options options;
  CommandLine line("world_sim", "");
  add_run_options(line, options);
  (void)line.parse(static_cast<int>(argv.size()), argv.data());
  return options;
}

}  // namespace

void merge_results(const std::vector<std::string>& folders, const std::string& out) {
  std::map<std::string, fs::path> found;
  for (const std::string& folder : folders) {
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      const std::string name = entry.path().filename().string();
      if (!entry.is_regular_file() || fnmatch(kResults, name.c_str(), FNM_EXTMATCH) != 0) continue;
      const auto [at, is_new] = found.emplace(name, entry.path());
      if (!is_new && !fs::equivalent(at->second, entry.path())) {
        throw Error(ExitCode::usage, fmt::format("{} and {} are results of the same program; name folders of one run",
                                                 at->second.string(), entry.path().string()));
      }
    }
  }
  for (const auto& [name, path] : found) {
    std::error_code error;
    fs::copy_file(path, fs::path(out) / name, fs::copy_options::overwrite_existing, error);
    if (error) throw Error(ExitCode::failed, fmt::format("{}/{}: {}", out, name, error.message()));
  }
}

int collect(const CollectRequest& request) {
  // Into a new folder first: the results may lie in the one that is to receive the summary.
  std::string found;
  bool launched = false, concluded = false;
  for (const std::string& folder : request.folders) {
    if (!fs::is_directory(folder))
      throw Error(ExitCode::usage, fmt::format("{}: is no folder; name those that the programs wrote to", folder));
    if (Claim still; !still.take_folder(folder))
      throw Error(ExitCode::usage, fmt::format("{}: its run has not ended", folder));
    // A session has its results in another folder than its logs.
    launched = launched || (fs::exists(folder + "/logs/world_sim.log") && !fs::exists(folder + "/hosts"));
    concluded = concluded || fs::exists(folder + "/summary.json");
    for (const auto& entry : fs::recursive_directory_iterator(folder)) {
      if (entry.path().filename() == "world.json") found = entry.path().string();
    }
  }
  if (found.empty() && request.scene.empty())
    throw Error(ExitCode::usage,
                "no world.json in these folders: name the one that world_sim wrote to with --out, too; or, where it "
                "was killed, the scene: --scene");
  RunResults run;
  const std::vector<std::string> given{request.scene};
  const Options options =
      options_of(found.empty() ? given : read_json(found).get<WorldPart>().arguments, request.scene);
  run.scene = load_scene(options);
  run.between_hosts = !options.network.peers.empty();
  std::string out = request.out;
  Claim claim;
  for (const std::string& folder : request.folders) {
    if (!out.empty() && fs::exists(out) && fs::equivalent(folder, out))
      throw Error(ExitCode::usage,
                  fmt::format("--out {}: holds results that are to be merged; choose another folder", out));
  }
  claim_folder(out, run.scene.name, claim);
  merge_results(request.folders, out);
  check_parts(run, out);
  run.command_line = request.command_line;
  run.date = date_of_now();
  run.dds = vendors_of(out, run.scene.settings.users);
  Ended ended;
  ended.orphaned = launched && !concluded;
  ended.parts = parts_of(out, run.scene.settings.users);
  RunRequest how;
  how.explain = request.explain;
  how.strict = request.strict;
  return conclude_run(run, ended, how, out, {});
}

}  // namespace subworld
