#pragma once

#include "io/results/json.hpp"
#include "lab/coupling/analysis.hpp"
#include "lab/coupling/measure.hpp"
#include "report/plots.hpp"

#include <string>
#include <vector>

namespace subworld {

/// Results of a sweep.
struct Findings {
  Rows rows;
  Rows users;  ///< a row for each point and user
  std::vector<Trace> traces;
  Json summary;
};

/// How a column of a setting is named.
struct AxisText {
  std::string column;
  std::string name;   ///< in a legend, and at the head of a table
  std::string words;  ///< in a title
  std::string label;  ///< of an axis
  double scale = 1.0;
  std::string unit = {};  ///< after a space, of a value times the scale
};
[[nodiscard]] AxisText axis_text(const std::string& column);

/// The columns of settings in which the rows differ.
[[nodiscard]] std::vector<std::string> swept(const Rows& rows);
[[nodiscard]] std::vector<std::string> swept(const std::vector<const Json*>& rows);
/// The swept columns of a row in words, without the column `x`: "r 4, box 0.2 m".
[[nodiscard]] std::string swept_text(const Json& row, const std::vector<std::string>& columns, const std::string& x);

/// The observed orders of one scene in words, a line for each fit (lab/analysis).
[[nodiscard]] std::vector<std::string> orders_of(const Json& fits, const Rows& rows);

/// The statistics over the variants of one scene in words, one line for each setting (lab/analysis).
[[nodiscard]] std::vector<std::string> variants_of(const Json& over_variants, const Rows& rows);

/// Plots of one scene, from its rows and all traces.
[[nodiscard]] std::vector<Plot> plots_of(const Rows& rows, const std::vector<Trace>& traces);

/// Writes one self-contained page. Throws `Error` (failed) if gnuplot is missing or the file cannot be written.
void write_report(const std::string& path, const Findings& findings);

}  // namespace subworld
