#pragma once

#include "lab/page/tables.hpp"

#include <string>

namespace subworld {

/// Of rows of `measured_plan_row`.
[[nodiscard]] Json plan_summary(const Rows& rows, std::size_t planned);

/// One page that needs nothing beside it. Throws `Error` (failed) where the file cannot be written.
void write_plan_report(const std::string& path, const Rows& rows, const Json& summary);

}  // namespace subworld
