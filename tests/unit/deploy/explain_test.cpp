// What --explain says of the network.
#include "judge/explain.hpp"

#include "judge/summary.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace subworld {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::string words_of(const RunResults& run) {
  std::string text = explanation(run, "out/x", false, "subworld");
  for (std::size_t at = text.find("\n  "); at != std::string::npos; at = text.find("\n  ")) text.replace(at, 3, " ");
  return text;
}

RunResults run_between_hosts(Mode mode) {
  RunResults run;
  run.scene.settings.mode = mode;
  run.scene.settings.remote = true;
  run.world.ratio.add(4.0);
  run.verdict = "ok";
  return run;
}

TEST(Explanation, SaysWhatTheRunAssumesAboutTheNetwork) {
  RunResults run = run_between_hosts(Mode::realtime);
  const std::string text = words_of(run);
  for (const char* part : {"several hosts", "ahead of the world by the round trip", "jitter", "25 cycles"})
    EXPECT_THAT(text, HasSubstr(part));
  run.link = "delay 50ms";
  EXPECT_THAT(words_of(run), HasSubstr("each way: delay 50ms"));
  run.scene.settings.remote = false;
  EXPECT_THAT(words_of(run), Not(HasSubstr("round trip"))) << "there is no network on one host";
}

TEST(Explanation, SaysThatANetworkChangesNothingInLockStep) {
  EXPECT_THAT(words_of(run_between_hosts(Mode::lockstep)), HasSubstr("changes no result"));
}

}  // namespace
}  // namespace subworld
