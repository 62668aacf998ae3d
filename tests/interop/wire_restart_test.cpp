#include "support/two_hosts.hpp"

namespace subworld {
namespace {

class WireRestart : public test::TwoHosts, public ::testing::WithParamInterface<test::VendorPair> {};

// As in containers, where each program has process number 1: a vendor that derives a participant's identity from host
// and process number alone takes the new one for the old one, until the lease of the old one has expired.
TEST_P(WireRestart, a_killed_program_that_starts_again_with_the_same_process_number_is_received) {
  if (!make_hosts()) GTEST_SKIP() << "network namespaces are not permitted here";
  const auto [there, here] = GetParam();
  open(here, Mode::realtime);
  for (int start = 0; start < 3; ++start) {
    heard_ = {};
    start_peer(there, Mode::realtime, "unshare --pid --fork ");
    EXPECT_TRUE(connected()) << "start " << start << ": " << text();
    EXPECT_EQ(heard_.pid, 1U);
    kill_peer();
  }
}

TEST_P(WireRestart, a_killed_program_that_starts_again_at_once_counts_once) {
  if (!make_hosts()) GTEST_SKIP() << "network namespaces are not permitted here";
  for (const Mode mode : {Mode::realtime, Mode::lockstep}) {
    SCOPED_TRACE(mode == Mode::realtime ? "realtime" : "lockstep");
    const auto [there, here] = GetParam();
    open(here, mode);
    for (int start = 0; start < 3; ++start) {
      heard_ = {};
      start_peer(there, mode);
      // Trust in the one before does not outlive it.
      EXPECT_TRUE(exchange_until([&] { return heard_.reports > 0; })) << "start " << start << ": " << text();
      reports_->trust_sender();
      EXPECT_TRUE(connected()) << "start " << start << ": " << text();
      EXPECT_TRUE(exchange_until([&] { return reports_->alive_writers() == 1 && states_->alive_writers() == 1; }, 5.0))
          << "start " << start << ": " << text();
      kill_peer();
    }
    close();
  }
}

INSTANTIATE_TEST_SUITE_P(Pairs, WireRestart, test::kMixedPairs, test::name_of_pair);
INSTANTIATE_TEST_SUITE_P(FullRealtime, WireRestart, test::kEqualPairs, test::name_of_pair);

}  // namespace
}  // namespace subworld
