// Lock-step: users join, leave and come back; a run repeats bit by bit with the record of who took part when.
#include "process/process_test.hpp"

#include <fmt/core.h>

#include <memory>
#include <utility>
#include <vector>

namespace subworld::test {
namespace {

class LockstepPresence : public ProcessTest, public ::testing::WithParamInterface<std::string> {
 protected:
  /// Of a run in lock-step of `lift`: two users lift one body.
  [[nodiscard]] Words flags(const Words& more) const {
    Words words{"--mode", "lockstep", "--dds", GetParam()};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  [[nodiscard]] pid_t find(const std::string& name, const std::string& user) const {
    for (const Running& one : running(out())) {
      if (!one.words.front().ends_with("/" + name)) continue;
      const auto flag = std::find(one.words.begin(), one.words.end(), "--user");
      if (flag != one.words.end() && *(flag + 1) == user) return one.pid;
    }
    return -1;
  }
};

TEST_P(LockstepPresence, IsPlannedAndRepeats) {
  const Words planned = flags({"--duration", "2", "--set", "presence=1 joins 0.5, 0 leaves 1, 0 joins 1.4"});
  std::vector<std::string> hashes;
  for (int i = 0; i < 2; ++i) {
    const Ended ended = run(scene("lift"), planned);
    ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
    const Json json = summary();
    EXPECT_GE(json["simulated_s"].get<double>(), 1.99) << json["verdict"];
    const std::string presence = json["presence"];
    for (const char* event : {"1 joins 0.5", "0 leaves 1,", "0 joins 1.4"})
      EXPECT_NE((presence + ",").find(event), std::string::npos) << presence;
    hashes.push_back(json["state_hash"]);
    EXPECT_EQ(json["world"]["absences"].size(), 2U);
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

// Under delays that differ from message to message, the last states of a user who leaves are missed at other steps.
class LockstepDelays : public LockstepPresence {};
TEST_P(LockstepDelays, RepeatTheLeaveOfAUser) {
  std::vector<std::string> hashes;
  for (int i = 0; i < 2; ++i) {
    const Ended ended = run(
        scene("lift"), flags({"--duration", "1", "--latency", "0.03", "--set", "delay.jitter_s=0.004", "--set",
                              "delay.loss_ratio=0.01", "--set", "presence=1 joins 0.2, 0 leaves 0.5, 0 joins 0.75"}));
    ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
    hashes.push_back(summary()["state_hash"]);
  }
  EXPECT_EQ(hashes[0], hashes[1]);
}

class LockstepOrders : public LockstepPresence {};
TEST_P(LockstepOrders, ToLeaveAreRecordedAndRepeat) {
  Process process(run_words(scene("lift"), flags({"--duration", "5"})), folder_.path());
  ASSERT_TRUE(eventually([&] { return read_text(out() + "/haptic_1.csv").size() > 10000; })) << process.err();
  const Ended order =
      finish({program("subworld"), "control", "leave", "--user", "1", "--domain", domain_.text(), "--dds", GetParam()});
  EXPECT_EQ(order.code, 0) << order.err;
  ASSERT_EQ(process.wait(), 0) << process.out() << process.err();
  const std::string presence = summary()["presence"], hash = summary()["state_hash"];
  EXPECT_NE(presence.find("1 leaves"), std::string::npos) << presence;
  EXPECT_EQ(run(scene("lift"), flags({"--duration", "5", "--set", "presence=" + presence})).code, 0);
  EXPECT_EQ(summary()["state_hash"], hash) << presence;
}

TEST_P(LockstepOrders, ArePlannedAndRecordedWithTheUserWhoNeverJoins) {
  const std::string planned = "1 joins 100, world engine ode quality from 0.1, 0 engine ode fast from 0.2";
  ASSERT_EQ(run(scene("lift"), flags({"--duration", "0.5", "--set", "presence=" + planned})).code, 0);
  const Json first = summary();
  const std::string presence = first["presence"];
  for (const char* event : {"1 joins 100", "world engine ode quality from 0.1", "0 engine ode fast from 0.2"})
    EXPECT_NE((presence + ",").find(event + std::string(",")), std::string::npos) << presence;
  EXPECT_EQ(first["world"]["engine_changes"][0]["to"], "ode");
  EXPECT_EQ(first["haptic"][0]["engine_changes"][0]["to"], "ode");
  EXPECT_EQ(run(scene("lift"), flags({"--duration", "0.5", "--set", "presence=" + presence})).code, 0);
  EXPECT_EQ(summary()["state_hash"], first["state_hash"]) << presence;

  const Ended unknown =
      run(scene("lift"), flags({"--duration", "0.5", "--set", "presence=world engine havoc fast from 0.1"}));
  EXPECT_EQ(unknown.code, 2);
  EXPECT_NE(unknown.err.find("choose one of"), std::string::npos) << unknown.err;
}

// A user's programs are halted, and continued after the world has gone on: they say so, and nobody else notices.
class LockstepHalt : public LockstepPresence {};
TEST_P(LockstepHalt, EndsProgramsThatTheWorldHasGoneOnWithout) {
  std::vector<std::pair<std::string, std::unique_ptr<Process>>> programs;
  const auto start = [&](const std::string& name, const std::string& user) {
    const std::string folder = folder_.path() + "/" + name + user;
    std::filesystem::create_directories(folder);
    Words words{program(name), scene("lift"), "--domain", domain_.text(), "--out", folder};
    for (const std::string& word : flags({"--duration", "1000", "--absent", "continue"})) words.push_back(word);
    if (!user.empty()) words.insert(words.end(), {"--user", user});
    programs.emplace_back(folder, std::make_unique<Process>(words, folder));
  };
  start("world_sim", "");
  for (const char* user : {"0", "1"}) {
    start("haptic_sim", user);
    start("device_sim", user);
  }
  const auto bytes = [&](std::size_t i, const char* file) { return read_text(programs[i].first + file).size(); };
  ASSERT_TRUE(eventually([&] { return bytes(3, "/haptic_1.csv") > 10000; })) << programs[3].second->err();
  programs[3].second->signal(SIGSTOP);
  programs[4].second->signal(SIGSTOP);
  const auto world_err = [&] { return programs[0].second->err(); };
  ASSERT_TRUE(eventually([&] { return world_err().find("user 1 is absent from t = ") != std::string::npos; }))
      << world_err();
  const std::size_t before = bytes(1, "/haptic_0.csv");
  EXPECT_TRUE(eventually([&] { return bytes(1, "/haptic_0.csv") > before + 10000; })) << "the other user stands";
  programs[3].second->signal(SIGCONT);
  programs[4].second->signal(SIGCONT);
  EXPECT_EQ(programs[3].second->wait(), 1);
  EXPECT_NE(programs[3].second->err().find("the world has gone on without user 1"), std::string::npos)
      << programs[3].second->err();
  EXPECT_TRUE(programs[4].second->wait());
  programs[0].second->signal(SIGTERM);
  EXPECT_EQ(programs[0].second->wait(), 1) << "a user is absent at the end";
  for (const std::size_t i : {std::size_t{1}, std::size_t{2}}) EXPECT_EQ(programs[i].second->wait(), 0);
}

class LockstepKill : public LockstepPresence {};

TEST_P(LockstepKill, IsRecordedAndRepeats) {
  const std::string duration = "3", victim = GetParam() == "fastdds" ? "device_sim" : "haptic_sim";
  const Words words =
      run_words(scene("lift"), flags({"--duration", duration, "--absent", "wait", "--restart", "on-failure"}));
  Process process(words, folder_.path());
  ASSERT_TRUE(eventually([&] { return read_text(out() + "/haptic_1.csv").size() > 20000 && find(victim, "1") > 0; }))
      << process.err();
  kill(find(victim, "1"), SIGKILL);
  ASSERT_EQ(process.wait(), 0) << process.out() << process.err();
  const Json json = summary();
  EXPECT_GE(json["simulated_s"].get<double>(), std::stod(duration) - 0.01) << json["verdict"];
  EXPECT_GE(json["world"]["absences"].size(), 1U) << json["verdict"];
  const std::string presence = json["presence"], hash = json["state_hash"];
  EXPECT_NE(presence.find("1 leaves"), std::string::npos) << presence;
  const Ended again = run(scene("lift"), flags({"--duration", duration, "--set", "presence=" + presence}));
  EXPECT_EQ(again.code, 0) << again.out << again.err;
  EXPECT_EQ(summary()["state_hash"], hash) << presence << "\n" << summary()["presence"];
}

INSTANTIATE_TEST_SUITE_P(Vendors, LockstepPresence, ::testing::Values("cyclonedds"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(Full, LockstepPresence, ::testing::Values("fastdds", "mixed"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(Vendors, LockstepKill, ::testing::Values("mixed"), [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(Full, LockstepKill, ::testing::Values("fastdds", "cyclonedds"),
                         [](const auto& one) { return one.param; });

INSTANTIATE_TEST_SUITE_P(Vendors, LockstepDelays, ::testing::Values("mixed"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(Vendors, LockstepOrders, ::testing::Values("fastdds"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(Vendors, LockstepHalt, ::testing::Values("cyclonedds"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace subworld::test
