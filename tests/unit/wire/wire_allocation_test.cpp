#include "support/allocations.hpp"
#include "support/wire_samples.hpp"
#include "wire/codec/codec.hpp"

#include <gtest/gtest.h>

#include <stdexcept>

namespace subworld {
namespace {

/// Allocations of 100 round trips after the first ones.
template <class M>
long allocations_of(M sample) {
  Codec<M> sender;
  Codec<M> receiver;
  M received;
  const auto round_trip = [&] {
    // Every message refers to the one before.
    if constexpr (requires { sample.base_stamp; }) sample.base_stamp = sample.stamp++;
    if (!receiver.decode(sender.encode(sample), received)) throw std::runtime_error("rejected");
  };
  for (int warm_up = 0; warm_up < 3; ++warm_up) round_trip();
  const long before = test::allocations();
  for (int round = 0; round < 100; ++round) round_trip();
  return test::allocations() - before;
}

TEST(WireAllocation, the_loops_topics_do_not_allocate) {
  test::SampleMaker make(29);
  EXPECT_EQ(allocations_of(make.make<DeviceState>()), 0);
  EXPECT_EQ(allocations_of(make.make<DeviceCommand>()), 0);
  auto frame = make.make<WorldFrame>();
  frame.entering.clear();  // contains names that are new to the receiver
  frame.states.resize(20);
  for (auto& state : frame.states) make.fill(state);
  EXPECT_EQ(allocations_of(frame), 0);
  auto report = make.make<HapticReport>();
  report.members.resize(20);
  for (auto& member : report.members) make.fill(member);
  report.followed.clear();  // after an order in lock-step only
  EXPECT_EQ(allocations_of(report), 0);
}

}  // namespace
}  // namespace subworld
