#pragma once

#include "io/results.hpp"
#include "model/scene.hpp"
#include "placement.hpp"
#include "rt/calibration.hpp"
#include "rt/kernel_share.hpp"

#include <optional>
#include <string>
#include <vector>

namespace subworld {

/// The launcher's own record of a run.
struct RunRecord {
  std::string command_line;
  std::string date;  ///< of the start, ISO 8601 with the zone
  std::string dds;   ///< a vendor or mixed
  std::optional<Calibration> calibration;
  Placement placement;
  double wall_s = 0.0;
  CoreLoad load;
};

/// What ran, with which settings and where: everything but the results of the programs.
[[nodiscard]] Json describe_run(const Scene& scene, const RunRecord& record);
/// Adds the parts that the programs wrote into the folder. Throws `Error` (failed) where one is missing.
void add_parts(Json& summary, const Scene& scene, const RunRecord& record, const std::string& folder);

/// Prints the run in a few lines.
void print_summary(const Json& summary);

/// How late the machine wakes bare loops, on one line.
[[nodiscard]] std::string to_text(const Calibration& calibration);

}  // namespace subworld
