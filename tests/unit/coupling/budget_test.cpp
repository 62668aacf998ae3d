#include "coupling/select/budget.hpp"
#include "support/outside.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace subworld {
namespace {

using test::kFloor;
using test::kStep_s;

/// One second a body and one a contact point: costs are counts.
constexpr StepCost kCountBodies{.body_s = 1.0};
constexpr StepCost kCountContacts{.contact_s = 1.0};

/// Cubes on a floor; the first is the proxy.
class Budgets : public testing::Test {
 protected:
  void make(std::uint32_t cubes) {
    world.emplace(cubes);
    centres.assign(cubes + 1, Vec3::Zero());
    candidates.clear();
    for (std::uint32_t i = 1; i <= cubes; ++i) candidates.push_back(BodyId{i});
  }
  std::vector<BodyId> chosen(const Budget& budget, std::vector<BodyId> present = {},
                             std::vector<PeerContact> peers = {}) {
    ContactGraph graph;
    graph.build(world->contacts, world->scene.bodies.size());
    if (!selector) selector.emplace(world->scene);
    std::vector<BodyId> members = candidates;
    const auto bounds = [&](BodyId id) {
      return Box{centres[index(id)] - Vec3::Constant(0.05), centres[index(id)] + Vec3::Constant(0.05)};
    };
    selector->limit(BodyId{1}, present, graph, kStep_s, peers, bounds, budget, members);
    return members;
  }

