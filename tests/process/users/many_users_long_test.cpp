#include "process/users/many_users.hpp"

#include <random>

namespace subworld::test {
namespace {

const Words kVendors{"fastdds", "cyclonedds", "mixed"};

class FullManyUsers : public ManyUsers {};

TEST_F(FullManyUsers, SixteenEndInOneStateThreeTimesWithEveryVendor) {
  std::set<std::string> hashes;
  for (int repeat = 0; repeat < 3; ++repeat) {
    for (const std::string& dds : kVendors) hashes.insert(hash_of_run(16, {"--dds", dds, "--duration", "0.5"}));
  }
  EXPECT_EQ(hashes.size(), 1U);
}

/// An order for each vendor; the parameter is the seed of the orders.
class Started : public ManyUsers, public ::testing::WithParamInterface<unsigned> {};

TEST_P(Started, InAnyOrderSixteenEndInOneState) {
  constexpr int kUsers = 16;
  std::set<std::string> hashes{hash_of_run(kUsers, {})};
  std::mt19937 random(GetParam());
  for (const std::string& dds : kVendors) {
    std::vector<int> order = usual_order(kUsers);
    std::ranges::shuffle(order, random);
    hashes.insert(hash_of_start(kUsers, order, dds));
  }
  EXPECT_EQ(hashes.size(), 1U);
}

INSTANTIATE_TEST_SUITE_P(Seeds, Started, ::testing::Values(1U));
INSTANTIATE_TEST_SUITE_P(Full, Started, ::testing::Values(2U));

}  // namespace
}  // namespace subworld::test
