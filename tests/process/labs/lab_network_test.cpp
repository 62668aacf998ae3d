#include "process/labs/lab_test.hpp"

#include <filesystem>
#include <regex>
#include <set>

namespace subworld::test {
namespace {

class NetworkLab : public LabTest {
 protected:
  NetworkLab() : LabTest("network") {}
  [[nodiscard]] Ended measured(Words words, const Environment& environment = {}) const {
    words.insert(words.end(), {"--domain", domain_.text(), "--out", out()});
    return finish(lab_words(words), environment);
  }
  [[nodiscard]] Json felt() const { return Json::parse(read_text(out() + "/felt.json"), nullptr, false); }
};

bool not_permitted(const Ended& ended) {
  return ended.out.find("Operation not permitted") != std::string::npos ||
         ended.out.find("/dev/net/tun") != std::string::npos;
}

/// With these settings no participant of this vendor starts.
const Environment kNoCyclone{{"CYCLONEDDS_URI", "file:///nonexistent.xml"}};

Words operator+(Words words, const Words& more) {
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

TEST_F(NetworkLab, MeasuresEveryVendorPairOnLoopback) {
  const Ended ended = measured({"--transport", "loopback", "--reliability", "reliable", "--rate", "200", "--payload",
                                "1000", "--users", "2", "--duration", "0.6", "--require", "received>100"});
  ASSERT_EQ(ended.code, 0) << ended.err << ended.out;
  std::set<std::string> pairs;
  for (const Json& row : results()) {
    pairs.insert(row["world_dds"].get<std::string>() + row["haptic_dds"].get<std::string>());
    EXPECT_LE(row["sent"], 2 * 120) << "0.6 s to two users; the start-up does not count";
    EXPECT_EQ(row["round_trip_s"]["n"], row["received"]);
    EXPECT_GE(row["round_trip_s"]["p50"], row["to_user_s"]["p50"]) << "the way back takes time too";
    EXPECT_TRUE(row["round_trip_s"]["p99"].is_null()) << "too few samples for it";
    EXPECT_GT(row["world_cpu_ratio"], 0.0);
    EXPECT_NE(row["qos"].get<std::string>().find("reliable volatile keep_last 8"), std::string::npos);
    EXPECT_TRUE(row["measured_delay_s"].is_null()) << "loopback has no emulated link";
  }
  EXPECT_EQ(pairs.size(), 4U);
  const std::string sentence = summary()["sentences"][0];
  EXPECT_NE(sentence.find("carries 200 Hz x 1000 bytes for 2 users with each of 4 vendor pairs"), std::string::npos);
  EXPECT_NE(ended.out.find(sentence), std::string::npos) << ended.out;
  EXPECT_NE(page().find(sentence), std::string::npos);
  EXPECT_NE(page().find("start-up is excluded"), std::string::npos);
  expect_same_page_again();
  expect_columns({"world_dds", "haptic_dds", "transport", "reliability", "rate_hz", "payload_bytes", "users", "delay_s",
                  "jitter_s", "loss_ratio", "round_trip_s_p99_99", "round_trip_s_n", "lost", "deadline_missed"});
}

TEST_F(NetworkLab, ALinkDelaysAndLosesAsRequested) {
  const Ended ended =
      measured({"--world-dds", "fastdds", "--haptic-dds", "cyclonedds", "--reliability", "best_effort", "--rate", "500",
                "--link", "delay 10ms loss 20%", "--duration", "1", "--require", "lost_ratio<0.01"});
  if (not_permitted(ended)) GTEST_SKIP() << "network namespaces are not permitted here: " << ended.err;
  ASSERT_EQ(ended.code, 4) << ended.err << ended.out;
  const Json row = results()[0];
  EXPECT_GE(row["to_user_s"]["p50"], 0.0099);
  EXPECT_GE(row["round_trip_s"]["p50"], 0.0198);
  EXPECT_GE(row["measured_delay_s"], 0.0099);
  EXPECT_NEAR(row["lost_ratio"], 0.2, 0.1) << "5 standard deviations";
  EXPECT_NEAR(row["measured_loss_ratio"], 0.2, 0.1);
  EXPECT_GE(row["lost_burst"], 1);
  const std::string missed = summary()["missed"][0];
  EXPECT_NE(missed.find("lost_ratio<0.01: it is 0."), std::string::npos) << missed;
  EXPECT_NE(ended.out.find(missed), std::string::npos) << ended.out;
}

// A datagram of 60,000 bytes is 41 packets, of which one is lost in a third of all cases.
TEST_F(NetworkLab, ALossCostsALongMessageOnePacket) {
  const Ended ended = measured({"--reliability", "reliable", "--rate", "60", "--payload", "60000", "--link", "loss 1%",
                                "--duration", "2", "--baseline", "off", "--require", "lost_ratio<0.1"});
  if (not_permitted(ended)) GTEST_SKIP() << "network namespaces are not permitted here: " << ended.err;
  EXPECT_EQ(ended.code, 0) << ended.err << ended.out;
  EXPECT_EQ(results().size(), 4U);
}

TEST_F(NetworkLab, AnInterruptedRunGoesOn) {
  const Words words{"--transport",  "loopback", "--reliability", "reliable", "--rate",    "200",
                    "--haptic-dds", "fastdds",  "--duration",    "0.3",      "--baseline"};
  ASSERT_EQ(measured(words + Words{"off", "--world-dds", "fastdds"}).code, 0);
  const Json first = results();
  ASSERT_EQ(first.size(), 1U);
  EXPECT_TRUE(first[0]["baseline_round_trip_s"]["max"].is_null());
  const Ended ended = measured(words + Words{"udp", "--resume"});
  ASSERT_EQ(ended.code, 0) << ended.err;
  ASSERT_EQ(results().size(), 2U);
  EXPECT_EQ(results()[0], first[0]) << "it is not measured again";
  EXPECT_EQ(results()[1]["world_dds"], "cyclonedds");
  EXPECT_EQ(results()[1]["baseline_lost_ratio"], 0.0);
  EXPECT_GT(results()[1]["baseline_round_trip_s"]["n"], 0);
}

TEST_F(NetworkLab, AgreesWithDdsperf) {
  const Ended ended =
      measured({"--world-dds", "cyclonedds", "--haptic-dds", "cyclonedds", "--reliability", "reliable", "--rate", "20",
                "--link", "delay 10ms", "--duration", "2", "--baseline", "udp,ddsperf"});
  if (not_permitted(ended)) GTEST_SKIP() << "network namespaces are not permitted here: " << ended.err;
  ASSERT_EQ(ended.code, 0) << ended.err << ended.out;
  const Json row = results()[0];
  const double lab_s = row["round_trip_s"]["p50"], ddsperf_s = row["ddsperf_round_trip_s"]["p50"];
  EXPECT_NEAR(lab_s / ddsperf_s, 1.0, 0.2);
  EXPECT_NEAR(lab_s / row["baseline_round_trip_s"]["p50"].get<double>(), 1.0, 0.2);
  EXPECT_NE(page().find("ddsperf p50 ms"), std::string::npos);
}

TEST_F(NetworkLab, APeerThatDoesNotStartFailsItsCellAlone) {
  const Words words{"--transport", "loopback",     "--reliability", "reliable",          "--rate",
                    "200",         "--haptic-dds", "fastdds",       "--duration",        "0.2",
                    "--baseline",  "off",          "--world-dds",   "cyclonedds,fastdds"};
  const Ended broken = measured(words, kNoCyclone);
  EXPECT_EQ(broken.code, 1) << broken.err << broken.out;
  ASSERT_EQ(results().size(), 2U);
  const std::string failure = results()[0]["failure"];
  EXPECT_NE(failure.find("/nonexistent.xml"), std::string::npos) << failure;
  EXPECT_GT(results()[1]["received"], 0) << "the lab goes on";
  EXPECT_NE(broken.out.find("1 of 2 cells could not be measured; the first: " + failure), std::string::npos)
      << broken.out;
  EXPECT_EQ(summary()["failed"], 1);

  const Json second = results()[1];
  const Ended ended = measured(words + Words{"--resume"});
  ASSERT_EQ(ended.code, 0) << ended.err << ended.out;
  ASSERT_EQ(results().size(), 2U);
  EXPECT_EQ(results()[0], second) << "it is not measured again";
  EXPECT_EQ(results()[1]["world_dds"], "cyclonedds");
  EXPECT_GT(results()[1]["received"], 0);
}

TEST_F(NetworkLab, ALinkThatIsNotPermittedFailsItsCellAlone) {
  const Words without_rights{"/usr/bin/setpriv", "--bounding-set", "-sys_admin,-net_admin"};
  if (finish(without_rights + Words{"/bin/true"}).code != 0) GTEST_SKIP() << "rights cannot be dropped here";
  const Ended ended =
      finish(without_rights + lab_words({"--transport",  "udp,loopback", "--reliability", "reliable",    "--rate",
                                         "200",          "--haptic-dds", "fastdds",       "--world-dds", "fastdds",
                                         "--link",       "lan",          "--duration",    "0.2",         "--require",
                                         "lost_ratio<1", "--domain",     domain_.text(),  "--out",       out()}));
  EXPECT_EQ(ended.code, 1) << "a fault, and no missed criterion" << ended.err << ended.out;
  ASSERT_EQ(results().size(), 2U);
  EXPECT_NE(results()[0]["failure"].get<std::string>().find("unshare -rn"), std::string::npos) << "the cure";
  EXPECT_FALSE(results()[0]["baseline_failure"].get<std::string>().empty());
  EXPECT_GT(results()[1]["received"], 0) << "the lab goes on";
  EXPECT_NE(page().find("unshare -rn"), std::string::npos);
}

// A busy machine delays the programs, so no error is held.
TEST_F(NetworkLab, WhatUsersFeelIsMeasuredWithTheRealProgramsAndGoesOn) {
  if (finish({"/usr/bin/unshare", "--net", "/bin/true"}).code != 0)
    GTEST_SKIP() << "network namespaces are not permitted here";
  const Words words{"--scene",     "row",     "--scene-duration", "0.6",
                    "--messages",  "off",     "--link",           "delay 1ms loss 0.1%",
                    "--world-dds", "fastdds", "--require",        "force_error_max<1e-6"};
  const Ended broken = measured(words, kNoCyclone);
  EXPECT_EQ(broken.code, 1) << broken.err << broken.out;
  ASSERT_EQ(felt().size(), 2U) << "a row for each vendor pair and user";
  EXPECT_NE(felt()[1]["failure"].get<std::string>().find("/nonexistent.xml"), std::string::npos) << felt()[1];
  EXPECT_TRUE(felt()[1]["force_error_rms"].is_null());
  EXPECT_NE(broken.out.find("undecided over delay 1ms loss 0.1% (not measured with fastdds > cyclonedds)"),
            std::string::npos)
      << broken.out;

  const Json first = felt()[0];
  const Ended ended = measured(words + Words{"--resume"});
  EXPECT_EQ(ended.code, 4) << ended.err << ended.out;
  ASSERT_EQ(felt().size(), 2U);
  EXPECT_EQ(felt()[0], first) << "it is not measured again";
  for (const Json& row : felt()) {
    EXPECT_EQ(row["failure"], "");
    EXPECT_EQ(row["user"], 0);
    for (const char* column : {"force_error_rms", "force_error_p99", "time_offset_s", "value_offset", "created_j",
                               "energy_excess_j", "missed_deadlines", "lost_frames", "reference_error"})
      EXPECT_TRUE(row[column].is_number()) << column << " " << row;
    EXPECT_GT(row["force_error_max"], 0.0) << "real time does not repeat the reference bit by bit";
  }
  const std::string user = felt()[0]["user_name"];
  EXPECT_NE(ended.out.find("MISSED: user " + user + ": force_error_max<1e-6: it is "), std::string::npos) << ended.out;
  const std::string sentence = summary()["felt"];
  EXPECT_TRUE(
      sentence.starts_with("scene row: the felt force is within the imperceptible bar (RMS 3.5 %, p99 7 %) over"))
      << sentence;
  EXPECT_NE(ended.out.find(sentence), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("\nresults: " + out() + "/felt.csv\n"), std::string::npos) << ended.out;
  EXPECT_FALSE(std::filesystem::exists(out() + "/results.csv")) << "no messages were measured";
  EXPECT_NE(page().find("What users feel"), std::string::npos);
  expect_same_page_again();
  EXPECT_NE(page().find(sentence.substr(0, sentence.find('('))), std::string::npos);
  EXPECT_NE(read_text(out() + "/felt.csv").find("scene,world_dds,haptic_dds,link,"), std::string::npos);
}

TEST_F(NetworkLab, MeasurementsSurviveAnInterrupt) {
  expect_kept_after_interrupt({"--transport", "loopback", "--rate", "100", "--duration", "0.2", "--require",
                               "duration_s<1", "--domain", domain_.text()},
                              "[  1/", 1, 8);
  const std::string verdict = summary()["verdict"];
  EXPECT_EQ(verdict.find("all cells pass"), std::string::npos) << verdict;
  EXPECT_TRUE(std::regex_search(verdict, std::regex("the (measured cell passes|[2-8] measured cells pass)")))
      << verdict;
}

TEST_F(NetworkLab, AnInterruptBeforeTheFirstCellLeavesNoTable) {
  Process lab(lab_words({"--transport", "loopback", "--duration", "100", "--require", "received>0", "--domain",
                         domain_.text(), "--out", out()}),
              folder_.path());
  ASSERT_TRUE(eventually([&] { return lab.out().find("results in ") != std::string::npos; })) << lab.err();
  lab.signal(SIGINT);
  EXPECT_EQ(lab.wait(), 0) << lab.err();
  EXPECT_NE(lab.out().find("stopped by SIGINT: no cell was measured; stopped after 0 of 8 points\nresults: " + out() +
                           "/summary.json\n"),
            std::string::npos)
      << lab.out();
  EXPECT_FALSE(std::filesystem::exists(out() + "/results.csv"));
  EXPECT_TRUE(std::filesystem::exists(out() + "/report.html"));
}

TEST_F(NetworkLab, WrongOptionsAreNamedWithTheCure) {
  expect_refused({{{"--rate", "0"}, {"--rate", "0"}},
                  {{"--payload", "8"}, {"--payload", "32"}},
                  {{"--haptic-dds", "cyclone"}, {"cyclone", "cyclonedds"}},
                  {{"--link", "wifo"}, {"wifo", "did you mean wifi"}},
                  {{"--require", "p99<1"}, {"p99", "round_trip_s_p99"}},
                  {{"--require", "force_error_rms<1"}, {"no column force_error_rms"}},
                  {{"--scene", "rows"}, {"rows", "row"}},
                  {{"--messages", "off"}, {"--scene"}},
                  {{"--require", "lost_ratio"}, {"COLUMN<NUMBER"}}});
}

TEST_F(NetworkLab, HelpsWithExamples) {
  const Ended ended = finish(lab_words({"--help"}));
  EXPECT_EQ(ended.code, 0);
  EXPECT_NE(ended.out.find("\n  subworld lab network --link wifi"), std::string::npos) << ended.out;
}

}  // namespace
}  // namespace subworld::test
