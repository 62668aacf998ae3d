#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "io/options/scene_name.hpp"
#include "io/results/json.hpp"
#include "lab/page/command_line.hpp"
#include "lab/plan/measure.hpp"
#include "lab/plan/report.hpp"
#include "lab/random/scene.hpp"
#include "lab/session/setting.hpp"
#include "model/error.hpp"
#include "model/joined.hpp"
#include "model/places.hpp"
#include "rt/stop.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>

namespace {

using namespace subworld;

constexpr double kQuickDuration_s = 1.0;
const std::vector<std::string> kQuickScenes{"press", "row", "scatter"};

struct Request {
  std::vector<std::string> scenes;
  std::vector<std::string> items;
  std::optional<double> duration_s;
  int repeats = 3;
  int random = 0;
  std::uint64_t seed = 1;
  bool quick = false;
  std::string out;
};

/// All scenes of deploy/scenes.
std::vector<std::string> shipped_scenes() {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(data_folder("scenes"))) {
    if (entry.path().extension() == ".yaml") files.push_back(entry.path().string());
  }
  std::ranges::sort(files);
  return files;
}

/// Throws `Error` (usage). Returns an exit code if the program is done.
std::optional<int> parse(int argc, char** argv, Request& request) {
  CommandLine line("subworld lab plan",
                   "Measures the time that each optimisation of the plan saves, and the difference that it makes: runs "
                   "each scene with it on and off.");
  std::string items;
  for (const OptimisationItem& item : optimisation_items())
    items += fmt::format("  {:<11} {} ({})\n", item.name, item.what, item.where);
  line.footer("Optimisations, each without what is named; \"all\" means all together:\n" + items +
              "\nExamples:\n"
              "  subworld lab plan --quick --out out/plan\n"
              "  subworld lab plan row scatter --item rest,all --repeat 5\n"
              "  subworld lab plan --random 100 --seed 3 --item all\n"
              "DIR/report.html shows the results, DIR/results.csv and results.json hold them.\n"
              "Ctrl-C writes what has been measured so far.\n"
              "Exit codes: 0 done (also SIGINT, SIGTERM), 1 failed while running, 2 usage or scene.");
  line.add("scene", &request.scenes, "scene files, or names of scenes of Subworld").otherwise("all of them");
  line.add("--item", &request.items, "optimisations, or all for all together").otherwise("each, and all");
  const Option repeat =
      line.add("--repeat", &request.repeats, "runs of each kind, of which the least CPU time counts").range(1, 1000);
  add_duration(line, request.duration_s);
  const Option random =
      line.add("--random", &request.random,
               "number of random scenes of `subworld lab stability`, beside only those scenes that are named")
          .range(1, 1'000'000)
          .otherwise("none");
  add_seed(line, request.seed).needs(random);
  line.flag("--quick", request.quick,
            fmt::format("a first look: scenes {}, {:g} s, one run of each kind, where nothing else is given",
                        joined(kQuickScenes, " "), kQuickDuration_s));
  add_out(line, "plan", request.out);
  if (const auto code = line.parse(argc, argv)) return code;
  (void)parse_disabled(request.items, "--item");
  std::vector<std::string> once;
  for (const std::string& item : request.items) {
    if (std::ranges::find(once, item) == once.end()) once.push_back(item);
  }
  request.items = once;
  if (request.quick && !request.duration_s && request.scenes.empty()) request.duration_s = kQuickDuration_s;
  if (request.quick && !repeat.given()) request.repeats = 1;
  if (request.random == 0) {
    if (request.scenes.empty()) request.scenes = request.quick ? scene_files(kQuickScenes) : shipped_scenes();
    for (std::string& scene : request.scenes) scene = scene_file(scene);
  }
  if (request.out.empty()) request.out = default_out("plan");
  return std::nullopt;
}

