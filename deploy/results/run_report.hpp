#pragma once

#include "io/results.hpp"
#include "report/page.hpp"

#include <string>
#include <vector>

namespace subworld {

/// Writes the page of a run from its summary, and from the histories and pictures in its folder as far as they are
/// there. Throws `Error` (failed).
void write_run_report(const std::string& page, const Json& summary, const std::string& folder);

/// The users of a run, each {"user", "name", "haptic", "device", "settings"}; a key without a value is missing.
[[nodiscard]] std::vector<Json> users_of(const Json& summary);
/// The tables of users, world and programs, as HTML.
[[nodiscard]] std::string user_tables(const Json& summary, const std::vector<Json>& users);
[[nodiscard]] std::string world_table(const Json& summary);
[[nodiscard]] std::string program_table(const Json& summary, const std::vector<Json>& users);
/// A sentence for each figure of these tables.
[[nodiscard]] std::string meanings(const Json& summary);

/// The plots of the histories, with the same time axis.
[[nodiscard]] std::vector<Plot> plots_of_run(const Json& summary, const std::vector<Json>& users,
                                             const std::string& folder);

/// The PNG files of the folder, in the page itself; empty: there are none.
[[nodiscard]] std::string pictures_in(const std::string& folder);

}  // namespace subworld
