// Programs that do not belong to a run: they do not affect the operator, the run continues, and its verdict names them.
#include "process/process_test.hpp"
#include "support/grid.hpp"

#include <cmath>

namespace subworld::test {
namespace {

struct ForeignWriter {
  std::string kind;
  std::string blamed;  ///< topic in the verdict
};
void PrintTo(const ForeignWriter& one, std::ostream* out) { *out << one.kind; }

const std::vector<ForeignWriter> kForeignWriters{{"old_frame", "world_frame"},
                                                 {"far_frame", "world_frame"},
                                                 {"standing_frame", "world_frame"},
                                                 {"last_frame", "world_frame"},
                                                 {"moved_frame", "world_frame"},
                                                 {"served_frame", "world_frame"},
                                                 {"jumping_state", "device_state"},
                                                 {"fast_state", "device_state"},
                                                 {"pressing_state", "device_state"},
                                                 {"second_device", "device_state"},
                                                 {"old_state", "device_state"},
                                                 {"huge_command", "device_command"},
                                                 {"flipping_command", "device_command"},
                                                 {"last_command", "device_command"},
                                                 {"far_command", "device_command"},
                                                 {"huge_report", "haptic_report"},
                                                 {"far_report", "haptic_report"},
                                                 {"second_haptic", "haptic_report"},
                                                 {"second_world", "scene"}};

class ForeignWriters : public ProcessTest,
                       public ::testing::WithParamInterface<std::tuple<std::string, ForeignWriter>> {
 protected:
  static constexpr double kForceLimit_n = 40.0, kForceStep_n = 10.0;

  /// The force and motion at the device.
  void expect_safe(const std::string& folder) const {
    const Table device = read_table(folder + "/device_0.csv");
    ASSERT_GT(device.rows.size(), 100U);
    const std::size_t x = device.column("force_x_n");
    std::array<double, 3> before{};
    for (const auto& row : device.rows) {
      double squares = 0.0, step = 0.0;
      for (std::size_t i = 0; i < 3; ++i) {
        ASSERT_TRUE(std::isfinite(row[x + i]));
        squares += row[x + i] * row[x + i];
        step += (row[x + i] - before[i]) * (row[x + i] - before[i]);
        before[i] = row[x + i];
      }
      ASSERT_LE(std::sqrt(squares), kForceLimit_n * (1.0 + 1e-9));
      ASSERT_LE(std::sqrt(step), kForceStep_n * (1.0 + 1e-6));
    }
  }
};

TEST_P(ForeignWriters, AreRefusedAndNamed) {
  const auto& [mode, foreign_writer] = GetParam();
  const std::string vendor = foreign_writer.kind.size() % 2 == 0 ? "fastdds" : "cyclonedds";
  const Words flags{"--mode", mode, "--duration", mode == "realtime" ? "2.5" : "12"};
  Process run(run_words(scene("press"), flags), folder_.path());
  const std::string folder = folder_.path() + "/foreign_writer";
  std::filesystem::create_directories(folder);
  Process peer({program("hostile_peer"), vendor, domain_.text(), mode, foreign_writer.kind, "1.0"}, folder);
  const std::string process = "process " + std::to_string(peer.pid());
  ASSERT_EQ(peer.wait(), 0) << peer.err();
  ASSERT_TRUE(run.wait()) << run.out();
  const Json results = summary();
  ASSERT_TRUE(results.is_object());
  const std::string verdict = results["verdict"];
  EXPECT_NE(verdict.find(foreign_writer.blamed + " from a foreign writer"), std::string::npos) << verdict << run.err();
  EXPECT_NE(verdict.find(process), std::string::npos) << verdict;
  expect_safe(out());
  EXPECT_GE(results["simulated_s"].get<double>(), 0.99 * std::stod(flags.back())) << "it ended early: " << verdict;
}

/// A writer of scenes that is there before the run.
class SceneFlood : public ProcessTest, public ::testing::WithParamInterface<std::tuple<std::string, std::string>> {};

TEST_P(SceneFlood, DoesNotPreventAStart) {
  const auto& [run_vendor, vendor] = GetParam();
  const std::string folder = folder_.path() + "/foreign_writer";
  std::filesystem::create_directories(folder);
  Process peer({program("hostile_peer"), vendor, domain_.text(), "realtime", "scene_flood", "60"}, folder);
  ASSERT_TRUE(eventually([&] { return !peer.out().empty(); })) << peer.err();
  Process run(run_words(scene("press"), {"--mode", "realtime", "--duration", "1", "--dds", run_vendor}),
              folder_.path());
  ASSERT_TRUE(run.wait()) << run.out() << run.err();
  const Json results = summary();
  ASSERT_TRUE(results.is_object()) << run.out() << run.err();
  EXPECT_GE(results["simulated_s"].get<double>(), 0.99) << results["verdict"];
  const std::string verdict = results["verdict"];
  EXPECT_NE(verdict.find("scene from a foreign writer"), std::string::npos) << verdict << run.err();
  const std::string by = results["world"]["refused"]["by"];
  EXPECT_NE(by.find("process " + std::to_string(peer.pid())), std::string::npos) << by;
  EXPECT_NE(verdict.find(by), std::string::npos) << verdict;
}

using Two = std::tuple<std::string, std::string>;
const auto kFloods = halves<std::string, std::string>({"fastdds", "cyclonedds"}, {"fastdds", "cyclonedds"});
std::string name_of_flood(const ::testing::TestParamInfo<Two>& one) {
  return std::get<0>(one.param) + "_and_" + std::get<1>(one.param);
}
INSTANTIATE_TEST_SUITE_P(Vendors, SceneFlood, ::testing::ValuesIn(kFloods.other), name_of_flood);
INSTANTIATE_TEST_SUITE_P(FullRealtime, SceneFlood, ::testing::ValuesIn(kFloods.half), name_of_flood);

/// A real program that the run already has.
class SecondProgram : public ProcessTest, public ::testing::WithParamInterface<std::tuple<std::string, std::string>> {};

TEST_P(SecondProgram, IsRefusedAndTheRunGoesOn) {
  const auto& [mode, name] = GetParam();
  const Words flags{"--mode", mode, "--duration", mode == "realtime" ? "4" : "12"};
  Process run(run_words(scene("press"), flags), folder_.path());
  ASSERT_TRUE(eventually([&] { return read_text(out() + "/device_0.csv").size() > 10000; })) << run.err();
  const std::string folder = folder_.path() + "/second";
  std::filesystem::create_directories(folder);
  Process second({program(name), scene("press"), "--domain", domain_.text(), "--mode", mode, "--duration", flags.back(),
                  "--wait", "2"},
                 folder);
  const auto code = second.wait();
  ASSERT_TRUE(code) << "it takes part";
  EXPECT_NE(*code, 0) << second.out();
  EXPECT_NE(second.err().find("two"), std::string::npos) << second.err();
  EXPECT_NE(second.err().find("--domain"), std::string::npos) << second.err();
  ASSERT_TRUE(run.wait());
  const Json results = summary();
  ASSERT_TRUE(results.is_object());
  EXPECT_GE(results["simulated_s"].get<double>(), 0.99 * std::stod(flags.back())) << results["verdict"];
}

std::string name_of_second(const ::testing::TestParamInfo<Two>& one) {
  return std::get<0>(one.param) + "_" + std::get<1>(one.param);
}
const auto kSeconds =
    halves<std::string, std::string>({"realtime", "lockstep"}, {"world_sim", "haptic_sim", "device_sim"});
std::vector<Two> of_mode(std::vector<Two> all, const std::string& mode) {
  std::erase_if(all, [&](const Two& one) { return std::get<0>(one) != mode; });
  return all;
}
INSTANTIATE_TEST_SUITE_P(Programs, SecondProgram, ::testing::ValuesIn(kSeconds.half), name_of_second);
INSTANTIATE_TEST_SUITE_P(Full, SecondProgram, ::testing::ValuesIn(of_mode(kSeconds.other, "lockstep")), name_of_second);
INSTANTIATE_TEST_SUITE_P(FullRealtime, SecondProgram, ::testing::ValuesIn(of_mode(kSeconds.other, "realtime")),
                         name_of_second);

using Foreign = std::tuple<std::string, ForeignWriter>;
std::string name_of_foreign(const ::testing::TestParamInfo<Foreign>& one) { return std::get<1>(one.param).kind; }
/// Those of the short tests, some in each mode, or the others: each topic, and each way in which a writer is
/// recognised.
std::vector<Foreign> foreign_writers(const std::string& mode, bool others = false) {
  static const std::set<std::string> kRealtime{"last_frame",   "jumping_state", "second_device",
                                               "huge_command", "far_report",    "second_world"};
  static const std::set<std::string> kLockstep{"moved_frame", "flipping_command", "second_haptic"};
  std::vector<Foreign> found;
  for (const ForeignWriter& one : kForeignWriters) {
    if ((mode == "realtime" ? kRealtime : kLockstep).contains(one.kind) != others) found.emplace_back(mode, one);
  }
  return found;
}
INSTANTIATE_TEST_SUITE_P(Realtime, ForeignWriters, ::testing::ValuesIn(foreign_writers("realtime")), name_of_foreign);
INSTANTIATE_TEST_SUITE_P(Lockstep, ForeignWriters, ::testing::ValuesIn(foreign_writers("lockstep")), name_of_foreign);
INSTANTIATE_TEST_SUITE_P(FullRealtime, ForeignWriters, ::testing::ValuesIn(foreign_writers("realtime", true)),
                         name_of_foreign);

}  // namespace
}  // namespace subworld::test
