#include "coupling/select/peers.hpp"
#include "support/outside.hpp"

#include <gtest/gtest.h>

#include <map>
#include <vector>

namespace subworld {
namespace {

using test::kFloor;

std::vector<BodyId> numbered(std::initializer_list<std::uint32_t> numbers) {
  std::vector<BodyId> list;
  for (const std::uint32_t n : numbers) list.push_back(BodyId{n});
  return list;
}

/// Cubes on a floor; cube 1 is the own proxy.
class Peers : public testing::Test {
 protected:
  /// The bodies of the sub-world, of which `inside` are there anyway.
  std::vector<BodyId> found(std::initializer_list<std::uint32_t> peers, std::initializer_list<std::uint32_t> inside) {
    ContactGraph graph;
    graph.build(world.contacts, world.scene.bodies.size());
    std::vector<BodyId> bodies;
    const auto reach = [this](BodyId proxy, std::vector<BodyId>& out) { out = numbered(reachable[index(proxy)]); };
    const auto fits = [this](std::size_t island, std::size_t contacts) { return island + contacts <= most; };
    PeerFinder finder(world.scene);
    std::vector<BodyId> proxies = numbered(peers);
    proxies.insert(proxies.begin(), BodyId{1});
    for (int again = 0; again < 2; ++again) {  // a search leaves nothing behind
      bodies = numbered(inside);
      finder.begin(world.contacts, proxies, reach);
      const auto links = finder.find(BodyId{1}, graph, reach, fits, bodies);
      last.assign(links.begin(), links.end());
    }
    return bodies;
  }

  test::Outside world{9};
  std::map<std::uint32_t, std::initializer_list<std::uint32_t>> reachable;
  std::size_t most = 100;  ///< bodies and contacts of an island that fits
  std::vector<PeerContact> last;
};

TEST_F(Peers, ContactsLeadToOneAtAnyDistance) {
  for (std::uint32_t i = 1; i < 6; ++i) world.touch(i, i + 1, Vec3::UnitX(), 1.0);
  EXPECT_EQ(found({8}, {1, 2}), numbered({1, 2})) << "no contact leads to it";
  EXPECT_EQ(found({6}, {1, 2}), numbered({1, 2, 3, 4, 5, 6}));
  ASSERT_EQ(last.size(), 1U);
  EXPECT_EQ(last[0].body, BodyId{5});
  EXPECT_EQ(last[0].proxy, BodyId{6});
}

TEST_F(Peers, TheWholeIslandBelongsAndTheShortestChainCounts) {
  for (std::uint32_t i = 1; i < 6; ++i) world.touch(i, i + 1, Vec3::UnitX(), 1.0);
  world.touch(1, 7, Vec3::UnitY(), 1.0);
  world.touch(7, 6, Vec3::UnitY(), 1.0);
  EXPECT_EQ(found({6}, {1}), numbered({1, 2, 3, 4, 5, 6, 7}));
  ASSERT_EQ(last.size(), 1U);
  EXPECT_EQ(last[0].body, BodyId{7});
}

TEST_F(Peers, OfAnIslandThatIsTooLargeTheChainBelongs) {
  for (std::uint32_t i = 1; i < 6; ++i) world.touch(i, i + 1, Vec3::UnitX(), 1.0);
  world.touch(2, 8, Vec3::UnitY(), 1.0);
  world.touch(3, 0, Vec3::UnitZ(), 1.0);
  most = 14;  // 7 bodies, 7 contacts
  EXPECT_EQ(found({4}, {1}), numbered({1, 2, 3, 4, 5, 6, 8}));
  most = 13;
  EXPECT_EQ(found({4}, {1}), numbered({1, 2, 3, 4}));
}

TEST_F(Peers, AFixedBodyConnectsNobody) {
  world.touch(1, 0, Vec3::UnitZ(), 1.0);
  world.touch(6, 0, Vec3::UnitZ(), 1.0);
  reachable = {{1, {0}}, {6, {0}}};
  EXPECT_EQ(found({6}, {1, 2}), numbered({1, 2}));
  EXPECT_TRUE(last.empty());
}

TEST_F(Peers, OneThatMayTouchTheChainSoonIsInsideBeforeItDoes) {
  world.touch(1, 2, Vec3::UnitX(), 1.0);
  world.touch(2, 3, Vec3::UnitX(), 1.0);
  EXPECT_EQ(found({6}, {1}), numbered({1}));
  reachable = {{6, {3, 6}}};
  EXPECT_EQ(found({6}, {1}), numbered({1, 2, 3, 6}));
  world.contacts.erase(world.contacts.begin());  // the own proxy does not touch it yet either
  EXPECT_EQ(found({6}, {1}), numbered({1}));
  reachable = {{6, {3, 6}}, {1, {1, 2}}};
  EXPECT_EQ(found({6}, {1}), numbered({1, 2, 3, 6}));
}

TEST_F(Peers, EachPeerIsFound) {
  world.touch(1, 2, Vec3::UnitX(), 1.0);
  world.touch(2, 3, Vec3::UnitX(), 1.0);
  world.touch(2, 4, Vec3::UnitY(), 1.0);
  EXPECT_EQ(found({3, 4, 8}, {1}), numbered({1, 2, 3, 4}));
  EXPECT_EQ(last.size(), 2U);
}

}  // namespace
}  // namespace subworld
