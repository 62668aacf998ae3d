#include "process/labs/lab_test.hpp"

#include <algorithm>
#include <map>

namespace subworld::test {
namespace {

class LatencyLab : public LabTest {
 protected:
  LatencyLab() : LabTest("latency") {}
};

/// A scene in which a delay is felt soon, at a ratio at which the scheme `paper` needs few bodies.
const Words kFeltSoon{"row", "--quick", "--scheme", "paper", "--largest", "0.1"};

// The searches before the first run over a link take minutes.
TEST_F(LatencyLab, ALinkThatIsNotPermittedIsAnErrorAtTheStart) {
  const Words without_rights{"/usr/bin/setpriv", "--bounding-set", "-sys_admin,-net_admin"};
  Words nothing = without_rights;
  nothing.emplace_back("/bin/true");
  if (finish(nothing).code != 0) GTEST_SKIP() << "rights cannot be dropped here";
  Words words = lab_words(kFeltSoon);
  words.insert(words.begin(), without_rights.begin(), without_rights.end());
  words.insert(words.end(), {"--link", "--out", out()});
  const Ended ended = finish(words);
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("unshare -rn"), std::string::npos) << ended.err;
  EXPECT_EQ(ended.out, "") << "nothing was searched";
}

TEST_F(LatencyLab, EndsWithTheLargestDelayThatIsNotFelt) {
  Words words = kFeltSoon;
  words.insert(words.end(), {"--device-latency", "--out", out()});
  const Ended ended = finish(lab_words(words));
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json rows = results();
  std::map<std::string, double> limits, least_felt;
  for (const Json& row : rows) {
    const std::string link = row["link"];
    if (row["kind"] == "limit") {
      limits[link] = row["limit_s"];
      EXPECT_EQ(row["delay_s"] > row["limit_s"], true) << row.dump();
    } else if (!row["exceeded"].is_null()) {
      const double delay_s = row["delay_s"];
      least_felt[link] = least_felt.contains(link) ? std::min(least_felt[link], delay_s) : delay_s;
    }
  }
  ASSERT_EQ(limits.size(), 2U);
  for (const auto& [link, limit_s] : limits) {
    EXPECT_LT(limit_s, least_felt[link]) << link;
    for (const Json& row : rows) {
      if (row["kind"] == "point" && row["link"] == link && row["delay_s"] <= limit_s) {
        EXPECT_LE(row["force_error_rms"], 0.035);
        EXPECT_LE(row["force_error_p99"], 0.07);
      }
    }
  }
  EXPECT_LE(limits["device"], 0.005) << "the bound on the time offset";
  for (const Json& answer : summary()["answers"]) {
    const std::string text = answer["sentence"];
    EXPECT_EQ(answer["finished"], true);
    EXPECT_NE(text.find("row: 1 user: "), std::string::npos) << text;
    EXPECT_NE(ended.out.find(text), std::string::npos) << ended.out;
    EXPECT_NE(page().find(text), std::string::npos);
  }
  expect_columns({"kind", "scene", "link", "ratio", "user_name", "delay_s", "force_error_rms", "force_error_p99",
                  "time_offset_s", "created_j", "oscillation_n", "stiffness_ratio", "exceeded", "limit_s", "undecided",
                  "reference_error"});
  expect_same_page_again();
}

TEST_F(LatencyLab, TwoSeedsAgree) {
  std::vector<double> limits;
  for (const char* seed : {"1", "2"}) {
    const Ended ended = finish(
        lab_words({"lift", "--ratio", "10", "--duration", "1.6", "--largest", "0.3", "--seed", seed, "--out", out()}));
    ASSERT_EQ(ended.code, 0) << ended.err;
    for (const Json& row : results()) {
      if (row["kind"] == "limit" && row["user"] == 0) limits.push_back(row["limit_s"]);
      if (row["kind"] == "point" && row["exceeded"].is_null() && row["force_error_p99"] > 0.035) {
        EXPECT_EQ(row["starts"], 4) << "near a bound, the paths begin at several instants of a cycle";
      }
    }
  }
  ASSERT_EQ(limits.size(), 2U);
  EXPECT_GT(limits[0], 0.0);
  EXPECT_NEAR(limits[1], limits[0], 0.2 * limits[0]);
}

TEST_F(LatencyLab, BoundsBelowTheReferenceErrorDecideNothing) {
  const Ended ended = finish(lab_words({"row", "--quick", "--rms", "1e-6", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("row: 1 user: cannot be decided: the reference error is larger than the bound"),
            std::string::npos)
      << ended.out;
}

TEST_F(LatencyLab, MeasurementsSurviveAnInterrupt) {
  expect_kept_after_interrupt({"carry", "row", "lift"}, "[  2/", 1, 3);
  EXPECT_NE(summary()["verdict"].get<std::string>().find("stopped before the limit was found"), std::string::npos);
}

TEST_F(LatencyLab, WrongOptionsAreNamedWithTheCure) {
  expect_refused({{{"row", "--largest", "50"}, {"--largest", "did you mean 0.05"}},
                  {{"row", "--rms", "-1"}, {"--rms", "-1"}},
                  {{"row", "--scheme", "papers"}, {"papers", "reduced"}},
                  {{"no_such_scene"}, {"no_such_scene"}}});
}

TEST_F(LatencyLab, HelpsWithExamples) {
  const Ended ended = finish(lab_words({"--help"}));
  EXPECT_EQ(ended.code, 0);
  EXPECT_NE(ended.out.find("\n  subworld lab latency row"), std::string::npos) << ended.out;
}

}  // namespace
}  // namespace subworld::test
