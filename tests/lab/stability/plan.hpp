#pragma once

#include "io/results/results.hpp"
#include "lab/stability/cases/case.hpp"

#include <string>
#include <vector>

namespace subworld {

/// Requested measurements. An empty list means all.
struct StabilityRequest {
  std::vector<std::string> names;  ///< of cases and groups
  std::vector<std::string> engines;
  std::vector<std::string> presets;
  std::vector<double> steps_s;
  bool quick = false;
};
inline constexpr double kStabilitySteps_s[] = {1.0 / 1000.0, 1.0 / 250.0, 1.0 / 60.0};
inline constexpr double kQuickStabilitySteps_s[] = {1.0 / 1000.0, 1.0 / 250.0};

/// One measurement of one case.
struct StabilityPoint {
  const StabilityCase* one = nullptr;
  EngineSetting setting;
  std::optional<double> value;  ///< of the case's parameter

  /// "slide_stop, 1 m/s": equal for every setting.
  [[nodiscard]] std::string label() const;
};
/// The label of a row.
[[nodiscard]] std::string label_of(const Json& row);

/// The cases of these names and groups, in the order of the page. Throws `Error` (usage) with the nearest name.
[[nodiscard]] std::vector<const StabilityCase*> chosen_cases(const std::vector<std::string>& names);
/// "sliding: slide_stop, ...", one line for each group.
[[nodiscard]] std::string cases_text();

/// Every measurement, setting by setting. Throws `Error` (usage).
[[nodiscard]] std::vector<StabilityPoint> points_of(const StabilityRequest& request);

}  // namespace subworld
