#include "coupling/sync/shared_islands.hpp"
#include "support/outside.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace subworld {
namespace {

constexpr double kCycle_s = 0.004;

/// Two users with the proxies 1 and 2, and cubes 3 to 6 on a floor.
class Shared : public testing::Test {
 protected:
  Shared() {
    world.scene.users.resize(2);
    world.scene.users[0].proxy = BodyId{1};
    world.scene.users[1].proxy = BodyId{2};
    world.scene.settings.users = 2;
    for (std::uint32_t u = 0; u < 2; ++u) {
      for (std::uint32_t i = 1; i <= 3; ++i) add(u, i, 0.0);
    }
    world.touch(1, 3, Vec3::UnitX(), 1.0);
    world.touch(3, 2, Vec3::UnitX(), 1.0);
  }
  void add(std::uint32_t user, std::uint32_t body, double x) {
    BodyState state;
    state.position.x() = x;
    state.linear_velocity.x() = 2.0 * x;
    reports[user].members.push_back({BodyId{body}, state});
    reports[user].islands.push_back(0);
  }
  void put(std::uint32_t user, std::uint32_t body, double x) {
    for (StampedBody& member : reports[user].members) {
      if (member.id == BodyId{body}) member.state.position.x() = x, member.state.linear_velocity.x() = 2.0 * x;
    }
  }
  /// After so many cycles.
  std::vector<MergedBody> merged(int cycles = 20) {
    SharedIslands islands(world.scene);
    std::vector<MergedBody> out;
    for (int k = 0; k <= cycles; ++k) {
      const std::vector<const HapticReport*> both{&reports[0], missing ? nullptr : &reports[1]};
      const auto now = islands.merge(world.contacts, both, kCycle_s);
      out.assign(now.begin(), now.end());
    }
    return out;
  }

  test::Outside world{6};
  HapticReport reports[2];
  bool missing = false;
};

TEST_F(Shared, TheMeanOfTheCopiesIsRightAndAProxyIsItsUsers) {
  put(0, 3, 1.0);
  put(1, 3, 3.0);
  put(0, 1, 0.1);
  put(1, 1, 0.2);
  put(0, 2, 0.3);
  put(1, 2, 0.4);
  const auto bodies = merged();
  ASSERT_EQ(bodies.size(), 3U);
  EXPECT_DOUBLE_EQ(bodies[0].mean.position.x(), 0.1);
  EXPECT_DOUBLE_EQ(bodies[1].mean.position.x(), 0.4);
  EXPECT_DOUBLE_EQ(bodies[2].mean.position.x(), 2.0);
  EXPECT_DOUBLE_EQ(bodies[2].mean.linear_velocity.x(), 4.0) << "the momentum of the mean is the mean of the momenta";
  for (const MergedBody& body : bodies) EXPECT_EQ(body.weight, 1.0);
}

TEST_F(Shared, AnIslandThatReachesOutOfOneOfThemIsTheWorlds) {
  world.touch(3, 4, Vec3::UnitX(), 1.0);
  EXPECT_TRUE(merged().empty()) << "4 is in none";
  add(0, 4, 0.0);
  EXPECT_TRUE(merged().empty()) << "4 is in one";
  add(1, 4, 0.0);
  EXPECT_EQ(merged().size(), 4U);
  reports[1].islands.assign(4, 0xFFFFFFFF);
  EXPECT_TRUE(merged().empty()) << "one sub-world has a contact with its outside";
}

TEST_F(Shared, AnIslandOfOneUserIsNotShared) {
  world.contacts.clear();
  for (HapticReport& report : reports) report.islands = {0, 1, 2};
  add(0, 5, 0.0);
  reports[0].islands.back() = 3;
  EXPECT_EQ(merged().size(), 3U) << "5 is in one sub-world alone";
}

TEST_F(Shared, WithoutAReportNothingIsShared) {
  missing = true;
  EXPECT_TRUE(merged().empty());
}

TEST_F(Shared, ACopyThatHasJustEnteredCountsLess) {
  EXPECT_TRUE(merged(0).empty());
  EXPECT_DOUBLE_EQ(merged(4).front().weight, 0.5);
  EXPECT_DOUBLE_EQ(merged(8).front().weight, 1.0);
}

TEST_F(Shared, ACopyThatMustGuessAnothersMotionCountsLess) {
  reports[1].peer_age_s = 0.25 * kCycle_s;
  EXPECT_DOUBLE_EQ(merged().front().weight, 0.75);
  reports[0].peer_age_s = kCycle_s;
  EXPECT_TRUE(merged().empty());
}

}  // namespace
}  // namespace subworld
