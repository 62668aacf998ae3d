// The lab's run in one process equals that of the real programs: equal state hashes for each run.
#include "process/process_test.hpp"
#include "process/results/hash_cases.hpp"
#include "support/grid.hpp"

namespace subworld::test {

void PrintTo(const HashCase& one, std::ostream* out) { *out << to_text(one); }

namespace {

class StateHashes : public ProcessTest, public ::testing::WithParamInterface<HashCase> {};

TEST_P(StateHashes, OfTheLabAreThoseOfThePrograms) {
  const Ended ended = run(scene(GetParam().scene), flags_of(GetParam()));
  ASSERT_EQ(ended.code, 0) << ended.out << ended.err;
  EXPECT_EQ(summary()["state_hash"], in_process_hash(GetParam(), SCENES_FOLDER));
}

std::string name_of(const testing::TestParamInfo<HashCase>& info) {
  const HashCase& one = info.param;
  return one.scene + "_" + one.scheme + "_" + std::to_string(one.users) + (one.latency_s > 0.0 ? "_delayed" : "");
}

/// `half`: of each scene with each scheme one case, with numbers of users and delays in turn.
Halves<HashCase> cells() {
  Halves<HashCase> found;
  const std::vector<HashCase> all = hash_cases(SCENES_FOLDER);
  for (std::size_t begin = 0, row = 0, end = 0; begin < all.size(); begin = end, ++row) {
    while (end < all.size() && all[end].scene == all[begin].scene && all[end].scheme == all[begin].scheme) ++end;
    for (std::size_t i = begin; i < end; ++i)
      (i - begin == row % (end - begin) ? found.half : found.other).push_back(all[i]);
  }
  return found;
}

INSTANTIATE_TEST_SUITE_P(Shipped, StateHashes, testing::ValuesIn(cells().half), name_of);
INSTANTIATE_TEST_SUITE_P(Full, StateHashes, testing::ValuesIn(cells().other), name_of);

}  // namespace
}  // namespace subworld::test
