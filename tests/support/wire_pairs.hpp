#pragma once

#include "wire/bus.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <utility>

namespace subworld::test {

/// Sender and receiver.
using VendorPair = std::pair<Vendor, Vendor>;

inline std::string name_of_pair(const ::testing::TestParamInfo<VendorPair>& info) {
  return std::string(name_of(info.param.first)) + "_to_" + name_of(info.param.second);
}

/// Each vendor in each role, and the pairs of one vendor.
inline const auto kMixedPairs =
    ::testing::Values(VendorPair{Vendor::fastdds, Vendor::cyclonedds}, VendorPair{Vendor::cyclonedds, Vendor::fastdds});
inline const auto kEqualPairs =
    ::testing::Values(VendorPair{Vendor::fastdds, Vendor::fastdds}, VendorPair{Vendor::cyclonedds, Vendor::cyclonedds});
inline const auto kAllPairs = ::testing::Values(
    VendorPair{Vendor::fastdds, Vendor::fastdds}, VendorPair{Vendor::fastdds, Vendor::cyclonedds},
    VendorPair{Vendor::cyclonedds, Vendor::fastdds}, VendorPair{Vendor::cyclonedds, Vendor::cyclonedds});

inline BusConfig config_of(Vendor vendor, int domain, Mode mode = Mode::lockstep) {
  BusConfig config;
  config.vendor = vendor;
  config.domain = domain;
  config.mode = mode;
  return config;
}

/// Waits on the bus until the condition holds; false after a time that is exceeded only by a fault.
template <class Condition>
bool until(Bus& bus, Condition condition, double limit_s = 20.0) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(limit_s);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    bus.wait(0.02);
  }
  return true;
}

}  // namespace subworld::test
