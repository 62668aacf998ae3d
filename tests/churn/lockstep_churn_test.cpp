// Programs of a run in lock-step die and are halted at random, and come back: the run reaches its end, and its record
// repeats it bit by bit. Longer, or with other seeds: SUBWORLD_CHURN_FAULTS and SUBWORLD_CHURN_SEED.
#include "process/process_test.hpp"

#include <fmt/core.h>

#include <cstdlib>
#include <map>
#include <random>
#include <tuple>

namespace subworld::test {
namespace {

int setting(const char* variable, int otherwise) {
  const char* const text = std::getenv(variable);
  return text == nullptr ? otherwise : std::atoi(text);
}

using Case = std::tuple<std::string, std::string>;  ///< vendor and --absent

class LockstepChurn : public ProcessTest, public ::testing::WithParamInterface<Case> {
 protected:
  [[nodiscard]] Words flags(const Words& more) const {
    Words words{"--mode", "lockstep", "--dds", std::get<0>(GetParam()), "--users", "2"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }
  [[nodiscard]] pid_t pid_of(const std::string& name, int user) const {
    for (const Running& one : running(out())) {
      const auto at = std::find(one.words.begin(), one.words.end(), "--user");
      if (!one.words.front().ends_with("/" + name) || at == one.words.end() || at + 1 == one.words.end()) continue;
      if (*(at + 1) == std::to_string(user)) return one.pid;
    }
    return -1;
  }
  /// Bytes that the world has recorded: it advances.
  [[nodiscard]] std::uintmax_t recorded() const {
    std::error_code none;
    const std::uintmax_t size = std::filesystem::file_size(out() + "/world.csv", none);
    return none ? 0 : size;
  }
};

TEST_P(LockstepChurn, RepeatsWithItsRecord) {
  const int most = setting("SUBWORLD_CHURN_FAULTS", 2);
  const auto& [vendor, absent] = GetParam();
  std::mt19937 random(static_cast<unsigned>(setting("SUBWORLD_CHURN_SEED", 1)));
  // A run that continues advances by tens of seconds while a user is away.
  const std::string duration = fmt::format("{}", (absent == "wait" ? 1 : 20) * (most + 1));
  Process process(
      run_words(scene("lift"), flags({"--duration", duration, "--absent", absent, "--restart", "on-failure"})),
      folder_.path());
  std::map<std::string, int> faults;
  int injected = 0;
  std::uintmax_t next = 10'000;
  std::optional<int> code;
  while (!(code = process.wait(0.02)) && injected < most) {
    if (recorded() < next) continue;
    const std::string victim = random() % 2 == 0 ? "haptic_sim" : "device_sim";
    const int user = static_cast<int>(random() % 2);
    const pid_t pid = pid_of(victim, user);
    if (pid <= 0) continue;
    const int signal = random() % 4 == 0 ? SIGSTOP : SIGKILL;
    kill(pid, signal);
    ++faults[fmt::format("{} {}", victim, signal == SIGKILL ? "killed" : "halted")];
    ++injected;
    next = recorded() + 10'000;
  }
  if (!code) code = process.wait(300.0 + 20.0 * most);
  ASSERT_EQ(code, 0) << process.out() << process.err();
  const Json json = summary();
  ASSERT_TRUE(json.is_object()) << process.err();
  EXPECT_GE(json["simulated_s"].get<double>(), std::stod(duration) - 0.01) << json["verdict"];
  EXPECT_GE(injected, std::min(most, 1)) << "too few faults";
  const std::string presence = json["presence"], hash = json["state_hash"];
  EXPECT_NE(presence.find(" leaves "), std::string::npos) << presence;
  Process again(run_words(scene("lift"), flags({"--duration", duration, "--set", "presence=" + presence})),
                folder_.path());
  EXPECT_EQ(again.wait(300.0 + 20.0 * most), 0) << again.out() << again.err();
  EXPECT_EQ(summary()["state_hash"], hash) << presence << "\n" << summary()["presence"];
  std::string text;
  for (const auto& [what, count] : faults) text += fmt::format(" {} {};", count, what);
  fmt::print("{}, --absent {}:{} {}\n", vendor, absent, text, presence);
}

INSTANTIATE_TEST_SUITE_P(Vendors, LockstepChurn,
                         ::testing::Values(Case{"cyclonedds", "continue"}, Case{"mixed", "wait"}),
                         [](const auto& one) { return std::get<0>(one.param) + "_" + std::get<1>(one.param); });

}  // namespace
}  // namespace subworld::test
