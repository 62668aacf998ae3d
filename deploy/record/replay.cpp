#include "record/replay.hpp"

#include "io/records/mcap_reader.hpp"
#include "io/results/json.hpp"
#include "io/results/output.hpp"
#include "io/results/replacing.hpp"
#include "model/error.hpp"
#include "model/places.hpp"
#include "model/settings/presence.hpp"
#include "record/player.hpp"
#include "record/recording.hpp"
#include "rt/stop.hpp"
#include "run/claim.hpp"
#include "run/page.hpp"
#include "wire/bus.hpp"

#include <fmt/core.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <memory>
#include <string_view>
#include <vector>

namespace subworld {

namespace {

using Attachments = std::map<std::string, std::string>;

struct Recorded {
  Json settings, summary;

  [[nodiscard]] std::string hash() const { return summary.value("state_hash", std::string()); }
  [[nodiscard]] std::string presence() const { return summary.value("presence", std::string()); }
  [[nodiscard]] bool repeats() const { return summary.value("mode", std::string()) == "lockstep"; }
};

/// Without a summary in the file, that of the run's folder, which the keeper of a killed run writes, or what was known
/// at the start.
Recorded read_recorded(const std::string& file, const Attachments& attachments) {
  const auto json_of = [&](const char* name) {
    const auto at = attachments.find(name);
    return at == attachments.end() ? Json() : parse_json(at->second);
  };
  Recorded recorded{json_of(kSettingsAttachment), json_of(kSummaryAttachment)};
  if (!recorded.settings.is_object()) {
    throw Error(ExitCode::usage, fmt::format("{}: has no attachment {}; name a file of `subworld run --record`", file,
                                             kSettingsAttachment));
  }
  if (recorded.summary.is_object()) return recorded;
  recorded.summary = json_of(kBegunAttachment);
  if (!recorded.summary.is_object()) recorded.summary = Json::object();
  const auto other = std::filesystem::absolute(file).parent_path() / recorded.settings.value("results", std::string()) /
                     kSummaryAttachment;
  std::error_code none;
  const Json written = std::filesystem::exists(other, none) ? read_json(other) : Json();
  if (written.is_object() && written.value("date", Json()) == recorded.summary.value("date", Json()))
    recorded.summary = written;
  return recorded;
}

/// Throws `Error`, also where it would replace what someone has changed.
void write_file(const std::filesystem::path& path, const std::string& contents) {
  std::filesystem::create_directories(path.parent_path());
  if (std::ifstream held(path, std::ios::binary); held) {
    if (std::string(std::istreambuf_iterator<char>(held), {}) == contents) return;
    throw Error(ExitCode::usage, fmt::format("{}: differs from the recording, which would replace it; choose another "
                                             "--out, or remove it",
                                             path.string()));
  }
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

/// The scene and its files, as recorded, in a folder. Returns the scene's file.
std::string extract_scene(const std::string& folder, const Attachments& attachments) {
  const auto recorded = std::filesystem::path(folder) / "recorded";
  for (const auto& [file, bytes] : attachments) {
    if (stays_inside(file)) write_file(recorded / file, bytes);
  }
  return recorded / kSceneAttachment;
}

std::string folder_of(const ReplayRequest& request) {
  std::string folder = request.out.empty() ? "out/replay-" + local_time("%Y%m%d-%H%M%S") : request.out;
  make_folder(folder);
  check_results(folder, {folder + "/picture.png"});
  return folder;
}

/// It gets SIGTERM when this program ends, in whichever way.
pid_t start_program(const std::vector<std::string>& words) {
  std::vector<char*> argv;
  for (const std::string& word : words) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);
  const pid_t parent = getpid(), pid = fork();
  if (pid == 0) {
    prctl(PR_SET_PDEATHSIG, SIGTERM);
    if (getppid() == parent) execv(argv[0], argv.data());
    dprintf(STDERR_FILENO, "%s: %s\n", argv[0], std::strerror(errno));
    _exit(1);
  }
  if (pid < 0) throw Error(ExitCode::failed, fmt::format("{}: {}", words[0], std::strerror(errno)));
  return pid;
}

int exit_code_of_program(pid_t pid) {
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : static_cast<int>(ExitCode::failed);
}

/// A display of the replay; it ends with this object.
class ReplayDisplay {
 public:
  explicit ReplayDisplay(const std::vector<std::string>& words) : pid_(start_program(words)) {}
  ~ReplayDisplay() {
    kill(pid_, SIGTERM);
    (void)exit_code_of_program(pid_);
  }
  ReplayDisplay(const ReplayDisplay&) = delete;
  ReplayDisplay& operator=(const ReplayDisplay&) = delete;

