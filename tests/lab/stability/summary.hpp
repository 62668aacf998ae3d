#pragma once

#include "lab/page/tables.hpp"
#include "lab/stability/plan.hpp"

namespace subworld {

/// Settings of the runs, passed rows by engine and preset, and advice: the worst failures with their factor, and a
/// setting that is better.
[[nodiscard]] Json stability_summary(const StabilityRequest& request, const Rows& rows, std::size_t planned);

}  // namespace subworld
