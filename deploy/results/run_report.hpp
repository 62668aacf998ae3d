#pragma once

#include "io/results/results.hpp"
#include "report/page.hpp"

#include <string>
#include <vector>

namespace subworld {

/// The options of `subworld report`.
struct ReportRequest {
  std::string what;  ///< a folder of results, or a file in one
  std::string out;   ///< the page; empty: report.html in that folder
};

/// Where the results are, and the page that is to be written.
struct ReportPlace {
  std::string folder, page;
  std::string lab;  ///< that measured them; empty: a run
};
/// Throws `Error`: usage where the request names no results, failed where their summary cannot be read.
[[nodiscard]] ReportPlace place_of(const ReportRequest& request);

/// Writes the page of a run from its summary, and from the histories and pictures in its folder as far as they are
/// there. Throws `Error` (failed).
void write_report(const ReportPlace& place);

// A summary may lack any key: it may be of a failed run, or of another version.
/// The value at a path as "world/step_s/p99" or "gates/0/name"; null where there is none.
[[nodiscard]] const Json& value_at(const Json& json, const std::string& path);
/// Not a number where there is none.
[[nodiscard]] double number_at(const Json& json, const std::string& path);
/// Words as they are, others as JSON; empty where there is none.
[[nodiscard]] std::string text_at(const Json& json, const std::string& path);

/// The users of a run, each {"user", "name", "haptic", "device", "settings"}; a key without a value is missing.
[[nodiscard]] std::vector<Json> users_of(const Json& summary);
/// The tables of users, world and programs, as HTML.
[[nodiscard]] std::string user_tables(const Json& summary, const std::vector<Json>& users);
[[nodiscard]] std::string world_table(const Json& summary);
[[nodiscard]] std::string program_table(const Json& summary, const std::vector<Json>& users);

/// The plots of the histories, with the same time axis.
[[nodiscard]] std::vector<Plot> plots_of_run(const Json& summary, const std::vector<Json>& users,
                                             const std::string& folder);

/// The PNG files of the folder, in the page itself; empty: there are none.
[[nodiscard]] std::string pictures_in(const std::string& folder);

}  // namespace subworld
