#pragma once

#include "lab/coupling/analysis.hpp"
#include "lab/coupling/measure.hpp"
#include "lab/page/plots.hpp"

#include <string>
#include <vector>

namespace subworld {

/// What a sweep found.
struct Findings {
  Rows rows;
  std::vector<Trace> traces;
  Json summary;
};

/// The columns of which the rows have more than one value.
[[nodiscard]] std::vector<std::string> swept(const Rows& rows);
[[nodiscard]] std::vector<std::string> swept(const std::vector<const Json*>& rows);
/// The swept columns of a row in words: "r 4, box 0.2 m"; without the column `x`.
[[nodiscard]] std::string swept_text(const Json& row, const std::vector<std::string>& columns, const std::string& x);

/// The observed orders of one scene in words, a line for each fit (lab/analysis).
[[nodiscard]] std::vector<std::string> orders_of(const Json& fits, const Rows& rows);

/// What the variants of one scene say in words, a line for each setting (lab/analysis).
[[nodiscard]] std::vector<std::string> variants_of(const Json& over_variants, const Rows& rows);

/// Of one scene: its rows, and the traces of all.
[[nodiscard]] std::vector<Plot> plots_of(const Rows& rows, const std::vector<Trace>& traces);

/// One page that needs nothing beside it. Throws `Error` (failed) where gnuplot is missing or the file cannot be
/// written.
void write_report(const std::string& path, const Findings& findings);

}  // namespace subworld