  std::optional<test::Outside> world;
  std::optional<BudgetSelector> selector;
  std::vector<Vec3> centres;
  std::vector<BodyId> candidates;
};

std::vector<BodyId> ids(std::initializer_list<std::uint32_t> numbers) {
  std::vector<BodyId> list;
  for (const std::uint32_t n : numbers) list.push_back(BodyId{n});
  return list;
}

TEST_F(Budgets, EveryBodyIsAMemberIfTheBudgetAllows) {
  make(4);
  EXPECT_EQ(chosen({.limit_s = 4.0, .cost = kCountBodies}), candidates);
  EXPECT_EQ(selector->omitted(), 0U);
  EXPECT_DOUBLE_EQ(selector->cost_s(), 4.0);
}

TEST_F(Budgets, TheProxyStaysWhateverItCosts) {
  make(3);
  EXPECT_EQ(chosen({.limit_s = 1e-9, .cost = kCountBodies}), ids({1}));
  EXPECT_EQ(selector->omitted(), 2U);
}

TEST_F(Budgets, ARowEntersFromTheProxyOn) {
  make(5);
  for (const std::uint32_t i : {4U, 2U, 1U, 3U}) world->touch(i, i + 1, Vec3::UnitX(), 1.0);
  for (int size = 1; size <= 5; ++size) {
    const auto members = chosen({.limit_s = size + 0.5, .cost = kCountBodies});
    EXPECT_EQ(members, std::vector(candidates.begin(), candidates.begin() + size));
  }
}

// A peer who barely touches a body may press it with any force in the next step.
TEST_F(Budgets, APeerCountsAsMuchAsTheBodyThatItTouches) {
  make(5);
  world->touch(1, 2, Vec3::UnitX(), 10.0);
  world->touch(2, 3, Vec3::UnitX(), 10.0);
  world->touch(2, 4, Vec3::UnitY(), 1e-3);
  world->scene.bodies[4].mass = 1e-3;
  EXPECT_EQ(chosen({.limit_s = 3.5, .cost = kCountBodies}), ids({1, 2, 3}));
  EXPECT_EQ(chosen({.limit_s = 3.5, .cost = kCountBodies}, {}, {{BodyId{2}, BodyId{4}}}), ids({1, 2, 4}));
}

TEST_F(Budgets, TheMoreLoadedNeighbourAndTheHeavierOneComeFirst) {
  make(3);
  world->touch(1, 2, Vec3::UnitX(), 1.0);
  world->touch(1, 3, Vec3::UnitY(), 5.0);
  EXPECT_EQ(chosen({.limit_s = 2.5, .cost = kCountBodies}), ids({1, 3}));
  make(3);
  selector.reset();
  world->scene.bodies[2].mass = 3.0;
  world->touch(1, 2, Vec3::UnitX(), 1.0);
  world->touch(1, 3, Vec3::UnitY(), 1.0);
  EXPECT_EQ(chosen({.limit_s = 2.5, .cost = kCountBodies}), ids({1, 2}));
}

TEST_F(Budgets, UnconnectedBodiesComeLastByDistance) {
  make(4);
  centres[2] = Vec3(0.5, 0, 0);
  centres[3] = Vec3(0.2, 0, 0);
  centres[4] = Vec3(0.9, 0, 0);
  world->touch(1, 4, Vec3::UnitX(), 1e-3);
  EXPECT_EQ(chosen({.limit_s = 2.5, .cost = kCountBodies}), ids({1, 4}));
  EXPECT_EQ(chosen({.limit_s = 3.5, .cost = kCountBodies}), ids({1, 3, 4}));
}

TEST_F(Budgets, ABodyThatTouchesAMemberCountsInTheCost) {
  make(3);
  world->touch(1, 2, Vec3::UnitX(), 1.0);
  world->touch(2, 3, Vec3::UnitX(), 1.0);
  const Budget two{.limit_s = 2.5, .cost = kCountBodies, .simulates_border = true};
  EXPECT_EQ(chosen(two), ids({1}));  // and 2 as its ghost; as a member, 2 would have the ghost 3
  EXPECT_DOUBLE_EQ(selector->cost_s(), 2.0);
  EXPECT_EQ(chosen({.limit_s = 9.0, .cost = kCountBodies, .simulates_border = true}), ids({1, 2, 3}));
  EXPECT_DOUBLE_EQ(selector->cost_s(), 3.0);  // a ghost that becomes a member was already counted
  EXPECT_EQ(chosen({.limit_s = 2.5, .cost = kCountBodies}), ids({1, 2}));  // without ghosts, the outside costs nothing
}

TEST_F(Budgets, ContactsAreThoseThatAStepHas) {
  make(3);
  for (int point = 0; point < 4; ++point) {
    world->touch(1, 2, Vec3::UnitX(), 1.0);
    world->touch(2, 3, Vec3::UnitX(), 1.0);
    world->touch(2, index(kFloor), Vec3::UnitZ(), 1.0);
  }
  candidates = ids({1, 2});
  (void)chosen({.limit_s = 100.0, .cost = kCountContacts, .simulates_border = true});
  EXPECT_DOUBLE_EQ(selector->cost_s(), 12.0);
  (void)chosen({.limit_s = 100.0, .cost = kCountContacts});
  EXPECT_DOUBLE_EQ(selector->cost_s(), 8.0);
}

TEST_F(Budgets, NoiseInTheLoadsExchangesNoMember) {
  make(3);
  const Budget two{.limit_s = 2.5, .cost = kCountBodies};
  world->touch(1, 2, Vec3::UnitX(), 1.0);
  world->touch(1, 3, Vec3::UnitY(), 1.2);
  EXPECT_EQ(chosen(two), ids({1, 3}));
  EXPECT_EQ(chosen(two, ids({1, 2})), ids({1, 2}));
  world->contacts.back().normal_impulse *= 5.0;  // more than noise
  EXPECT_EQ(chosen(two, ids({1, 2})), ids({1, 3}));
}

TEST_F(Budgets, MembersStayALittleAboveTheLimitThatKeepsOthersOut) {
  make(2);
  const Budget tight{.limit_s = 1.9, .cost = kCountBodies};
  EXPECT_EQ(chosen(tight), ids({1}));
  EXPECT_EQ(chosen(tight, ids({1, 2})), ids({1, 2}));
  EXPECT_EQ(chosen({.limit_s = 1.5, .cost = kCountBodies}, ids({1, 2})), ids({1}));
}

TEST(Correction, FollowsWhatStepsTake) {
  CostCorrection correction;
  EXPECT_EQ(correction.factor(), 1.0);
  for (int i = 0; i < 500; ++i) correction.observe(1e-4, 2e-4);
  EXPECT_NEAR(correction.factor(), 2.0, 0.2);
  for (int i = 0; i < 500; ++i) correction.observe(1e-4, 0.5e-4);
  EXPECT_NEAR(correction.factor(), 0.5, 0.05);
}

TEST(Correction, IgnoresTheFewStepsThatTheOsDelayed) {
  CostCorrection correction;
  for (int i = 0; i < 2000; ++i) correction.observe(1e-4, i % 10 == 0 ? 1.0 : 1e-4);
  EXPECT_EQ(correction.factor(), 1.0);
}

TEST(Correction, IgnoresWhatIsUnknownOrNonsense) {
  CostCorrection correction;
  for (int i = 0; i < 100; ++i) {
    correction.observe(1e-4, 0.0);
    correction.observe(1e-4, NAN);
    correction.observe(0.0, 1.0);
    correction.observe(1e-4, -1.0);
  }
  EXPECT_EQ(correction.factor(), 1.0);
}

}  // namespace
}  // namespace subworld
