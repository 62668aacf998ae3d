#include "io/options/command_line.hpp"
#include "io/options/options.hpp"
#include "io/results/json.hpp"
#include "lab/page/tables.hpp"
#include "model/error.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>

namespace {

using namespace subworld;

/// A compared figure: an entry of a row of `subworld lab coupling`.
struct Figure {
  const char* object;
  const char* quantile;
};
constexpr std::array kFigures{Figure{"haptic_step_s", "p50"}, Figure{"haptic_step_s", "p99"},
                              Figure{"world_step_s", "p50"}, Figure{"world_step_s", "p99"},
                              Figure{"synchronise_step_s", "p50"}};

/// Rows of each round of one side, in order.
std::vector<Rows> rounds_of(const std::string& folder) {
  std::vector<Rows> rounds;
  for (int round = 1;; ++round) {
    const std::string file = fmt::format("{}/{}/results.json", folder, round);
    if (!std::filesystem::exists(file)) return rounds;
    const Json rows = read_json(file);
    rounds.emplace_back(rows.begin(), rows.end());
  }
}

double median(std::vector<double> values) {
  if (values.empty()) return NAN;
  std::ranges::sort(values);
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : 0.5 * (values[middle - 1] + values[middle]);
}

std::vector<double> values_of(const std::vector<Rows>& rounds, std::size_t scene, const Figure& figure) {
  std::vector<double> values;
  for (const Rows& rows : rounds) {
    if (scene < rows.size()) values.push_back(rows[scene].at(figure.object).at(figure.quantile).get<double>());
  }
  return values;
}

Rows compared(const std::vector<Rows>& now, const std::vector<Rows>& before, const std::string& version_now,
              const std::string& version_before) {
  const Json here = machine();
  Rows table;
  for (std::size_t i = 0; i < now.front().size(); ++i) {
    for (const Figure& figure : kFigures) {
      const std::vector<double> a = values_of(now, i, figure), b = values_of(before, i, figure);
      std::vector<double> ratios;
      for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k) ratios.push_back(a[k] / b[k]);
      const bool any = !ratios.empty();
      table.push_back({{"scene", now.front()[i].at("scene")},
                       {"figure", fmt::format("{}.{}", figure.object, figure.quantile)},
                       {"now_s", median(a)},
                       {"baseline_s", median(b)},
                       {"ratio", median(ratios)},
                       {"ratio_least", any ? *std::ranges::min_element(ratios) : NAN},
                       {"ratio_most", any ? *std::ranges::max_element(ratios) : NAN},
                       {"rounds", a.size()},
                       {"version", version_now},
                       {"baseline", version_before},
                       {"cpu", here.at("cpu")},
                       {"cores", here.value("cores", 0)}});
    }
  }
  return table;
}

void print(const Rows& table) {
  fmt::print("{:<16} {:<24} {:>12} {:>12} {:>8}  {}\n", "scene", "figure", "now, us", "baseline, us", "ratio",
             "least .. most of a round");
  for (const Json& row : table) {
    const double ratio = number(row, "ratio");
    fmt::print("{:<16} {:<24} {:>12.1f} {}\n", row.at("scene").get<std::string>(), row.at("figure").get<std::string>(),
               1e6 * number(row, "now_s"),
               std::isfinite(ratio)
                   ? fmt::format("{:>12.1f} {:>8.3f}  {:.3f} .. {:.3f}", 1e6 * number(row, "baseline_s"), ratio,
                                 number(row, "ratio_least"), number(row, "ratio_most"))
                   : fmt::format("{:>12}", "-"));
  }
}

int compare(int argc, char** argv) {
  std::string folder, now = "unknown", before;
  CommandLine line(
      "bench_compare",
      "Compares the rounds that tests/bench/run left in FOLDER/rounds: medians, and ratios round by round.");
  line.add("folder", &folder, "folder of tests/bench/run").required();
  line.add("--version-now", &now, "version of this tree, for the table");
  line.add("--version-baseline", &before, "version of the baseline, for the table");
  if (const auto code = line.parse(argc, argv)) return *code;
  const std::vector<Rows> rounds = rounds_of(folder + "/rounds/now");
  if (rounds.empty())
    throw Error(ExitCode::usage, fmt::format("{}/rounds/now/1/results.json is not there; run tests/bench/run", folder));
  const Rows table = compared(rounds, rounds_of(folder + "/rounds/baseline"), now, before);
  write_csv(folder + "/results.csv", table);
  write_json(folder + "/results.json", table);
  print(table);
  fmt::print("results: {}/results.csv\n", folder);
  return static_cast<int>(ExitCode::done);
}

}  // namespace

int main(int argc, char** argv) {
  return guarded("bench_compare", [&] { return compare(argc, argv); });
}
