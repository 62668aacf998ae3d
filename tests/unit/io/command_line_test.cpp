// Options, their checks and their messages; likely slips of units.
#include "io/options/command_line.hpp"

#include "model/error.hpp"
#include "model/slips.hpp"

#include <fmt/core.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

namespace subworld {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

struct Parsed {
  std::string text = "preset";
  std::optional<double> latency_s;
  double wait_s = 30.0;
  int users = 1;
  std::uint64_t seed = 1;
  std::vector<std::string> peers;
  std::vector<int> ratios{4};
  std::vector<std::string> scenes;
  int random = 0;
  bool gui = false;
  bool given = false;
  std::optional<int> code;
};

Parsed parse(std::vector<const char*> words) {
  words.insert(words.begin(), "program");
  Parsed p;
  CommandLine line("program", "About.");
  line.add("scene", &p.scenes, "scenes");
  line.add("--text", &p.text, "a text").environment("COMMAND_LINE_TEST_TEXT");
  line.add("--latency", &p.latency_s, "a delay").range(0.0, 2.0, "s");
  const Option wait = line.add("--wait", &p.wait_s, "a time").range(0.1, 3600.0, "s");
  line.add("--users", &p.users, "a count").range(1, 64);
  line.add("--peers", &p.peers, "hosts");
  line.add("--ratio", &p.ratios, "ratios").range(1, 1000);
  const Option random = line.add("--random", &p.random, "how many").implies("100").range(1, 1000);
  line.add("--seed", &p.seed, "a seed").range(0, 9e15).needs(random);
  line.flag("--gui", p.gui, "a flag");
  p.code = line.parse(static_cast<int>(words.size()), words.data());
  p.given = wait.given();
  return p;
}

std::string refused(const std::vector<const char*>& words) {
  try {
    (void)parse(words);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ExitCode::usage);
    return error.what();
  }
  return "accepted";
}

