#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "io/options/scene_name.hpp"
#include "io/results/json.hpp"
#include "lab/latency/measure.hpp"
#include "lab/latency/report.hpp"
#include "lab/over_link/over_link.hpp"
#include "lab/page/command_line.hpp"
#include "model/joined.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <iterator>

namespace {

using namespace subworld;

constexpr double kLargest_s = 2.0, kMostDuration_s = 1.0;
const std::vector<std::string> kScenes{"row", "lift", "carry"};
const std::vector<std::string> kQuickScenes{"row"};

struct Request {
  std::vector<std::string> scenes;
  LatencyQuestion question;               ///< without its scene
  std::vector<double> jitters_s, losses;  ///< empty: the scene's
  bool device = false;
  bool emulated = false;
  bool quick = false;
  std::uint64_t seed = 1;
  std::string out;
};

void add_bounds(CommandLine& line, Criteria& bounds) {
  static constexpr std::array<std::pair<const char*, const char*>, kCriteria> kOptions{
      {{nullptr, nullptr},
       {"--rms", "bound on the RMS error of the force on the operator"},
       {"--p99", "bound on the 99th percentile of the error, as a part of the largest force"},
       {"--offset", "bound on the time offset of the force"},
       {"--energy", "bound on the energy that is created at the operator"},
       {"--oscillation", "bound on the oscillation of the force"},
       {nullptr, nullptr}}};
  static constexpr std::array<const char*, kCriteria> kUnits{"", kPartUnit, kPartUnit, "s", "J", "N", ""};
  constexpr double kMost = 100.0;
  for (std::size_t i = 0; i < kCriteria; ++i) {
    if (kOptions[i].first != nullptr)
      line.add(kOptions[i].first, &bounds[static_cast<Criterion>(i)], kOptions[i].second).range(0.0, kMost, kUnits[i]);
  }
}

/// Throws `Error` (usage). Returns an exit code if the program is done.
std::optional<int> parse(int argc, char** argv, Request& request) {
  LatencyQuestion& question = request.question;
  Point& point = question.point;
  point.ratio = 0;
  point.substeps = 0;
  CommandLine line("subworld lab latency",
                   "Searches, for each user, the largest delay between world and sub-world that cannot be felt.");
  line.footer(
      "Examples:\n"
      "  subworld lab latency row --out out/row\n"
      "  subworld lab latency lift carry --scheme paper --largest 0.1\n"
      "  subworld lab latency row --rms 0.1 --p99 0.2 --seed 2\n"
      "  subworld lab latency press --device-latency\n"
      "  subworld lab latency carry --jitter 0,0.005 --loss 0,0.01\n"
      "  subworld lab latency row --link --dds cyclonedds\n"
      "DIR/report.html shows the errors against the delay, DIR/results.csv and results.json hold them, with a row\n"
      "for the limit of each user.\n"
      "Ctrl-C writes what has been measured so far.\n"
      "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, 2 usage or scene.");
  const std::string scenes = "the scene's";
  line.add("scene", &request.scenes, "scene files, or names of scenes of Subworld").otherwise(joined(kScenes, " "));
  line.flag("--device-latency", request.device,
            "also search the largest delay between device and sub-world; there the stability of the coupling in a wall "
            "is a bound too");
  line.flag("--link", request.emulated,
            "also search the largest round-trip delay of an emulated network link, with the real programs in real time "
            "on hosts of their own; needs the rights of `subworld link`");
  add_dds(line, question.dds, {"fastdds", "cyclonedds", "mixed"});
  line.add("--largest", &question.largest_s, "largest delay that is looked at").range(0.001, kLargest_s, "s");
  line.add("--jitter", &request.jitters_s, "longest extra delay of a single message; the limit is searched for each")
      .range(0.0, 1.0, "s")
      .otherwise("the scene's, usually 0");
  line.add("--loss", &request.losses, "part of the messages that is lost; the limit is searched for each")
      .range(0.0, 0.9)
      .otherwise("the scene's, usually 0");
  add_bounds(line, question.bounds);
  line.add("--scheme", &point.scheme, "coupling scheme")
      .one_of({"direct", "paper", "reduced"})
      .otherwise(scenes + ", else reduced");
  line.add("--ratio", &point.ratio, "simulation ratio r = T / h").check(fixed_ratio_fault).otherwise(scenes);
  std::optional<std::string> passivity;
  std::vector<std::string> set;
  const Setting& bound = *find_setting("passivity");
  line.add("--passivity", &passivity, std::string(bound.meaning))
      .one_of({bound.range.words.begin(), bound.range.words.end()})
      .otherwise(scenes);
  add_set_option(line, set);
  add_duration(line, point.duration_s);
  add_seed(line, request.seed,
           "seed of the grid of delays, of the instants in a cycle at which the paths begin, and of "
           "jitter and loss");
  line.flag("--quick", request.quick,
            fmt::format("a first look: scene {}, {:g} s, a coarse grid, where nothing else is given",
                        joined(kQuickScenes, " "), kMostDuration_s));
  add_out(line, "latency", request.out);
  if (const auto code = line.parse(argc, argv)) return code;
  if (passivity) point.settings.push_back({"passivity", *passivity});
  for (const std::string& text : set) point.settings.push_back(parse_change(text));
  if (request.quick) {
    question.range.stride = 2.0;
    question.range.precision = 1.2;
    question.starts = 1;
    if (!point.duration_s) point.duration_s = kMostDuration_s;
  }
  if (request.scenes.empty()) request.scenes = scene_files(request.quick ? kQuickScenes : kScenes);
  if (request.out.empty()) request.out = default_out("latency");
  return std::nullopt;
}

/// The question's point with each of these values of a setting; without values, as it is.
std::vector<Point> varied(const std::vector<Point>& points, const char* key, const std::vector<double>& values) {
  if (values.empty()) return points;
  std::vector<Point> all;
  for (const Point& point : points) {
    for (const double value : values) all.emplace_back(point).settings.push_back({key, fmt::format("{}", value)});
  }
  return all;
}

std::vector<LatencyQuestion> questions_of(const Request& request) {
  const std::vector<Point> points =
      varied(varied({request.question.point}, "delay.jitter_s", request.jitters_s), "delay.loss_ratio", request.losses);
  std::vector<LatencyQuestion> questions;
  for (const std::string& scene : request.scenes) {
    for (const Link link : {Link::world, Link::device, Link::emulated}) {
      if (link == Link::device && !request.device) continue;
      if (link == Link::emulated && !request.emulated) continue;
      for (const Point& point : points) {
        LatencyQuestion& question = questions.emplace_back(request.question);
        question.point = point;
        question.point.scene = scene_file(scene);
        question.link = link;
        scatter(question, request.seed);
      }
    }
  }
  return questions;
}

/// Prints a line for each delay.
class Progress {
 public:
  void operator()(const LatencyQuestion& question, const LatencyAnswer& answer, const DelayedRun& run,
                  std::size_t most) const {
    std::size_t worst = 0;
    const auto of = [&](std::size_t u) { return run.users[u][Criterion::rms]; };
    for (std::size_t u = 0; u < run.users.size(); ++u) {
      if (!(of(u) <= of(worst))) worst = u;
    }
    const Criteria& values = run.users[worst];
    const std::optional<Criterion> over = exceeded(values, question.bounds);
    fmt::print("[{:3}/{}] {:<13} {:<6} {:6.4g} ms  {}: rms {:.2f} %, p99 {:.2f} %, offset {:.1f} ms{}{}\n",
               answer.runs.size(), most, answer.settings.at("scene").get<std::string>(),
               name_of(question.link) + disturbance_of(answer.settings), 1e3 * run.delay_s, answer.limits[worst].name,
               1e2 * values[Criterion::rms], 1e2 * values[Criterion::p99], 1e3 * values[Criterion::offset],
               over ? fmt::format(": {}", text_of(*over, values[*over])) : "",
               left_.text(static_cast<double>(answer.runs.size()) / static_cast<double>(most)));
    std::fflush(stdout);
  }

