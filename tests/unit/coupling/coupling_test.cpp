#include "coupling/messages/delay.hpp"
#include "coupling/safety/force_guard.hpp"
#include "coupling/safety/passivity.hpp"
#include "coupling/schemes/paper/paper.hpp"
#include "coupling/schemes/scheme.hpp"
#include "coupling/select/border.hpp"
#include "coupling/select/contact_graph.hpp"
#include "coupling/select/selection.hpp"
#include "coupling/sync/blend.hpp"
#include "coupling/sync/synchroniser.hpp"
#include "coupling/tool/tool.hpp"
#include "coupling/tool/virtual_coupling.hpp"
#include "model/error.hpp"
#include "support/bodies.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>
#include <vector>

namespace subworld {
namespace {

using test::at;
using test::ball_proxy;

TEST(Selection, MembersAreMovableAndAlwaysHoldTheProxy) {
  const std::vector<Body> bodies{test::floor_plane(BodyId{0}), test::cube(BodyId{1}), test::cube(BodyId{2}),
                                 ball_proxy(BodyId{3})};
  Membership m;
  select_members(std::vector{BodyId{0}, BodyId{2}}, bodies, BodyId{3}, m);
  EXPECT_EQ(m.members, (std::vector{BodyId{2}, BodyId{3}}));
  select_fixed(std::vector{BodyId{0}, BodyId{1}, BodyId{2}}, {}, bodies, m);
  EXPECT_EQ(m.fixed, std::vector{BodyId{0}});
  EXPECT_TRUE(m.holds(BodyId{0}));
  EXPECT_FALSE(m.holds(BodyId{1}));
  // A fixed body in contact with a member is inside, even if its bounds do not reach the box.
  select_fixed({}, std::vector{Contact{.a = BodyId{0}, .b = BodyId{2}}, Contact{.a = BodyId{0}, .b = BodyId{1}}},
               bodies, m);
  EXPECT_EQ(m.fixed, (std::vector{BodyId{0}}));
}

Contact contact(unsigned a, unsigned b, double normal_impulse, const Vec3& tangential = Vec3::Zero()) {
  Contact c;
  c.a = BodyId{a};
  c.b = BodyId{b};
  c.normal = Vec3::UnitZ();
  c.normal_impulse = normal_impulse;
  c.tangential_impulse = tangential;
  return c;
}

// Figure 9: of five contacts two cross the boundary, each with its own border body.
TEST(Border, Figure9CountsContactsThatCrossTheBoundary) {
  const Membership m{.members = {BodyId{1}, BodyId{2}, BodyId{3}}, .fixed = {BodyId{0}}};
  const std::vector contacts{contact(0, 1, 1.0), contact(1, 2, 2.0), contact(2, 5, 3.0, {0.5, 0, 0}),
                             contact(3, 4, 4.0), contact(4, 5, 5.0)};
  std::vector<BoundaryContact> border;
  extract_border(contacts, m, border);
  ASSERT_EQ(border.size(), 2U);
  EXPECT_EQ(border[0].inside, BodyId{2});
  EXPECT_EQ(border[0].outside, BodyId{5});
  EXPECT_EQ(border[0].normal, Vec3(0, 0, 1));  // b to a, and a is inside
  EXPECT_EQ(border[0].tangential_impulse, Vec3(0.5, 0, 0));
  std::vector<BodyId> bodies;
  border_bodies(border, bodies);
  EXPECT_EQ(bodies, (std::vector{BodyId{2}, BodyId{3}}));
}

TEST(Border, ImpulsesActOnTheInsideBodyWhicheverSideItIs) {
  const Membership m{.members = {BodyId{5}}, .fixed = {}};
  std::vector<BoundaryContact> border;
  extract_border(std::vector{contact(2, 5, 3.0, {0.5, 0, 0})}, m, border);
  ASSERT_EQ(border.size(), 1U);
  EXPECT_EQ(border[0].normal, Vec3(0, 0, -1));
  EXPECT_EQ(border[0].tangential_impulse, Vec3(-0.5, 0, 0));
  std::vector<PointImpulse> impulses;
  frozen_impulses(border, 0.25, impulses);
  EXPECT_EQ(impulses[0].impulse, Vec3(-0.125, 0, -0.75));
}

// Figure 8 a: members with contacts only among themselves and with the floor have no border.
TEST(Border, Figure8aClosedSubWorldHasNone) {
  const Membership m{.members = {BodyId{1}, BodyId{2}}, .fixed = {BodyId{0}}};
  std::vector<BoundaryContact> border;
  extract_border(std::vector{contact(0, 1, 1.0), contact(1, 2, 1.0), contact(3, 4, 1.0)}, m, border);
  EXPECT_TRUE(border.empty());
}

TEST(Blend, WeightFollowsTheFourIndicators) {
  const PaperSettings settings;
  Indicators i{.proxy_impulse_n_s = 1.0,
               .total_impulse_n_s = 4.0,
               .device_impulse_n_s = 1.0,
               .border_bodies = 2,
               .proxy_contacts = 3};
  EXPECT_DOUBLE_EQ(blend_weight(i, settings), 0.5);
  i.proxy_contacts = 0;
  EXPECT_EQ(blend_weight(i, settings), 0.0);
  i.border_bodies = 0;
  EXPECT_EQ(blend_weight(i, settings), 1.0);
  i.proxy_contacts = 1;
  EXPECT_EQ(blend_weight(i, settings), 1.0);
  i.border_bodies = 1;
  i.device_impulse_n_s = 0.5 * settings.device_impulse_threshold_n_s;
  EXPECT_EQ(blend_weight(i, settings), 0.0);
  i.device_impulse_n_s = 1.0;
  i.total_impulse_n_s = 0.0;
  EXPECT_EQ(blend_weight(i, settings), 0.0);
  i.total_impulse_n_s = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(blend_weight(i, settings), 0.0);
}

TEST(Blend, ShiftIsTheDifferenceAndStatesMeetInTheMiddle) {
  BodyState a = at(1, 2, 3), b = at(2, 2, 2);
  b.orientation = Quat(Eigen::AngleAxisd(0.5, Vec3::UnitZ()));
  b.linear_velocity = Vec3(1, 0, 0);
  const BodyState back = shifted(a, difference(a, b));
  EXPECT_LT((back.position - b.position).norm(), 1e-15);
  EXPECT_LT(back.orientation.angularDistance(b.orientation), 1e-7);
  const BodyState half = blend(a, b, 0.5);
  EXPECT_LT((half.position - Vec3(1.5, 2, 2.5)).norm(), 1e-15);
  EXPECT_NEAR(half.orientation.angularDistance(a.orientation), 0.25, 1e-7);
}

TEST(Blend, AShareOfARotationIsThatOfASlerp) {
  for (const double angle : {0.0, 1e-9, 1e-3, 0.059, 0.061, 2.0, -0.05}) {
    for (const double part : {0.0, 0.1, 0.8, 1.0}) {
      const Quat turn(Eigen::AngleAxisd(angle, Vec3(1, -2, 2).normalized()));
      for (const Quat& same : {turn, Quat(-turn.coeffs())}) {
        const Quat expected = Quat::Identity().slerp(part, same);
        const Quat found = scaled({.rotation = same}, part).rotation;
        EXPECT_LT((found.coeffs() - expected.coeffs()).norm(), 1e-12) << angle << " rad, " << part;
      }
    }
  }
}

TEST(VirtualCoupling, IsASpringAndDamperUpToTheLimit) {
  const CouplingSettings k{.stiffness_n_m = 1000, .damping_n_s_m = 20};
  const ForceLimits limits{.force_n = 40};
  BodyState proxy = at(0, 0, 0);
  proxy.linear_velocity = Vec3(0.1, 0, 0);
  DevicePose device{{Vec3(0.01, 0, 0), Quat::Identity()}, Vec3(0.3, 0, 0), Vec3::Zero()};
  EXPECT_NEAR(coupling_wrench(k, limits, proxy, device).force.x(), 10.0 + 4.0, 1e-12);
  device.pose.position.x() = 1.0;
  EXPECT_NEAR(coupling_wrench(k, limits, proxy, device).force.norm(), 40.0, 1e-12);
  EXPECT_EQ(coupling_wrench(k, limits, proxy, device).torque, Vec3::Zero());
}

/// Free proxy of 0.1 kg under the implicit coupling to a device at rest, dt far beyond the explicit limit.
TEST(VirtualCoupling, ImplicitStepIsStableAtAnyStep) {
  const CouplingSettings k{.stiffness_n_m = 1e5, .damping_n_s_m = 1.0};
  const ForceLimits limits{.force_n = 1e9};
  const Body body = ball_proxy(BodyId{0});
  BodyState proxy = at(0.01, 0, 0);
  const DevicePose device{};
  constexpr double dt = 0.02;
  double energy = 1e9;
  for (int i = 0; i < 200; ++i) {
    const ImplicitStep step = implicit_step(k, limits, body, proxy, device, dt);
    BodyState next = step.start;
    next.linear_velocity += dt / step.mass * step.wrench.force;
    next.position += dt * next.linear_velocity;
    const Wrench mean = exerted(k, limits, step, next, dt);
    EXPECT_NEAR((body.mass * (next.linear_velocity - proxy.linear_velocity)).x(), dt * mean.force.x(), 1e-9);
    proxy = next;
    const double now =
        0.5 * body.mass * proxy.linear_velocity.squaredNorm() + coupling_energy(k, limits, proxy, device);
    EXPECT_LE(now, energy);
    energy = now;
  }
  EXPECT_LT(proxy.position.norm(), 1e-4);
}

/// A coupling far too stiff for its limit switches between spring and limit in every step; the limit bounds its power.
TEST(VirtualCoupling, SaturationBoundsTheEnergy) {
  const CouplingSettings k{.stiffness_n_m = 1e6, .damping_n_s_m = 20.0};
  const ForceLimits limits{.force_n = 40.0};
  const Body body = ball_proxy(BodyId{0});
  BodyState proxy = at(0.01, 0.003, -0.002);
  DevicePose device;
  constexpr double dt = 0.001;
  for (int i = 0; i < 20000; ++i) {
    device.pose.position.x() = 0.05 * std::sin(0.002 * i);
    device.linear_velocity.x() = 0.1 * std::cos(0.002 * i);
    const ImplicitStep step = implicit_step(k, limits, body, proxy, device, dt);
    const Vec3 before = proxy.linear_velocity;
    proxy = step.start;
    proxy.linear_velocity += dt / step.mass * step.wrench.force;
    proxy.position += dt * proxy.linear_velocity;
    ASSERT_LE(exerted(k, limits, step, proxy, dt).force.norm(), limits.force_n * (1.0 + 1e-9));
    ASSERT_LE(body.mass * (proxy.linear_velocity - before).norm(), dt * limits.force_n * (1.0 + 1e-9));
    ASSERT_LE((proxy.position - device.pose.position).norm(), 0.02);
  }
}

TEST(VirtualCoupling, TorqueTurnsTheProxyTowardsTheDevice) {
  const CouplingSettings k;
  const ForceLimits limits{.force_n = 40, .torque_n_m = 2, .torques = true};
  DevicePose device;
  device.pose.orientation = Quat(Eigen::AngleAxisd(0.2, Vec3::UnitY()));
  const Wrench w = coupling_wrench(k, limits, at(0, 0, 0), device);
  EXPECT_NEAR(w.torque.y(), 0.2 * k.rotational_stiffness_n_m, 1e-9);
  device.pose.orientation.coeffs() = -device.pose.orientation.coeffs();  // the same rotation
  EXPECT_NEAR(coupling_wrench(k, limits, at(0, 0, 0), device).torque.y(), 0.2 * k.rotational_stiffness_n_m, 1e-9);
}

struct ToolMotion {
  std::vector<BodyState> proxy;  ///< velocities in wall time
  std::vector<Wrench> wrench;
};

/// A free tool of six degrees of freedom whose device oscillates and turns, in 300 steps of 1 ms of wall time, on a
/// clock of which step i covers rate(i).
template <class Rate>
ToolMotion oscillate(Rate&& rate) {
  UserSpec user;
  user.coupling = {.stiffness_n_m = 1000, .damping_n_s_m = 5};
  const ForceLimits limits{.force_n = 40, .torque_n_m = 2, .torques = true};
  Body ball = ball_proxy(BodyId{0});
  ball.inertia = Vec3(1e-4, 2e-4, 3e-4);
  ball.rotates = true;
  constexpr double h = 0.001;
  ToolMotion seen;
  BodyState proxy;
  double now = rate(0);
  for (int i = 0; i < 300; ++i) {
    const double before = std::exchange(now, rate(i));
    proxy = at_rate(proxy, before, now);
    const Tool tool = tool_at(now, user, ball);
    const double t = i * h;
    DevicePose device{{Vec3(0.02 * std::sin(9.0 * t), 0.01 * t, 0), Quat(Eigen::AngleAxisd(2.0 * t, Vec3::UnitY()))},
                      Vec3(0.18 * std::cos(9.0 * t), 0.01, 0),
                      Vec3(0, 2.0, 0)};
    device.linear_velocity /= now;
    device.angular_velocity /= now;
    const double dt = now * h;
    const ImplicitStep step = implicit_step(tool.coupling, limits, tool.body, proxy, device, dt);
    const Quat to_body = proxy.orientation.conjugate();
    proxy = step.start;
    proxy.linear_velocity += dt / step.mass * step.wrench.force;
    proxy.angular_velocity +=
        to_body.conjugate() * Vec3((dt * (to_body * step.wrench.torque)).cwiseQuotient(step.inertia));
    proxy = advanced(proxy, dt);
    seen.wrench.push_back(exerted(tool.coupling, limits, step, proxy, dt));
    seen.proxy.push_back(at_rate(proxy, now, 1.0));
  }
  return seen;
}

// The proxy runs in wall time: with any clock, and while its rate changes, motion and force are those at full speed.
TEST(Tool, MovesInWallTimeAsAtFullSpeed) {
  const ToolMotion full = oscillate([](int) { return 1.0; });
  EXPECT_GT(full.wrench.front().force.norm(), 0.1) << "N";
  const std::vector<std::function<double(int)>> rates{
      [](int) { return 0.5; }, [](int) { return 0.05; },
      [](int i) { return std::max(0.02, std::pow(0.97, i < 150 ? i : 300 - i)); }};
  for (const auto& rate : rates) {
    SCOPED_TRACE(rate(150));
    const ToolMotion slowed = oscillate(rate);
    for (std::size_t i = 0; i < full.proxy.size(); ++i) {
      ASSERT_LT((slowed.proxy[i].position - full.proxy[i].position).norm(), 1e-12);
      ASSERT_LT((slowed.proxy[i].linear_velocity - full.proxy[i].linear_velocity).norm(), 1e-10);
      ASSERT_LT(slowed.proxy[i].orientation.angularDistance(full.proxy[i].orientation), 1e-7);
      ASSERT_LT((slowed.wrench[i].force - full.wrench[i].force).norm(), 1e-9);
      ASSERT_LT((slowed.wrench[i].torque - full.wrench[i].torque).norm(), 1e-9);
    }
  }
}

TEST(Tool, KeepsItsEnergyWhenTheRateChanges) {
  const UserSpec user;
  Body ball = ball_proxy(BodyId{0});
  BodyState proxy = at(0, 0, 0);
  proxy.linear_velocity = Vec3(0.3, 0.1, 0);
  proxy.angular_velocity = Vec3(0, 2, 1);
  EXPECT_NEAR(kinetic_energy(tool_at(0.3, user, ball).body, at_rate(proxy, 1.0, 0.3)), kinetic_energy(ball, proxy),
              1e-12);
}

constexpr OperatorLimits kLimits{.wrench = {.force_n = 10, .torque_n_m = 1, .torques = true},
                                 .force_rate_n_s = 2500,
                                 .torque_rate_n_m_s = 250,
                                 .power_w = 10};

TEST(ForceGuard, ChangesNoFasterThanTheLimit) {
  ForceGuard guard(kLimits, 0.0);
  Vec3 before = Vec3::Zero();
  for (int i = 0; i < 40; ++i) {
    const Vec3 wanted((i / 10) % 2 == 0 ? 100.0 : -100.0, 0, 0);
    const Vec3 now = guard.pass({wanted, Vec3::Zero()}, Vec3::Zero(), true, 0.001).force;
    EXPECT_LE((now - before).norm(), 2.5 + 1e-12);
    before = now;
    if (i % 10 != 9) continue;
    EXPECT_NEAR(now.x(), wanted.x() / 10.0, 1e-12);
  }
}

TEST(ForceGuard, DeliversNoMorePowerToTheOperatorThanTheLimit) {
  ForceGuard guard(kLimits, 0.0);
  const Vec3 along(4, 3, 0), velocity(2, 0, 0);
  Vec3 force;
  for (int i = 0; i < 10; ++i) force = guard.pass({along, Vec3::Zero()}, -velocity, true, 0.001).force;
  EXPECT_EQ(force, along) << "a brake gives no power";
  guard.restart();
  for (int i = 0; i < 10; ++i) force = guard.pass({2 * along, Vec3::Zero()}, velocity, true, 0.001).force;
  EXPECT_NEAR(force.dot(velocity), 10.0, 1e-9);
  EXPECT_NEAR(force.y(), 6.0, 1e-9) << "the component across is unchanged";
}

TEST(ForceGuard, ReEngagesFromZeroForceAfterADeclutch) {
  ForceGuard guard(kLimits, 0.1);
  const Wrench wanted{Vec3(8, 0, 0), Vec3::Zero()};
  for (int i = 0; i < 200; ++i) EXPECT_LE(guard.pass(wanted, Vec3::Zero(), true, 0.001).force.norm(), 8.0);
  guard.declutch();
  double before = 8.0;
  for (int i = 0; i < 20; ++i) {
    const double now = guard.pass(wanted, Vec3::Zero(), true, 0.001).force.norm();
    EXPECT_NEAR(before - now, 8.0 * 0.001 / 0.02, 1e-9);
    before = now;
  }
  EXPECT_NEAR(before, 0.0, 1e-9);
  EXPECT_NEAR(guard.pass(wanted, Vec3::Zero(), true, 0.001).force.norm(), 8.0 * 0.001 / 0.1, 1e-12);
}

TEST(ForceGuard, RampsBoundsAndFades) {
  ForceGuard guard(kLimits, 0.1);
  double before = 0.0;
  for (int i = 0; i < 200; ++i) {
    const double now = guard.pass({Vec3(100, 0, 0), Vec3::Zero()}, Vec3::Zero(), true, 0.001).force.norm();
    EXPECT_LE(now - before, 10.0 * 0.001 / 0.1 + 1e-12);
    EXPECT_LE(now, 10.0 + 1e-12);
    before = now;
  }
  EXPECT_NEAR(before, 10.0, 1e-12);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int i = 0; i < 100; ++i) {
    const Wrench out = guard.pass({Vec3(nan, 0, 0), Vec3(0, INFINITY, 0)}, Vec3::Zero(), true, 0.001);
    ASSERT_TRUE(out.force.allFinite());
    ASSERT_TRUE(out.torque.allFinite());
    EXPECT_LE(out.force.norm(), before + 1e-12);
    before = out.force.norm();
  }
  EXPECT_EQ(before, 0.0);
}

TEST(ForceGuard, ALostSourceEndsInZeroForceWithin5MsAndALateSampleIsNotFelt) {
  const OperatorLimits limits = operator_limits_of(DeviceSpec{});
  ForceGuard guard(limits, 0.02, ForceGuard::Loss::ends_force);
  const Wrench wanted{Vec3(40, 0, 0), Vec3::Zero()};
  for (int i = 0; i < 40; ++i) (void)guard.pass(wanted, Vec3::Zero(), true, 0.001);
  EXPECT_GT(guard.pass(wanted, Vec3::Zero(), false, 0.001).force.norm(), 0.99 * 40.0);
  EXPECT_EQ(guard.pass(wanted, Vec3::Zero(), true, 0.001).force.norm(), 40.0);
  for (const double x : {0.2, 0.4, 0.6, 0.8, 1.0})
    EXPECT_NEAR(guard.pass(wanted, Vec3::Zero(), false, 0.001).force.norm(), 40.0 * (1.0 - x * x * x), 1e-4);
  EXPECT_EQ(guard.pass(wanted, Vec3::Zero(), false, 0.001).force.norm(), 0.0);
}

Settings paper() {
  Settings s;
  s.scheme = "paper";
  return s;
}

HapticReport pushing_report(std::uint64_t stamp, std::uint64_t confirmed, const BodyState& member) {
  HapticReport r;
  r.stamp = stamp;
  r.confirmed_stamp = confirmed;
  r.members = {{BodyId{1}, member}};
  r.indicators = {.proxy_impulse_n_s = 1,
                  .total_impulse_n_s = 4,
                  .device_impulse_n_s = 1,
                  .border_bodies = 1,
                  .proxy_contacts = 1};  // s = 0.5
  return r;
}

WorldFrame frame_of(std::uint64_t stamp, std::uint64_t echoed, const BodyState& member) {
  WorldFrame f;
  f.stamp = stamp;
  f.echoed_stamp = echoed;
  f.states = {{BodyId{1}, member}};
  return f;
}

/// Body 1 is what both sides hold; the users' proxies are given.
Scene with_proxies(BodyId own, BodyId other) {
  Scene scene;
  scene.settings = paper();
  scene.settings.users = 2;
  scene.users.resize(2);
  scene.users[0].proxy = own;
  scene.users[1].proxy = other;
  return scene;
}

TEST(Synchroniser, BothCopiesMeetAndTheProxyFollowsTheSubWorld) {
  const Scene scene = with_proxies(BodyId{9}, BodyId{8});
  const Scheme& scheme = scheme_of(scene.settings);
  Synchroniser s(scheme, scene, 0);
  const auto pairs = s.synchronise(frame_of(1, 0, at(0, 0, 0)), pushing_report(1, 0, at(1, 0, 0)), 1.0);
  ASSERT_EQ(pairs.size(), 1U);
  EXPECT_NEAR(pairs[0].world.position.x(), 0.5, 1e-15);
  EXPECT_NEAR(pairs[0].sub.position.x(), -0.5, 1e-15);

  const Scene of_proxy = with_proxies(BodyId{1}, BodyId{8});
  Synchroniser proxy(scheme, of_proxy, 0);
  EXPECT_NEAR(
      proxy.synchronise(frame_of(1, 0, at(0, 0, 0)), pushing_report(1, 0, at(1, 0, 0)), 1.0)[0].world.position.x(), 1.0,
      1e-15);
  const Scene of_peer = with_proxies(BodyId{9}, BodyId{1});
  Synchroniser peer(scheme, of_peer, 0);
  EXPECT_NEAR(peer.synchronise(frame_of(1, 0, at(0, 0, 0)), pushing_report(1, 0, at(1, 0, 0)), 1.0)[0].sub.position.x(),
              -1.0, 1e-15);
}

// Both sides wrote stamp 2 before they had applied the blend of stamp 1: no correction is applied twice.
TEST(Synchroniser, LateBlendsAreNotAppliedTwice) {
  const Scene scene = with_proxies(BodyId{9}, BodyId{8});
  const Scheme& scheme = scheme_of(scene.settings);
  Synchroniser s(scheme, scene, 0);
  (void)s.synchronise(frame_of(1, 0, at(0, 0, 0)), pushing_report(1, 0, at(1, 0, 0)), 1.0);
  const auto late = s.synchronise(frame_of(2, 0, at(0, 0, 0)), pushing_report(2, 0, at(1, 0, 0)), 1.0);
  EXPECT_NEAR(late[0].world.position.x(), 0.0, 1e-15);
  EXPECT_NEAR(late[0].sub.position.x(), 0.0, 1e-15);
  const auto on_time = s.synchronise(frame_of(3, 2, at(0.5, 0, 0)), pushing_report(3, 2, at(0.7, 0, 0)), 1.0);
  EXPECT_NEAR(on_time[0].world.position.x(), 0.1, 1e-15);
}

// What friction holds turns less in the shorter step of the sub-world. What the outside does shows in the positions.
TEST(Synchroniser, TheWorldFollowsTheSubWorldInRotationAlone) {
  Scene scene = with_proxies(BodyId{9}, BodyId{8});
  scene.settings.scheme = "reduced";
  const Scheme& scheme = scheme_of(scene.settings);
  BodyState sub = at(1, 0, 0);
  sub.orientation = Eigen::AngleAxisd(0.4, Vec3::UnitZ());
  sub.linear_velocity.x() = 2.0;
  sub.angular_velocity.z() = 3.0;
  const auto of_world = [&](std::uint64_t confirmed, BodyId peer, double lag_cycles, int degrees_of_freedom = 6) {
    Scene with_peer = with_proxies(BodyId{9}, peer);
    with_peer.users[0].device.degrees_of_freedom = degrees_of_freedom;
    Synchroniser s(scheme, with_peer, 0);
    HapticReport report = pushing_report(30, confirmed, sub);
    return s.synchronise(frame_of(30, 29, at(0, 0, 0)), report, lag_cycles)[0].world;
  };
  for (const auto& [confirmed, share] : {std::pair{29U, 0.5}, std::pair{28U, 0.5}, std::pair{20U, 0.1}}) {
    const Shift shift = of_world(confirmed, BodyId{8}, 1.0);
    EXPECT_NEAR(Eigen::AngleAxisd(shift.rotation).angle(), share * 0.4, 1e-12) << confirmed;
    EXPECT_NEAR(shift.angular_velocity.z(), share * 3.0, 1e-12) << confirmed;
    EXPECT_EQ(shift.position, Vec3(0, 0, 0));
    EXPECT_EQ(shift.linear_velocity, Vec3(0, 0, 0));
  }
  // World and sub-world compute it alike, though only the sub-world knows when it uses the frame.
  EXPECT_EQ(of_world(20, BodyId{8}, INFINITY).angular_velocity, of_world(20, BodyId{8}, 1.0).angular_velocity);
  // Other users' copies of these bodies may say otherwise.
  EXPECT_EQ(of_world(29, BodyId{1}, 1.0).angular_velocity, Vec3(0, 0, 0)) << "a peer is inside";
  EXPECT_EQ(of_world(29, BodyId{8}, 1.0, 3).angular_velocity, Vec3(0, 0, 0)) << "a tool that does not turn";
}

TEST(Schemes, UnknownNameIsAnErrorThatNamesTheCure) {
  Settings s;
  s.scheme = "papers";
  try {
    (void)scheme_of(s);
    FAIL();
  } catch (const Error& e) {
    EXPECT_NE(std::string(e.what()).find("paper"), std::string::npos);
  }
}

TEST(Islands, AreOpenWhereTheyReachOut) {
  Islands islands;
  const std::vector<BodyId> ids{BodyId{1}, BodyId{2}, BodyId{3}, BodyId{5}};
  islands.begin(ids);
  islands.join(BodyId{1}, BodyId{2});
  islands.join(BodyId{3}, BodyId{9});
  EXPECT_FALSE(islands.is_open(BodyId{1}));
  EXPECT_TRUE(islands.is_open(BodyId{3}));
  EXPECT_TRUE(islands.is_open(BodyId{9}));
  std::vector<std::uint32_t> labels;
  islands.labels(labels);
  EXPECT_EQ(labels[0], labels[1]);
  EXPECT_EQ(labels[2], kOpenIsland);
  EXPECT_NE(labels[3], labels[0]);
  // The other side has a contact of 2 and 3: then the whole island is open.
  Islands both;
  both.begin(ids);
  both.join(ids, labels);
  both.join(BodyId{2}, BodyId{3});
  EXPECT_TRUE(both.is_open(BodyId{1}));
  EXPECT_FALSE(both.is_open(BodyId{5}));
}

TEST(Delay, AFrameIsLateByBothDirectionsWhereTheWorldTrails) {
  Settings settings;
  settings.ratio = 5;
  settings.delay = {.up_s = 0.004, .down_s = 0.006};
  const Timetable timetable(settings.ratio, 16);
  const Delay parallel(settings, 0, 0);
  EXPECT_EQ(parallel.frame_due(3, timetable), 3U * 5 + 6);
  EXPECT_FALSE(parallel.report_due(3, 3, timetable));
  EXPECT_TRUE(parallel.report_due(3, 4, timetable));
  const Delay trailing(settings, 1, 0);
  EXPECT_EQ(trailing.frame_due(3, timetable), 3U * 5 + 5 + 10);
  EXPECT_FALSE(trailing.report_due(3, 1, timetable));
  EXPECT_TRUE(trailing.report_due(3, 2, timetable));
}

TEST(Delay, ADeviceWithoutOneIsNoNetworkAway) {
  DelaySettings delay{.up_s = 0.01, .jitter_s = 0.1, .loss_ratio = 0.9};
  const auto disturbed = [&](Direction direction) {
    const Journey journey(delay, 0);
    bool any = false;
    for (std::uint64_t i = 0; i < 100; ++i)
      any = any || journey.is_lost(direction, i) || journey.delay_s(direction, i) > 0.05;
    return any;
  };
  EXPECT_FALSE(disturbed(Direction::from_device));
  EXPECT_FALSE(disturbed(Direction::to_device));
  EXPECT_TRUE(disturbed(Direction::up));
  EXPECT_TRUE(disturbed(Direction::from_peer));
  delay.to_device_s = 0.001;
  EXPECT_TRUE(disturbed(Direction::from_device));
}

TEST(Delay, OfAPeersDeviceIsThatOfItsLinkAndOfOneHop) {
  Settings settings;
  settings.delay = {.up_s = 0.004, .down_s = 0.006, .from_device_s = 0.002, .to_device_s = 0.003};
  EXPECT_EQ(journey_steps(Journey(settings.delay, 0), Direction::from_peer, 7, settings.h_s), 8U);
  EXPECT_EQ(journey_steps(Journey(settings.delay, 0), Direction::from_device, 7, settings.h_s), 2U);
}

// Equation (7) of common/coupling/README.md.
TEST(Reduced, CorrectsLessTheLaterTheWorldsStateComes) {
  const auto gain = [](double lag_cycles) {
    return scheme_of(Settings{}).correction({Owner::world, lag_cycles}, {}, {}).sub;
  };
  EXPECT_DOUBLE_EQ(gain(1.0), 0.5);
  EXPECT_DOUBLE_EQ(gain(2.0), 0.5);
  EXPECT_DOUBLE_EQ(gain(4.0), 0.3);
  EXPECT_DOUBLE_EQ(gain(12.0), 0.1);
}

// Bounds (1) and (2) of coupling/passivity.
TEST(Passivity, BoundsTheForceOfASpringAndTheSpeedOfAMassThatHoldTheEnergy) {
  const auto force_n = [](double velocity_m_s) {
    return passive_force({10, 0, 0}, {velocity_m_s, 0, 0}, 0.005, 1000.0, 1e-3).x();
  };
  EXPECT_NEAR(force_n(0.0), std::sqrt(10.0), 1e-12);
  EXPECT_NEAR(force_n(0.1), std::sqrt(10.0), 1e-12);
  EXPECT_NEAR(force_n(-0.01), 10.0, 1e-12) << "it brakes";
  EXPECT_NEAR(force_n(-0.005), 0.5 * (10.0 + std::sqrt(10.0)), 1e-12);
  EXPECT_NEAR(passive_velocity({1, 0, 0}, Vec3::Zero(), 0.002, 0.1, 1e-3).x(), 0.2, 1e-12);
  EXPECT_NEAR(passive_velocity({1, 0, 0}, {5, 0, 0}, 0.002, 0.1, 1e-3).x(), 0.25, 1e-12) << "pushed by the operator";
}

TEST(Delay, JitterRepeatsAndStaysInItsBounds) {
  Settings settings;
  settings.ratio = 5;
  settings.delay = {.up_s = 0.004, .down_s = 0.006, .jitter_s = 0.01};
  const Timetable timetable(settings.ratio, 16);
  const Delay delay(settings, 1, 0);
  std::uint64_t least = 1000, most = 0;
  for (std::uint64_t j = 1; j < 1000; ++j) {
    const std::uint64_t late = delay.frame_due(j, timetable) - 5 * j - 5;
    EXPECT_EQ(delay.frame_due(j, timetable), Delay(settings, 1, 0).frame_due(j, timetable));
    least = std::min(least, late);
    most = std::max(most, late);
  }
  EXPECT_GE(least, 10U);
  EXPECT_LE(most, 30U);
  EXPECT_GT(most, least + 10);
}

}  // namespace
}  // namespace subworld
