// `subworld up --restart`: programs of a session that are started again, each on its host.
#include "process/sessions/sessions.hpp"

#include <unistd.h>

#include <filesystem>
#include <memory>

namespace subworld::test {
namespace {

struct Victim {
  std::string program, user, host;

  [[nodiscard]] std::string label() const { return user.empty() ? program : program + "_" + user; }
};

/// A real-time session of 5 s in which a program is killed at about 1.2 s.
class SessionRestarts : public SessionsByShell, public ::testing::WithParamInterface<Victim> {
 protected:
  static constexpr double kDuration_s = 5.0;

  [[nodiscard]] std::string realtime_session(const std::string& passage = "", const std::string& by = "",
                                             const std::string& duration = "5") const {
    std::string text = read_text(session(passage, by));
    const std::string flags = "mode: lockstep, duration: 0.2";
    return folder_.write("session.yaml",
                         text.replace(text.find(flags), flags.size(), "mode: realtime, duration: " + duration));
  }
  /// Kills it when its history has enough rows. `folder`: a part of its command line.
  void kill_in_the_middle(const Victim& victim, const std::string& folder, const std::string& history,
                          double after_s = 1.2) const {
    ASSERT_TRUE(eventually([&] {
      const Table table = read_table(history);
      return !table.rows.empty() && table.rows.back()[0] > after_s;
    })) << history;
    int killed = 0;
    for (const Running& one : running(folder)) {
      const auto user = std::ranges::find(one.words, "--user");
      const bool same_user = victim.user.empty() || (user != one.words.end() && *(user + 1) == victim.user);
      if (!one.words.front().ends_with("/" + victim.program) || !same_user) continue;
      kill(one.pid, SIGKILL);
      ++killed;
    }
    ASSERT_EQ(killed, 1);
  }
  void expect_whole_run(const Victim& victim) const {
    const Json json = summary();
    ASSERT_TRUE(json.is_object());
    EXPECT_NEAR(json["simulated_s"].get<double>(), kDuration_s, 0.01);
    EXPECT_FALSE(json.contains("partial"));
    if (victim.program == "world_sim") {
      EXPECT_GT(json["world"].value("resumed_from_s", 0.0), 0.4) << "it did not go on from a checkpoint";
    } else if (victim.program == "haptic_sim") {
      ASSERT_EQ(json["world"]["absences"].size(), 1U);
      EXPECT_LT(json["world"]["absences"][0]["to_s"].get<double>(), kDuration_s - 0.1) << "it did not return";
    }
  }
  void expect_restarted(const Victim& victim) const {
    const Json json = summary();
    ASSERT_EQ(json["restarts"].size(), 1U) << json["verdict"];
    EXPECT_EQ(json["restarts"][0]["program"], victim.label());
    EXPECT_EQ(json["restarts"][0]["reason"], "killed by SIGKILL");
    const std::string verdict = json["verdict"];
    EXPECT_NE(verdict.find(victim.label() + " was started again (killed by SIGKILL)"), std::string::npos) << verdict;
  }
};

TEST_P(SessionRestarts, InNamespacesServeEveryUserToTheEnd) {
  if (!has_namespaces()) GTEST_SKIP() << "network namespaces are not permitted here";
  const Victim& victim = GetParam();
  Process process(up(realtime_session(), out(), {"--namespaces", "--restart", "on-failure", "--dds", "mixed"}),
                  folder_.path());
  const std::string results = out() + "/hosts/" + victim.host;
  kill_in_the_middle(victim, results, out() + "/hosts/world/world.csv");
  EXPECT_EQ(process.wait(), 0) << process.err() << process.out();
  expect_whole_run(victim);
  expect_restarted(victim);
}

INSTANTIATE_TEST_SUITE_P(Programs, SessionRestarts, ::testing::Values(Victim{"device_sim", "0", "left"}),
                         [](const auto& one) { return one.param.program; });
INSTANTIATE_TEST_SUITE_P(FullRealtime, SessionRestarts,
                         ::testing::Values(Victim{"world_sim", "", "world"}, Victim{"haptic_sim", "1", "right"}),
                         [](const auto& one) { return one.param.program; });

TEST_F(SessionRestarts, AWorldOnADistantHostGoesOnFromItsCheckpointThere) {
  for (const char* user : {"user@10.0.0.1", "user@10.0.0.2", "user@10.0.0.3"}) make_checkout(home(user) + "/subworld");
  const std::string file = realtime_session("  - name: world\n", "  - name: world\n    ssh: user@10.0.0.1\n");
  // The programs there know relative paths only; the name of the results tells this session from others.
  const std::string mark = "restarted_" + std::to_string(getpid()), there = "out/sessions/" + mark + "/world";
  Process process(up(file, folder_.path() + "/" + mark, {"--ssh", ssh(), "--restart", "on-failure"}), folder_.path());
  const Victim world{"world_sim", "", "world"};
  kill_in_the_middle(world, there, home("user@10.0.0.1") + "/subworld/" + there + "/world.csv");
  EXPECT_EQ(process.wait(), 0) << process.err() << process.out();
  std::filesystem::rename(folder_.path() + "/" + mark, out());
  expect_whole_run(world);
  expect_restarted(world);
}

// Its results are there, not here.
TEST_F(SessionRestarts, AWorldOnADistantHostThatFailsAfterItsResultsIsNotStartedAgain) {
  const std::string world = home("user@10.0.0.1") + "/subworld/build/release/bin/world_sim";
  std::filesystem::create_directories(std::filesystem::path(world).parent_path());
  for (const char* user : {"user@10.0.0.2", "user@10.0.0.3"}) make_checkout(home(user) + "/subworld");
  const std::string starts = folder_.path() + "/starts";
  std::filesystem::copy(write_script("world", "echo >> " + starts + "; " + program("world_sim") + " \"$@\"; exit 1"),
                        world);
  const std::string file = realtime_session("  - name: world\n", "  - name: world\n    ssh: user@10.0.0.1\n", "1");
  const std::string mark = "failed_" + std::to_string(getpid());
  const Ended ended = finish(up(file, folder_.path() + "/" + mark, {"--ssh", ssh(), "--restart", "on-failure"}));
  EXPECT_EQ(ended.code, 1) << ended.err << ended.out;
  EXPECT_EQ(read_text(starts), "\n") << "it was started again: " << ended.err;
}

// Each host starts its own programs again, also one without the world.
TEST_F(SessionRestarts, OfAShareThatIsStartedByHost) {
  const std::string file = realtime_session();
  std::vector<std::unique_ptr<Process>> shares;
  Words collect{program("subworld"), "collect"};
  for (const std::string host : {"right", "world", "left"}) {
    const std::string of_host = folder_.path() + "/" + host;
    std::filesystem::create_directory(of_host);
    shares.push_back(
        std::make_unique<Process>(up(file, of_host, {"--host", host, "--restart", "on-failure"}), of_host));
    collect.push_back(of_host);
  }
  const Victim victim{"haptic_sim", "1", "right"};
  kill_in_the_middle(victim, folder_.path() + "/right", folder_.path() + "/world/hosts/world/world.csv");
  for (const auto& share : shares) EXPECT_EQ(share->wait(), 0) << share->err();
  collect.insert(collect.end(), {"--out", out()});
  const Ended ended = finish(collect);
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  expect_whole_run(victim);
}

// In lock-step the world waits for the user, and the record of the run repeats it.
TEST_F(SessionRestarts, InLockstepTheUserReturnsAndTheRecordRepeatsTheRun) {
  if (!has_namespaces()) GTEST_SKIP() << "network namespaces are not permitted here";
  const std::string flags = "mode: lockstep, duration: 0.2";
  const auto with = [&](const std::string& more) {
    std::string text = read_text(session());
    return folder_.write("lockstep.yaml", text.replace(text.find(flags), flags.size(), "mode: lockstep, " + more));
  };
  Process process(
      up(with("duration: 1.5, absent: wait, bodies: [cube]"), out(), {"--namespaces", "--restart", "on-failure"}),
      folder_.path());
  kill_in_the_middle({"haptic_sim", "1", "right"}, out() + "/hosts/right", out() + "/hosts/world/world.csv", 0.5);
  EXPECT_EQ(process.wait(), 0) << process.err() << process.out();
  const Json first = summary();
  ASSERT_GE(first["restarts"].size(), 1U) << first["verdict"];  // its device waited in vain, and is started again too
  EXPECT_FALSE(read_table(out() + "/bodies.csv").rows.empty());
  const std::string presence = first["presence"];
  EXPECT_NE(presence.find("1 leaves"), std::string::npos) << presence;
  const Ended again = finish(up(with("duration: 1.5, set: 'presence=" + presence + "'"), out(), {"--namespaces"}));
  EXPECT_EQ(again.code, 0) << again.err << again.out;
  EXPECT_EQ(summary()["state_hash"], first["state_hash"]);
}

TEST_F(SessionRestarts, NeedRealTimeOrAWorldThatWaits) {
  const Ended ended = finish(up(session(), out(), {"--restart", "on-failure"}));
  EXPECT_EQ(ended.code, 2);
  EXPECT_NE(ended.err.find("--restart: a run in lock-step ends with the first of its programs"), std::string::npos)
      << ended.err;
}

}  // namespace
}  // namespace subworld::test
