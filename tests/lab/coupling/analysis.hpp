#pragma once

#include "lab/page/tables.hpp"

#include <string>
#include <vector>

namespace subworld {

/// CPU budgets for the choice of a setting, CPU s per simulated s.
inline constexpr double kBudgets[] = {0.05, 0.1, 0.25, 0.5, 1.0};
inline constexpr double kImperceptibleRms = 0.035;       ///< half the force JND
inline constexpr double kImperceptibleP99 = 0.07;        ///< the force JND
inline constexpr double kImperceptibleOffset_s = 0.005;  ///< a third of the delay that subjects detected

/// The columns of settings: those before "force_error_rms" that say nothing of the run itself or its users.
[[nodiscard]] std::vector<std::string> setting_columns(const Json& row);
/// Those of the conditions that are equal for all methods.
[[nodiscard]] std::vector<std::string> conditions_of(const Json& row);

/// False if the reference felt no force: then there is no relative error.
[[nodiscard]] bool comparable(const Json& row);
/// Whether errors can be compared with a reference of this error. If the reference error itself can be felt, the
/// reference is only one of many valid ones.
[[nodiscard]] inline bool usable(double reference_error) { return reference_error <= kImperceptibleRms; }
/// Whether a coupling can hardly have a smaller error than this one (lab/coupling/causal).
[[nodiscard]] bool at_bound(double error, double reference_error, double causal_error);
/// The same of a row, where the bound is one of causality.
[[nodiscard]] bool at_causal_bound(const Json& row);
[[nodiscard]] bool imperceptible(const Json& row);
/// The first row of each engine of the world.
[[nodiscard]] std::vector<const Json*> first_of_each_engine(const std::vector<const Json*>& rows);

/// Whether another point under the same conditions is better in error or CPU time and not worse in the other. Errors
/// below a usable reference error are equal.
[[nodiscard]] bool dominated(const Json& row, const Rows& rows);
/// The surviving row with the least error, then the least CPU time, within `budget` CPU s per s, or nullptr. Errors
/// below a usable reference error are equal.
[[nodiscard]] const Json* choice(const std::vector<const Json*>& rows, double budget);

/// Observed order p of force_error_rms ~ C x^p by least squares in the logarithms. One entry for each set of points
/// that differ only in the column `x`: surviving points above the reference error, without delay. With fewer than two
/// such points p is null.
[[nodiscard]] Json convergence(const Rows& rows, const std::string& x);

/// Statistics over the variants of a scene. One entry for each set of rows that differ only in the variant: the median
/// and the largest error of the surviving ones, their number, and the least and the largest reference error. Empty
/// without variants.
[[nodiscard]] Json over_variants(const Rows& rows);

}  // namespace subworld
