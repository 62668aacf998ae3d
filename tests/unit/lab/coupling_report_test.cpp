#include "lab/coupling/report.hpp"

#include <gtest/gtest.h>

namespace subworld {
namespace {

// The reference of a run has the engine of its world.
TEST(CouplingReport, EachEngineHasItsReferenceError) {
  Rows rows;
  for (const auto& [engine, error] : {std::pair{"bullet", 0.001}, std::pair{"ode", 0.02}}) {
    for (const int ratio : {4, 10}) {
      rows.push_back({{"scene", "row"},
                      {"scheme", "reduced"},
                      {"engine", engine},
                      {"haptic_engine", engine},
                      {"ratio", ratio},
                      {"survived", true},
                      {"force_error_rms", 0.03},
                      {"reference_error", error},
                      {"world_cpu_s_per_s", 0.1},
                      {"haptic_cpu_s_per_s", 0.1},
                      {"synchronise_cpu_s_per_s", 0.1}});
    }
  }
  const std::vector<Plot> plots = plots_of(rows, {});
  ASSERT_EQ(plots.size(), 2U);
  for (const Plot& plot : plots) {
    ASSERT_EQ(plot.levels.size(), 3U) << plot.title;
    EXPECT_EQ(plot.levels[0].title, "reference error of bullet 0.1 %");
    EXPECT_EQ(plot.levels[1].title, "reference error of ode 2 %");
  }
  std::erase_if(rows, [](const Json& row) { return row.at("engine") == "ode"; });
  EXPECT_EQ(plots_of(rows, {}).front().levels.front().title, "reference error 0.1 %");
}

}  // namespace
}  // namespace subworld
