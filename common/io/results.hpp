#pragma once

#include "model/exchange.hpp"
#include "model/optimisation.hpp"
#include "rt/histogram.hpp"

#include <nlohmann/json.hpp>

#include <span>
#include <string>

namespace subworld {

using Json = nlohmann::ordered_json;

/// {"p50", "p99", "p99_9", "max", "mean"} in seconds.
[[nodiscard]] Json quantiles(const Histogram& histogram);

/// A loop's stages (rt/stages), by name: {"NAME_s": quantiles over the steps that contain the stage, with its `share`
/// of the time outside waking up}.
[[nodiscard]] Json stages(std::span<const Histogram> times, std::span<const char* const> names);

/// Mean and maximum of a count.
struct MeanMax {
  double sum = 0.0;
  double max = 0.0;
  std::uint64_t count = 0;

  void add(double value) noexcept {
    sum += value;
    max = count == 0 ? value : (value > max ? value : max);
    ++count;
  }
  [[nodiscard]] double mean() const noexcept { return count == 0 ? 0.0 : sum / static_cast<double>(count); }
};
[[nodiscard]] Json mean_max(const MeanMax& values);

/// An exchange of engines while running.
struct EngineChange {
  std::uint32_t order = 0;  ///< number of the `Control` that requested it
  double at_s = 0.0;        ///< simulated time
  std::string from;
  std::string to;
  double exchange_s = 0.0;    ///< time that the loop spent on it
  double force_step_n = 0.0;  ///< largest change of the force on the operator between two steps just after; haptic only
  double force_step_before_n = 0.0;  ///< likewise just before the exchange
};
/// Energy balance of an operator (coupling/energy_port), J: final energy, least energy, and the energy delivered to the
/// operator beyond what the coupling could store.
[[nodiscard]] Json operator_energy(double net_j, double least_j, double created_j);
/// Middleware events while a loop ran.
[[nodiscard]] Json to_json(const EventCounts& events);

[[nodiscard]] std::string to_text(const EngineChange& change);
[[nodiscard]] Json to_json(const EngineChange& change);

/// Decision and reason of each item of the plan.
[[nodiscard]] Json to_json(std::span<const PlannedItem> plan);

/// Creates the folder. Throws `Error` (failed) with the cure.
void make_folder(const std::string& folder);
/// Writes the complete file or nothing. Throws `Error` (failed).
void write_json(const std::string& path, const Json& json);
/// Throws `Error` (failed) if the file is missing or invalid.
[[nodiscard]] Json read_json(const std::string& path);

[[nodiscard]] int machine_cores();
/// Machine, kernel and versions, for the summary.
[[nodiscard]] Json machine();

}  // namespace subworld
