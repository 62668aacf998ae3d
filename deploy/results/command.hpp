#pragma once

#include "io/command_line.hpp"

#include <string>

namespace subworld {

/// The options of `subworld report`.
struct ReportRequest {
  std::string what;  ///< a folder of results, or a file in one
  std::string out;   ///< the page; empty: report.html in that folder
};
void add_report_options(CommandLine& line, ReportRequest& request);

/// Where the results are, and the page that is to be written.
struct ReportPlace {
  std::string folder, page;
  std::string lab;  ///< that measured them; empty: a run
};
/// Throws `Error`: usage where the request names no results, failed where their summary cannot be read.
[[nodiscard]] ReportPlace place_of(const ReportRequest& request);

/// Writes the page of a run. Throws `Error` (failed).
void write_report(const ReportPlace& place);

}  // namespace subworld
