#pragma once

#include "io/results/json.hpp"
#include "lab/engines/body_costs.hpp"
#include "lab/engines/grades.hpp"
#include "report/page.hpp"

#include <string>
#include <vector>

namespace subworld {

/// The course of one run.
struct Course {
  Json row;
  Rows history;
};

/// Results of the lab.
struct EngineFindings {
  Rows rows;
  std::vector<Course> courses;  ///< of the first combination of each scene
  Rows costs;                   ///< body_costs of all engines
  Json summary;
};

/// Combinations of friction, restitution and time step, in order; one row for each.
[[nodiscard]] std::vector<const Json*> combinations_of(const Rows& rows);
/// The rows that differ from the first only in the time step, or in engine and preset.
[[nodiscard]] Rows time_steps_of(const Rows& rows);
/// Error of a run: displacement of a structure, penetration in a fall.
struct ErrorMeasure {
  const char* column;
  const char* words;
};
[[nodiscard]] ErrorMeasure error_measure(const Json& row);
/// CPU time for a frame of 1/60 s, s.
[[nodiscard]] double cpu_per_frame_s(const Json& row);

/// Plots of one scene: the paper's figure 5, kinetic energy, and, with several steps, error against run time.
[[nodiscard]] std::vector<Plot> plots_of(const Rows& rows, const std::vector<const Course*>& courses);
/// The paper's figure 12.
[[nodiscard]] std::vector<Plot> cost_plots(const Rows& costs);

/// The results that the lab has saved in a folder. Throws `Error` (failed), or the exception of a key that is missing.
[[nodiscard]] EngineFindings saved_engine_runs(const std::string& folder);

/// Writes one self-contained page. Throws `Error` (failed) if gnuplot is missing or the file cannot be written.
void write_report(const std::string& path, const EngineFindings& findings);

}  // namespace subworld
