#include "physics/contact_totals.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <vector>

namespace subworld {
namespace {

Contact contact(std::uint32_t a, std::uint32_t b, double x, double normal_impulse) {
  Contact made;
  made.a = BodyId{a};
  made.b = BodyId{b};
  made.point = Vec3(x, 0, 0);
  made.normal_impulse = normal_impulse;
  made.tangential_impulse = Vec3(0, 0.5 * normal_impulse, 0);
  return made;
}

TEST(ContactTotals, ListsPairsByBodiesAndPointsInTheOrderOfAdding) {
  ContactTotals totals;
  totals.add(contact(3, 4, 0.2, 1), 0, 0.01);
  totals.add(contact(1, 9, 0.0, 2), 0, 0.01);
  totals.add(contact(3, 4, 0.1, 3), 0, 0.01);
  totals.add(contact(1, 2, 0.0, 4), 0, 0.01);
  totals.merge();
  std::vector<double> impulses;
  for (const Contact& c : totals.contacts()) impulses.push_back(c.normal_impulse);
  EXPECT_EQ(impulses, (std::vector<double>{4, 2, 1, 3}));
}

TEST(ContactTotals, AddsUpAPointThatSeveralSubstepsSaw) {
  ContactTotals totals;
  for (int substep = 0; substep < 3; ++substep) {
    totals.add(contact(1, 2, 0.100 + 0.001 * substep, 1), substep, 0.01);
    totals.add(contact(1, 2, 0.200 + 0.001 * substep, 10), substep, 0.01);
    totals.add(contact(0, 7, 0.100, 100), substep, 0.01);
  }
  totals.merge();
  ASSERT_EQ(totals.contacts().size(), 3U);
  EXPECT_EQ(totals.contacts()[0].normal_impulse, 300);
  EXPECT_EQ(totals.contacts()[1].normal_impulse, 3);
  EXPECT_EQ(totals.contacts()[1].tangential_impulse, Vec3(0, 1.5, 0));
  EXPECT_DOUBLE_EQ(totals.contacts()[1].point.x(), 0.102) << "the place is that of the last sub-step";
  EXPECT_EQ(totals.contacts()[2].normal_impulse, 30);
}

TEST(ContactTotals, KeepsNearPointsOfOneSubstepApart) {
  ContactTotals totals;
  totals.add(contact(1, 2, 0.100, 1), 0, 0.01);
  totals.add(contact(1, 2, 0.101, 2), 0, 0.01);
  totals.merge();
  EXPECT_EQ(totals.contacts().size(), 2U);
}

TEST(ContactTotals, ForgetsWhatWasBeforeClear) {
  ContactTotals totals;
  totals.add(contact(1, 2, 0.1, 1), 0, 0.01);
  totals.clear();
  totals.add(contact(1, 2, 0.1, 5), 0, 0.01);
  totals.merge();
  ASSERT_EQ(totals.contacts().size(), 1U);
  EXPECT_EQ(totals.contacts()[0].normal_impulse, 5);
}

}  // namespace
}  // namespace subworld
