#pragma once

#include "lab/coupling/report.hpp"

#include <string>
#include <vector>

namespace subworld {

/// Writes a trace to the folder `traces` of a lab's folder. Throws `Error` (failed).
void write_trace(const std::string& folder, const Trace& trace);
/// Of each trace its file and to what it belongs, for the summary.
[[nodiscard]] Json traces_json(const std::vector<Trace>& traces);

/// The results that a sweep has saved. Throws `Error` (failed), or the exception of a key that is missing.
[[nodiscard]] Findings saved_sweep(const std::string& folder);

}  // namespace subworld
