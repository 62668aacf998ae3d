#include "support/two_hosts.hpp"

namespace subworld {
namespace {

constexpr const char* kLoss = "loss 30%";  // in both directions

class WireLoss : public test::TwoHosts, public ::testing::WithParamInterface<test::VendorPair> {
 protected:
  /// Exchanges until the peer has written so many reports after the link became bad.
  void lose(Mode mode, std::uint64_t reports) {
    start(GetParam(), mode);
    ASSERT_TRUE(connected()) << text();
    network_->set_links(parse_link(kLoss));
    heard_.lost = heard_.disorders = heard_.gap = 0;
    first_ = heard_;
    ASSERT_TRUE(exchange_until([&] { return heard_.stamp >= first_.stamp + reports; }, 50.0)) << text();
    RecordProperty("longest_gap_samples", static_cast<int>(heard_.gap));
    RecordProperty("lost_samples", static_cast<int>(heard_.lost));
  }
  test::FromPeer first_;
};

// A reliable writer sends lost samples again, in order: newer ones wait at the reader for those. The writer's history
// bounds this wait, because what it no longer has is not waited for.
TEST_P(WireLoss, in_real_time_the_newest_report_is_never_older_than_a_few_histories) {
  if (!make_hosts()) GTEST_SKIP() << "network namespaces are not permitted here";
  constexpr std::uint64_t kReports = 600;
  ASSERT_NO_FATAL_FAILURE(lose(Mode::realtime, kReports));
  EXPECT_LE(heard_.gap, 8U * kTopicOf<HapticReport>.depth);
  EXPECT_EQ(heard_.disorders == 0, heard_.lost == 0);
  EXPECT_LT(heard_.lost, kReports * 3 / 10) << "no more arrive than without repair";
}

TEST_P(WireLoss, in_lockstep_every_report_arrives_in_order) {
  if (!make_hosts()) GTEST_SKIP() << "network namespaces are not permitted here";
  ASSERT_NO_FATAL_FAILURE(lose(Mode::lockstep, 300));
  EXPECT_EQ(heard_.disorders, 0U);
  EXPECT_EQ(heard_.lost, 0U);
  EXPECT_EQ(heard_.reports - first_.reports, heard_.stamp - first_.stamp);
}

INSTANTIATE_TEST_SUITE_P(Pairs, WireLoss, test::kMixedPairs, test::name_of_pair);
INSTANTIATE_TEST_SUITE_P(FullRealtime, WireLoss, test::kEqualPairs, test::name_of_pair);

}  // namespace
}  // namespace subworld
