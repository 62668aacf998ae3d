#include "lab/session/metrics.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

namespace subworld {
namespace {

constexpr double kH_s = 0.001;
constexpr int kSamples = 3000;
constexpr double kFrequency_hz = 1.5;

/// A sine on x and a weaker one on z, `delay_s` late.
std::vector<Vec3> sine(double delay_s = 0.0, double factor = 1.0) {
  std::vector<Vec3> force;
  for (int i = 0; i < kSamples; ++i) {
    const double phase = 2.0 * std::numbers::pi * kFrequency_hz * (i * kH_s - delay_s);
    force.emplace_back(factor * 10.0 * std::sin(phase), 0.0, factor * 3.0 * std::cos(phase));
  }
  return force;
}

std::vector<Vec3> with_noise(std::vector<Vec3> force, double deviation_n) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0.0, deviation_n);
  for (Vec3& f : force) f += Vec3(normal(random), normal(random), normal(random));
  return force;
}

// One user ends with a large force where the next begins without: the lag does not mix them.
TEST(ForceError, OfSeveralUsersHasTheirCommonLag) {
  const std::vector<Vec3> early = sine(), late = sine(0.01);
  std::vector<Vec3> strong = early, strong_late = late;
  for (std::vector<Vec3>* force : {&strong, &strong_late}) {
    for (Vec3& f : *force) f += Vec3(100, 0, 0);
  }
  const ForcePair users[] = {{strong_late, strong}, {late, early}};
  EXPECT_NEAR(force_error(users, kH_s).time_offset_s, 0.01, 1e-4);
  const ForceError alone = force_error(late, early, kH_s);
  const ForcePair twice[] = {{late, early}, {late, early}};
  const ForceError both = force_error(twice, kH_s);
  EXPECT_NEAR(both.rms, alone.rms, 1e-12);
  EXPECT_NEAR(both.smoothed_rms, alone.smoothed_rms, 1e-12);
  EXPECT_NEAR(both.jitter_ratio, alone.jitter_ratio, 1e-12);
}

TEST(ForceError, OfEqualForcesIsZero) {
  const ForceError e = force_error(sine(), sine(), kH_s);
  for (const double zero : {e.rms, e.p99, e.max, e.value_offset, e.smoothed_rms}) EXPECT_EQ(zero, 0.0);
  EXPECT_NEAR(e.time_offset_s, 0.0, 1e-9);
  EXPECT_DOUBLE_EQ(e.jitter_ratio, 1.0);
}

// F = k R: |F - R| = |k - 1| |R|, and no lag reduces it.
TEST(ForceError, OfAScaledForceIsTheScale) {
  for (const double k : {0.0, 0.9, 1.05, 2.0}) {
    const ForceError e = force_error(sine(0.0, k), sine(), kH_s);
    EXPECT_NEAR(e.rms, std::abs(k - 1.0), 1e-12) << k;
    EXPECT_NEAR(e.max, std::abs(k - 1.0), 1e-12) << k;
    EXPECT_NEAR(e.smoothed_rms, std::abs(k - 1.0), 1e-12) << k;
    EXPECT_NEAR(e.jitter_ratio, k, 1e-12);
    EXPECT_LE(e.p99, e.max);
  }
}

// A sine that is late by d: |F - R| = 2 sin(w d / 2) |R|, and zero after shifting it back.
TEST(ForceError, OfALateForceIsFoundAsATimeOffset) {
  for (const double delay_s : {0.0, 0.0031, 0.0104, -0.0057, 0.05}) {
    const ForceError e = force_error(sine(delay_s), sine(), kH_s);
    EXPECT_NEAR(e.time_offset_s, delay_s, 0.1 * kH_s) << delay_s;
    EXPECT_NEAR(e.rms, 2.0 * std::abs(std::sin(std::numbers::pi * kFrequency_hz * delay_s)), 0.02 * e.rms + 1e-12);
    EXPECT_LE(e.value_offset, 2.0 * std::numbers::pi * kFrequency_hz * 0.5 * kH_s) << delay_s;
  }
}

// White noise of deviation s on each of three axes: RMS = s sqrt(3) / RMS of R; a mean of 41 removes most of it.
TEST(ForceError, OfNoiseIsJitterAndGoesBySmoothing) {
  const double deviation_n = 0.5;
  const ForceError e = force_error(with_noise(sine(), deviation_n), sine(), kH_s);
  const double reference_rms_n = std::sqrt((100.0 + 9.0) / 2.0);
  const double expected = deviation_n * std::sqrt(3.0) / reference_rms_n;
  EXPECT_NEAR(e.rms, expected, 0.05 * expected);
  EXPECT_GT(e.jitter_ratio, 5.0);
  EXPECT_NEAR(e.smoothed_rms, expected / std::sqrt(41.0), 0.1 * expected);
  EXPECT_NEAR(e.time_offset_s, 0.0, kH_s);
}

TEST(ForceError, CoversTheCommonLength) {
  std::vector<Vec3> longer = sine();
  longer.emplace_back(1e6, 0.0, 0.0);
  EXPECT_EQ(force_error(longer, sine(), kH_s).max, 0.0);
  EXPECT_EQ(force_error({}, sine(), kH_s).rms, 0.0);
}

TEST(ForceError, OfAForceThatIsNoNumberIsNone) {
  std::vector<Vec3> force = sine();
  force[100].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(std::isfinite(force_error(force, sine(), kH_s).rms));
}

}  // namespace
}  // namespace subworld
