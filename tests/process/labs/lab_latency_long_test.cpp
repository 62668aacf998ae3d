#include "process/labs/lab_test.hpp"

#include <map>

namespace subworld::test {
namespace {

class LatencyLabLong : public LabTest {
 protected:
  LatencyLabLong() : LabTest("latency") {}
};

// A busy machine delays the programs, so no error is held.
TEST_F(LatencyLabLong, RepeatsTheSearchOverAnEmulatedLink) {
  if (finish({"/usr/bin/unshare", "--net", "/bin/true"}).code != 0)
    GTEST_SKIP() << "network namespaces are not permitted here";
  const Ended ended = finish(lab_words({"row", "--link", "--quick", "--largest", "0.004", "--out", out()}));
  ASSERT_EQ(ended.code, 0) << ended.err;
  std::map<std::string, int> runs;
  for (const Json& row : results()) {
    if (row["kind"] != "point") continue;
    ++runs[row["link"]];
    EXPECT_TRUE(row["force_error_rms"].is_number()) << row.dump();
  }
  EXPECT_GE(runs["emulated"], 1);
  EXPECT_GE(runs["world"], 2);
  EXPECT_NE(ended.out.find("round-trip delay of an emulated link"), std::string::npos) << ended.out;
}

}  // namespace
}  // namespace subworld::test
