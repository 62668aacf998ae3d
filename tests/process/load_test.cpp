#include "process/process_test.hpp"

#include <memory>
#include <set>

namespace subworld::test {
namespace {

class Load : public ProcessTest, public ::testing::WithParamInterface<const char*> {};

// Each program gets a core for a small part of the time: a peer that is silent for a while is not taken for dead.
TEST_P(Load, LockstepRunsBesideManyOthersEndWithTheSameHash) {
  constexpr int kRuns = 10;
  std::vector<std::unique_ptr<Process>> runs;
  const auto folder = [&](int i) { return folder_.path() + "/run_" + std::to_string(i); };
  for (int i = 0; i < kRuns; ++i) {
    const Words words{program("subworld"), "run",   scene("lift"),     "--duration", "0.5", "--dds",
                      GetParam(),          "--out", folder(i) + "/out"};
    std::filesystem::create_directory(folder(i));
    runs.push_back(std::make_unique<Process>(words, folder(i)));
  }
  std::set<std::string> hashes;
  for (int i = 0; i < kRuns; ++i) {
    EXPECT_EQ(runs[static_cast<std::size_t>(i)]->wait(), 0) << runs[static_cast<std::size_t>(i)]->err();
    const Json json = Json::parse(read_text(folder(i) + "/out/summary.json"), nullptr, false);
    ASSERT_TRUE(json.is_object()) << i;
    hashes.insert(json.value("state_hash", ""));
  }
  EXPECT_EQ(hashes.size(), 1U);
}

INSTANTIATE_TEST_SUITE_P(Vendors, Load, ::testing::Values("fastdds", "cyclonedds", "mixed"),
                         [](const auto& one) { return std::string(one.param); });

}  // namespace
}  // namespace subworld::test