 private:
  TimeLeft left_{1.0};
};

Json summary_of(const Request& request, const LatencyFindings& found) {
  std::size_t runs = 0;
  for (const LatencyAnswer& answer : found.answers) {
    for (const DelayedRun& at : answer.runs) runs += static_cast<std::size_t>(at.starts);
  }
  Json summary = begin_summary("latency", found.answers.size(), found.questions.size());
  summary["runs"] = runs;
  summary["seed"] = request.seed;
  for (const CriterionText& text : kCriterionTexts)
    summary["bounds"][text.column] = request.question.bounds[text.criterion];
  summary["starts"] = request.question.starts;
  summary["largest_s"] = request.question.largest_s;
  summary["answers"] = Json::array();
  std::string verdict;
  for (const LatencyAnswer& answer : found.answers) {
    Json entry = answer.settings;
    entry["finished"] = answer.finished;
    entry["sentence"] = answer.sentence;
    summary["answers"].push_back(std::move(entry));
    verdict += (verdict.empty() ? "" : "\n") + answer.sentence;
  }
  summary["verdict"] = verdict;
  return summary;
}

int run_lab(int argc, char** argv) {
  const auto again = [](const std::string& folder, const std::string& page) {
    write_latency_report(page, saved_searches(folder));
  };
  if (const auto code = report_again(argc, argv, again)) return *code;
  Request request;
  if (const auto code = parse(argc, argv, request)) return *code;
  LatencyFindings found{.questions = questions_of(request), .answers = {}, .summary = {}};
  if (request.emulated) require_link_rights();
  open_results("latency", request.out);
  watch_stop_signals();
  fmt::print("subworld lab latency: {} searches, results in {}\n", found.questions.size(), request.out);
  std::fflush(stdout);

  Rows rows;
  References references;
  for (const LatencyQuestion& question : found.questions) {
    if (stop_signal() != 0) break;
    const Progress progress;
    found.answers.push_back(
        answer(question, references, [&](const LatencyAnswer& so_far, const DelayedRun& run, std::size_t most) {
          progress(question, so_far, run, most);
        }));
    std::ranges::move(rows_of(question, found.answers.back()), std::back_inserter(rows));
  }
  found.summary = summary_of(request, found);
  return end_lab(request.out, rows, found.summary, [&](const std::string& page) { write_latency_report(page, found); });
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("subworld lab latency", [&] { return run_lab(argc, argv); });
}
