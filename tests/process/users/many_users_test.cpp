#include "process/users/many_users.hpp"

namespace subworld::test {
namespace {

TEST_F(ManyUsers, EightEndInOneStateWithEachVendor) {
  std::set<std::string> hashes;
  for (const char* dds : {"fastdds", "cyclonedds"}) hashes.insert(hash_of_run(8, {"--dds", dds}));
  EXPECT_EQ(hashes.size(), 1U);
}

TEST_F(ManyUsers, TheOrderInWhichTheProgramsStartDoesNotMatter) {
  constexpr int kUsers = 2;
  std::vector<int> order = usual_order(kUsers);
  std::set<std::string> hashes{hash_of_start(kUsers, order, "mixed")};
  std::ranges::reverse(order);  // the world last
  hashes.insert(hash_of_start(kUsers, order, "mixed"));
  EXPECT_EQ(hashes.size(), 1U);
  EXPECT_FALSE(hashes.contains(""));
}

TEST_F(ManyUsers, MoreThanADomainHasRoomForAreRefused) {
  const std::string file = folder_.write("pairs.yaml", pairs_scene(58));
  for (const char* command : {"run", "plan"}) {
    const Ended ended = finish({program("subworld"), command, file});
    EXPECT_EQ(ended.code, 2) << command;
    EXPECT_NE(ended.err.find("one host has room for 57 users"), std::string::npos) << command << ended.err;
  }
  const Ended planned = finish({program("subworld"), "plan", file, "--users", "57"});
  EXPECT_EQ(planned.code, 0) << planned.err;
  EXPECT_NE(planned.out.find("limit: one host has room for 57 users"), std::string::npos) << planned.out;
}

/// Impedance and admittance devices, with three and six degrees of freedom, at four rates.
class MixedDevices : public ProcessTest {};

TEST_F(MixedDevices, EndInOneStateInLockStepWithMixedRatiosEnginesAndVendors) {
  std::set<std::string> hashes;
  for (const char* dds : {"fastdds", "mixed"}) {
    const Ended ended = run(scene("devices"), {"--mode", "lockstep", "--duration", "0.5", "--dds", dds,
                                               "--haptic-engine", "ode", "--ratio", "4-8"});
    ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
    hashes.insert(summary()["state_hash"]);
    for (const Json& haptic : summary()["haptic"]) EXPECT_GT(haptic["force_max_n"], 1.0) << haptic["user"];
  }
  EXPECT_EQ(hashes.size(), 1U);
}

// The devices' rates differ: each sub-world must ask no more of another user's device than that offers.
TEST_F(MixedDevices, MatchInRealTimeAndAreFelt) {
  for (const char* dds : {"fastdds", "cyclonedds"}) {
    const Ended ended = run(scene("devices"), {"--mode", "realtime", "--duration", "1", "--dds", dds});
    ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
    for (const Json& haptic : summary()["haptic"]) {
      EXPECT_EQ(haptic["events"]["incompatible_qos"], 0) << dds << haptic["user"];
      EXPECT_GT(haptic["force_max_n"], 1.0) << dds << haptic["user"];
    }
  }
}

}  // namespace
}  // namespace subworld::test
