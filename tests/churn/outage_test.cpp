// The network between the hosts of a session is down for a while, or the world is: no energy is created.
#include "process/sessions/sessions.hpp"

#include <fmt/core.h>

#include <algorithm>

namespace subworld::test {
namespace {

struct Outage {
  const char* dds;
  int for_ms;
};

class Outages : public Sessions, public ::testing::WithParamInterface<Outage> {};

// Two operators hold a cube in the air. A report that is missing for 0.1 s holds the proxy; one for 0.25 s makes the
// user absent.
TEST_P(Outages, LeaveTheCubeWhereItIs) {
  if (!has_namespaces()) GTEST_SKIP() << "network namespaces are not permitted here";
  const auto [dds, for_ms] = GetParam();
  const std::string file = session("mode: lockstep, duration: 0.2", "mode: realtime, duration: 4");
  const std::string results = folder_.path() + "/results";
  const Ended ended =
      finish(up(file, results,
                {"--namespaces", "--dds", dds, "--link", fmt::format("delay 5ms outage from 3s for {}ms", for_ms)}));
  ASSERT_TRUE(ended.code == 0 || ended.code == 4) << ended.out << ended.err;
  const Json json = Json::parse(read_text(results + "/summary.json"), nullptr, false);
  const Table world = read_table(results + "/world.csv");
  double kinetic_j = 0.0, potential_j = 0.0;
  for (const auto& row : world.rows) {
    kinetic_j = std::max(kinetic_j, row[world.column("kinetic_energy_j")]);
    potential_j = std::max(potential_j, row[world.column("potential_energy_j")]);
  }
  EXPECT_LT(kinetic_j, 0.5) << json["verdict"];
  EXPECT_GT(world.rows.back()[world.column("potential_energy_j")], 0.8 * potential_j) << "the cube has fallen";
  EXPECT_GE(json["world"]["absences"].size(), for_ms > 300 ? 2U : 0U) << "the link was not down";
  for (const Json& absence : json["world"]["absences"]) {
    EXPECT_GT(for_ms, 150) << absence;
    EXPECT_LT(absence["to_s"].get<double>(), 3.99) << "user " << absence["user"] << " has not returned";
  }
  fmt::print("{}, {} ms: largest kinetic energy {:.4f} J, absences {}; {}\n", dds, for_ms, kinetic_j,
             json["world"]["absences"].dump(), json["verdict"].get<std::string>());
}

// A world slows its clock within a cycle, and the operators do not: what they know of each other is 0.1 s old by their
// own clocks, whatever the simulated time is.
TEST_F(Sessions, AWorldThatSlowsOverADelayedNetworkCreatesNoEnergy) {
  const Ended ended =
      run(scene("lift"), {"--mode", "realtime", "--engine", "busy", "--duration", "2", "--latency", "0.05"},
          {{"SUBWORLD_ENGINES", SLOW_ENGINE_FOLDER}});
  ASSERT_TRUE(ended.code == 0 || ended.code == 4) << ended.out << ended.err;
  const Json json = summary();
  EXPECT_LT(json["world"]["real_time_factor_min"], 0.25);
  EXPECT_EQ(json["verdict"].get<std::string>().find("energy"), std::string::npos) << json["verdict"];
}

INSTANTIATE_TEST_SUITE_P(Links, Outages,
                         ::testing::Values(Outage{"cyclonedds", 120}, Outage{"fastdds", 200},
                                           Outage{"cyclonedds", 400}),
                         [](const auto& one) { return fmt::format("{}_{}ms", one.param.dds, one.param.for_ms); });

}  // namespace
}  // namespace subworld::test
