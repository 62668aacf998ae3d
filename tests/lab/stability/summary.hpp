#pragma once

#include "lab/page/tables.hpp"
#include "lab/stability/plan.hpp"

namespace subworld {

/// What ran, how many rows passed by engine and preset, and advice: what fails worst, by what factor, and who does
/// better there.
[[nodiscard]] Json stability_summary(const StabilityRequest& request, const Rows& rows, std::size_t planned);

}  // namespace subworld
