#pragma once

#include "lab/page/tables.hpp"

#include <string>

namespace subworld {

/// Summary of rows of `measured_plan_row`.
[[nodiscard]] Json plan_summary(const Rows& rows, std::size_t planned);

/// Writes one self-contained page. Throws `Error` (failed) if the file cannot be written.
void write_plan_report(const std::string& path, const Rows& rows, const Json& summary);

}  // namespace subworld
