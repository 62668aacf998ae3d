#include "replay.hpp"

#include "io/mcap_reader.hpp"
#include "io/results.hpp"
#include "launch.hpp"
#include "model/error.hpp"
#include "recording.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <map>
#include <string_view>
#include <vector>

namespace subworld {

namespace {

using Attachments = std::map<std::string, std::string>;

struct Recorded {
  Json settings, summary;

  [[nodiscard]] std::string hash() const { return summary.value("state_hash", std::string()); }
  [[nodiscard]] bool repeats() const { return summary.value("mode", std::string()) == "lockstep"; }
};

Recorded read_recorded(const std::string& file, const Attachments& attachments) {
  const auto json_of = [&](const char* name) {
    const auto at = attachments.find(name);
    const Json json = at == attachments.end() ? Json() : Json::parse(at->second, nullptr, false);
    if (json.is_object()) return json;
    throw Error(ExitCode::usage,
                fmt::format("{}: has no attachment {}; name a file of `subworld run --record`", file, name));
  };
  return {json_of(kSettingsAttachment), json_of(kSummaryAttachment)};
}

void write_file(const std::filesystem::path& path, const std::string& contents) {
  std::filesystem::create_directories(path.parent_path());
  std::ofstream file(path, std::ios::binary);
  file << contents;
  file.close();
  if (!file) throw Error(ExitCode::failed, fmt::format("{}: cannot be written; choose another --out", path.string()));
}

/// The recorded flags, but for the scene and for what belongs to the network of the recorded run.
std::vector<std::string> flags_of_run(const Json& settings) {
  constexpr std::array<std::string_view, 4> kNetwork{"--interface", "--peers", "--qos", "--wait"};
  const auto given = settings.at("flags").get<std::vector<std::string>>();
  std::vector<std::string> flags;
  for (std::size_t i = 1; i < given.size(); ++i) {
    if (std::ranges::find(kNetwork, given[i]) != kNetwork.end()) {
      ++i;
    } else {
      flags.push_back(given[i]);
    }
  }
  return flags;
}

/// Runs a program to its end. Returns its exit code.
int run_program_with(const std::vector<std::string>& words) {
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  pid_t pid = -1;
  int status = 0;
  if (const int fault = posix_spawn(&pid, argv[0], nullptr, nullptr, argv.data(), environ); fault != 0)
    throw Error(ExitCode::failed, fmt::format("{}: {}", words[0], std::strerror(fault)));
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : static_cast<int>(ExitCode::failed);
}

int resimulate(const ReplayRequest& request, const Attachments& attachments, const Recorded& recorded) {
  if (!recorded.repeats()) {
    throw Error(ExitCode::usage, fmt::format("{}: a run in real time does not repeat bit by bit; re-simulate a "
                                             "recording of `subworld run --mode lockstep`",
                                             request.file));
  }
  const std::string folder = request.out.empty()
                                 ? fmt::format("out/replay-{:%Y%m%d-%H%M%S}", fmt::localtime(std::time(nullptr)))
                                 : request.out;
  make_folder(folder);
  const std::string scene_text = attachments.at(kSceneAttachment), scene = folder + "/recorded/" + kSceneAttachment;
  write_file(scene, scene_text);
  for (const std::string& file : files_of_scene(scene_text)) {
    if (const auto at = attachments.find(file); at != attachments.end())
      write_file(std::filesystem::path(folder) / "recorded" / file, at->second);
  }
  std::vector<std::string> words{program_folder() + "/subworld", "run", scene};
  for (const std::string& flag : flags_of_run(recorded.settings)) words.push_back(flag);
  // One that was stopped is repeated as far as it came.
  const double simulated_s = recorded.summary.value("simulated_s", 0.0);
  if (simulated_s > 0.0 && simulated_s < recorded.summary.value("duration_s", 0.0))
    words.insert(words.end(), {"--duration", fmt::format("{}", simulated_s)});
  words.insert(words.end(), {"--mode", "lockstep", "--dds", recorded.settings.value("dds", std::string("fastdds")),
                             "--out", folder});
  std::fflush(stdout);
  if (const int code = run_program_with(words); code != 0) return code;
  const std::string again = read_json(folder + "/summary.json").value("state_hash", std::string());
  const bool equal = again == recorded.hash();
  fmt::print("re-simulated: state hash {}, recorded {}: {}\n", again, recorded.hash(),
             equal ? "equal" : "they differ; another version or build, or orders during the recorded run");
  return static_cast<int>(equal ? ExitCode::done : ExitCode::failed);
}

}  // namespace

int replay(const ReplayRequest& request) {
  mcap::Reader reader(request.file);
  const Attachments attachments = reader.attachments();
  const Recorded recorded = read_recorded(request.file, attachments);
  fmt::print("{}: scene {}, {}, {} messages in {:.1f} s of wall time\n  recorded {}: {}\n", request.file,
             recorded.summary.value("scene", std::string()), recorded.summary.value("mode", std::string()),
             reader.messages(), reader.duration_s(), recorded.summary.value("date", std::string()),
             recorded.summary.value("command_line", std::string()));
  if (recorded.summary.contains("recording")) {
    const Json& counts = recorded.summary["recording"];
    fmt::print("  messages lost: {} of {}\n", counts.value("messages_lost", 0), counts.value("messages_sent", 0));
  }
  fmt::print("  state hash {}\n  verdict: {}\n", recorded.hash(), recorded.summary.value("verdict", std::string()));
  return request.resimulate ? resimulate(request, attachments, recorded) : static_cast<int>(ExitCode::done);
}

}  // namespace subworld
