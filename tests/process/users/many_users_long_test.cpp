#include "process/users/many_users.hpp"

#include <random>

namespace subworld::test {
namespace {

const Words kVendors{"fastdds", "cyclonedds", "mixed"};

TEST_F(ManyUsers, SixteenEndInOneStateThreeTimesWithEveryVendor) {
  std::set<std::string> hashes;
  for (int repeat = 0; repeat < 3; ++repeat) {
    for (const std::string& dds : kVendors) hashes.insert(hash_of_run(16, {"--dds", dds, "--duration", "0.5"}));
  }
  EXPECT_EQ(hashes.size(), 1U);
}

TEST_F(ManyUsers, SixteenStartInAnyOrder) {
  constexpr int kUsers = 16;
  std::set<std::string> hashes{hash_of_run(kUsers, {})};
  std::mt19937 random(1);
  for (int repeat = 0; repeat < 6; ++repeat) {
    std::vector<int> order = usual_order(kUsers);
    std::ranges::shuffle(order, random);
    hashes.insert(hash_of_start(kUsers, order, kVendors[static_cast<std::size_t>(repeat) % kVendors.size()]));
  }
  EXPECT_EQ(hashes.size(), 1U);
}

}  // namespace
}  // namespace subworld::test
