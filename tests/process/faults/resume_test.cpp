#include "process/process_test.hpp"
#include "world_sim/checkpoint/checkpoint.hpp"

#include <cmath>

namespace subworld::test {
namespace {

class Resume : public ProcessTest {
 protected:
  [[nodiscard]] std::string killed() const { return folder_.path() + "/killed"; }
  /// A run of `row` whose world is killed once it has written two checkpoints.
  void run_and_kill(const std::string& dds) const {
    Words words{program("subworld"), "run", scene("row"),   "--out", killed(), "--mode", "realtime",
                "--duration",        "20",  "--checkpoint", "0.25",  "--dds",  dds,      "--domain",
                domain_.text()};
    Process process(words, folder_.path());
    ASSERT_TRUE(eventually([&] { return std::filesystem::exists(checkpoint_file(killed(), 1)); })) << process.out();
    for (const Running& one : running(killed()))
      if (one.words.front().ends_with("world_sim")) kill(one.pid, SIGKILL);
    EXPECT_EQ(process.wait(), 1) << process.out();
  }
  [[nodiscard]] WorldCheckpoint newest() const {
    std::vector<std::string> skipped;
    Scene row = load_scene(scene("row"));
    row.settings.mode = Mode::realtime;
    row.settings.users = static_cast<int>(row.users.size());
    return read_checkpoint(killed(), row, skipped);
  }
};

TEST_F(Resume, ARunGoesOnWhereItsWorldWasKilled) {
  run_and_kill("fastdds");
  const WorldCheckpoint from = newest();
  const Ended ended = run(scene("row"), {"--mode", "realtime", "--resume", killed(), "--duration",
                                         std::to_string(from.time_s + 1.0), "--bodies", "all"});
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  const std::string verdict = summary()["verdict"];
  EXPECT_FALSE(verdict.starts_with("failed") || verdict.starts_with("unstable")) << verdict;
  char resumed[64];
  std::snprintf(resumed, sizeof(resumed), "; resumed from t = %.3f s", from.time_s);
  EXPECT_NE(verdict.find(resumed), std::string::npos) << verdict;
  EXPECT_EQ(summary()["world"]["resumed_from_s"], from.time_s);

  // The first rows are the checkpoint's states.
  std::ifstream bodies(out() + "/bodies.csv");
  std::string line, cell;
  std::getline(bodies, line);
  std::size_t rows = 0;
  const Scene row = load_scene(scene("row"));
  for (const Body& body : row.bodies) {
    if (body.fixed()) continue;
    ASSERT_TRUE(std::getline(bodies, line));
    std::istringstream cells(line);
    std::getline(cells, cell, ',');
    EXPECT_NEAR(std::stod(cell), from.time_s, 1e-9);
    std::getline(cells, cell, ',');
    EXPECT_EQ(cell, body.name);
    for (int i = 0; i < 3; ++i) {
      std::getline(cells, cell, ',');
      EXPECT_NEAR(std::stod(cell), from.states[index(body.id)].position[i], 1e-7) << body.name;
    }
    ++rows;
  }
  EXPECT_GT(rows, 3U);
  const Table world = read_table(out() + "/world.csv");
  ASSERT_FALSE(world.rows.empty());
  const double energy_j =
      world.rows[0][world.column("kinetic_energy_j")] + world.rows[0][world.column("potential_energy_j")];
  EXPECT_NEAR(energy_j, from.kinetic_j + from.potential_j, 5e-3);
  EXPECT_GT(summary()["world"]["checkpoints"]["written"], 1);
  EXPECT_TRUE(std::filesystem::exists(checkpoint_file(killed(), 0)));  // what it went on from stays
}

TEST_F(Resume, ADamagedOrForeignCheckpointIsRefusedWithTheCure) {
  run_and_kill("fastdds");
  const Ended foreign = run(scene("press"), {"--mode", "realtime", "--resume", killed()});
  EXPECT_EQ(foreign.code, 2) << foreign.out;
  EXPECT_NE(foreign.err.find("a checkpoint of another scene or of other settings"), std::string::npos) << foreign.err;
  for (const unsigned number : {0U, 1U}) {
    std::fstream file(checkpoint_file(killed(), number), std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(1000);
    file.put('?');
    file.put('!');
  }
  const Ended damaged = run(scene("row"), {"--mode", "realtime", "--resume", killed()});
  EXPECT_EQ(damaged.code, 1) << damaged.out;
  EXPECT_NE(damaged.err.find("checksum"), std::string::npos) << damaged.err;
  EXPECT_NE(damaged.err.find("without --resume"), std::string::npos) << damaged.err;
  const Ended same = finish({program("subworld"), "run", scene("row"), "--mode", "realtime", "--out", killed(),
                             "--resume", killed(), "--domain", domain_.text()});
  EXPECT_EQ(same.code, 2);
  EXPECT_NE(same.err.find("choose another folder"), std::string::npos) << same.err;
  const Ended lockstep = run(scene("row"), {"--mode", "lockstep", "--resume", killed()});
  EXPECT_EQ(lockstep.code, 2) << lockstep.err;
}

// A folder that is a file's name: the checkpoint cannot be renamed there.
TEST_F(Resume, ARunGoesOnWhereItsCheckpointsCannotBeWritten) {
  Process process({program("subworld"), "run", scene("row"), "--out", out(), "--mode", "realtime", "--duration", "3",
                   "--checkpoint", "0.25", "--domain", domain_.text()},
                  folder_.path());
  ASSERT_TRUE(eventually([&] { return std::filesystem::exists(out() + "/logs/world_sim.log"); }));
  for (const unsigned number : {0U, 1U})
    std::filesystem::create_directories(checkpoint_file(out(), number) + ".part/x");
  EXPECT_EQ(process.wait(), 0) << process.out() << process.err();
  const std::string verdict = summary()["verdict"];
  EXPECT_NE(verdict.find("checkpoints could not be written"), std::string::npos) << verdict;
}

}  // namespace
}  // namespace subworld::test
