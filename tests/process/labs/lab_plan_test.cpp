#include "process/labs/lab_test.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>

namespace subworld::test {
namespace {

class PlanLab : public LabTest {
 protected:
  PlanLab() : LabTest("plan") {}
};

const std::vector<std::string> kPlanColumns{"scene",
                                            "item",
                                            "enabled",
                                            "reason",
                                            "world_cpu_ratio",
                                            "haptic_cpu_ratio",
                                            "bytes_ratio",
                                            "memory_ratio",
                                            "start_ratio",
                                            "hash_equal",
                                            "force_difference_rms",
                                            "reference_error",
                                            "position_difference_max_m",
                                            "reference_position_error_m",
                                            "position_error_enabled_m",
                                            "position_error_disabled_m",
                                            "held"};

TEST_F(PlanLab, EveryItemIsTheSameOrNoWorse) {
  const Ended ended = finish(lab_words({"press", "scatter", "--duration", "0.5", "--repeat", "1", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json rows = results();
  ASSERT_FALSE(rows.empty());
  for (const Json& row : rows) {
    SCOPED_TRACE(row.dump());
    for (const std::string& column : kPlanColumns) EXPECT_TRUE(row.contains(column)) << column;
    EXPECT_EQ(row["held"], true);
    EXPECT_NE(row["reason"], "");
    if (row["enabled"] == false) {
      EXPECT_TRUE(row["world_cpu_ratio"].is_null());
    } else {
      EXPECT_GT(row["world_cpu_ratio"], 0.0);
      EXPECT_LE(row["bytes_ratio"], 1.0) << "skipped data are not sent";
    }
    // Most of its cubes are always at rest.
    if (row["scene"] == "scatter" && row["item"] == "rest") {
      EXPECT_LT(row["world_cpu_ratio"], 0.8);
    }
    if (row["item"] == "impulses" || row["item"] == "friction") {
      EXPECT_EQ(row["hash_equal"], true);
    }
  }
  expect_columns(kPlanColumns);
  EXPECT_GT(summary()["items"].size(), 3U);
  EXPECT_NE(page().find("The plan"), std::string::npos);
  expect_same_page_again();
}

TEST_F(PlanLab, RandomScenesServeToo) {
  const Ended ended =
      finish(lab_words({"--random", "2", "--seed", "5", "--item", "all", "--repeat", "1", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  ASSERT_EQ(results().size(), 2U);
  EXPECT_EQ(results()[1]["scene"], "random_5_1");
}

TEST_F(PlanLab, RefusesWhatItDoesNotKnow) {
  expect_refused({{{"press", "--item", "rst"}, {"rst", "did you mean rest"}},
                  {{"presse"}, {"presse", "press"}},
                  {{"press", "--repeat", "0"}, {"--repeat"}}});
}

TEST_F(PlanLab, ATableOfSomeoneElseIsNotReplaced) {
  std::filesystem::create_directories(out());
  const std::string table = out() + "/results.json", theirs = "[{\"scene\": \"mine\"}]";
  std::ofstream(table) << theirs;
  expect_refused({{{"press", "--item", "rest"}, {"results.json, which Subworld has not made"}}});
  EXPECT_EQ(read_text(table), theirs);
  std::filesystem::remove(table);
  for (int time = 0; time < 2; ++time) {
    const Ended ended = finish(lab_words({"press", "--item", "rest", "--repeat", "2", "--out", out()}));
    EXPECT_EQ(ended.code, 0) << ended.err;
  }
}

TEST_F(PlanLab, AnInterruptKeepsWhatWasMeasured) {
  expect_kept_after_interrupt({"press", "row", "--item", "rest,all", "--repeat", "2"}, "[  1/4]", 1, 4);
}

}  // namespace
}  // namespace subworld::test
