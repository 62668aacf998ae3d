#pragma once

#include "lab/page/tables.hpp"

#include <string>
#include <vector>

namespace subworld {

/// A condition on a column of the table: `round_trip_s_p99<0.02`.
struct Requirement {
  std::string text;
  std::string column;
  char relation = '<';  ///< '<' or '>'
  double bound = 0.0;
};

/// Throws `Error` (usage) for a condition that cannot be read, or a column that `example`, a row, does not have.
[[nodiscard]] Requirement parse_requirement(const std::string& text, const Json& example);

/// The value of a column as the CSV file names it; not a number where it was not measured.
[[nodiscard]] double value_of(const Json& row, const std::string& column);
/// A value that was not measured fails.
[[nodiscard]] bool holds(const Requirement& requirement, const Json& row);

/// Those whose columns the row has.
[[nodiscard]] std::vector<Requirement> those_of(const Json& row, const std::vector<Requirement>& requirements);

/// Why a row does not pass, one text for each condition that fails.
[[nodiscard]] std::vector<std::string> missed_by(const Json& row, const std::vector<Requirement>& requirements);

}  // namespace subworld
