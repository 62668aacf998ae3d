// Lock-step: users join, leave and come back; a run repeats bit by bit with the record of who took part when.
#include "process_test.hpp"

#include <fmt/format.h>

#include <tuple>

namespace subworld::test {
namespace {

class LockstepPresence : public ProcessTest, public ::testing::WithParamInterface<std::string> {
 protected:
  /// `press` with two users, whose proxies touch the same body.
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
  const Words planned = flags({"--duration", "2", "--presence", "1 joins 0.5, 0 leaves 1, 0 joins 1.4"});
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
  const Ended again = run(scene("lift"), flags({"--duration", duration, "--presence", presence}));
  EXPECT_EQ(again.code, 0) << again.out << again.err;
  EXPECT_EQ(summary()["state_hash"], hash) << presence << "\n" << summary()["presence"];
}

INSTANTIATE_TEST_SUITE_P(Vendors, LockstepPresence, ::testing::Values("fastdds", "cyclonedds", "mixed"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(Vendors, LockstepKill, ::testing::Values("fastdds", "cyclonedds", "mixed"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace subworld::test