/// A scene as `subworld run` loads it, in lock-step.
Scene loaded(const std::string& file, const std::optional<double>& duration_s) {
  Options options;
  options.scene = file;
  change(options, "mode", "lockstep");
  if (duration_s) change(options, "duration_s", fmt::format("{}", *duration_s));
  return load_scene(options);
}

std::vector<PlanPoint> points_of(const Request& request) {
  std::vector<std::string> items = request.items;
  if (items.empty()) {
    for (const OptimisationItem& item : optimisation_items()) items.emplace_back(item.name);
    items.emplace_back("all");
  }
  std::vector<PlanPoint> points;
  const auto add = [&](const std::string& name, const std::function<Scene()>& load) {
    for (const std::string& item : items) points.push_back({name, load, item});
  };
  for (const std::string& file : request.scenes) {
    add(loaded(file, request.duration_s).name, [=] { return loaded(file, request.duration_s); });
  }
  for (int i = 0; i < request.random; ++i) {
    add(fmt::format("random_{}_{}", request.seed, i),
        [=] { return random_scene(request.seed, static_cast<std::uint64_t>(i)); });
  }
  return points;
}

/// The errors of both runs, if their difference exceeds the reference error.
std::string errors_text(const Json& row) {
  if (!(number(row, "force_difference_rms") > number(row, "reference_error"))) return "";
  return fmt::format(", errors {:.2g} % on and {:.2g} % off", 1e2 * number(row, "error_enabled_rms"),
                     1e2 * number(row, "error_disabled_rms"));
}

void print(const Json& row, std::size_t done, std::size_t all, const std::string& left) {
  std::string text = row.at("reason");
  if (row.at("enabled").get<bool>()) {
    const auto difference =
        row.at("hash_equal").get<bool>()             ? std::string("the same bit by bit")
        : number(row, "force_difference_rms") == 0.0 ? std::string("the same force")
        : std::isfinite(number(row, "force_difference_rms"))
            ? fmt::format("differs by {:.2g} %, reference error {:.2g} %{}", 1e2 * number(row, "force_difference_rms"),
                          1e2 * number(row, "reference_error"), errors_text(row))
            : std::string("no force felt");
    text = fmt::format("world {:.3f}, haptic {:.3f}, bytes {:.3f} of those with it off; {}; bodies {:.2g} mm apart{}",
                       number(row, "world_cpu_ratio"), number(row, "haptic_cpu_ratio"), number(row, "bytes_ratio"),
                       difference, 1e3 * number(row, "position_difference_max_m"),
                       row.at("held").get<bool>() ? "" : ": worse");
  } else {
    text = "off: " + text;
  }
  fmt::print("[{:3}/{}] {:<18} {:<10} {}{}\n", done, all, row.at("scene").get<std::string>(),
             row.at("item").get<std::string>(), text, left);
  std::fflush(stdout);
}

int run_lab(int argc, char** argv) {
  const auto again = [](const std::string& folder, const std::string& page) {
    write_plan_report(page, read_rows(folder + "/results.json"), read_json(folder + "/summary.json"));
  };
  if (const auto code = report_again(argc, argv, again)) return *code;
  Request request;
  if (const auto code = parse(argc, argv, request)) return *code;
  const std::vector<PlanPoint> points = points_of(request);
  open_results("plan", request.out);
  watch_stop_signals();
  fmt::print("subworld lab plan: {} comparisons, results in {}\n", points.size(), request.out);
  std::fflush(stdout);
  Rows rows;
  const TimeLeft left(static_cast<double>(points.size()));
  try {
    for (const PlanPoint& point : points) {
      rows.push_back(measured_plan_row(point, request.repeats));
      print(rows.back(), rows.size(), points.size(), left.text(static_cast<double>(rows.size())));
      write_json(request.out + "/results.json", rows);
    }
  } catch (const Interrupted&) {
  }
  const Json summary = plan_summary(rows, points.size());
  return end_lab(request.out, rows, summary, [&](const std::string& page) { write_plan_report(page, rows, summary); });
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("subworld lab plan", [&] { return run_lab(argc, argv); });
}
