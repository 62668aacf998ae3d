#pragma once

#include "lab/page/tables.hpp"

#include <string>

namespace subworld {

/// One page: advice, the maps, how many rows pass at which multiple of their tolerance, and a section for each case
/// with its table, formula and source. Throws `Error` (failed).
void write_stability_report(const std::string& path, const Rows& rows, const Json& summary);

}  // namespace subworld