 private:
  pid_t pid_;
};

int publish(ReplayRequest request, mcap::Reader& reader, const Attachments& attachments, const Recorded& recorded) {
  const std::string folder = folder_of(request), scene_file = extract_scene(folder, attachments);
  std::vector<std::string> words{(program_folder() / "gui_headless").string(), scene_file};
  for (const std::string& flag : flags_of_run(recorded.settings)) words.push_back(flag);
  Settings settings;
  settings.mode = recorded.repeats() ? Mode::lockstep : Mode::realtime;
  settings.users = recorded.summary.value("users", 1);
  const double h_s = recorded.summary.value("h_s", settings.h_s);
  settings.h_s = h_s;
  settings.set_ratio({recorded.summary.value("ratio", 4), recorded.summary.value("ratio_most", 4)});
  choose_live_port(request.live, request.page);
  if (!request.network.secure.empty())
    throw Error(ExitCode::usage, "--secure: a replay sends for all programs, and no role may; publish without it");
  Claim claim;
  request.network.domain = claim_domain(request.domain, claim);
  const auto bus = open_bus(request.network, settings, h_s, "world_sim");
  Player player(reader, *bus,
                {.speed = request.speed,
                 .from_s = request.from_s,
                 .paused = request.paused,
                 .stays = request.live.port.has_value()});
  fmt::print("replay: domain {}, speed {}; subworld control pause, resume, step, seek or stop --domain {}\n",
             request.network.domain, request.speed, request.network.domain);
  if (request.page) fmt::print("replay: page: {}\n", page_address(request.live));
  std::fflush(stdout);
  std::unique_ptr<ReplayDisplay> display;
  if (request.live.port) {
    words.insert(words.end(), {"--domain", std::to_string(request.network.domain), "--dds", request.network.dds,
                               "--out", folder, "--mode", recorded.repeats() ? "lockstep" : "realtime"});
    for (const std::string& flag : live_flags_of(request.live)) words.push_back(flag);
    display = std::make_unique<ReplayDisplay>(words);
  }
  watch_stop_signals();
  PageOpener open_page(request.live, request.page);
  constexpr double kWait_s = 0.05;
  while (stop_signal() == 0 && player.advance(kWait_s)) open_page();
  display.reset();
  fmt::print("replay: {} messages published, to t = {:.3f} s\n", player.published(), player.time_s());
  return static_cast<int>(ExitCode::done);
}

int resimulate(const ReplayRequest& request, const Attachments& attachments, const Recorded& recorded) {
  if (!recorded.repeats()) {
    throw Error(ExitCode::usage, fmt::format("{}: a run in real time does not repeat bit by bit; re-simulate a "
                                             "recording of `subworld run --mode lockstep`",
                                             request.file));
  }
  if (recorded.hash().empty()) {
    throw Error(ExitCode::usage,
                fmt::format("{}: holds no state hash to compare with; --page shows what it holds", request.file));
  }
  const std::string folder = folder_of(request), scene = extract_scene(folder, attachments);
  std::vector<std::string> words{(program_folder() / "subworld").string(), "run", scene};
  for (const std::string& flag : flags_of_run(recorded.settings)) words.push_back(flag);
  const double simulated_s = recorded.summary.value("simulated_s", 0.0);
  if (simulated_s == 0.0)
    throw Error(ExitCode::usage,
                fmt::format("{}: this run ended before its first cycle; record a longer one", request.file));
  // One that ended early is repeated as far as it came: up to the stop in its record, or to its last cycle.
  const bool stops = recorded.presence().find("world stops") != std::string::npos;
  if (!stops && simulated_s < recorded.summary.value("duration_s", 0.0))
    words.insert(words.end(), {"--set", fmt::format("duration_s={}", simulated_s)});
  words.insert(words.end(), {"--set", "mode=lockstep", "--dds", recorded.settings.value("dds", std::string("fastdds")),
                             "--out", folder});
  if (request.domain >= 0) words.insert(words.end(), {"--domain", std::to_string(request.domain)});
  // What was ordered, and who came and went.
  if (!recorded.presence().empty()) words.insert(words.end(), {"--set", "presence=" + recorded.presence()});
  std::fflush(stdout);
  if (const int code = exit_code_of_program(start_program(words)); code != 0) return code;
  const Recorded again{recorded.settings, read_json(folder + "/summary.json")};
  const bool equal = again.hash() == recorded.hash();
  std::string verdict = equal ? "equal" : "they differ; another version or build";
  if (const std::string lacking = lacking_events(recorded.presence(), again.presence()); !equal && !lacking.empty()) {
    verdict = fmt::format("they differ; the re-simulation ended at t = {} s without these recorded events: {}",
                          again.summary.value("simulated_s", 0.0), lacking);
  } else if (!equal && recorded.summary.contains("restarts")) {
    verdict += ", or an order that a sub-world followed just before its program was killed, and did not report";
  }
  fmt::print("re-simulated: state hash {}, recorded {}: {}\n", again.hash(), recorded.hash(), verdict);
  return static_cast<int>(equal ? ExitCode::done : ExitCode::failed);
}

/// A copy with all that the file holds, with an end and, where the keeper of the run has written one, with its summary.
int repair(const ReplayRequest& request, mcap::Reader& reader, Attachments attachments, const Recorded& recorded) {
  if (reader.lacks().empty())
    throw Error(ExitCode::usage, fmt::format("--repair: {} is whole; use it as it is", request.file));
  std::error_code none;
  if (std::filesystem::equivalent(request.repair, request.file, none))
    throw Error(ExitCode::usage,
                fmt::format("--repair {}: is the recording; name another file for the copy", request.repair));
  check_replaced("--repair", request.repair, kRecordingBegin);
  mcap::Writer copy(request.repair);
  std::map<std::uint16_t, std::uint16_t> channels;
  for (const auto& [id, topic] : reader.topics()) {
    const mcap::Schema& schema = reader.schema_of(id);
    channels[id] = copy.add_channel(copy.add_schema(schema.name, schema.encoding, schema.text), topic, "cdr");
  }
  if (recorded.summary.contains("verdict")) attachments.try_emplace(kSummaryAttachment, json_text(recorded.summary, 2));
  for (const auto& [name, bytes] : attachments) {
    const bool json = name.ends_with(".json");
    copy.attach(name, json ? "application/json" : "application/octet-stream", bytes, reader.to_ns());
  }
  for (std::size_t i = 0; i < reader.chunks(); ++i) {
    const mcap::Chunk chunk = reader.read_chunk(i);
    for (const mcap::Message& one : chunk.messages)
      copy.write(channels.at(one.channel), one.number, one.time_ns, one.data);
  }
  copy.finish();
  fmt::print("repaired: {} has {} messages{}\n", request.repair, reader.messages(),
             attachments.contains(kSummaryAttachment) ? " and the summary of the run" : ", and no summary");
  return static_cast<int>(ExitCode::done);
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
  if (!reader.lacks().empty()) fmt::print("  {}\n", reader.lacks());
  const auto or_none = [](const std::string& text) { return text.empty() ? "none" : text; };
  fmt::print("  state hash {}\n  verdict: {}\n", or_none(recorded.hash()),
             or_none(recorded.summary.value("verdict", std::string())));
  if (!request.repair.empty()) return repair(request, reader, attachments, recorded);
  if (request.publish || request.page || request.live.port) return publish(request, reader, attachments, recorded);
  return request.resimulate ? resimulate(request, attachments, recorded) : static_cast<int>(ExitCode::done);
}

}  // namespace subworld
