#pragma once

#include "lab/page/tables.hpp"
#include "lab/random/run.hpp"
#include "report/page.hpp"

#include <string>

namespace subworld {

/// Seed, a row for each engine and preset with its counts, and the failures.
[[nodiscard]] Json random_summary(const RandomRequest& request, const Rows& rows);
/// The counts as lines of text.
[[nodiscard]] std::string random_text(const Json& summary);
/// "100 random scenes: 99 held, 1 failed", after the verdict of the cases.
[[nodiscard]] std::string random_verdict(const Json& summary, const std::string& cases);
/// Whether no scene failed.
[[nodiscard]] bool all_held(const Json& summary);
/// A section of the lab's page.
void add_random_section(Page& page, const Json& summary);

}  // namespace subworld
