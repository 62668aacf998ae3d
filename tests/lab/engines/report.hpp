#pragma once

#include "lab/engines/body_costs.hpp"
#include "lab/engines/grades.hpp"
#include "lab/page/page.hpp"

#include <string>
#include <vector>

namespace subworld {

/// The course of one run.
struct Course {
  Json row;
  Rows history;
};

/// What a run of the lab found.
struct EngineFindings {
  Rows rows;
  std::vector<Course> courses;  ///< of the first combination of each scene
  Rows costs;                   ///< body_costs of all engines
  Json summary;
};

/// Combinations of friction, restitution and time step, in order: a row for each.
[[nodiscard]] std::vector<const Json*> combinations_of(const Rows& rows);
/// The rows that differ from the first in the time step alone, or in engine and preset.
[[nodiscard]] Rows time_steps_of(const Rows& rows);
/// What is wrong in a run: displacement of a structure, penetration in a fall.
struct ErrorMeasure {
  const char* column;
  const char* words;
};
[[nodiscard]] ErrorMeasure error_measure(const Json& row);
/// CPU time in which a frame of 1/60 s is simulated, s.
[[nodiscard]] double cpu_per_frame_s(const Json& row);

/// Of one scene: the paper's figure 5, kinetic energy, and error against run time where there are several steps.
[[nodiscard]] std::vector<Plot> plots_of(const Rows& rows, const std::vector<const Course*>& courses);
/// The paper's figure 12.
[[nodiscard]] std::vector<Plot> cost_plots(const Rows& costs);

/// One page that needs nothing beside it. Throws `Error` (failed) where gnuplot is missing or the file cannot be
/// written.
void write_report(const std::string& path, const EngineFindings& findings);

}  // namespace subworld
