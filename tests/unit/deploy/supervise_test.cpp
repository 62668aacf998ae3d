// Which programs are started again. Shells stand in for the programs.
#include "run/supervise.hpp"
#include "support/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>

namespace subworld::test {
namespace {

class Restarts : public ::testing::Test {
 protected:
  /// A program that writes a line when it starts; then `commands`. Its results are in `part()` where it has any.
  void start(const std::string& label, const std::string& commands, const std::string& logs = "") {
    std::filesystem::create_directories(file(logs));
    const Command command{"/bin/sh", {"-c", "echo x >> " + file(label + ".starts") + "; " + commands}};
    programs_.start(
        {.label = label, .log = file(logs + label + ".log"), .part = part(label), .command = [command](bool) {
           return command;
         }});
  }
  std::optional<Supervisor::Failure> watch() {
    return programs_.watch([] {});
  }
  [[nodiscard]] std::string file(const std::string& name) const { return folder_.path() + "/" + name; }
  [[nodiscard]] std::string part(const std::string& label) const { return file(label + ".json"); }
  [[nodiscard]] long starts(const std::string& label) const {
    std::ifstream stream(file(label + ".starts"));
    return std::count(std::istreambuf_iterator<char>(stream), {}, '\n');
  }

  const TemporaryFolder folder_;
  const Keeper keeper_{[](const std::vector<Restarted>&) {}};
  bool over_ = false;  ///< the world says that the run is over
  Supervisor programs_{Restart::on_failure, keeper_, {.run_is_over = [this] { return over_; }}};
};

constexpr const char* kDies = "kill -9 $$";

TEST_F(Restarts, AWorldThatIsKilledInTheMiddleIsStartedAgain) {
  start("world_sim", "if [ -e " + file("once") + " ]; then exit 0; fi; touch " + file("once") + "; " + kDies);
  EXPECT_FALSE(watch());
  EXPECT_EQ(starts("world_sim"), 2);
  ASSERT_EQ(programs_.restarts().size(), 1U);
  EXPECT_EQ(programs_.restarts()[0].reason, "killed by SIGKILL");
}

// It would wait for the others, who have ended, and replace the results of the run by those of nothing.
TEST_F(Restarts, AWorldAtItsEndIsNotStartedAgain) {
  start("world_sim", "echo '{}' > " + part("world_sim") + "; " + kDies);
  const auto failed = watch();
  ASSERT_TRUE(failed);
  EXPECT_EQ(failed->reason, "killed by SIGKILL");
  EXPECT_EQ(starts("world_sim"), 1);
  EXPECT_TRUE(programs_.restarts().empty());
}

// Its results could not be written, or are on another host.
TEST_F(Restarts, AWorldThatHasSaidThatTheRunIsOverIsNotStartedAgain) {
  start("world_sim", "until [ -e " + file("device_sim_0.starts") + " ]; do sleep 0.01; done; exit 1");
  over_ = true;
  start("device_sim_0", "sleep 0.3; exit 1");
  EXPECT_TRUE(watch());
  EXPECT_EQ(starts("world_sim"), 1);
  EXPECT_EQ(starts("device_sim_0"), 1);
}

TEST_F(Restarts, TheFolderOfTheLogIsMadeAnew) {
  start("world_sim",
        "if [ -e " + file("once") + " ]; then exit 0; fi; touch " + file("once") + "; rm " +
            file("logs/world_sim.log") + "; rmdir " + file("logs") + "; " + kDies,
        "logs/");
  EXPECT_FALSE(watch());
  EXPECT_EQ(starts("world_sim"), 2);
}

TEST_F(Restarts, OneThatCannotBeStartedAgainIsAFailureWithItsCause) {
  start("world_sim",
        "rm " + file("logs/world_sim.log") + "; rmdir " + file("logs") + "; touch " + file("logs") + "; " + kDies,
        "logs/");
  const auto failed = watch();
  ASSERT_TRUE(failed);
  EXPECT_TRUE(failed->reason.starts_with("killed by SIGKILL, and cannot be started again: ")) << failed->reason;
  EXPECT_NE(failed->reason.find("Not a directory"), std::string::npos) << failed->reason;
}

TEST_F(Restarts, AProgramThatDiesAfterTheWorldHasEndedIsNotStartedAgain) {
  start("world_sim", "exit 0");
  start("haptic_sim_0", "sleep 0.3; " + std::string(kDies));
  ASSERT_TRUE(watch());
  EXPECT_EQ(starts("haptic_sim_0"), 1);
}

}  // namespace
}  // namespace subworld::test
