#include "judge/salvage.hpp"

#include "io/records/history_reader.hpp"
#include "io/results/json.hpp"
#include "judge/summary.hpp"
#include "model/error.hpp"
#include "rt/histogram.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace subworld {

namespace {

Json of_world(HistoryReader& rows) {
  Histogram step, lateness;
  double factor_min = 1.0;
  while (rows.next()) {
    step.add(rows.at("step_s"));
    lateness.add(rows.at("lateness_s"));
    factor_min = std::min(factor_min, rows.at("real_time_factor"));
  }
  return {{"cycles", step.count()},
          {"step_s", quantiles(step)},
          {"lateness_s", quantiles(lateness)},
          {"real_time_factor_min", factor_min}};
}

Json of_haptic(HistoryReader& rows) {
  Histogram step, lateness;
  MeanMax squared;
  double skipped = 0.0;
  while (rows.next()) {
    step.add(rows.at("step_s"));
    lateness.add(rows.at("lateness_s"));
    const double force_n = rows.norm("operator_force", "n");
    squared.add(force_n * force_n);
    skipped += rows.at("skipped");
  }
  return {{"steps", step.count()},
          {"skipped_steps", static_cast<std::uint64_t>(skipped)},
          {"lateness_s", quantiles(lateness)},
          {"step_s", quantiles(step)},
          {"force_rms_n", std::sqrt(squared.mean())},
          {"force_max_n", std::sqrt(squared.max)}};
}

Json of_device(HistoryReader& rows) {
  std::uint64_t steps = 0;
  while (rows.next()) ++steps;
  return {{"steps", steps}};
}

/// Adds the time of the last complete row.
template <class Read>
Json of_history(const std::string& file, Read read) {
  HistoryReader rows(file);
  Json json = read(rows);
  json["to_s"] = rows.at("time_s");
  json["partial"] = true;
  return json;
}

/// The part as the program wrote it; without one, null.
Json part_of(const std::string& file) {
  try {
    return read_json(file);
  } catch (const Error&) {
    return nullptr;
  }
}

}  // namespace

Json salvage(const std::string& folder, int users) {
  Json found;
  if (Json part = part_of(part_file(folder, "world_sim", -1)); part.is_object()) {
    found["simulated_s"] = part["simulated_s"];
    found["state_hash"] = part["state_hash"];
    found["world"] = std::move(part["world"]);
    found["world"]["ending"] = std::move(part["ending"]);
  } else {
    found["world"] = of_history(folder + "/world.csv", of_world);
    found["simulated_s"] = found["world"]["to_s"];
  }
  const auto add = [&](const char* kind, int user, const auto& read) {
    Json part = part_of(part_file(folder, fmt::format("{}_sim", kind), user));
    if (!part.is_object()) {
      part = {{"user", user}};
      part.update(of_history(fmt::format("{}/{}_{}.csv", folder, kind, user), read));
    }
    found[kind].push_back(std::move(part));
  };
  for (int user = 0; user < users; ++user) {
    add("haptic", user, of_haptic);
    add("device", user, of_device);
  }
  return found;
}

}  // namespace subworld
