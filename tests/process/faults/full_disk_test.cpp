// Runs whose disk, output, files or locks are not as they should be.
#include "process/faults/ends.hpp"

#include <unistd.h>

#include <fstream>

namespace subworld::test {
namespace {

/// Runs a shell command with a file system of 2 MB at `out()`.
class SmallDisk : public RunEnds {
 protected:
  Ended on_small_disk(const std::string& before, const Words& words, const std::string& after) const {
    std::string command =
        "mount -t tmpfs -o size=2m tmpfs " + out() + " || exit 77; mkdir " + out() + "/results; " + before + "; ";
    for (const std::string& word : words) command += "'" + word + "' ";
    std::filesystem::create_directories(out());
    return finish({"/usr/bin/unshare", "-m", "--propagation", "private", "/bin/sh", "-c",
                   command + "; code=$?; " + after + "; exit $code"});
  }
  [[nodiscard]] Words words(const Words& flags) const {
    Words all{program("subworld"), "run", scene("press"), "--domain", domain_.text(), "--out", out() + "/results"};
    all.insert(all.end(), flags.begin(), flags.end());
    return all;
  }
};

TEST_F(SmallDisk, ThatFillsUpLosesNeitherTheVerdictNorTheSummary) {
  const Ended ended = on_small_disk("head -c 1500000 /dev/zero > " + out() + "/zeros", words({"--duration", "20"}),
                                    "cat " + out() + "/results/summary.json; ls " + out() + "/results");
  if (ended.code == 77) GTEST_SKIP() << "needs the rights of root";
  EXPECT_EQ(ended.code, 1) << ended.err;
  EXPECT_NE(ended.out.find("verdict: failed: "), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find(".csv: No space left on device"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("\"force_max_n\""), std::string::npos) << "no measurements";
  EXPECT_EQ(ended.out.find(".part"), std::string::npos) << ended.out;
}

TEST_F(SmallDisk, ThatIsFullAtTheStartIsNamed) {
  const Ended ended = on_small_disk("cat /dev/zero > " + out() + "/zeros 2> " + out() + "/nothing", words({}), ":");
  if (ended.code == 77) GTEST_SKIP() << "needs the rights of root";
  EXPECT_EQ(ended.code, 1) << ended.err;
  EXPECT_NE(ended.err.find("No space left on device"), std::string::npos) << ended.err;
}

TEST_F(SmallDisk, TheFolderOfARunThatIsRemovedIsNamedAndTheSummaryWritten) {
  start("lockstep", "fastdds", "20");
  if (HasFatalFailure()) return;
  std::filesystem::remove_all(out());
  EXPECT_EQ(process_->wait(), 1) << process_->err();
  EXPECT_NE(process_->out().find("was removed during the run"), std::string::npos) << process_->out();
  EXPECT_GT(summary()["haptic"][0]["steps"], 0);
}

// The world measures to its end and cannot write the results: it is not started again.
TEST_F(SmallDisk, AFolderThatBecomesReadOnlyIsNamedAndTheRunGoesOnOnce) {
  const std::string results = out() + "/results";
  const std::string freeze = "(until [ -e " + results + "/world_1.checkpoint ]; do sleep 0.05; done; mount --bind " +
                             results + " " + results + "; mount -o remount,bind,ro " + results + ") &";
  const Ended ended = on_small_disk(
      freeze + " :", words({"--mode", "realtime", "--duration", "3", "--checkpoint", "0.2", "--restart", "on-failure"}),
      "cat " + results + "/logs/world_sim.log");
  if (ended.code == 77) GTEST_SKIP() << "needs the rights of root";
  EXPECT_EQ(ended.code, 1) << ended.err;
  EXPECT_NE(ended.out.find("verdict: failed: "), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find(".json: Read-only file system"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("the checkpoint cannot be written: "), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("the run is over at t = 3.000 s"), std::string::npos) << "the run did not go on";
  EXPECT_EQ(ended.err.find("world_sim exited with 1; it is started again"), std::string::npos) << ended.err;
}

// The mount covers the folder for a second: files that are open already are written.
TEST_F(SmallDisk, AFolderThatIsReadOnlyForAWhileCostsCheckpointsAndTheVerdictNamesTheCause) {
  std::string command;
  for (const std::string& word :
       run_words(scene("press"), {"--mode", "realtime", "--duration", "4", "--checkpoint", "0.25"}))
    command += "'" + word + "' ";
  const Ended ended =
      finish({"/usr/bin/unshare", "-m", "--propagation", "private", "/bin/sh", "-c",
              "mount -t tmpfs tmpfs /mnt || exit 77; " + command + " & until [ -e " + out() +
                  "/world_1.checkpoint ]; do sleep 0.05; done; mount --bind " + out() + " " + out() +
                  " && mount -o remount,bind,ro " + out() + "; sleep 1; umount " + out() + "; wait $!"});
  if (ended.code == 77) GTEST_SKIP() << "needs the rights of root";
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  const Json json = summary();
  EXPECT_NEAR(json["simulated_s"].get<double>(), 4.0, 0.01) << "the run goes on";
  const std::string verdict = json["verdict"];
  EXPECT_NE(verdict.find("checkpoints could not be written: " + out() + "/world_"), std::string::npos) << verdict;
  EXPECT_NE(verdict.find("Read-only file system"), std::string::npos) << verdict;
  EXPECT_GT(json["world"]["checkpoints"]["newest_s"].get<double>(), 3.0) << "they are written again afterwards";
}

TEST_F(RunEnds, AFullOutputEndsNoRunButIsAnError) {
  Words words = run_words(scene("press"), {"--duration", "1"});
  std::string command;
  for (const std::string& word : words) command += "'" + word + "' ";
  const Ended ended = finish({"/bin/sh", "-c", command + "> /dev/full"});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("stdout: No space left on device"), std::string::npos) << ended.err;
  EXPECT_EQ(summary()["verdict"], "ok");
}

TEST_F(RunEnds, TooFewOpenFilesAreNamed) {
  Words words = run_words(scene("press"), {"--duration", "1"});
  std::string command = "ulimit -n 16; ";
  for (const std::string& word : words) command += "'" + word + "' ";
  const Ended ended = finish({"/bin/sh", "-c", command});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("a process may open 16 files"), std::string::npos) << ended.err;
  EXPECT_NE(ended.err.find("ulimit -n 1024"), std::string::npos) << ended.err;
}

TEST_F(RunEnds, LimitsOfTheShellAreNamed) {
  const auto under = [&](const std::string& limit) {
    std::string command = limit + "; ";
    for (const std::string& word : run_words(scene("press"), {"--duration", "1"})) command += "'" + word + "' ";
    return finish({"/bin/sh", "-c", command});
  };
  const Ended small = under("ulimit -f 4");
  EXPECT_EQ(small.code, 1);
  EXPECT_NE(small.err.find("File too large"), std::string::npos) << small.err;
  for (const std::string kilobytes : {"60000", "80000", "100000"}) {
    const Ended narrow = under("ulimit -v " + kilobytes);
    EXPECT_EQ(narrow.code, 1);
    EXPECT_NE(narrow.err.find("too little memory; a process may use " + kilobytes + " kB"), std::string::npos)
        << narrow.err;
    EXPECT_EQ(std::ranges::count(narrow.err, '\n'), 1) << narrow.err;
  }
}

TEST_F(RunEnds, ATableThatNoRunHasMadeIsNotReplaced) {
  std::filesystem::create_directories(out());
  std::ofstream(out() + "/world.csv") << "country,city\n";
  const Ended refused = run(scene("press"), {"--duration", "0.1"});
  EXPECT_EQ(refused.code, 2);
  EXPECT_NE(refused.err.find("world.csv, which Subworld has not made"), std::string::npos) << refused.err;
  EXPECT_EQ(read_text(out() + "/world.csv"), "country,city\n");
  std::filesystem::remove(out() + "/world.csv");
  for (int time = 0; time < 2; ++time) EXPECT_EQ(run(scene("press"), {"--duration", "0.1", "--gui"}).code, 0);
}

TEST_F(RunEnds, ADomainOfAnotherUserIsRefusedAndTheNextIsFree) {
  if (getuid() != 0) GTEST_SKIP() << "needs the rights of root";
  std::filesystem::create_directories(out());
  for (const std::string& open : {folder_.path(), out()})
    std::filesystem::permissions(open, std::filesystem::perms::all);
  const auto by_nobody = [&](const Words& flags) {
    Words words{"/usr/bin/setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"};
    for (const Words& more : {Words{program("subworld"), "run", scene("press"), "--duration", "0.1"}, flags})
      words.insert(words.end(), more.begin(), more.end());
    return words;
  };
  Process first({"/bin/sh", "-c",
                 "umask 077; exec '" + program("subworld") + "' run '" + scene("press") +
                     "' --duration 1000 --domain " + domain_.text() + " --out '" + out() + "/first'"},
                folder_.path());
  ASSERT_TRUE(eventually([&] { return running(out()).size() >= 4; }));
  const Ended refused = finish(by_nobody({"--domain", domain_.text(), "--out", out() + "/refused"}));
  EXPECT_EQ(refused.code, 3);
  EXPECT_NE(refused.err.find("domain " + domain_.text() + " is in use by a program of user root"), std::string::npos)
      << refused.err;
  const Ended next = finish(by_nobody({"--out", out() + "/next"}));
  EXPECT_EQ(next.code, 0) << next.err;
  std::ofstream(folder_.path() + "/subworld-cores.lock").close();
  std::filesystem::permissions(folder_.path() + "/subworld-cores.lock", std::filesystem::perms::owner_all);
  const Ended unplaced = finish(by_nobody({"--mode", "realtime", "--out", out() + "/unplaced"}),
                                {{"TMPDIR", folder_.path()}, {"SUBWORLD_PLACEMENT", "auto"}});
  EXPECT_NE(unplaced.out.find("get no cores of their own: " + folder_.path() + "/subworld-cores.lock: Permission"),
            std::string::npos)
      << unplaced.out;
  first.signal(SIGTERM);
  EXPECT_EQ(first.wait(), 0);
}

class RunOnAFullDisk : public RunEnds, public ::testing::WithParamInterface<std::string> {};

TEST_P(RunOnAFullDisk, SaysSoAtOnceAndGoesOnButIsNotOk) {
  std::filesystem::create_directories(out());
  std::filesystem::create_symlink("/dev/full", out() + "/haptic_0.csv");
  const std::string duration = GetParam() == "realtime" ? "2" : "5";
  process_.emplace(run_words(scene("press"), {"--mode", GetParam(), "--duration", duration}), folder_.path());
  ASSERT_TRUE(eventually([&] {
    return read_text(out() + "/logs/haptic_sim_0.log").find("haptic_0.csv: No space left on device") !=
           std::string::npos;
  }));
  EXPECT_FALSE(std::filesystem::exists(out() + "/haptic_0.json")) << "only at the end";
  EXPECT_EQ(process_->wait(), 1);
  const Json json = summary();
  EXPECT_NE(json["verdict"].get<std::string>().find("haptic_0.csv: No space left on device"), std::string::npos)
      << json["verdict"];
  EXPECT_NEAR(json["simulated_s"].get<double>(), std::stod(duration), 0.01) << "the run did not go on";
}

INSTANTIATE_TEST_SUITE_P(Modes, RunOnAFullDisk, ::testing::Values("lockstep"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(FullRealtime, RunOnAFullDisk, ::testing::Values("realtime"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace subworld::test
