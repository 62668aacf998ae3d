#include "process/process_test.hpp"

#include <cmath>

namespace subworld::test {
namespace {

struct Case {
  std::string name;
  std::string scene;
  Words flags;
  int users = 1;
  bool sub_worlds = true;
  std::size_t extra_steps = 0;  ///< steps of the sub-world until it receives the world's last frame
  Words vendors = {};           ///< of the runs that must have the result of the first one
};

void PrintTo(const Case& one, std::ostream* out) { *out << one.name; }

const Words kRunKeys{"scene", "mode",       "scheme",     "engine",  "haptic_engine", "dds",    "h_s",   "ratio",
                     "users", "duration_s", "state_hash", "verdict", "world",         "haptic", "device"};
const Words kWorldKeys{"bodies", "cycles", "late_cycles", "step_s", "real_time_factor_min"};
const Words kHapticKeys{"user",         "steps",           "skipped_steps", "missed_deadlines",
                        "lateness_s",   "step_s",          "force_rms_n",   "force_max_n",
                        "members",      "contacts",        "border_pairs",  "sync_s",
                        "round_trip_s", "bytes_per_cycle", "lost_frames",   "energy_excess_j"};
const Words kDeviceKeys{"user", "round_trip_s", "missed_deadlines"};
const Words kQuantiles{"p50", "p99", "p99_9", "max", "mean"};

void expect_keys(const Json& json, const Words& keys, const std::string& what) {
  for (const std::string& key : keys) EXPECT_TRUE(json.contains(key)) << what << " has no " << key;
}

/// Checks that the summary is complete.
void expect_complete(const Json& summary) {
  expect_keys(summary, kRunKeys, "summary.json");
  expect_keys(summary["world"], kWorldKeys, "world");
  expect_keys(summary["world"]["step_s"], kQuantiles, "world.step_s");
  for (const Json& haptic : summary["haptic"]) {
    expect_keys(haptic, kHapticKeys, "haptic");
    for (const char* times : {"lateness_s", "step_s", "sync_s", "round_trip_s"})
      expect_keys(haptic[times], kQuantiles, times);
    for (const char* counts : {"members", "contacts", "border_pairs"})
      expect_keys(haptic[counts], {"mean", "max"}, counts);
  }
  for (const Json& device : summary["device"]) expect_keys(device, kDeviceKeys, "device");
}

class LockStep : public ProcessTest, public ::testing::WithParamInterface<Case> {
 protected:
  /// Runs the case and checks the results that are common to all such runs.
  Json results(const std::string& dds) {
    Words flags = GetParam().flags;
    flags.insert(flags.end(), {"--mode", "lockstep", "--duration", "0.4", "--dds", dds});
    const Ended ended = run(scene(GetParam().scene), flags);
    EXPECT_EQ(ended.code, 0) << ended.out << ended.err;
    const Json json = summary();
    if (json.is_discarded()) return {};
    expect_complete(json);
    EXPECT_EQ(json["dds"], dds);
    EXPECT_TRUE(json["verdict"].get<std::string>().starts_with("ok")) << ended.out;
    EXPECT_NE(ended.out.find(json["state_hash"].get<std::string>()), std::string::npos);
    expect_histories(json);
    return json;
  }

