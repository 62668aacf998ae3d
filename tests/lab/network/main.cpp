#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "io/results/json.hpp"
#include "lab/network/criteria.hpp"
#include "lab/network/ddsperf.hpp"
#include "lab/network/peer.hpp"
#include "lab/network/report.hpp"
#include "lab/network/run.hpp"
#include "lab/network/udp.hpp"
#include "lab/page/command_line.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <functional>

namespace {

using namespace subworld;

constexpr double kQuick_s = 2.0, kQuickScene_s = 1.0;

struct Request : NetworkRequest {
  std::vector<std::string> require;
  bool quick = false;
};

void add_axes(CommandLine& line, NetworkAxes& axes) {
  const std::vector<std::string> vendors{"fastdds", "cyclonedds"};
  line.add("--world-dds", &axes.world_dds, "DDS vendors of the world").one_of(vendors);
  line.add("--haptic-dds", &axes.haptic_dds, "DDS vendors of the users; every pair is measured").one_of(vendors);
  line.add("--transport", &axes.transports,
           "udp: each program on a host of its own, over the emulated link; loopback: all on this host, without a link")
      .one_of({"udp", "loopback"});
  line.add("--reliability", &axes.reliabilities, "services").one_of({"best_effort", "reliable"});
  line.add("--rate", &axes.rates_hz, "messages a second from the world to each user; each is returned")
      .range(1.0, 20'000.0, "Hz");
  line.add("--payload", &axes.payloads_bytes, "size of a message, bytes")
      .range(kLeastPayload_bytes, kMostPayload_bytes);
  line.add("--users", &axes.users, "number of users").range(1, kMostNetworkUsers);
  line.add("--depth", &axes.depths, "depth of the histories").range(1, 10'000);
  line.add("--link", &axes.links, "links, in the words of `subworld link`");
}

void add_scene(CommandLine& line, FeltSettings& felt) {
  line.add("--scene", &felt.scene,
           "also measure what users feel: the real programs run this scene, a file or the name of a scene of Subworld, "
           "in "
           "real time over each link with each vendor pair")
      .otherwise("none");
  line.add("--scene-duration", &felt.duration_s, "simulated time of the scene")
      .range(0.3, 1e4, "s")
      .otherwise("the scene's");
}

/// Throws `Error` (usage). Returns an exit code if the program is done.
std::optional<int> parse(int argc, char** argv, Request& request) {
  CommandLine line("subworld lab network",
                   "Measures what a network carries: loss, delay and gap of messages between a world and its users, "
                   "for every combination of the lists, and with --scene the force that users feel over it.");
  line.footer(
      "Examples:\n"
      "  subworld lab network --link wifi --out out/wifi\n"
      "  subworld lab network --link 'ideal,delay 20ms 5ms loss 2%' --rate 250,1000 --payload 256,4096\n"
      "  subworld lab network --reliability reliable --depth 10 --rate 30 --payload 1000 --link 'loss 10%,loss 30%'\n"
      "  subworld lab network --transport loopback --users 1,4 --quick\n"
      "  subworld lab network --link lan --baseline udp,ddsperf\n"
      "  subworld lab network --link lan --require 'lost_ratio<0.01,round_trip_s_p99<0.02'\n"
      "  subworld lab network --scene row --messages off --link 'ideal,wifi,delay 20ms 5ms loss 2%'\n"
      "  subworld lab network --duration 1 --link ideal,lan,wifi,4g,starlink,hotel,transatlantic --rate 250,500,1000 "
      "--payload 64,256,1024 --resume --out out/matrix\n"
      "DIR/results.csv and results.json have a row for each cell, felt.csv and felt.json one for each user of the "
      "scene;\n"
      "the JSON files are written anew after each cell. A cell that cannot be measured does not end the lab.\n"
      "The start-up is excluded: discovery, and the first 0.5 s of messages.\n"
      "The transport udp and --scene need root, or a user namespace: unshare -rn subworld lab network ...\n"
      "Ctrl-C writes what has been measured so far.\n"
      "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, or a cell could not be measured,\n"
      "2 usage or scene, 4 a cell misses --require.");
  add_axes(line, request.axes);
  Option duration =
      line.add("--duration", &request.settings.duration_s, "time of each cell that counts").range(0.1, 86'400.0, "s");
  line.add("--require", &request.require,
           "pass criteria: COLUMN<NUMBER or COLUMN>NUMBER, with the columns of results.csv for each cell and those of "
           "felt.csv for each user")
      .otherwise("none");
  add_scene(line, request.felt);
  std::string messages = "on";
  line.add("--messages", &messages, "measure messages; off: only what users feel").one_of({"on", "off"});
  line.add("--domain", &request.settings.domain, "DDS domain").range(0, 232);
  add_seed(line, request.settings.seed, "seed of the emulated link");
  line.flag("--quick", request.quick,
            fmt::format("a first look: {:g} s a cell and {:g} s of the scene, where nothing else is given", kQuick_s,
                        kQuickScene_s));
  line.add("--baseline", &request.baselines,
           "also measure plain UDP, or the program ddsperf of Cyclone DDS, once for the vendor pairs of a setting")
      .one_of({kPlainUdp, kDdsperf, "off"});
  line.flag("--resume", request.resume,
            "go on with the results in --out: measure only the cells that it does not have, or that failed");
  add_out(line, "network", request.out);
  if (const auto code = line.parse(argc, argv)) return code;
  request.messages = messages == "on";
  if (request.has_baseline(kDdsperf)) require_ddsperf();
  request.felt.domain = request.settings.domain;
  if (request.quick && !duration.given()) request.settings.duration_s = kQuick_s;
  if (request.quick && !request.felt.duration_s) request.felt.duration_s = kQuickScene_s;
  if (!request.messages && request.felt.scene.empty())
    throw Error(ExitCode::usage, "--messages off: nothing is left to measure; name a scene: --scene row");
  if (request.resume && request.out.empty())
    throw Error(ExitCode::usage, "--resume: needs --out, the folder of the run that goes on");
  if (request.out.empty()) request.out = default_out("network");
  return std::nullopt;
}

/// Conditions on the columns of both parts, as far as they run.
std::vector<Requirement> requirements_of(const Request& request) {
  Json example = request.messages ? row_of({}, request.settings, {}, {}) : Json::object();
  if (!request.felt.scene.empty()) example.update(felt_row_of({}, request.felt));
  std::vector<Requirement> requirements;
  for (const std::string& text : request.require) requirements.push_back(parse_requirement(text, example));
  return requirements;
}

struct Verdict {
  std::vector<std::string> sentences;  ///< by network
  std::string felt;                    ///< empty: no scene was run
  std::vector<std::string> missed = {};
  std::size_t failed = 0;  ///< cells
  std::string first_failure = {};
};

void judge_part(Verdict& verdict, const Rows& rows, const std::vector<Requirement>& requirements,
                const std::function<std::string(std::size_t)>& name_of_row) {
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::string command = rows[i].at("command");
    if (failed(rows[i]) && verdict.first_failure.empty()) verdict.first_failure = rows[i].at("failure");
    for (const std::string& text : missed_by(rows[i], those_of(rows[i], requirements)))
      verdict.missed.push_back(fmt::format("{}: {}; {}", name_of_row(i), text, command));
  }
}

Verdict judge(const NetworkRows& rows, const std::vector<Requirement>& requirements) {
  Verdict verdict{.sentences = {}, .felt = felt_sentence_of(rows.felt), .failed = rows.failed_cells()};
  if (!rows.cells.empty()) verdict.sentences = sentences_of(rows.cells, those_of(rows.cells.front(), requirements));
  judge_part(verdict, rows.cells, requirements, [](std::size_t i) { return fmt::format("cell {}", i + 1); });
  judge_part(verdict, rows.felt, requirements,
             [&](std::size_t i) { return "user " + rows.felt[i].at("user_name").get<std::string>(); });
  return verdict;
}

std::string gate_text(const Request& request, const Verdict& verdict, std::size_t measured, std::size_t planned) {
  if (request.require.empty() || measured == 0) return "";
  if (verdict.missed.empty()) {
    if (measured == planned) return "\nall cells pass";
    return measured == 1 ? "\nthe measured cell passes" : fmt::format("\nthe {} measured cells pass", measured);
  }
  constexpr std::size_t kMostNamed = 10;
  std::string text;
  for (std::size_t i = 0; i < std::min(kMostNamed, verdict.missed.size()); ++i)
    text += "\nMISSED: " + verdict.missed[i];
  if (verdict.missed.size() > kMostNamed)
    text += fmt::format("\n{} more are missed, see summary.json", verdict.missed.size() - kMostNamed);
  return text;
}

std::string failed_text(const Request& request, const Verdict& verdict, std::size_t planned) {
  if (verdict.failed == 0) return "";
  return fmt::format(
      "\n{} of {} cells could not be measured; the first: {}; measure them again with --resume --out {} and the same "
      "options",
      verdict.failed, planned, verdict.first_failure, request.out);
}

Json summary_of(const Request& request, const NetworkRows& rows, std::size_t planned, const Verdict& verdict) {
  Json summary = begin_summary("network", rows.measured(), planned);
  summary["seed"] = request.settings.seed;
  summary["duration_s"] = request.settings.duration_s;
  summary["start_up_excluded_s"] = kStartUp_s;
  summary["failed"] = verdict.failed;
  summary["require"] = request.require;
  summary["missed"] = verdict.missed;
  summary["sentences"] = verdict.sentences;
  summary["felt"] = verdict.felt;
  std::vector<std::string> sentences = verdict.sentences;
  if (!verdict.felt.empty()) sentences.push_back(verdict.felt);
  if (sentences.empty()) sentences.emplace_back("no cell was measured");
  summary["verdict"] =
      fmt::format("{}{}{}{}", joined(sentences, "\n"), gate_text(request, verdict, rows.measured(), planned),
                  failed_text(request, verdict, planned), stopped_text(rows.measured(), planned));
  return summary;
}

void write_felt(const std::string& out, const Rows& rows) {
  for (const char* const file : {"/felt.json", "/felt.csv"}) std::filesystem::remove(out + file);
  if (rows.empty()) return;
  write_json(out + "/felt.json", rows);
  write_csv(out + "/felt.csv", rows);
}

void report_saved(const std::string& folder, const std::string& page) {
  write_network_report(page, read_rows(folder + "/results.json"), read_rows(folder + "/felt.json"),
                       read_json(folder + "/summary.json"));
}

int run_lab(int argc, char** argv) {
  if (const auto code = report_again(argc, argv, report_saved)) return *code;
  Request request;
  if (const auto code = parse(argc, argv, request)) return *code;
  const NetworkPlan plan = plan_of(request);
  const std::vector<Requirement> requirements = requirements_of(request);
  open_results("network", request.out);
  watch_stop_signals();
  const NetworkRows rows = measure_all(plan, request);
  const Verdict verdict = judge(rows, requirements);
  const Json summary = summary_of(request, rows, plan.size(), verdict);
  write_felt(request.out, rows.felt);
  const int code = end_lab(
      request.out, rows.cells, summary,
      [&](const std::string& page) { write_network_report(page, rows.cells, rows.felt, summary); },
      rows.felt.empty() ? "" : "felt.csv");
  if (verdict.failed > 0) return static_cast<int>(ExitCode::failed);
  return verdict.missed.empty() ? code : static_cast<int>(ExitCode::quality);
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("subworld lab network", [&] { return run_lab(argc, argv); });
}
