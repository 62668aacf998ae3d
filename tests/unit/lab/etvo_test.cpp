// Effective time and value offset of a force.

#include "lab/session/etvo.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace subworld {
namespace {

constexpr double kH_s = 1e-3;

/// Four smooth presses of 2 N within 2 s.
double press_n(double t_s) {
  double force_n = 0.0;
  for (const auto& [at_s, half_s] : {std::pair{0.3, 0.1}, {0.7, 0.15}, {1.2, 0.1}, {1.6, 0.12}}) {
    const double x = (t_s - at_s) / half_s;
    if (std::abs(x) < 1.0) force_n += 1.0 + std::cos(M_PI * x);
  }
  return force_n;
}

std::vector<Vec3> presses(double late_s, double factor, double step_s = kH_s) {
  std::vector<Vec3> force;
  for (double t_s = 0.0; t_s < 2.0 - 0.5 * step_s; t_s += step_s)
    force.emplace_back(0.0, 0.0, factor * press_n(t_s - late_s));
  return force;
}

TEST(Etvo, IsNoneOfEqualForces) {
  const Etvo none = etvo(presses(0, 1), presses(0, 1), kH_s);
  EXPECT_EQ(none.time_p99_s, 0.0);
  EXPECT_EQ(none.value_p99_n, 0.0);
}

TEST(Etvo, FindsAKnownDelayWithoutAnOffsetOfValue) {
  for (const double late_s : {0.02, 0.1, -0.05}) {
    const Etvo late = etvo(presses(late_s, 1), presses(0, 1), kH_s);
    EXPECT_NEAR(late.time_p50_s, std::abs(late_s), 1e-9);
    EXPECT_NEAR(late.time_p99_s, std::abs(late_s), 0.002);
    EXPECT_LT(late.value_p50_n, 1e-9);
  }
  const Etvo fine = etvo(presses(0.02, 1, 0.25e-3), presses(0, 1, 0.25e-3), 0.25e-3);
  EXPECT_NEAR(fine.time_p50_s, 0.02, 1e-9);
}

// Of a force that is constant while it is felt, nothing can be explained by a delay.
TEST(Etvo, FindsAKnownOffsetOfValueWithoutADelay) {
  std::vector<Vec3> reference(1000, Vec3::Zero());
  std::fill(reference.begin() + 200, reference.begin() + 700, Vec3(1.0, 2.0, 2.0));
  std::vector<Vec3> force = reference;
  for (Vec3& f : force) f *= 1.2;
  const Etvo scaled = etvo(force, reference, kH_s);
  EXPECT_NEAR(scaled.value_p50_n, 0.6, 1e-9);
  EXPECT_NEAR(scaled.value_p99_n, 0.6, 1e-9);
  EXPECT_EQ(scaled.time_p99_s, 0.0);
}

TEST(Etvo, TakesNoiseForAnOffsetOfValue) {
  std::vector<Vec3> noisy = presses(0, 1);
  for (std::size_t i = 0; i < noisy.size(); ++i) noisy[i].x() += i % 2 == 0 ? 0.01 : -0.01;
  const Etvo noise = etvo(noisy, presses(0, 1), kH_s);
  EXPECT_EQ(noise.time_p99_s, 0.0);
  EXPECT_NEAR(noise.value_p50_n, 0.01, 1e-9);
}

TEST(Etvo, IsUnknownWithoutAForce) {
  const std::vector<Vec3> none(100, Vec3::Zero());
  EXPECT_TRUE(std::isnan(etvo(none, none, kH_s).time_p50_s));
  EXPECT_TRUE(std::isnan(etvo({}, {}, kH_s).value_p50_n));
}

}  // namespace
}  // namespace subworld
