// The table of tests/bench/users_curve, from the summaries of its runs.

#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "io/results/json.hpp"
#include "lab/page/tables.hpp"
#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace subworld;

double median(std::vector<double> values) {
  std::ranges::sort(values);
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

/// Of one run; what concerns users is that of the worst one.
Json figures_of(const Json& summary) {
  double own = 0.0, by_os = 0.0, late_s = 0.0, step_s = 0.0, members = 0.0;
  for (const Json& user : summary.at("haptic")) {
    const double steps = std::max(1.0, user.at("steps").get<double>());
    own = std::max(own, user.at("missed_by_run").get<double>() / steps);
    by_os = std::max(by_os, user.at("missed_by_os").get<double>() / steps);
    late_s = std::max(late_s, user.at("lateness_s").at("p99").get<double>());
    step_s = std::max(step_s, user.at("step_s").at("p99").get<double>());
    members = std::max(members, user.at("members").at("mean").get<double>());
  }
  const Json &world = summary.at("world"), &load = summary.at("machine_load");
  return {{"missed_by_run_ratio", own},
          {"missed_by_os_ratio", by_os},
          {"lateness_p99_s", late_s},
          {"haptic_step_p99_s", step_s},
          {"members_mean", members},
          {"world_step_p50_s", world.at("step_s").at("p50")},
          {"real_time_factor_min", world.at("real_time_factor_min")},
          {"real_time_factor_mean", world.at("real_time_factor_mean")},
          {"ratio_mean", world.at("ratio").at("mean")},
          {"own_cores", load.at("own_cores")},
          {"other_cores", load.at("other_cores")}};
}

int main_of(int argc, char** argv) {
  CommandLine line("bench_users_curve",
                   "Prints the table of the runs that tests/bench/users_curve left in FOLDER/runs.");
  std::string folder;
  line.add("folder", &folder, "folder of tests/bench/users_curve").required();
  if (const auto code = line.parse(argc, argv)) return *code;
  std::map<std::pair<double, int>, std::vector<Json>> points;  // by rate and users
  Json any;
  for (const auto& run : std::filesystem::directory_iterator(folder + "/runs")) {
    if (!run.is_directory()) continue;
    any = read_json(run.path().string() + "/summary.json");
    points[{-1.0 / any.at("h_s").get<double>(), any.at("users").get<int>()}].push_back(figures_of(any));
  }
  Rows table;
  for (const auto& [point, rounds] : points) {
    Json row{{"scene", any.at("scene")}, {"rate_hz", -point.first}, {"users", point.second}, {"rounds", rounds.size()}};
    for (const auto& [name, first] : rounds.front().items()) {
      std::vector<double> values;
      for (const Json& round : rounds) values.push_back(round.at(name).get<double>());
      row[name] = median(values);
    }
    row["cpu"] = any.at("machine").at("cpu");
    row["cores"] = any.at("machine").at("cores");
    table.push_back(row);
  }
  fmt::print("{:>8} {:>6} {:>16} {:>15} {:>18} {:>19} {:>10}\n", "rate Hz", "users", "missed by run %",
             "missed by OS %", "real-time factor", "its least value", "cores");
  for (const Json& row : table) {
    const auto number = [&](const char* name) { return row.at(name).get<double>(); };
    fmt::print("{:>8.0f} {:>6} {:>16.3f} {:>15.3f} {:>18.3f} {:>19.3f} {:>10.2f}\n", number("rate_hz"),
               row.at("users").get<int>(), 100.0 * number("missed_by_run_ratio"), 100.0 * number("missed_by_os_ratio"),
               number("real_time_factor_mean"), number("real_time_factor_min"), number("own_cores"));
  }
  write_csv(folder + "/results.csv", table);
  fmt::print("results: {}/results.csv\n", folder);
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  return subworld::guarded("bench_users_curve", [&] { return main_of(argc, argv); });
}
