#pragma once

#include "lab/stability_plan.hpp"
#include "lab/tables.hpp"

namespace subworld {

/// Settings of the runs, passed rows by engine and preset, and advice: the worst failures with their factor, and a
/// setting that is better.
[[nodiscard]] Json stability_summary(const StabilityRequest& request, const Rows& rows, std::size_t planned);

/// Engine and preset of a row.
[[nodiscard]] std::string setting_of(const Json& row);
/// The settings of all rows, in their order.
[[nodiscard]] std::vector<std::string> settings_of(const Rows& rows);

}  // namespace subworld
