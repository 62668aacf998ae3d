// The short form of `subworld lab stability` over all engines: rows that passed before still pass.
#include "io/results/json.hpp"
#include "lab/stability/plan.hpp"
#include "lab/stability/run.hpp"
#include "physics/engine.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <fstream>
#include <random>
#include <set>
#include <string>

namespace subworld {
namespace {

/// The key of a row in known_misses.txt.
std::string key_of(const Json& row) {
  return fmt::format("{} {}: {:g} ms", row.at("engine").get<std::string>(), row.at("preset").get<std::string>(),
                     1e3 * row.at("step_s").get<double>()) +
         " " + label_of(row);
}

/// The list shrinks when an engine improves; a row that is not in it must pass. The two halves of the rows are drawn,
/// so that each has all engines, presets, steps and cases.
void expect_known_misses_only(unsigned half) {
  std::ifstream file(KNOWN_MISSES);
  ASSERT_TRUE(file) << KNOWN_MISSES;
  std::set<std::string> known;
  for (std::string line; std::getline(file, line);) {
    if (!line.empty() && line.front() != '#') known.insert(line);
  }
  std::mt19937 random(1);
  int rows = 0, held = 0;
  for (const StabilityPoint& point :
       points_of({.names = {}, .engines = engine_names(), .presets = {}, .steps_s = {}, .quick = true})) {
    if (random() % 2 != half) continue;
    const std::optional<Json> row = measured_row(point);
    ASSERT_TRUE(row) << "interrupted";
    ++rows;
    held += row->at("pass").get<bool>();
    if (row->at("pass").get<bool>()) continue;
    EXPECT_TRUE(known.contains(key_of(*row))) << key_of(*row) << "\n" << row->dump();
  }
  EXPECT_GT(held, rows / 2);
}

TEST(Margins, NoRowIsMissedThatIsNotKnown) { expect_known_misses_only(0); }
TEST(FullMargins, NoRowIsMissedThatIsNotKnown) { expect_known_misses_only(1); }

}  // namespace
}  // namespace subworld
