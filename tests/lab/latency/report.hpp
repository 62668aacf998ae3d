#pragma once

#include "lab/latency/measure.hpp"
#include "report/plots.hpp"

#include <string>
#include <vector>

namespace subworld {

struct LatencyFindings {
  std::vector<LatencyQuestion> questions;
  std::vector<LatencyAnswer> answers;  ///< of the first questions
  Json summary;
};

/// The errors of each user against the delay, with their bounds.
[[nodiscard]] std::vector<Plot> plots_of(const LatencyQuestion& question, const LatencyAnswer& answer);

/// The results that the lab has saved in a folder. Throws `Error` (failed), or the exception of a key that is missing.
[[nodiscard]] LatencyFindings saved_searches(const std::string& folder);

/// Writes one self-contained page. Throws `Error` (failed) if gnuplot is missing or the file cannot be written.
void write_latency_report(const std::string& path, const LatencyFindings& findings);

}  // namespace subworld
