#include "coupling/tool/impulse_account.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>

namespace subworld {
namespace {

constexpr double kT_s = 0.005;
constexpr ForceLimits kOfDevice{.force_n = 40.0, .torque_n_m = 2.0, .torques = true};

/// The report of a user who pushes with a force that varies.
HapticReport pushed(std::uint64_t stamp) {
  HapticReport report;
  report.stamp = stamp;
  report.stamp_s = kT_s * static_cast<double>(stamp);
  const double phase = 0.3 * static_cast<double>(stamp);
  report.impulse_total = {{0.02 * (1.0 - std::cos(phase)), 0.01 * std::sin(phase), 0.001 * phase},
                          {0.0, 0.001 * std::sin(phase), 0.0}};
  return report;
}

/// What arrives so late that `newest` is all that the world has in a cycle.
Wrench passed(ImpulseAccount& account, std::uint64_t before, std::uint64_t newest, std::uint64_t stamp) {
  const Wrench mean = account.pass(pushed(before), pushed(newest), kOfDevice, kT_s * static_cast<double>(stamp));
  return {kT_s * mean.force, kT_s * mean.torque};
}

TEST(ImpulseAccount, PassesOnTheMeanWrenchOfTheCycle) {
  ImpulseAccount account;
  for (std::uint64_t j = 1; j < 50; ++j) {
    const Vec3 impulse = passed(account, j - 1, j, j).force;
    EXPECT_TRUE(impulse.isApprox(pushed(j).impulse_total.force - pushed(j - 1).impulse_total.force, 1e-12)) << j;
  }
}

// Reports that are late by up to ten cycles, come in bursts, or are lost: the sum is the user's impulse.
TEST(ImpulseAccount, LosesNoImpulseAndCountsNoneTwice) {
  std::mt19937 random(1);
  for (int run = 0; run < 20; ++run) {
    ImpulseAccount account;
    Wrench sum;
    std::uint64_t before = 0, newest = 0;
    for (std::uint64_t j = 1; j <= 400; ++j) {
      if (j == 400 || random() % 10 < 4) {
        before = newest;
        newest = j;
      }
      const Wrench impulse = passed(account, before, newest, j);
      sum.force += impulse.force;
      sum.torque += impulse.torque;
      ASSERT_LE(impulse.force.norm(), kT_s * kOfDevice.force_n * (1.0 + 1e-9));
    }
    EXPECT_LT((sum.force - pushed(400).impulse_total.force).norm(), 1e-9 * sum.force.norm()) << run;
    EXPECT_LT((sum.torque - pushed(400).impulse_total.torque).norm(), 1e-9) << run;
  }
}

TEST(ImpulseAccount, DoesNotGuessForEver) {
  ImpulseAccount account;
  for (std::uint64_t j = 1; j <= 4; ++j) (void)passed(account, j - 1, j, j);
  Vec3 guessed = Vec3::Zero();
  for (std::uint64_t j = 5; j <= 200; ++j) guessed += passed(account, 3, 4, j).force;
  const Vec3 slope = (pushed(4).impulse_total.force - pushed(3).impulse_total.force) / kT_s;
  EXPECT_LT((guessed - kLongestGuess_s * slope).norm(), 1e-12);
}

TEST(ImpulseAccount, SpreadsALargeCorrectionOverSeveralCycles) {
  HapticReport before, now;
  now.impulse_total.force = {1.0, 0.0, 0.0};
  ImpulseAccount account;
  double sum = 0.0;
  for (int j = 1; j <= 10; ++j) {
    now.stamp_s = kT_s * j;
    before.stamp_s = now.stamp_s - kT_s;
    const double force_n = account.pass(before, now, kOfDevice, now.stamp_s).force.x();
    EXPECT_LE(force_n, 40.0 * (1.0 + 1e-9));
    sum += kT_s * force_n;
  }
  EXPECT_NEAR(sum, 1.0, 1e-12);
}

}  // namespace
}  // namespace subworld
