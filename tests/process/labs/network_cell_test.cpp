// A cell of the lab of the network: its processes, over plain datagrams.

#include "lab/network/measure.hpp"
#include "lab/network/udp.hpp"
#include "support/process.hpp"

#include <gtest/gtest.h>

namespace subworld::test {
namespace {

CellFindings found_with(int payload_bytes) {
  const TestDomain domain;
  NetworkCell cell{.world_dds = kPlainUdp, .haptic_dds = kPlainUdp, .transport = NetworkTransport::loopback};
  cell.rate_hz = 200.0;
  cell.payload_bytes = payload_bytes;
  cell.users = 2;
  return measure_cell(cell, {.duration_s = 0.3, .domain = domain.number()});
}

// No datagram is that large, so the system refuses each.
TEST(NetworkCellProcesses, EachRefusedWriteThatCountsIsCountedOnce) {
  const CellFindings found = found_with(70'000);
  ASSERT_EQ(found.failure, "");
  EXPECT_GT(found.sent, 0U);
  EXPECT_EQ(found.refused, found.sent) << "those of the start-up do not count";
  EXPECT_EQ(found.there.received, 0U);
}

TEST(NetworkCellProcesses, AcceptedWritesAreNoRefusedOnes) {
  const CellFindings found = found_with(256);
  ASSERT_EQ(found.failure, "");
  EXPECT_GT(found.there.received, 0U);
  EXPECT_EQ(found.refused, 0U);
}

}  // namespace
}  // namespace subworld::test
