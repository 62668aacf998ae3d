#pragma once

#include <string>
#include <vector>

namespace subworld {

/// Copies the programs' results that lie in the folders, at any depth, into `out`. Throws `Error` (usage) where a
/// program's results are there twice.
void merge_results(const std::vector<std::string>& folders, const std::string& out);

}  // namespace subworld
