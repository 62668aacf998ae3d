#include "interop/outage.hpp"

namespace subworld {
namespace {

using test::WireOutage;

TEST_P(WireOutage, both_sides_receive_again_after_2_5_s) { expect_exchange_after(2.5); }

INSTANTIATE_TEST_SUITE_P(Pairs, WireOutage, test::kMixedPairs, test::name_of_pair);
INSTANTIATE_TEST_SUITE_P(FullRealtime, WireOutage, test::kEqualPairs, test::name_of_pair);

}  // namespace
}  // namespace subworld
