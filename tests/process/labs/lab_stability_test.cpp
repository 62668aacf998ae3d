#include "process/labs/lab_test.hpp"

namespace subworld::test {
namespace {

class StabilityLab : public LabTest {
 protected:
  StabilityLab() : LabTest("stability") {}
};

const std::vector<std::string> kStabilityColumns{"case",
                                                 "engine",
                                                 "preset",
                                                 "step_s",
                                                 "parameter",
                                                 "value",
                                                 "measured",
                                                 "expected",
                                                 "error",
                                                 "tolerance",
                                                 "pass",
                                                 "source",
                                                 "error_over_tolerance",
                                                 "held_at",
                                                 "failed_at",
                                                 "failure"};

// Cases that bullet passes at 1 ms with a wide margin, one for each kind: a value, a limit with a formula, a required
// limit.
TEST_F(StabilityLab, BulletHoldsTheFormulasAtOneMillisecond) {
  const Ended ended = finish(
      lab_words({"slide_stop", "slip_angle", "throw_place_ball", "bounce", "rest_depth", "smallest_cube", "--quick",
                 "--engine", "bullet", "--preset", "fast,quality", "--dt", "1/1000", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("[  12/12]"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("bullet fast: 6 of 6 rows pass."), std::string::npos) << ended.out;
  const Json rows = results();
  ASSERT_EQ(rows.size(), 12U);
  for (const Json& row : rows) {
    SCOPED_TRACE(row.dump());
    for (const std::string& column : kStabilityColumns) EXPECT_TRUE(row.contains(column)) << column;
    EXPECT_EQ(row["pass"], true);
    EXPECT_LE(row["error"], row["tolerance"]);
    EXPECT_NE(row["source"], "");
    EXPECT_EQ(row["failure"], "");
    EXPECT_EQ(row["step_s"], 0.001);
    if (row["case"] == "slip_angle") {
      EXPECT_NEAR(row["expected"], 26.565, 0.001) << "atan(0.5)";
      EXPECT_LT(row["held_at"], row["failed_at"]);
      EXPECT_GE(row["measured"], row["held_at"]);
      EXPECT_LE(row["measured"], row["failed_at"]);
      EXPECT_LT(row["failed_at"].get<double>() / row["held_at"].get<double>(), 1.005);
    }
    if (row["case"] == "slide_stop") {
      EXPECT_NEAR(row["measured"], 0.1019, 0.002);
    }
  }
  expect_columns(kStabilityColumns);
  EXPECT_EQ(summary()["settings"].size(), 2U);
  const std::string text = page();
  for (const char* part : {"atan(mu)", "Coulomb", "error over tolerance", "Source:", "1/1000 s", "slip_angle, 0.5"})
    EXPECT_NE(text.find(part), std::string::npos) << part;
  expect_same_page_again();
}

// A missed tolerance is a result: it is shown with a better engine, and does not change the exit code.
TEST_F(StabilityLab, AMissedToleranceIsAFailedRow) {
  const Ended ended =
      finish(lab_words({"tunnel_speed", "--engine", "ode", "--preset", "fast", "--dt", "1/1000,1/60", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json rows = results();
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0]["pass"], true);
  EXPECT_EQ(rows[1]["pass"], false) << "a ball of 5 mm flies 80 mm in 1/60 s, and ode does not look ahead";
  EXPECT_GT(rows[1]["error_over_tolerance"], 2.0);
  EXPECT_LT(rows[1]["measured"], rows[0]["measured"]);
  EXPECT_NE(ended.out.find("The largest misses: tunnel_speed at 1/60 s"), std::string::npos) << ended.out;
  EXPECT_EQ(summary()["verdict"], "2 measurements: 1 pass, 1 miss their tolerance, 0 of these could not be measured");
}

// Three scenes of a seed that hold in bullet: counts, rows, page, and no measurement of a case.
TEST_F(StabilityLab, RandomScenesAreRunAloneAndCounted) {
  const Ended ended = finish(lab_words(
      {"--random", "3", "--seed", "1", "--engine", "bullet", "--preset", "fast", "--strict", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  EXPECT_NE(ended.out.find("3 runs of random scenes: 3 held, 0 failed"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("\nresults: " + out() + "/random.csv\n"), std::string::npos) << ended.out;
  EXPECT_FALSE(std::filesystem::exists(out() + "/results.csv"));
  const Json random = summary()["random"];
  EXPECT_EQ(random["seed"], 1);
  EXPECT_EQ(random["settings"][0]["scenes"], 3);
  EXPECT_TRUE(random["failures"].empty());
  EXPECT_NE(read_text(out() + "/report.html").find("Random scenes"), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(out() + "/random.csv"));
}

TEST_F(StabilityLab, OneRandomSceneIsRepeatedWithItsDetails) {
  const Ended ended = finish(lab_words(
      {"--random", "--seed", "1", "--scene-index", "2", "--engine", "bullet", "--preset", "fast", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  EXPECT_NE(ended.out.find("bullet fast, scene 2 of seed 1: holds"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("put_in_j"), std::string::npos);
}

TEST_F(StabilityLab, WrongOptionsAreNamedWithTheCure) {
  expect_refused({{{"slip_angel"}, {"slip_angel", "did you mean \"slip_angle\"", "sliding:"}},
                  {{"slip_angle", "--engine", "bulet"}, {"bulet", "bullet"}},
                  {{"slip_angle", "--preset", "fastest"}, {"fastest", "fast", "quality"}},
                  {{"slip_angle", "--dt", "1/0"}, {"--dt 1/0", "1/60"}},
                  {{"--random", "0"}, {"--random", "1"}},
                  {{"--seed", "2"}, {"--seed", "--random"}},
                  {{"slip_angle", "--colour", "red"}, {"--colour", "--help"}}});
}

TEST_F(StabilityLab, HelpListsTheCasesAndHasExamples) {
  const Ended ended = finish(lab_words({"--help"}));
  EXPECT_EQ(ended.code, 0);
  for (const char* part : {"\n  subworld lab stability --quick", "sliding: slide_stop, ", "tunnel_speed"})
    EXPECT_NE(ended.out.find(part), std::string::npos) << ended.out;
}

TEST_F(StabilityLab, MeasurementsSurviveAnInterrupt) {
  expect_kept_after_interrupt({"slide_stop", "stack", "--engine", "bullet", "--preset", "quality", "--dt", "1/1000"},
                              "[   1/7]", 1, 7);
}

}  // namespace
}  // namespace subworld::test
