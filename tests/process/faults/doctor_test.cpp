// A few misconfigurations, a healthy system, and the table of `subworld top`. All the others: doctor_long_test.cpp
#include "process/faults/doctor_cases.hpp"

#include <algorithm>

namespace subworld::test {
namespace {

class ShortDoctor : public Doctor, public ::testing::WithParamInterface<std::string> {};

TEST_P(ShortDoctor, NamesAMisconfigurationAndItsCureWorks) {
  if (!has_namespaces()) GTEST_SKIP() << "needs root and namespaces";
  const auto found = std::ranges::find(misconfigurations(), GetParam(), &Misconfiguration::name);
  ASSERT_NE(found, misconfigurations().end());
  expect_found_and_cured(*found);
}

INSTANTIATE_TEST_SUITE_P(Cases, ShortDoctor,
                         ::testing::Values("NoRealtimeRights", "PeersWithoutInterface", "ARunWithoutADevice"),
                         [](const auto& one) { return one.param; });

/// The findings but those of the moment.
std::string report_of(const Ended& ended) {
  std::string report;
  std::istringstream lines(ended.out);
  for (std::string line; std::getline(lines, line);) report += line.starts_with("lateness") ? "" : line + "\n";
  return report;
}

TEST_F(Doctor, IsSilentOnAHealthySystem) {
  if (!has_namespaces()) GTEST_SKIP() << "needs root and namespaces";
  const Ended ended = run_apart(
      "subworld doctor --json > $WORK/alone.json\n"
      "host_b; subworld doctor press --domain 70 --interface eth0 --peers 10.77.0.2 --json > $WORK/two.json\n"
      "run='press --duration 600 --mode realtime --domain 71 --interface eth0'\n"
      "start $BIN/world_sim $run; start $BIN/haptic_sim $run; start $BIN/device_sim $run\n"
      "subworld doctor --json > $WORK/running.json; subworld doctor --domain 71\n"
      "subworld top; subworld top --once --domain 71 --dds cyclonedds > $WORK/top.txt");
  for (const char* name : {"alone", "two", "running"}) {
    const Json json = Json::parse(read_text(folder_.path() + "/scratch/" + name + ".json"), nullptr, false);
    ASSERT_FALSE(json.is_discarded()) << name << ended.out << ended.err;
    for (const Json& one : json["findings"]) EXPECT_EQ(one["check"], "lateness") << name << ": " << one["what"];
    EXPECT_GT(json["checks"].size(), 25U);
  }
  EXPECT_NE(report_of(ended).find("checks passed\n"), std::string::npos) << ended.out;
  for (const std::string& table : {ended.out, read_text(folder_.path() + "/scratch/top.txt")}) {
    EXPECT_NE(table.find("domain 71, 3 programs"), std::string::npos) << table;
    for (const char* name : {"world_sim ", "haptic_sim 0 ", "device_sim 0 "})
      EXPECT_NE(table.find(std::string("\n  ") + name), std::string::npos) << table;
  }
}

TEST_F(Doctor, WrongWordsAreUsageErrors) {
  EXPECT_EQ(finish({program("subworld"), "doctor", "pres"}).code, 2);
  EXPECT_EQ(finish({program("subworld"), "doctor", "--domain", "233"}).code, 2);
  EXPECT_EQ(finish({program("subworld"), "top", "--domain", "233"}).code, 2);
  const Ended nowhere = finish({program("subworld"), "top", "--domain", domain_.text(), "--interface", "nowhere"});
  EXPECT_EQ(nowhere.code, 3) << nowhere.err;
}

// The table is drawn again each second; `q` ends it and leaves the terminal as it was.
TEST_F(Doctor, TopIsLiveOnATerminalUntilQ) {
  Process world(
      {program("world_sim"), scene("press"), "--mode", "realtime", "--domain", domain_.text(), "--wait", "60"},
      folder_.path());
  Process top({program("subworld"), "top", "--domain", domain_.text()}, folder_.path(), {{"TERM", "xterm"}},
              Process::Output::terminal);
  const auto shown = [&](const std::string& text) {
    return eventually([&] { return top.read_terminal().find(text) != std::string::npos; });
  };
  EXPECT_TRUE(shown("world_sim")) << top.read_terminal();
  EXPECT_TRUE(shown("waiting")) << top.read_terminal();
  top.type("q");
  EXPECT_EQ(top.wait(), 0);
  EXPECT_NE(top.read_terminal().find("\033[?25h"), std::string::npos) << "the cursor is hidden";
}

}  // namespace
}  // namespace subworld::test
