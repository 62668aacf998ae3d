#include "io/command_line.hpp"
#include "io/options.hpp"
#include "lab/network/criteria.hpp"
#include "lab/network/ddsperf.hpp"
#include "lab/network/measure.hpp"
#include "lab/network/report.hpp"
#include "lab/network/udp.hpp"
#include "lab/page/command_line.hpp"
#include "model/error.hpp"
#include "rt/stop.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <filesystem>
#include <map>

namespace {

using namespace subworld;

constexpr double kQuick_s = 2.0;

struct Request {
  NetworkAxes axes;
  NetworkRunSettings settings;
  std::vector<std::string> require;
  std::vector<std::string> baselines{kPlainUdp};
  bool quick = false;
  bool resume = false;
  std::string out;
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

/// Throws `Error` (usage). Returns an exit code if the program is done.
std::optional<int> parse(int argc, char** argv, Request& request) {
  CommandLine line("subworld lab network",
                   "Measures what a network carries: loss, delay and gap of messages between a world and its users, "
                   "for every combination of the lists.");
  line.footer(
      "Examples:\n"
      "  subworld lab network --link wifi --out out/wifi\n"
      "  subworld lab network --link 'ideal,delay 20ms 5ms loss 2%' --rate 250,1000 --payload 256,4096\n"
      "  subworld lab network --reliability reliable --depth 10 --rate 30 --payload 1000 --link 'loss 10%,loss 30%'\n"
      "  subworld lab network --transport loopback --users 1,4 --quick\n"
      "  subworld lab network --link lan --baseline udp,ddsperf\n"
      "  subworld lab network --link lan --require 'lost_ratio<0.01,round_trip_s_p99<0.02'\n"
      "DIR/results.csv and results.json have a row for each cell, and are written anew after each.\n"
      "The start-up is excluded: discovery, and the first 0.5 s of messages.\n"
      "The transport udp needs root, or a user namespace: unshare -rn subworld lab network ...\n"
      "Ctrl-C writes what has been measured so far.\n"
      "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, 2 usage, 4 a cell misses --require.");
  add_axes(line, request.axes);
  Option duration =
      line.add("--duration", &request.settings.duration_s, "time of each cell that counts").range(0.1, 86'400.0, "s");
  line.add("--require", &request.require,
           "pass criteria for each cell: COLUMN<NUMBER or COLUMN>NUMBER, with the columns of results.csv")
      .otherwise("none");
  line.add("--domain", &request.settings.domain, "DDS domain").range(0, 232);
  add_seed(line, request.settings.seed, "seed of the emulated link");
  line.flag("--quick", request.quick,
            fmt::format("a first look: {:g} s a cell, where nothing else is given", kQuick_s));
  line.add("--baseline", &request.baselines,
           "also measure plain UDP, or the program ddsperf of Cyclone DDS, once for the vendor pairs of a setting")
      .one_of({kPlainUdp, kDdsperf, "off"});
  line.flag("--resume", request.resume,
            "go on with the results in --out: measure only the cells that it does not have");
  add_out(line, "network", request.out);
  if (const auto code = line.parse(argc, argv)) return code;
  if (std::ranges::find(request.baselines, kDdsperf) != request.baselines.end()) require_ddsperf();
  if (request.quick && !duration.given()) request.settings.duration_s = kQuick_s;
  if (request.resume && request.out.empty())
    throw Error(ExitCode::usage, "--resume: needs --out, the folder of the run that goes on");
  if (request.out.empty()) request.out = default_out("network");
  return std::nullopt;
}

std::vector<Requirement> requirements_of(const Request& request) {
  const Json example = row_of({}, request.settings, {}, {});
  std::vector<Requirement> requirements;
  for (const std::string& text : request.require) requirements.push_back(parse_requirement(text, example));
  return requirements;
}

/// The rows of an earlier run of the same cells, by their command; those that failed are measured again.
std::map<std::string, Json> earlier_rows(const Request& request) {
  std::map<std::string, Json> rows;
  const std::string file = request.out + "/results.json";
  if (!request.resume || !std::filesystem::exists(file)) return rows;
  const auto names = [](const Json& row) {
    std::vector<std::string> found;
    for (const auto& [name, value] : row.items()) found.push_back(name);
    return found;
  };
  const std::vector<std::string> expected = names(row_of({}, request.settings, {}, {}));
  for (const Json& row : read_json(file)) {
    if (row.is_object() && names(row) == expected && !failed(row)) rows[row.at("command").get<std::string>()] = row;
  }
  return rows;
}

/// The baselines of a setting, measured once for the cells of its vendor pairs.
class Baselines {
 public:
  explicit Baselines(const Request& request) : request_(request) {}
  const Baseline& of(NetworkCell cell) {
    cell.world_dds = cell.haptic_dds = kPlainUdp;
    if (to_text(cell) == setting_) return found_;
    setting_ = to_text(cell);
    found_ = {};
    if (is_wanted(kPlainUdp) && cell.payload_bytes <= kMostDatagram_bytes)
      found_.udp = measure_cell(cell, request_.settings);
    if (is_wanted(kDdsperf)) found_.ddsperf = measure_ddsperf(cell, request_.settings);
    return found_;
  }

 private:
  [[nodiscard]] bool is_wanted(const char* name) const {
    return std::ranges::find(request_.baselines, name) != request_.baselines.end();
  }
  const Request& request_;
  std::string setting_;
  Baseline found_;
};

/// The rows of the cells that have been measured.
Rows measure_all(const std::vector<NetworkCell>& cells, const Request& request) {
  const std::map<std::string, Json> earlier = earlier_rows(request);
  Rows rows;
  Baselines baselines(request);
  std::vector<NetworkCell> ahead;
  for (const NetworkCell& cell : cells) {
    const auto known = earlier.find(command_of(cell, request.settings));
    if (known == earlier.end())
      ahead.push_back(cell);
    else
      rows.push_back(known->second);
  }
  if (!rows.empty()) fmt::print("resumed: {} of {} cells are there\n", rows.size(), cells.size());
  double all_s = 0.0, done_s = 0.0;
  for (const NetworkCell& cell : ahead) all_s += planned_s(cell, request.settings);
  const TimeLeft left(all_s);
  for (const NetworkCell& cell : ahead) {
    const Baseline& baseline = baselines.of(cell);
    const CellFindings found = measure_cell(cell, request.settings);
    if (stop_signal() != 0) break;
    rows.push_back(row_of(cell, request.settings, found, baseline));
    write_json(request.out + "/results.json", rows);
    done_s += planned_s(cell, request.settings);
    fmt::print("[{:3}/{}] {}: {}{}\n", rows.size(), cells.size(), to_text(cell), result_text(rows.back()),
               left.text(done_s));
    std::fflush(stdout);
  }
  return rows;
}

struct Verdict {
  std::vector<std::string> sentences;
  std::vector<std::string> missed = {};
  std::size_t failed = 0;
};

Verdict judge(const Rows& rows, const std::vector<Requirement>& requirements) {
  Verdict verdict{.sentences = sentences_of(rows, requirements)};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (failed(rows[i])) ++verdict.failed;
    for (const std::string& text : missed_by(rows[i], requirements))
      verdict.missed.push_back(fmt::format("cell {}: {}; {}", i + 1, text, rows[i].at("command").get<std::string>()));
  }
  return verdict;
}

std::string gate_text(const Request& request, const Verdict& verdict) {
  if (request.require.empty()) return "";
  if (verdict.missed.empty()) return "\nall cells pass";
  constexpr std::size_t kMostNamed = 10;
  std::string text;
  for (std::size_t i = 0; i < std::min(kMostNamed, verdict.missed.size()); ++i)
    text += "\nMISSED: " + verdict.missed[i];
  if (verdict.missed.size() > kMostNamed)
    text += fmt::format("\n{} more are missed, see summary.json", verdict.missed.size() - kMostNamed);
  return text;
}

Json summary_of(const Request& request, const Rows& rows, std::size_t planned, const Verdict& verdict) {
  Json summary = begin_summary("network", rows.size(), planned);
  summary["seed"] = request.settings.seed;
  summary["duration_s"] = request.settings.duration_s;
  summary["start_up_excluded_s"] = kStartUp_s;
  summary["failed"] = verdict.failed;
  summary["require"] = request.require;
  summary["missed"] = verdict.missed;
  summary["sentences"] = verdict.sentences;
  summary["verdict"] =
      fmt::format("{}{}{}{}", fmt::join(verdict.sentences, "\n"),
                  verdict.failed > 0 ? fmt::format("; {} cells could not be measured", verdict.failed) : "",
                  gate_text(request, verdict), stopped_text(rows.size(), planned));
  return summary;
}

int run_lab(int argc, char** argv) {
  Request request;
  if (const auto code = parse(argc, argv, request)) return *code;
  const std::vector<NetworkCell> cells = cells_of(request.axes);
  const std::vector<Requirement> requirements = requirements_of(request);
  make_folder(request.out);
  watch_stop_signals();
  fmt::print("subworld lab network: {} cells, results in {}\n", cells.size(), request.out);
  std::fflush(stdout);
  const Rows rows = measure_all(cells, request);
  const Verdict verdict = judge(rows, requirements);
  const Json summary = summary_of(request, rows, cells.size(), verdict);
  const int code =
      end_lab(request.out, rows, summary, [&](const std::string& page) { write_network_report(page, rows, summary); });
  if (!verdict.missed.empty()) return static_cast<int>(ExitCode::quality);
  return verdict.failed > 0 ? static_cast<int>(ExitCode::failed) : code;
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("subworld lab network", [&] { return run_lab(argc, argv); });
}