  void expect_histories(const Json& json) const {
    const Table world = read_table(out() + "/world.csv");
    EXPECT_EQ(world.columns.front(), "time_s");
    const auto ratio = world.column("ratio");
    std::size_t steps = 0;
    for (const auto& row : world.rows) steps += static_cast<std::size_t>(row.at(ratio));
    const double h_s = json["h_s"].get<double>();
    EXPECT_NEAR(h_s * static_cast<double>(steps), 0.4, 0.51 * h_s * json["ratio_most"].get<double>());
    EXPECT_EQ(world.rows.size(), json["world"]["cycles"]);
    for (std::size_t user = 0; user < json["haptic"].size(); ++user) {
      const std::size_t made = steps + GetParam().extra_steps;
      EXPECT_EQ(json["haptic"][user]["steps"], made);
      for (const char* kind : {"haptic", "device"}) {
        const Table table = read_table(out() + "/" + kind + "_" + std::to_string(user) + ".csv");
        EXPECT_EQ(table.columns.front(), "time_s");
        EXPECT_EQ(table.rows.size(), made) << kind << " " << user;
      }
    }
  }
};

TEST_P(LockStep, GivesOneResultWhateverTheVendor) {
  const Json first = results("fastdds");
  ASSERT_FALSE(first.empty());
  ASSERT_EQ(first["haptic"].size(), static_cast<std::size_t>(GetParam().users));
  for (const Json& haptic : first["haptic"]) {
    EXPECT_EQ(haptic["lost_frames"], 0);
    EXPECT_EQ(haptic["members"]["mean"] > 0.0, GetParam().sub_worlds);
    EXPECT_EQ(haptic["border_pairs"]["mean"] > 0.0, GetParam().sub_worlds);
  }
  for (const std::string& dds : GetParam().vendors) {
    const Json again = results(dds);
    ASSERT_FALSE(again.empty());
    EXPECT_EQ(again["state_hash"], first["state_hash"]) << dds;
    for (std::size_t user = 0; user < first["haptic"].size(); ++user) {
      EXPECT_EQ(again["haptic"][user]["force_rms_n"], first["haptic"][user]["force_rms_n"]) << dds;
      EXPECT_EQ(again["haptic"][user]["lost_frames"], 0) << dds;
    }
  }
}

const std::vector<Case> kCases{
    {"heap", "heap", {"--ratio", "8", "--set", "settle.duration_s=1"}, 1, true, 8},
    {"heap_two_users", "heap", {"--users", "2", "--ratio", "8", "--set", "settle.duration_s=1"}, 2, true, 8},
    {"row", "row", {}, 1, true, 4},
    {"row_deadband", "row", {"--set", "deadband=0.1"}, 1, true, 4},
    {"row_adaptive", "row", {"--ratio", "4-10"}, 1, true, 4},
    {"row_adaptive_late", "row", {"--ratio", "4-10", "--latency", "0.02"}, 1, true, 24},
    {"row_late", "row", {"--latency", "0.02"}, 1, true, 24},
    {"row_paper_late", "row", {"--scheme", "paper", "--latency", "0.02"}, 1, true, 10},
    {"heap_two_users_paper",
     "heap",
     {"--users", "2", "--scheme", "paper", "--ratio", "8", "--set", "settle.duration_s=1"},
     2},
    {"row_direct", "row", {"--scheme", "direct"}, 1, false},
    {"press_direct", "press", {"--scheme", "direct"}, 1, false}};
/// With one vendor after the first one, in turn, or with the others.
std::vector<Case> cases(bool others) {
  std::vector<Case> all = kCases;
  for (std::size_t i = 0; i < all.size(); ++i) {
    const Words vendors{"cyclonedds", "mixed", "fastdds"};
    for (std::size_t vendor = 0; vendor < vendors.size(); ++vendor) {
      if ((vendor == i % vendors.size()) != others) all[i].vendors.push_back(vendors[vendor]);
    }
  }
  return all;
}
INSTANTIATE_TEST_SUITE_P(Scenes, LockStep, ::testing::ValuesIn(cases(false)),
                         [](const auto& one) { return one.param.name; });
INSTANTIATE_TEST_SUITE_P(Full, LockStep, ::testing::ValuesIn(cases(true)),
                         [](const auto& one) { return one.param.name; });

/// The hash is independent of the vendor, but depends on the run.
class LockStepHash : public ProcessTest {};

TEST_F(LockStepHash, DiffersBetweenRunsThatDiffer) {
  std::set<std::string> hashes;
  for (const char* duration : {"0.4", "0.404"}) {
    ASSERT_EQ(run(scene("row"), {"--duration", duration}).code, 0);
    hashes.insert(summary()["state_hash"].get<std::string>());
  }
  EXPECT_EQ(hashes.size(), 2U);
}

class Suppression : public ProcessTest {};

TEST_F(Suppression, OfAnOperatorInFreeSpaceSavesMessagesAndChangesNoForce) {
  std::vector<Json> users;
  for (const char* item : {"suppression", "energy_bound"}) {  // optimisation off; the bound does not affect messages
    ASSERT_EQ(run(scene("scatter"), {"--duration", "0.2", "--disable", item}).code, 0);
    users.push_back(summary()["haptic"][0]);
  }
  EXPECT_LT(users[1]["bytes_per_cycle"], 0.25 * users[0]["bytes_per_cycle"].get<double>());
  for (const char* same : {"steps", "force_rms_n", "force_max_n"}) EXPECT_EQ(users[0][same], users[1][same]) << same;
}

}  // namespace
}  // namespace subworld::test
