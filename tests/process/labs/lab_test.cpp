#include "process/labs/lab_test.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>

namespace subworld::test {
namespace {

class Lab : public LabTest {
 protected:
  Lab() : LabTest("coupling") {}
};

const std::vector<std::string> kFlatColumns{"scene",
                                            "variant",
                                            "scheme",
                                            "engine",
                                            "haptic_engine",
                                            "ratio",
                                            "box_m",
                                            "world_substeps",
                                            "oracle",
                                            "latency_s",
                                            "jitter_s",
                                            "device_latency_s",
                                            "loss_ratio",
                                            "deadband",
                                            "device_sent_ratio",
                                            "passivity",
                                            "coupling_stiffness_n_m",
                                            "survived",
                                            "force_error_rms",
                                            "force_error_p99",
                                            "force_error_max",
                                            "time_offset_s",
                                            "value_offset",
                                            "jitter_ratio",
                                            "smoothed_force_error_rms",
                                            "torque_error_rms",
                                            "position_error_rms_m",
                                            "drift_max_m",
                                            "operator_force_error_rms",
                                            "operator_time_offset_s",
                                            "created_j",
                                            "created_ratio",
                                            "momentum_error_ratio",
                                            "copies_rms_m",
                                            "energy_excess_j",
                                            "reference_energy_excess_j",
                                            "device_work_j",
                                            "reference_error",
                                            "at_reference_error",
                                            "causal_error",
                                            "at_bound",
                                            "members_mean",
                                            "ghosts_mean",
                                            "border_pairs_mean",
                                            "world_cpu_s_per_s",
                                            "haptic_cpu_s_per_s",
                                            "synchronise_cpu_s_per_s",
                                            "transport_cpu_s_per_s"};

TEST_F(Lab, ASweepLeavesTablesTracesAndOnePage) {
  const std::string old_trace = out() + "/traces/of_an_earlier_sweep.csv";
  std::filesystem::create_directories(out() + "/traces");
  std::ofstream(old_trace) << "time_s,force_x_n\n";
  const Ended ended =
      finish(lab_words({"press", "--quick", "--scheme", "direct,paper", "--latency", "0,0.01,0", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("[  8/8] press"), std::string::npos) << "the same point is measured once: " << ended.out;

  const Json rows = results();
  ASSERT_EQ(rows.size(), 8U);
  std::set<std::string> points;
  for (const Json& row : rows) {
    for (const std::string& column : kFlatColumns) EXPECT_TRUE(row.contains(column)) << column;
    for (const char* part : {"world_step_s", "haptic_step_s", "synchronise_step_s"}) {
      for (const char* q : {"p50", "p99", "p99_9", "max", "mean"}) EXPECT_TRUE(row.at(part).contains(q)) << part << q;
    }
    for (const char* q : {"p50", "p99"}) EXPECT_TRUE(row.at("etvo_time_s").contains(q)) << q;
    EXPECT_EQ(row["survived"], true);
    EXPECT_GT(row["reference_error"], 0.0);
    EXPECT_EQ(row["at_reference_error"],
              row["force_error_rms"] <= row["reference_error"] && row["reference_error"] <= 0.035);
    EXPECT_GT(row["world_cpu_s_per_s"], 0.0);
    points.insert(row["scheme"].dump() + row["ratio"].dump() + row["latency_s"].dump());
  }
  EXPECT_EQ(points.size(), 8U);

  expect_columns(kFlatColumns);
  expect_columns({"world_step_s_p99_9"});

  EXPECT_EQ(summary()["points"], 8);
  EXPECT_EQ(summary()["scenes"][0]["duration_s"], 1.0);
  EXPECT_TRUE(summary()["machine"].contains("cpu"));
  const Table trace = read_table(out() + "/traces/press_paper_r4.csv");
  EXPECT_EQ(trace.columns.size(), 8U);
  EXPECT_EQ(trace.rows.size(), 1000U);
  EXPECT_TRUE(std::filesystem::exists(out() + "/traces/press_paper_r4_late_10_ms.csv"));
  EXPECT_NE(page().find("Felt force of user 0 at ratio 4, 10 ms late"), std::string::npos);
  EXPECT_FALSE(std::filesystem::exists(old_trace));

  EXPECT_NE(page().find("imperceptible"), std::string::npos);
  expect_same_page_again();
}

// The plot of an axis has all its values, with one value of each other axis.
TEST_F(Lab, SeveralAxesGiveAPlotEach) {
  const Ended ended = finish(lab_words({"press", "--duration", "0.3", "--ratio", "4,10", "--ratio-most", "0,12",
                                        "--substeps", "1,2", "--scheme", "direct", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  ASSERT_EQ(results().size(), 8U);
  const std::string text = page();
  for (const char* title : {"Error against the ratio (r at most 0, sub-steps 1)",
                            "Error against the largest ratio (r 10,", "Error against sub-steps (r 10, r at most 0)"}) {
    EXPECT_NE(text.find(title), std::string::npos) << title;
  }
}

// A delay of the device's link shifts the force on the operator, and the bound takes from it.
TEST_F(Lab, TheLinkOfTheDeviceActsOnTheForceOnTheOperator) {
  const Ended ended = finish(lab_words({"squeeze", "--duration", "1.5", "--ratio", "4", "--scheme", "reduced", "--set",
                                        "delay.device_latency_s=0,0.01", "--set", "delay.loss_ratio=0,0.05",
                                        "--passivity", "on,off", "--mutual", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json rows = results();
  ASSERT_EQ(rows.size(), 8U);
  for (const Json& row : rows) {
    if (row["passivity"] == "on") continue;
    if (row["device_latency_s"] == 0.01) {
      EXPECT_NEAR(row["operator_time_offset_s"], 0.01, 0.003);
    } else {
      EXPECT_NEAR(row["operator_force_error_rms"], row["force_error_rms"], 0.01);
    }
  }
  const std::string users = read_text(out() + "/users.csv");
  EXPECT_EQ(std::ranges::count(users, '\n'), 17) << "a head, and a row for each point and user";
  for (const char* column : {"user_name", "work_j", "created_ratio", "momentum_error_ratio", "copies_max_m",
                             "bounded_ratio", "mutual_latency_s", "reference_mutual_latency_s"}) {
    EXPECT_NE(users.find(column), std::string::npos) << column;
  }
  const std::string text = page();
  for (const char* part : {"passivity off", "Error against latency of the device", "Error against lost messages",
                           "Each user alone", "mutual latency ms"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part;
  }
  expect_same_page_again();
}

// A setting that no lab knows by name is an axis: with a column, a plot, and a reference of its own.
TEST_F(Lab, AnySettingIsAnAxis) {
  const Ended ended = finish(
      lab_words({"press", "--duration", "0.5", "--ratio", "4", "--scheme", "reduced", "--set",
                 "users.device.force_limit_n=1,40", "--set", "gravity_m_s2=[0,0,-9.81],[0,0,-1]", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  const Json rows = results();
  ASSERT_EQ(rows.size(), 4U);
  std::set<double> limits;
  std::set<std::string> gravities, references;
  for (const Json& row : rows) {
    limits.insert(row.at("users_device_force_limit_n").get<double>());
    gravities.insert(row.at("gravity_m_s2").dump());
    references.insert(row.at("reference_error").dump());
  }
  EXPECT_EQ(limits, (std::set{1.0, 40.0}));
  EXPECT_EQ(gravities.size(), 2U);
  EXPECT_GE(references.size(), 2U);
  EXPECT_NE(page().find("Error against users_device_force_limit_n"), std::string::npos);
  expect_same_page_again();
}

TEST_F(Lab, VariantsOfASceneHaveReferencesOfTheirOwn) {
  const Ended ended = finish(lab_words(
      {"row", "--duration", "0.6", "--ratio", "4", "--scheme", "reduced", "--variants", "2", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  EXPECT_NE(ended.out.find("variants, row: median"), std::string::npos) << ended.out;
  const Json rows = results();
  ASSERT_EQ(rows.size(), 3U);
  std::set<double> floors, errors;
  for (const Json& row : rows) {
    floors.insert(row["reference_error"].get<double>());
    errors.insert(row["force_error_rms"].get<double>());
  }
  EXPECT_EQ(floors.size(), 3U);
  const Json over = summary()["over_variants"];
  ASSERT_EQ(over.size(), 1U);
  EXPECT_EQ(over[0]["variants"], 3);
  EXPECT_EQ(over[0]["force_error_rms_max"], *errors.rbegin());
  EXPECT_EQ(over[0]["force_error_rms_median"], *std::next(errors.begin()));
  EXPECT_NE(page().find("Over the variants"), std::string::npos);
  const Json factors = summary()["variants"];
  ASSERT_EQ(factors.size(), 3U);
  EXPECT_EQ(factors[0]["mass_factor"], 1.0);
  EXPECT_NE(factors[1]["mass_factor"], factors[2]["mass_factor"]);
}

TEST_F(Lab, WrongOptionsAreNamedWithTheCure) {
  expect_refused({{{"press", "--scheme", "papers"}, {"--scheme", "papers", "reduced"}},
                  {{"press", "--ratio", "4,0"}, {"--ratio", "0", "1000"}},
                  {{"press", "--ratio", "4-12"}, {"--ratio 4 --ratio-most 12"}},
                  {{"press", "--ratio", "5-2"}, {"--ratio 2 --ratio-most 5"}},
                  {{"press", "--variants", "-1"}, {"--variants", "-1"}},
                  {{"press", "--latency", "0,nan"}, {"--latency", "nan"}},
                  {{"press", "--set", "delay.loss_ratio=0,5"}, {"--set delay.loss_ratio=0,5", "0.05"}},
                  {{"press", "--set", "bix=1"}, {"--set bix=1: unknown setting"}},
                  {{"press", "--set", "ratio=4,5"}, {"option of its own"}},
                  {{"press", "--passivity", "maybe"}, {"maybe", "automatic"}},
                  {{"press", "--engine", "havoc"}, {"havoc", "bullet"}},
                  {{"no_such_scene"}, {"no_such_scene"}},
                  {{"press", "--durations", "1"}, {"did you mean --duration?"}},
                  {{"press", "--colour", "red"}, {"--colour", "--help"}}});
}

TEST_F(Lab, HelpsWithExamples) {
  const Ended lab = finish({program("subworld"), "lab", "--help"});
  const Ended coupling = finish(lab_words({"--help"}));
  for (const Ended& ended : {lab, coupling}) {
    EXPECT_EQ(ended.code, 0);
    EXPECT_NE(ended.out.find("\n  subworld lab coupling --quick"), std::string::npos) << ended.out;
  }
  EXPECT_NE(coupling.out.find("--latency"), std::string::npos);
  EXPECT_NE(coupling.out.find("--set"), std::string::npos);
}

TEST_F(Lab, MeasurementsSurviveAnInterrupt) {
  expect_kept_after_interrupt({"row", "--ratio", "4,5,6,7,8,9,10,11,12,13,14,15,16", "--substeps", "1,2,3,4,5,6,7,8"},
                              "[  2/", 2, 312);
}

TEST_F(Lab, WithoutGnuplotTheTablesAreThereAndTheCureIsNamed) {
  const Ended ended = finish(lab_words({"press", "--quick", "--ratio", "20", "--scheme", "paper", "--out", out()}),
                             {{"PATH", folder_.path()}});
  EXPECT_EQ(ended.code, 1);
  EXPECT_NE(ended.err.find("gnuplot-nox"), std::string::npos) << ended.err;
  EXPECT_TRUE(std::filesystem::exists(out() + "/results.csv"));
  EXPECT_TRUE(std::filesystem::exists(out() + "/summary.json"));
}

}  // namespace
}  // namespace subworld::test
