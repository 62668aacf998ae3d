#include "process/labs/lab_test.hpp"

namespace subworld::test {
namespace {

class EngineLab : public LabTest {
 protected:
  EngineLab() : LabTest("engines") {}
};

const std::vector<std::string> kEngineColumns{"scene",
                                              "engine",
                                              "preset",
                                              "friction",
                                              "restitution",
                                              "dt_s",
                                              "duration_s",
                                              "held",
                                              "max_displacement_m",
                                              "kinetic_energy_j",
                                              "penetration_max_m",
                                              "fell_at_s",
                                              "failure",
                                              "cpu_s_per_simulated_s",
                                              "kinetic_energy_max_j"};

TEST_F(EngineLab, ASweepLeavesTablesHistoriesAndOnePage) {
  const Ended ended = finish(lab_words({"row", "--quick", "--engine", "bullet", "--preset", "fast,quality",
                                        "--friction", "0.5,0", "--dt", "1/60,0.01", "--states", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("[  8/8] row"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("For stiff structures: bullet"), std::string::npos) << ended.out;

  const Json rows = results();
  ASSERT_EQ(rows.size(), 8U);
  std::set<std::string> points;
  for (const Json& row : rows) {
    for (const std::string& column : kEngineColumns) EXPECT_TRUE(row.contains(column)) << column;
    for (const char* q : {"p50", "p99", "p99_9", "max", "mean"}) EXPECT_GT(row.at("step_s").at(q), 0.0) << q;
    EXPECT_EQ(row["restitution"], 0.4);
    EXPECT_EQ(row["duration_s"], 1.0);
    EXPECT_EQ(row["held"], true) << "a row of cubes on the floor stays where it is";
    EXPECT_EQ(row["fell_at_s"], nullptr);
    EXPECT_LT(row["max_displacement_m"], 0.05);
    points.insert(row["preset"].dump() + row["friction"].dump() + row["dt_s"].dump());
  }
  EXPECT_EQ(points.size(), 8U);
  expect_columns(kEngineColumns);
  expect_columns({"step_s_p99_9", "step_s_mean"});

  EXPECT_EQ(summary()["engines"][0]["engine"], "bullet");
  EXPECT_EQ(summary()["scenes"][0]["kind"], "structure");
  const Table history = read_table(out() + "/histories/row_bullet_fast_f0.5_e0.4_dt1-60.csv");
  EXPECT_EQ(history.rows.size(), 60U);
  EXPECT_NEAR(history.rows.back()[history.column("t_s")], 1.0, 1e-9);
  for (const char* column :
       {"kinetic_energy_j", "potential_energy_j", "step_s", "max_displacement_m", "penetration_max_m", "contacts"})
    (void)history.column(column);
  const Table states = read_table(out() + "/states/row_bullet_quality_f0_e0.4_dt1-100.csv");
  EXPECT_EQ(states.rows.size(), 100U * 10U);
  EXPECT_NE(page().find("Havok, paper"), std::string::npos);
  expect_same_page_again();
}

TEST_F(EngineLab, ATowerThatFallsIsNotHeld) {
  const Ended ended = finish(lab_words({"card_house", "--engine", "bullet", "--preset", "quality", "--friction", "0",
                                        "--dt", "1/60", "--duration", "0.6", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json row = results()[0];
  EXPECT_EQ(row["held"], false) << "a card house stands by friction alone";
  EXPECT_GT(row["fell_at_s"], 0.0);
  EXPECT_LT(row["fell_at_s"], 0.6);
  EXPECT_EQ(row["failure"], "");
}

TEST_F(EngineLab, WrongOptionsAreNamedWithTheCure) {
  expect_refused({{{"row", "--engine", "havoc"}, {"havoc", "bullet"}},
                  {{"row", "--preset", "fastest"}, {"fastest", "fast", "quality"}},
                  {{"row", "--dt", "1/0"}, {"--dt 1/0", "1/60"}},
                  {{"row", "--dt", "quick"}, {"--dt quick", "1/60"}},
                  {{"row", "--dt", "0.5"}, {"--dt 0.5", "0.1"}},
                  {{"row", "--friction", "0.5,-1"}, {"--friction", "-1"}},
                  {{"row", "--restitution", "1.5"}, {"--restitution", "1.5"}},
                  {{"row", "--duration", "nan"}, {"--duration", "nan"}},
                  {{"no_such_scene"}, {"no_such_scene"}},
                  {{"row", "--colour", "red"}, {"--colour", "--help"}}});
}

TEST_F(EngineLab, HelpsWithExamplesAndSaysWhatHeldMeans) {
  const Ended ended = finish(lab_words({"--help"}));
  EXPECT_EQ(ended.code, 0);
  EXPECT_NE(ended.out.find("\n  subworld lab engines --quick"), std::string::npos) << ended.out;
  EXPECT_NE(ended.out.find("has held when"), std::string::npos);
}

TEST_F(EngineLab, MeasurementsSurviveAnInterrupt) {
  expect_kept_after_interrupt({"stack", "--engine", "bullet", "--preset", "quality", "--dt", "1/60,1/100,1/120,1/250",
                               "--duration", "5", "--friction", "0.1,0.2,0.3,0.4,0.5,0.6"},
                              "[  1/24]", 1, 24);
}

}  // namespace
}  // namespace subworld::test
