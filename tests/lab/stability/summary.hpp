#pragma once

#include "lab/stability/plan.hpp"
#include "lab/page/tables.hpp"

namespace subworld {

/// What ran, how many rows passed by engine and preset, and advice: what fails worst, by what factor, and who does
/// better there.
[[nodiscard]] Json stability_summary(const StabilityRequest& request, const Rows& rows, std::size_t planned);

/// Engine and preset of a row.
[[nodiscard]] std::string setting_of(const Json& row);
/// Those of all rows, in their order.
[[nodiscard]] std::vector<std::string> settings_of(const Rows& rows);

}  // namespace subworld
