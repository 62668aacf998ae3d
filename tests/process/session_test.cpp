#include "process/process_test.hpp"

#include <filesystem>
#include <memory>

namespace subworld::test {
namespace {

namespace fs = std::filesystem;

/// Sessions of three hosts, all of which are this machine.
class Sessions : public ProcessTest {
 protected:
  /// The library's session of three hosts on loopback, with one passage replaced.
  [[nodiscard]] std::string session(const std::string& passage = "", const std::string& by = "") const {
    std::string text = read_text(std::string(SCENES_FOLDER) + "/../sessions/three_hosts.yaml");
    const auto replace = [&](const std::string& from, const std::string& to, bool all) {
      std::size_t at = text.find(from);
      EXPECT_NE(at, std::string::npos) << from;
      for (; at != std::string::npos; at = all ? text.find(from, at + to.size()) : std::string::npos)
        text.replace(at, from.size(), to);
    };
    for (const char* address : {"address: 10.0.0.1", "address: 10.0.0.2", "address: 10.0.0.3"})
      replace(address, "address: 127.0.0.1", true);
    replace("interface: eth0", "interface: lo", true);
    replace("duration: 1}", "duration: 0.2}", false);
    replace("hosts:\n", "domain: " + domain_.text() + "\nhosts:\n", false);
    if (!passage.empty()) replace(passage, by, false);
    return folder_.write("session.yaml", text);
  }
  [[nodiscard]] std::string hash_of_one_host() const {
    EXPECT_EQ(run(scene("lift"), {"--duration", "0.2"}).code, 0);
    return summary()["state_hash"];
  }
  [[nodiscard]] Words up(const std::string& file, const std::string& out, const Words& flags = {}) const {
    Words words{program("subworld"), "up", file, "--out", out};
    words.insert(words.end(), flags.begin(), flags.end());
    return words;
  }
  void expect_error(const std::string& file, const std::string& text) const {
    const Ended ended = finish(up(file, folder_.path() + "/wrong"));
    EXPECT_EQ(ended.code, 2) << ended.err;
    EXPECT_NE(ended.err.find(text), std::string::npos) << ended.err;
  }
};

// In the place of ssh stands a shell on this machine, with a folder of its own for each destination.
TEST_F(Sessions, SshStartsDistantProgramsAndBringsTheirResultsBack) {
  const std::string home = folder_.path() + "/home";
  for (const char* user : {"user@10.0.0.2", "user@10.0.0.3"}) {
    fs::create_directories(fs::path(home) / user / "subworld/build/release");
    fs::create_directory_symlink(PROGRAMS_FOLDER, fs::path(home) / user / "subworld/build/release/bin");
  }
  const std::string ssh = folder_.write("ssh",
                                        "#!/bin/sh\nwhile :; do case $1 in -o) shift 2;; -*) shift;; *) break;; "
                                        "esac; done\ncd " +
                                            home + "/$1 && shift && exec sh -c \"$*\"\n");
  fs::permissions(ssh, fs::perms::owner_all);
  const Ended ended = finish(up(session(), out(), {"--ssh", ssh}));
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  EXPECT_EQ(summary()["verdict"], "ok");
  EXPECT_TRUE(fs::exists(out() + "/haptic_1.csv")) << "the histories come with the results";
  EXPECT_EQ(summary()["state_hash"], hash_of_one_host());
}

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

class NamespacedSessions : public Sessions, public ::testing::WithParamInterface<std::string> {};

TEST_P(NamespacedSessions, OverALinkThatDelaysAndLosesTheHashIsThatOfOneHost) {
  const Ended probe = finish({"/usr/bin/unshare", "--net", "/bin/true"});
  if (probe.code != 0) GTEST_SKIP() << "network namespaces are not permitted here: " << probe.err;
  const Ended ended =
      finish(up(session(), out(), {"--namespaces", "--dds", GetParam(), "--link", "delay 2ms jitter 2ms loss 1%"}));
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  EXPECT_EQ(summary()["verdict"], "ok");
  EXPECT_EQ(summary()["dds"], GetParam());
  EXPECT_EQ(summary()["state_hash"], hash_of_one_host());
}

INSTANTIATE_TEST_SUITE_P(Vendors, NamespacedSessions, ::testing::Values("fastdds", "cyclonedds", "mixed"),
                         [](const auto& one) { return one.param; });

class RealTimeSessions : public Sessions, public ::testing::WithParamInterface<std::string> {
 protected:
  /// Runs the session in real time over a link of 100 ms. False where namespaces are not permitted.
  bool run_over_100_ms(const std::string& more_flags) {
    if (finish({"/usr/bin/unshare", "--net", "/bin/true"}).code != 0) return false;
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
}

TEST_P(RealTimeSessions, ADeadbandSendsAFractionOfTheDevicesSamples) {
  if (!run_over_100_ms(", deadband: 0.1")) GTEST_SKIP() << "network namespaces are not permitted here";
  for (const char* program : {"haptic", "device"}) {
    for (const Json& user : summary()[program]) {
      EXPECT_GT(user["sent_ratio"], 0.05) << program;
      EXPECT_LT(user["sent_ratio"], 0.6) << program;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Vendors, RealTimeSessions, ::testing::Values("fastdds", "cyclonedds"),
                         [](const auto& one) { return one.param; });

TEST_F(Sessions, MistakesAreNamedWithTheirPlaceAndCure) {
  expect_error(session("haptic_sim 1, device_sim 1", "haptic_sim 1"), "no host runs device_sim 1; add it");
  expect_error(session("device_sim 1", "device_sim 1, device_sim 0"), "device_sim 0 runs 2 times; keep one");
  expect_error(session("device_sim 1", "device_sim"), "device_sim needs the number of its user");
  expect_error(session("world_sim", "world_simm"), "did you mean \"world_sim\"?");
  expect_error(session("programs: [world_sim]", "programs: [world_sim, haptic_sim 2]"), "but 2 users take part");
  expect_error(session("mode: lockstep", "mode: lockstop"), "session.yaml:6:");
  expect_error(session("mode: lockstep", "peers: 10.0.0.9"), "peers is not a flag of a session");
  expect_error(session("    interface: lo\n", ""), "has no interface; add it, or");
  expect_error(session("name: right", "name: left"), "two hosts \"left\"");
  expect_error("three_host", "those are three_hosts, two_hosts");
  const Ended ended = finish(up(session(), out(), {"--host", "middle"}));
  EXPECT_EQ(ended.code, 2);
  EXPECT_NE(ended.err.find("it has world, left, right"), std::string::npos) << ended.err;
}

}  // namespace
}  // namespace subworld::test
