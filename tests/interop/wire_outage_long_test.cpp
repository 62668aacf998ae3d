#include "interop/outage.hpp"

namespace subworld {
namespace {

using test::WireOutage;

// Longer than the lease of a Cyclone participant.
TEST_P(WireOutage, both_sides_receive_again_after_12_s) { expect_exchange_after(12.0); }
// Longer than both vendors' usual leases.
TEST_P(WireOutage, both_sides_receive_again_after_25_s) { expect_exchange_after(25.0); }

INSTANTIATE_TEST_SUITE_P(Pairs, WireOutage, test::kAllPairs, test::name_of_pair);

}  // namespace
}  // namespace subworld
