// The estimate is compared with known sums: a force that friction transmits, and impulses that an engine reports.
#include "physics/friction_estimate.hpp"

#include "physics/engine.hpp"
#include "support/bodies.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace subworld {
namespace {

using test::at;
using test::cube;
using test::floor_plane;

/// A stack of three cubes on a plane, pushed sideways in the middle. Steps an engine that reports friction, and returns
/// its tangential impulses and the estimate for the same step.
struct Compared {
  std::vector<Contact> reported;
  std::vector<Contact> estimated;
};

/// The estimate starts at `begin` times the reported impulses.
Compared compare(double push_n, int steps, double begin = 0.0) {
  constexpr double kDt = 0.001;
  const auto engine = make_engine(EngineSettings{}, {});
  engine->add(floor_plane(BodyId{0}), BodyState{});
  for (std::uint32_t i = 1; i <= 3; ++i) engine->add(cube(BodyId{i}), at(0, 0, 0.1 * i - 0.05));
  const Vec3 weight(0, 0, -9.81 * 0.2);
  std::vector<VelocityChange> changes(4);
  for (int n = 0; n < steps; ++n) {
    for (std::uint32_t i = 1; i <= 3; ++i) {
      const BodyState before = engine->state(BodyId{i});
      changes[i] = {.inverse_mass = 1.0 / 0.2,
                    .inverse_inertia = Eigen::Matrix3d::Identity() * (6.0 / (0.2 * 0.01)),
                    .centre = before.position,
                    .linear = -before.linear_velocity - kDt * weight / 0.2,
                    .angular = -before.angular_velocity};
    }
    engine->apply_force(BodyId{2}, {push_n, 0, 0}, Vec3::Zero());
    changes[2].linear.x() -= kDt * push_n / 0.2;
    engine->step(kDt);
  }
  for (std::uint32_t i = 1; i <= 3; ++i) {
    const BodyState after = engine->state(BodyId{i});
    changes[i].linear += after.linear_velocity;
    changes[i].angular += after.angular_velocity;
  }
  Compared result;
  result.reported.assign(engine->contacts().begin(), engine->contacts().end());
  result.estimated = result.reported;
  for (Contact& c : result.estimated) c.tangential_impulse *= begin;
  FrictionEstimate().estimate(changes, std::vector<double>(result.estimated.size(), 0.5), result.estimated);
  return result;
}

Vec3 friction_on(const std::vector<Contact>& contacts, BodyId id) {
  Vec3 sum = Vec3::Zero();
  for (const Contact& c : contacts) {
    if (c.a == id) sum += c.tangential_impulse;
    if (c.b == id) sum -= c.tangential_impulse;
  }
  return sum;
}

TEST(FrictionEstimate, SumsOnEveryBodyOfAStackAreThoseOfTheEngine) {
  for (const auto& [push_n, begin] : {std::pair{0.0, 0.0},
                                      {0.5, 0.0},
                                      {1.5, 0.0},
                                      {2.5, 0.0},  // the stack slides
                                      {0.5, 2.0},
                                      {1.5, -1.0},
                                      {2.5, 100.0}}) {
    const Compared result = compare(push_n, 40, begin);
    ASSERT_GE(result.reported.size(), 8U) << push_n;
    const double scale = std::max(0.1, push_n) * 0.001;
    for (std::uint32_t i = 1; i <= 3; ++i) {
      EXPECT_LT((friction_on(result.estimated, BodyId{i}) - friction_on(result.reported, BodyId{i})).norm(),
                0.05 * scale)
          << "body " << i << " pushed by " << push_n << " N, begun at " << begin;
    }
  }
}

TEST(FrictionEstimate, StaysInsideTheConeAndAcrossTheNormal) {
  const Compared result = compare(4.0, 200);
  for (const Contact& c : result.estimated) {
    EXPECT_LE(c.tangential_impulse.norm(), 0.5 * c.normal_impulse * (1.0 + 1e-9));
    EXPECT_NEAR(c.tangential_impulse.dot(c.normal), 0.0, 1e-15);
  }
}

TEST(FrictionEstimate, WithoutFrictionThereIsNone) {
  Compared result = compare(1.5, 50, 1.0);
  std::vector<VelocityChange> changes(4);
  for (VelocityChange& change : changes) change.linear = {1.0, 0.0, 0.0};
  FrictionEstimate().estimate(changes, std::vector<double>(result.estimated.size(), 0.0), result.estimated);
  for (const Contact& c : result.estimated) EXPECT_EQ(c.tangential_impulse, Vec3::Zero());
}

}  // namespace
}  // namespace subworld
