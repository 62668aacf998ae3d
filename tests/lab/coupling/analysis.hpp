#pragma once

#include "lab/page/tables.hpp"

#include <string>
#include <vector>

namespace subworld {

/// CPU s per simulated s among which a user may have to choose.
inline constexpr double kBudgets[] = {0.05, 0.1, 0.25, 0.5, 1.0};
inline constexpr double kImperceptibleRms = 0.035;       ///< half the force JND
inline constexpr double kImperceptibleP99 = 0.07;        ///< the force JND
inline constexpr double kImperceptibleOffset_s = 0.005;  ///< a third of the delay that was detected

/// False where the reference felt no force: then there is no relative error.
[[nodiscard]] bool comparable(const Json& row);
/// Whether a reference's floor tells errors apart at all: a floor that could be felt says only that the reference is
/// one of many.
[[nodiscard]] inline bool telling(double floor) { return floor <= kImperceptibleRms; }
[[nodiscard]] bool imperceptible(const Json& row);

/// Whether another point under the same conditions is better in error or CPU and not worse in the other; errors under
/// a telling floor are equal.
[[nodiscard]] bool dominated(const Json& row, const Rows& rows);
/// The survivor with the least error, then the least CPU, of those within `budget` CPU s per s, or nullptr. Errors
/// under a telling floor are equal.
[[nodiscard]] const Json* choice(const std::vector<const Json*>& rows, double budget);

/// Observed order p of force_error_rms ~ C x^p by least squares in the logarithms, one entry for each set of points
/// that differ in the column `x` alone: survivors above the floor, without delay. Fewer than two such points: p is
/// null.
[[nodiscard]] Json convergence(const Rows& rows, const std::string& x);

/// What becomes of each setting over the variants of its scene: an entry for each set of rows that differ in the
/// variant alone, with the median and the largest error of the survivors, how many these are, and the least and the
/// largest floor. Empty without variants.
[[nodiscard]] Json over_variants(const Rows& rows);

}  // namespace subworld
