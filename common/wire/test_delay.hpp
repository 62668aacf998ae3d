#pragma once

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <functional>
#include <random>
#include <thread>

namespace subworld {

/// For tests of lock-step: SUBWORLD_TEST_DELAY=SEED:MAX_MS delays a process where endpoints are made, messages written
/// and received, and statuses heard. Each such place waits up to MAX_MS in one of 16 calls, and the process up to 500
/// times as long before it opens its bus. Without the variable it costs a comparison.
inline void test_delay(double scale = 1.0) noexcept {
  struct Setting {
    std::uint64_t seed = 0;
    double max_ms = 0.0;
  };
  static const Setting setting = [] {
    Setting read;
    const char* const text = std::getenv("SUBWORLD_TEST_DELAY");
    unsigned long long seed = 0;
    if (text != nullptr && std::sscanf(text, "%llu:%lf", &seed, &read.max_ms) == 2) read.seed = seed;
    return read;
  }();
  if (!(setting.max_ms > 0.0)) return;
  // Each thread draws of its own, so that no lock joins them.
  thread_local std::minstd_rand random(static_cast<std::minstd_rand::result_type>(
      setting.seed * 7919U + std::hash<std::thread::id>{}(std::this_thread::get_id())));
  if (scale <= 1.0 && random() % 16 != 0) return;
  const double part = static_cast<double>(random() % 1000) / 1000.0;
  std::this_thread::sleep_for(std::chrono::duration<double, std::milli>(part * scale * setting.max_ms));
}

inline constexpr double kTestDelayOfStart = 500.0;

}  // namespace subworld
