#include "process/process_test.hpp"

#include <set>

namespace subworld::test {
namespace {

class Repeat : public ProcessTest, public ::testing::WithParamInterface<std::pair<int, int>> {};  // users, runs

// Five simulated seconds of the heap, with every vendor: one hash.
TEST_P(Repeat, the_heap_ends_in_one_state) {
  std::set<std::string> hashes;
  const Words vendors{"fastdds", "cyclonedds", "mixed"};
  const auto [users, repeats] = GetParam();
  for (int i = 0; i < repeats; ++i) {
    const Ended ended = run(scene("heap"), {"--mode", "lockstep", "--duration", "5", "--users", std::to_string(users),
                                            "--dds", vendors[static_cast<std::size_t>(i) % vendors.size()]});
    ASSERT_EQ(ended.code, 0) << ended.err;
    const Json json = summary();
    hashes.insert(json["state_hash"]);
    for (const Json& haptic : json["haptic"]) {
      EXPECT_GT(haptic["members"]["mean"], 0.0);
      EXPECT_GT(haptic["border_pairs"]["mean"], 0.0);
      EXPECT_EQ(haptic["lost_frames"], 0);
    }
  }
  EXPECT_EQ(hashes.size(), 1U);
}

INSTANTIATE_TEST_SUITE_P(Vendors, Repeat, testing::Values(std::pair(1, 3), std::pair(2, 3)));
INSTANTIATE_TEST_SUITE_P(Full, Repeat, testing::Values(std::pair(1, 10), std::pair(2, 4)));

}  // namespace
}  // namespace subworld::test
