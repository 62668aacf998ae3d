#include "lab/network/felt.hpp"

#include "io/options/scene_name.hpp"
#include "io/results/json.hpp"
#include "lab/coupling/analysis.hpp"
#include "lab/network/criteria.hpp"
#include "lab/network/report.hpp"
#include "lab/over_link/over_link.hpp"
#include "link/settings.hpp"
#include "model/joined.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

namespace subworld {

namespace {

constexpr const char* kMeasured[] = {"force_error_rms",      "force_error_p99", "force_error_max",
                                     "time_offset_s",        "value_offset",    "created_j",
                                     "reference_created_j",  "energy_excess_j", "reference_energy_excess_j",
                                     "missed_deadlines",     "missed_by_os",    "missed_ratio",
                                     "real_time_factor_min", "lost_frames",     "late_reports_ratio",
                                     "reference_error",      "attempts"};

/// As the gates of a run (deploy/gates).
constexpr double kMostMissedRatio = 0.001;
constexpr double kLeastRealTimeFactor = 1.0;

Point point_of(const FeltSettings& settings) {
  Point point;
  point.scene = scene_file(settings.scene);
  point.ratio = 0;
  point.substeps = 0;
  point.duration_s = settings.duration_s;
  return point;
}

void fill(Json& row, const LinkedRun& run, const ForceError& error, std::size_t user) {
  const Json& haptic = run.summary.at("haptic").at(user);
  const double steps = haptic.at("steps").get<double>() + haptic.at("skipped_steps").get<double>();
  row["force_error_rms"] = error.rms;
  row["force_error_p99"] = error.p99;
  row["force_error_max"] = error.max;
  row["time_offset_s"] = error.time_offset_s;
  row["value_offset"] = error.value_offset;
  row["created_j"] = run.summary.at("device").at(user).at("operator_energy").at("created_j");
  row["reference_created_j"] = run.reference.balance[user].created_j;
  row["energy_excess_j"] = haptic.at("energy_excess_j");
  row["reference_energy_excess_j"] = run.reference.energy_excess_j;
  row["missed_deadlines"] = haptic.at("missed_deadlines");
  row["missed_by_os"] = haptic.at("missed_by_os");
  row["missed_ratio"] = haptic.at("missed_deadlines").get<double>() / std::max(1.0, steps);
  row["real_time_factor_min"] = run.summary.at("world").at("real_time_factor_min");
  row["lost_frames"] = haptic.at("lost_frames");
  row["late_reports_ratio"] = haptic.at("late_reports_ratio");
  row["attempts"] = run.attempts;
  row["verdict"] = run.summary.at("verdict");
}

/// False if a signal requested a stop.
bool measure(Rows& users, const FeltCell& cell, const FeltSettings& settings, References& references) {
  const Point point = point_of(settings);
  const Reference* const reference = references.of(point);
  if (reference == nullptr) return false;
  const std::optional<LinkedRun> run = undisturbed_run_over_link(
      point, {.link = cell.link, .dds = cell.world_dds, .users_dds = cell.haptic_dds, .domain = settings.domain});
  if (!run) return false;
  const std::vector<ForceError> errors =
      force_errors(run->felt, run->reference.felt, scene_of(point).settings.h_s, &FeltHistory::on_operator);
  for (std::size_t user = 0; user < users.size(); ++user) {
    fill(users[user], *run, errors.at(user), user);
    users[user]["reference_error"] = reference->on_operator_errors[user].rms;
  }
  return true;
}

/// In one line: of the launcher's output the verdict, which names program and fault, or else its errors.
std::string failure_in(std::string text) {
  for (const char* const mark : {"verdict: failed: ", "error: "}) {
    if (const std::size_t at = text.rfind(mark); at != std::string::npos) {
      text.erase(0, at + std::string(mark).size());
      break;
    }
  }
  while (text.ends_with('\n')) text.pop_back();
  for (std::size_t at = text.find('\n'); at != std::string::npos; at = text.find('\n', at)) text.replace(at, 1, "; ");
  return text;
}

/// The larger of the errors over their bars; above 1 the force can be felt to be wrong.
double excess_of(const Json& row) {
  const double rms = value_of(row, "force_error_rms") / kImperceptibleRms;
  const double p99 = value_of(row, "force_error_p99") / kImperceptibleP99;
  return std::isnan(rms) || std::isnan(p99) ? std::nan("") : std::max(rms, p99);
}

/// A value that is not a number is the worst.
const Json& worst_of(const Rows& rows) {
  return *std::ranges::max_element(rows, [](const Json& a, const Json& b) {
    const double x = excess_of(a), y = excess_of(b);
    return std::isnan(y) ? !std::isnan(x) : x < y;
  });
}

std::string figures_of(const Json& row) {
  return fmt::format("RMS {:.2g} %, p99 {:.2g} %", 1e2 * value_of(row, "force_error_rms"),
                     1e2 * value_of(row, "force_error_p99"));
}

std::string pair_and_user(const Json& row) {
  return fmt::format("{}, user {}", pair_of(row), row.at("user_name").get<std::string>());
}

/// The first gate with its figure, without the explanation that follows: "unstable: user 0: created energy 3 J". A
/// verdict that begins with ok has no explanation.
std::string without_explanation(const std::string& verdict) {
  const std::size_t kind = verdict.find(": ");
  if (verdict.starts_with("ok") || kind == std::string::npos) return verdict;
  std::size_t gate = kind + 2;
  if (verdict.compare(gate, 5, "user ") == 0) gate = verdict.find(": ", gate) + 2;
  return verdict.substr(0, verdict.find(": ", gate));
}

/// The answers of one sentence.
struct FeltLists {
  std::vector<std::string> within, beyond, undecided;
};

void judge_link(FeltLists& lists, const Rows& rows) {
  const std::string link = rows.front().at("link");
  const auto undecided = [&](const std::string& why) { lists.undecided.push_back(fmt::format("{} ({})", link, why)); };
  if (const auto bad = std::ranges::find_if(rows, failed); bad != rows.end())
    return undecided("not measured with " + pair_of(*bad));
  for (const Json& row : rows) {
    const double error = value_of(row, "reference_error");
    if (std::isfinite(error) && usable(error)) continue;
    return undecided(std::isfinite(error) ? fmt::format("the reference error of user {} is {:.2g} %",
                                                        row.at("user_name").get<std::string>(), 1e2 * error)
                                          : "the reference felt no force");
  }
  const Json& worst = worst_of(rows);
  if (excess_of(worst) <= 1.0) {
    lists.within.push_back(fmt::format("{} ({})", link, figures_of(worst)));
    return;
  }
  Rows calm = rows;
  std::erase_if(calm, disturbed);
  if (calm.empty() || excess_of(worst_of(calm)) <= 1.0)
    return undecided(fmt::format("{} in a run that the machine disturbed", figures_of(worst)));
  const Json& row = worst_of(calm);
  lists.beyond.push_back(fmt::format("{} ({}: {})", link, figures_of(row), pair_and_user(row)));
}

}  // namespace

std::vector<FeltCell> felt_cells_of(const NetworkAxes& axes, const FeltSettings& settings) {
  std::vector<FeltCell> cells;
  if (settings.scene.empty()) return cells;
  for (const std::string& link : axes.links) {
    for (const std::string& world : axes.world_dds) {
      for (const std::string& haptic : axes.haptic_dds) cells.push_back({world, haptic, link});
    }
  }
  return cells;
}

void check_scene(const FeltSettings& settings) {
  if (!settings.scene.empty()) (void)scene_of(point_of(settings));
}

Json felt_row_of(const FeltCell& cell, const FeltSettings& settings) {
  const LinkSettings link = parse_link(cell.link);
  Json row = {{"scene", settings.scene},
              {"world_dds", cell.world_dds},
              {"haptic_dds", cell.haptic_dds},
              {"link", cell.link},
              {"delay_s", link.delay_s},
              {"jitter_s", link.jitter_s},
              {"loss_ratio", link.loss.loss_ratio()},
              {"duration_s", nullptr},
              {"user", nullptr},
              {"user_name", ""}};
  for (const char* const column : kMeasured) row[column] = nullptr;
  row["verdict"] = "";
  row["failure"] = "";
  row["command"] = command_of(cell, settings);
  return row;
}

Rows measure_felt(const FeltCell& cell, const FeltSettings& settings, References& references) {
  const Scene scene = scene_of(point_of(settings));
  Rows users;
  for (int user = 0; user < scene.settings.users; ++user) {
    Json& row = users.emplace_back(felt_row_of(cell, settings));
    row["duration_s"] = scene.settings.duration_s;
    row["user"] = user;
    row["user_name"] = scene.users[user].name;
  }
  const Rows without_values = users;
  try {
    if (!measure(users, cell, settings, references)) return {};
  } catch (const std::exception& e) {
    users = without_values;
    for (Json& row : users) row["failure"] = failure_in(e.what());
  }
  return users;
}

std::string command_of(const FeltCell& cell, const FeltSettings& settings) {
  const std::string duration =
      settings.duration_s ? fmt::format(" --scene-duration {}", *settings.duration_s) : std::string();
  return fmt::format("subworld lab network --messages off --scene {}{} --world-dds {} --haptic-dds {} --link '{}'",
                     settings.scene, duration, cell.world_dds, cell.haptic_dds, cell.link);
}

double planned_s(const FeltCell& cell, const FeltSettings& settings) {
  constexpr double kAround_s = 2.0;                   // start and end of the programs, and the reference
  constexpr double kAttempts = 1.5, kWithLoss = 4.0;  // a run that loses frames is not "ok"
  const double attempts = parse_link(cell.link).loss.loss_ratio() > 0.0 ? kWithLoss : kAttempts;
  return attempts * (scene_of(point_of(settings)).settings.duration_s + kAround_s);
}

std::string to_text(const FeltCell& cell, const FeltSettings& settings) {
  return fmt::format("{:>10} > {:<10} scene {} {}", cell.world_dds, cell.haptic_dds, settings.scene, cell.link);
}

std::string felt_result_text(const Rows& users) {
  const Json& worst = worst_of(users);
  if (failed(worst)) return "FAILED: " + worst.at("failure").get<std::string>();
  return fmt::format("{}, user {}, verdict {}", figures_of(worst), worst.at("user_name").get<std::string>(),
                     without_explanation(worst.at("verdict")));
}

bool disturbed(const Json& row) {
  return value_of(row, "missed_ratio") > kMostMissedRatio ||
         value_of(row, "real_time_factor_min") < kLeastRealTimeFactor;
}

std::string felt_sentence_of(const Rows& rows) {
  if (rows.empty()) return "";
  FeltLists lists;
  for (const Rows& link : by_link(rows)) judge_link(lists, link);
  const auto words = [](const std::vector<std::string>& names) { return joined(names, ", "); };
  return fmt::format("scene {}: the felt force is within the imperceptible bar (RMS {:g} %, p99 {:g} %) over {}{}{}",
                     rows.front().at("scene").get<std::string>(), 1e2 * kImperceptibleRms, 1e2 * kImperceptibleP99,
                     lists.within.empty() ? "no link" : words(lists.within),
                     lists.beyond.empty() ? "" : "; beyond it over " + words(lists.beyond),
                     lists.undecided.empty() ? "" : "; undecided over " + words(lists.undecided));
}

}  // namespace subworld
