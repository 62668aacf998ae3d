#pragma once

#include "support/two_hosts.hpp"

namespace subworld::test {

/// A link that is down for a time and then back: the vendors' leases of writers and participants expire in between.
class WireOutage : public TwoHosts, public ::testing::WithParamInterface<VendorPair> {
 protected:
  void expect_exchange_after(double outage_s) {
    if (!make_hosts()) GTEST_SKIP() << "network namespaces are not permitted here";
    start(GetParam(), Mode::realtime);
    ASSERT_TRUE(connected()) << text();
    network_->set_links(parse_link("loss 100%"));
    const auto back = std::chrono::steady_clock::now() + std::chrono::duration<double>(outage_s);
    ASSERT_TRUE(exchange_until([&] { return reports_->alive_writers() == 0 && states_->alive_writers() == 0; }))
        << "the link is not down";
    ASSERT_TRUE(exchange_until([&] { return std::chrono::steady_clock::now() >= back; }, outage_s + 40.0));
    network_->set_links(parse_link("ideal"));
    const auto begun = std::chrono::steady_clock::now();
    EXPECT_TRUE(connected()) << text();
    const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - begun;
    RecordProperty("resumed_after_ms", static_cast<int>(taken.count()));
  }
};

}  // namespace subworld::test
