#include "process/sessions/sessions.hpp"

#include <csignal>
#include <filesystem>
#include <memory>
#include <regex>
#include <set>
#include <sstream>

namespace subworld::test {
namespace {

namespace fs = std::filesystem;

TEST_F(Sessions, SharesThatAreStartedByHostAreCollectedIntoOneVerdict) {
  const std::string file = session();
  std::vector<std::unique_ptr<Process>> shares;
  Words collect{program("subworld"), "collect"};
  for (const std::string host : {"right", "world", "left"}) {
    const std::string of_host = folder_.path() + "/" + host;
    fs::create_directory(of_host);
    shares.push_back(std::make_unique<Process>(up(file, of_host, {"--host", host}), of_host));
    collect.push_back(of_host);
  }
  for (const auto& share : shares) EXPECT_EQ(share->wait(), 0) << share->err();
  collect.insert(collect.end(), {"--out", out()});
  const Ended ended = finish(collect);
  EXPECT_EQ(ended.code, 0) << ended.err;
  EXPECT_EQ(summary()["verdict"], "ok");
  EXPECT_EQ(summary()["dds"], "fastdds");
  EXPECT_EQ(summary()["state_hash"], hash_of_one_host());

  const Ended part = finish({program("subworld"), "collect", folder_.path() + "/world", "--out", out() + "2"});
  EXPECT_EQ(part.code, 2);
  EXPECT_NE(part.err.find("no results of haptic_sim 0"), std::string::npos) << part.err;
  const Ended users = finish({program("subworld"), "collect", folder_.path() + "/left", "--out", out() + "2"});
  EXPECT_NE(users.err.find("no world.json"), std::string::npos) << users.err;
}

TEST_F(Sessions, KeepTheirDomain) {
  const std::string of_session = folder_.path() + "/session";
  const std::string text = read_text(session("duration: 0.2}", "duration: 1000}"));
  const std::string here = folder_.write("here.yaml", std::regex_replace(text, std::regex(" *ssh: [^\n]*\n"), ""));
  Process first(up(here, of_session), folder_.path());
  ASSERT_TRUE(eventually([&] { return running(of_session).size() >= 4; })) << first.err();
  const Ended second = run(scene("press"), {"--duration", "0.1"});
  EXPECT_EQ(second.code, 3);
  EXPECT_NE(second.err.find("domain " + domain_.text() + " is in use by subworld"), std::string::npos) << second.err;
  first.signal(SIGTERM);
  EXPECT_EQ(first.wait(), 0);
}

class NamespacedSessions : public Sessions, public ::testing::WithParamInterface<std::string> {};

TEST_P(NamespacedSessions, OverALinkThatDelaysAndLosesTheHashIsThatOfOneHost) {
  if (!has_namespaces()) GTEST_SKIP() << "network namespaces are not permitted here";
  const Ended ended =
      finish(up(session(), out(), {"--namespaces", "--dds", GetParam(), "--link", "delay 2ms jitter 2ms loss 1%"}));
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  EXPECT_EQ(summary()["verdict"], "ok");
  EXPECT_EQ(summary()["dds"], GetParam());
  EXPECT_EQ(summary()["session"], folder_.path() + "/session.yaml");
  EXPECT_EQ(summary()["link"], "delay 2ms 2ms loss 1%");
  EXPECT_TRUE(summary()["machine_load"].is_object()) << "all hosts are this machine";
  EXPECT_EQ(summary()["state_hash"], hash_of_one_host());
}

TEST_F(Sessions, InNamespacesAreRecordedAndTracedInOneFile) {
  if (!has_namespaces()) GTEST_SKIP() << "network namespaces are not permitted here";
  const std::string file = folder_.path() + "/run.mcap", trace = folder_.path() + "/trace.json";
  Ended ended = finish(up(session(), out(), {"--namespaces", "--record", file, "--trace", trace}));
  ASSERT_EQ(ended.code, 0) << ended.err << ended.out;
  const Json counts = summary()["recording"];
  EXPECT_EQ(counts["messages_lost"], 0);
  for (const char* topic : {"/user_0/device_state", "/user_1/world_frame", "/user_1/haptic_report", "/world_state"})
    EXPECT_GT(counts["topics"][topic], 0) << topic;
  std::set<std::string> traced;
  for (const Json& event : Json::parse(read_text(trace), nullptr, false)) {
    if (event["name"] == "process_name") traced.insert(event["args"]["name"]);
  }
  EXPECT_EQ(traced.size(), 5U) << "not all programs are in the trace";

  const std::string hash = summary()["state_hash"];
  ended = finish({program("subworld"), "replay", file, "--resimulate", "--out", folder_.path() + "/again"});
  EXPECT_EQ(ended.code, 0) << ended.out << ended.err;
  EXPECT_NE(ended.out.find("state hash " + hash + ", recorded " + hash + ": equal"), std::string::npos) << ended.out;
}

INSTANTIATE_TEST_SUITE_P(Vendors, NamespacedSessions, ::testing::Values("mixed"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(Full, NamespacedSessions, ::testing::Values("fastdds", "cyclonedds"),
                         [](const auto& one) { return one.param; });

TEST_F(Sessions, AHostInANamespaceIsEnteredWithThePrintedCommand) {
  if (!has_namespaces()) GTEST_SKIP() << "network namespaces are not permitted here";
  const std::string file = session("duration: 0.2", "duration: 1000");
  Process process(up(file, out(), {"--namespaces"}), folder_.path());
  ASSERT_TRUE(eventually([&] { return read_text(out() + "/hosts/right/haptic_1.csv").size() > 10000; }))
      << process.err();
  std::smatch hint;
  const std::string text = process.out();
  ASSERT_TRUE(std::regex_search(text, hint, std::regex("another terminal: nsenter (\\S+) subworld (.*)"))) << text;
  Words stop{"/usr/bin/nsenter", hint[1], program("subworld")};
  std::istringstream words(std::regex_replace(hint[2].str(), std::regex("pause"), "stop"));
  for (std::string word; words >> word;) stop.push_back(word);
  const Ended ended = finish(stop);
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  EXPECT_EQ(process.wait(), 0) << process.err();
  EXPECT_TRUE(summary()["verdict"].get<std::string>().starts_with("stopped by control")) << summary()["verdict"];
}

TEST_F(Sessions, ThePageNamesEachOption) {
  const std::string page = read_text(std::string(SCENES_FOLDER) + "/../sessions/README.md");
  const std::string help = finish({program("subworld"), "up", "--help"}).out;
  const std::regex option("\n  (--[a-z]+)");
  int options = 0;
  for (std::sregex_iterator one(help.begin(), help.end(), option), end; one != end; ++one, ++options)
    EXPECT_NE(page.find("| `" + (*one)[1].str()), std::string::npos) << (*one)[1];
  EXPECT_GE(options, 8) << help;
}

TEST_F(Sessions, TheFileOfItsPageIsTheLibrarys) {
  const std::string folder = std::string(SCENES_FOLDER) + "/../sessions";
  const auto without_remarks = [](std::string text) {
    text = std::regex_replace(text, std::regex(" *#[^\n]*"), "");
    return std::regex_replace(text, std::regex("description: >\n(  [^\n]*\n)+"), "");
  };
  EXPECT_NE(
      without_remarks(read_text(folder + "/README.md")).find(without_remarks(read_text(folder + "/three_hosts.yaml"))),
      std::string::npos);
}

TEST_F(Sessions, AHostHasAVendorOfItsOwn) {
  if (!has_namespaces()) GTEST_SKIP() << "network namespaces are not permitted here";
  const std::string file = session("  - name: world\n", "  - name: world\n    dds: cyclonedds\n");
  const auto vendor_is = [](const Json& part, const std::string& vendor) {
    return part["dds"].get<std::string>().find(vendor) != std::string::npos;
  };
  Ended ended = finish(up(file, out(), {"--namespaces"}));
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  EXPECT_EQ(summary()["dds"], "mixed");
  EXPECT_TRUE(vendor_is(summary()["world"], "cyclonedds")) << summary()["world"]["dds"];
  for (const char* program : {"haptic", "device"}) {
    for (const Json& user : summary()[program]) EXPECT_TRUE(vendor_is(user, "fastdds")) << user["dds"];
  }
  EXPECT_EQ(summary()["state_hash"], hash_of_one_host());

  ended = finish(up(file, out(), {"--namespaces", "--dds", "fastdds"}));
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  EXPECT_EQ(summary()["dds"], "fastdds") << "--dds replaces the vendors of the hosts";
  EXPECT_TRUE(vendor_is(summary()["world"], "fastdds")) << summary()["world"]["dds"];
}

class RealTimeSessions : public Sessions, public ::testing::WithParamInterface<std::string> {
 protected:
  /// Runs the session in real time over a link of 100 ms. False where namespaces are not permitted.
  bool run_over_100_ms(const std::string& more_flags) {
    if (!has_namespaces()) return false;
    const std::string file = session("mode: lockstep, duration: 0.2", "mode: realtime, duration: 2" + more_flags);
    const Ended ended = finish(up(file, out(), {"--namespaces", "--dds", GetParam(), "--link", "delay 50ms"}));
    EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
    for (const Json& user : summary()["haptic"]) EXPECT_GT(user["force_max_n"], 5.0) << "both lift the cube";
    return true;
  }
};

// Else the world would guess what the operators do: an error of the force of tens of percent.
TEST_P(RealTimeSessions, TheWorldHasEachReportInTimeAlthoughTheLinkDelaysIt) {
  if (!run_over_100_ms("")) GTEST_SKIP() << "network namespaces are not permitted here";
  for (const Json& user : summary()["haptic"]) EXPECT_LT(user["late_reports_ratio"], 0.5);
  EXPECT_EQ(summary()["world"]["refused_reports"], 0);
  EXPECT_EQ(summary()["settings"]["plan"].dump().find("no message is delayed"), std::string::npos)
      << summary()["settings"]["plan"];
}

TEST_P(RealTimeSessions, ADeadbandSendsAFractionOfTheDevicesSamples) {
  if (!run_over_100_ms(", set: deadband=0.1")) GTEST_SKIP() << "network namespaces are not permitted here";
  for (const char* program : {"haptic", "device"}) {
    for (const Json& user : summary()[program]) {
      EXPECT_GT(user["sent_ratio"], 0.05) << program;
      EXPECT_LT(user["sent_ratio"], 0.6) << program;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Vendors, RealTimeSessions, ::testing::Values("fastdds"),
                         [](const auto& one) { return one.param; });
INSTANTIATE_TEST_SUITE_P(FullRealtime, RealTimeSessions, ::testing::Values("cyclonedds"),
                         [](const auto& one) { return one.param; });

struct Death {
  std::string program, label, host;
};

class NamespacedDeaths : public Sessions, public ::testing::WithParamInterface<Death> {};

TEST_P(NamespacedDeaths, AreNamedWithTheirHostAndEndTheRunInOrder) {
  if (!has_namespaces()) GTEST_SKIP() << "network namespaces are not permitted here";
  const Death& death = GetParam();
  Process process(up(session("duration: 0.2", "duration: 1000"), out(), {"--namespaces"}), folder_.path());
  const std::string results = out() + "/hosts/" + death.host;
  ASSERT_TRUE(eventually([&] { return read_text(out() + "/hosts/right/haptic_1.csv").size() > 10000; }))
      << process.err();
  for (const Running& one : running(results)) {
    if (one.words.front().ends_with("/" + death.program)) kill(one.pid, SIGKILL);
  }
  EXPECT_EQ(process.wait(), 1) << process.err();
  const std::string verdict = "failed: " + death.label + " on host " + death.host + " killed by SIGKILL";
  EXPECT_TRUE(summary()["verdict"].get<std::string>().starts_with(verdict)) << summary()["verdict"];
  EXPECT_NE(process.err().find(out() + "/logs/" + death.label + ".log"), std::string::npos) << process.err();
  for (const char* history : {"haptic_0", "haptic_1", "device_0", "device_1"}) {
    EXPECT_FALSE(read_table(out() + "/" + history + ".csv").rows.empty()) << "no results of " << history;
  }
}

INSTANTIATE_TEST_SUITE_P(Programs, NamespacedDeaths,
                         ::testing::Values(Death{"world_sim", "world_sim", "world"},
                                           Death{"haptic_sim", "haptic_sim_1", "right"},
                                           Death{"device_sim", "device_sim_0", "left"}),
                         [](const auto& one) { return one.param.program; });

TEST_F(Sessions, MistakesAreNamedWithTheirPlaceAndCure) {
  expect_error(session("haptic_sim 1, device_sim 1", "haptic_sim 1"), "no host runs device_sim 1; add it");
  expect_error(session("device_sim 1", "device_sim 1, device_sim 0"), "device_sim 0 runs 2 times; keep one");
  expect_error(session("device_sim 1", "device_sim"), "device_sim needs the number of its user");
  expect_error(session("world_sim", "world_simm"), "did you mean \"world_sim\"?");
  expect_error(session("programs: [world_sim]", "programs: [world_sim, haptic_sim 2]"), "but 2 users take part");
  expect_error(session("mode: lockstep", "mode: lockstop"), "session.yaml:6:");
  expect_error(session("mode: lockstep", "peers: 10.0.0.9"), "peers is not a flag of a session");
  expect_error(session("    interface: lo\n", ""), "has no interface; add it, or");
  expect_error(session("name: left", "name: left\n    dds: mixed"), "hosts[1].dds: unknown \"mixed\"; choose one of");
  expect_error(session("name: right", "name: left"), "two hosts \"left\"");
  expect_error("three_host", "those are three_hosts, two_hosts");
  const Ended ended = finish(up(session(), out(), {"--host", "middle"}));
  EXPECT_EQ(ended.code, 2);
  EXPECT_NE(ended.err.find("it has world, left, right"), std::string::npos) << ended.err;
  const Ended both = finish(up(session(), out(), {"--host", "left", "--namespaces"}));
  EXPECT_EQ(both.code, 2);
  EXPECT_NE(both.err.find("--host and --namespaces exclude each other"), std::string::npos) << both.err;
  const Ended recorded = finish(up(session(), out(), {"--host", "left", "--record", folder_.path() + "/run.mcap"}));
  EXPECT_EQ(recorded.code, 2);
  EXPECT_NE(recorded.err.find("--host and --record exclude each other"), std::string::npos) << recorded.err;
}

}  // namespace
}  // namespace subworld::test
