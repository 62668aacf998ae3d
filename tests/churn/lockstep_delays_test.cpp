// Short runs in lock-step whose programs are delayed at random: they start, join, leave and end, and have the same
// result. More of them, or with other seeds: SUBWORLD_DELAY_RUNS and SUBWORLD_DELAY_SEED.
#include "process/sessions/sessions.hpp"

#include <fmt/core.h>

#include <cstdlib>
#include <map>

namespace subworld::test {
namespace {

class LockstepDelayed : public Sessions, public ::testing::WithParamInterface<std::string> {
 protected:
  static int setting(const char* variable, int otherwise) {
    const char* const text = std::getenv(variable);
    return text == nullptr ? otherwise : std::atoi(text);
  }
  const int count_ = setting("SUBWORLD_DELAY_RUNS", 2), seed_ = setting("SUBWORLD_DELAY_SEED", 1);
  [[nodiscard]] Environment delays(int run) const {
    return {{"SUBWORLD_TEST_DELAY", fmt::format("{}:{}", seed_ + run, run % 2 == 0 ? 3 : 1)}};
  }
};

TEST_P(LockstepDelayed, RunsReachTheirEndWithOneResult) {
  std::map<std::string, std::string> hashes;
  for (int i = 0; i < count_ && !HasFailure(); ++i) {
    for (const char* presence : {"", "1 joins 0.05", "1 joins 100", "1 joins 0.02, 0 leaves 0.05, 0 joins 0.08",
                                 "1 leaves 0.04, 1 joins 0.07"}) {
      Words flags{"--users", "2", "--duration", "0.1", "--dds", GetParam()};
      if (*presence != '\0') flags.insert(flags.end(), {"--set", "presence=" + std::string(presence)});
      const Ended ended = run(scene("lift"), flags, delays(i));
      ASSERT_EQ(ended.code, 0) << presence << ", run " << i;
      const std::string hash = summary()["state_hash"];
      EXPECT_EQ(hashes.try_emplace(presence, hash).first->second, hash) << presence << ", run " << i;
    }
  }
}

TEST_P(LockstepDelayed, SessionsReachTheirEnd) {
  if (!has_namespaces()) GTEST_SKIP() << "network namespaces are not permitted here";
  const std::string file = session("duration: 0.2}", "duration: 0.1}");
  for (int i = 0; i < count_ && !HasFailure(); ++i)
    EXPECT_EQ(finish(up(file, out(), {"--namespaces", "--dds", GetParam()}), delays(i)).code, 0) << "run " << i;
}

INSTANTIATE_TEST_SUITE_P(Vendors, LockstepDelayed, ::testing::Values("fastdds", "cyclonedds", "mixed"),
                         [](const auto& one) { return one.param; });

}  // namespace
}  // namespace subworld::test