TEST(CommandLineTest, SetsWhatIsGivenAndKeepsDefaults) {
  const Parsed none = parse({});
  EXPECT_EQ(none.text, "preset");
  EXPECT_FALSE(none.latency_s);
  EXPECT_THAT(none.ratios, ElementsAre(4));
  EXPECT_FALSE(none.given);
  const Parsed all = parse({"row", "--latency", "5e-2", "heap", "--users=3", "--wait", "1", "--wait", "2", "--peers",
                            "a,b", "--peers", "c", "--ratio", "1,10", "--gui", "--random", "--seed", "9000000000"});
  EXPECT_THAT(all.scenes, ElementsAre("row", "heap"));
  EXPECT_EQ(all.latency_s, 0.05);
  EXPECT_EQ(all.users, 3);
  EXPECT_EQ(all.wait_s, 2.0) << "the last one counts";
  EXPECT_TRUE(all.given);
  EXPECT_THAT(all.peers, ElementsAre("a", "b", "c"));
  EXPECT_THAT(all.ratios, ElementsAre(1, 10));
  EXPECT_TRUE(all.gui);
  EXPECT_EQ(all.random, 100);
  EXPECT_EQ(all.seed, 9'000'000'000U);
  EXPECT_EQ(parse({"--random", "7"}).random, 7);
}

TEST(CommandLineTest, NamesTheOptionTheFaultAndTheCure) {
  EXPECT_EQ(refused({"--latency", "50"}),
            "--latency 50: out of range 0 to 2 s; did you mean 0.05 (50 ms)? See program --help");
  EXPECT_THAT(refused({"--latency", "-1"}), HasSubstr("--latency -1: out of range 0 to 2 s; see"));
  EXPECT_THAT(refused({"--latency", "50ms"}), HasSubstr("without its unit, which is s"));
  for (const char* number : {"nan", "inf", "-inf", "1e999"})
    EXPECT_THAT(refused({"--latency", number}), HasSubstr("must be a finite number"));
  EXPECT_THAT(refused({"--latency", ""}), HasSubstr("must be a number"));
  EXPECT_THAT(refused({"--users", "many"}), HasSubstr("must be a whole number"));
  EXPECT_THAT(refused({"--users", "2.5"}), HasSubstr("must be a whole number"));
  EXPECT_THAT(refused({"--users", "99999999999"}), HasSubstr("out of range 1 to 64"));
  EXPECT_THAT(refused({"--ratio", "4,0"}), HasSubstr("--ratio 0: out of range"));
  EXPECT_THAT(refused({"--wait", "--gui"}), HasSubstr("--wait needs a value, before --gui"));
  EXPECT_THAT(refused({"--wait"}), HasSubstr("--wait"));
  EXPECT_THAT(refused({"--seed", "1"}), HasSubstr("--seed requires --random"));
  EXPECT_THAT(refused({"--usres", "1"}), HasSubstr("unknown option --usres; did you mean --users?"));
}

TEST(CommandLineTest, TheEnvironmentIsNamedWhereItIsWrong) {
  setenv("COMMAND_LINE_TEST_TEXT", "environment", 1);
  EXPECT_EQ(parse({}).text, "environment");
  EXPECT_EQ(parse({"--text", "flag"}).text, "flag");
  unsetenv("COMMAND_LINE_TEST_TEXT");
  int number = 1;
  CommandLine line("program", "About.");
  line.add("--number", &number, "a number").range(0, 9).environment("COMMAND_LINE_TEST_NUMBER");
  setenv("COMMAND_LINE_TEST_NUMBER", "10", 1);
  const char* const words[] = {"program"};
  EXPECT_THROW(
      {
        try {
          (void)line.parse(1, words);
        } catch (const Error& error) {
          EXPECT_THAT(error.what(), HasSubstr("--number (or COMMAND_LINE_TEST_NUMBER) 10: out of range 0 to 9"));
          throw;
        }
      },
      Error);
  unsetenv("COMMAND_LINE_TEST_NUMBER");
}

TEST(CommandLineTest, HelpShowsRangesUnitsAndDefaults) {
  ::testing::internal::CaptureStdout();
  EXPECT_EQ(parse({"--help"}).code, 0);
  const std::string help = ::testing::internal::GetCapturedStdout();
  for (const char* part :
       {"--wait <s>", "a time (0.1 to 3600 s; default: 30 s)", "--users <N>", "a count (1 to 64; default: 1)",
        "default: preset; environment: COMMAND_LINE_TEST_TEXT", "needs --random", "--version"})
    EXPECT_THAT(help, HasSubstr(part));
  ::testing::internal::CaptureStdout();
  EXPECT_EQ(parse({"--version"}).code, 0);
  EXPECT_THAT(::testing::internal::GetCapturedStdout(), ::testing::StartsWith("program "));
}

TEST(CommandLineTest, CommandsAreChosenAndNamed) {
  const auto chosen = [](std::vector<const char*> words) {
    words.insert(words.begin(), "program");
    CommandLine line("program", "About.");
    double wait_s = 1.0;
    CommandLine& run = line.command("run", "Runs.");
    run.add("--wait", &wait_s, "a time").range(0.1, 10.0, "s");
    CommandLine& plan = line.command("plan", "Plans.");
    (void)line.parse(static_cast<int>(words.size()), words.data());
    return run.chosen() ? fmt::format("run {}", wait_s) : plan.chosen() ? "plan" : "none";
  };
  const auto fault = [&](const std::vector<const char*>& words) -> std::string {
    try {
      return chosen(words);
    } catch (const Error& error) {
      return error.what();
    }
  };
  EXPECT_EQ(chosen({"run", "--wait", "5"}), "run 5");
  EXPECT_EQ(chosen({"plan"}), "plan");
  EXPECT_THAT(fault({}), HasSubstr("a command is missing; choose one of: run, plan"));
  EXPECT_THAT(fault({"fly"}), HasSubstr("\"fly\" is no command; choose one of: run, plan"));
  EXPECT_THAT(fault({"plna"}), HasSubstr("did you mean plan?"));
  EXPECT_THAT(fault({"run", "--wait", "100"}), HasSubstr("out of range 0.1 to 10 s; did you mean 0.1 (100 ms)?"));
  EXPECT_THAT(fault({"run", "--wiat", "1"}), HasSubstr("did you mean --wait? See program run --help"));
}

TEST(Slips, AreFactorsOfUsualUnits) {
  EXPECT_EQ(likely_slip(1.0, {.least = 1e-6, .most = 0.1}, "s"), "; did you mean 0.001 (1 ms)?");
  EXPECT_EQ(likely_slip(500.0, {.least = 1e-6, .most = 0.1}, "s"), "; did you mean 0.0005 (500 us)?");
  EXPECT_EQ(likely_slip(100.0, {.least = 0.0, .most = 1.0}, "m"), "; did you mean 0.1 (100 mm)?");
  EXPECT_EQ(likely_slip(200.0, {.least = 0.0, .most = 10.0}, "kg"), "; did you mean 0.2 (200 g)?");
  EXPECT_EQ(likely_slip(1.0, {.least = 10.0, .most = 1e5}, "Hz"), "; did you mean 1000 (1 kHz)?");
  EXPECT_EQ(likely_slip(90.0, {.least = -M_PI, .most = M_PI}, "rad"), "; did you mean 1.5708 (90 deg)?");
  EXPECT_EQ(likely_slip(20.0, {.least = 0.0, .most = 0.9}, kPartUnit), "; did you mean 0.2 (20 %)?");
  EXPECT_EQ(likely_slip(0.5, {.least = 0.0, .most = 1.0}, "m"), "") << "inside";
  EXPECT_EQ(likely_slip(-5.0, {.least = 0.0, .most = 1.0}, "m"), "") << "no unit helps";
}

TEST(Slips, TheUnitStandsInTheKey) {
  EXPECT_EQ(unit_of("settings.h_s"), "s");
  EXPECT_EQ(unit_of("bodies[3].size_m[2]"), "m");
  EXPECT_EQ(unit_of("users[0].device.path[0].move"), "");
  EXPECT_EQ(unit_of("bodies[0].mass_kg"), "kg");
  EXPECT_EQ(unit_of("users[0].device.speed_limit_m_s"), "m/s");
  EXPECT_EQ(unit_of("users[0].coupling.stiffness_n_m"), "N/m");
  EXPECT_EQ(unit_of("users[0].device.torque_limit_n_m"), "N m");
  EXPECT_EQ(unit_of("settings.ratio"), "");
  EXPECT_EQ(unit_of("settings.delay.loss_ratio"), kPartUnit);
}

}  // namespace
}  // namespace subworld
