#pragma once

#include "model/messages/exchange.hpp"

#include <random>
#include <string>

/// Samples of every topic with random contents, and equality of their bits.
namespace subworld::test {

class SampleMaker {
 public:
  explicit SampleMaker(std::uint32_t seed) : random_(seed) {}

  double number() { return std::uniform_real_distribution<double>(-10.0, 10.0)(random_); }
  double positive() { return std::uniform_real_distribution<double>(0.0, 10.0)(random_); }
  std::uint32_t word() { return static_cast<std::uint32_t>(random_()); }
  std::uint32_t user() { return word() % static_cast<std::uint32_t>(kMostUsers); }
  std::uint64_t long_word() { return (std::uint64_t{word()} << 32U) | word(); }
  std::size_t count() { return std::uniform_int_distribution<std::size_t>(0, 5)(random_); }
  bool coin() { return (word() & 1U) != 0; }
  Vec3 vector() { return {number(), number(), number()}; }
  Quat quaternion() { return Quat{number(), number(), number(), number()}.normalized(); }
  std::string text() { return std::string(count() * 7, static_cast<char>('a' + word() % 26)); }

  void fill(Pose& to) { to = {vector(), quaternion()}; }
  void fill(Wrench& to) { to = {vector(), vector()}; }
  void fill(BodyState& to) { to = {vector(), quaternion(), vector(), vector()}; }
  void fill(StampedBody& to) {
    to.id = BodyId{word()};
    fill(to.state);
  }
  void fill(std::uint32_t& to) { to = word(); }
  void fill(BodyId& to) { to = BodyId{word()}; }
  void fill(BoundaryContact& to) {
    to = {BodyId{word()}, BodyId{word()}, vector(), vector().normalized(), number(), number(), vector()};
  }
  void fill(GhostModel& to) {
    to = {.outside = BodyId{word()},
          .mass_kg = 0.1 + positive(),
          .load_n = vector(),
          .axis_count = word() % 4,
          .axes = {}};
    for (std::size_t i = 0; i < to.axis_count; ++i)
      to.axes[i] = {vector().normalized(), number(), positive(), vector()};
    to.approaching = coin();
    if (coin()) {
      CarriedBody& carried = to.carried.emplace();
      carried.mass_kg = 0.1 + positive();
      carried.centre_m = vector();
      const Vec3 v = vector();
      carried.inertia_kg_m2 = v * v.transpose() + Eigen::Matrix3d::Identity();
      fill(carried.drive);
    }
  }
  void fill(GhostPeer& to) { to = {BodyId{word()}, word() % 3, BodyId{word()}, number()}; }
  void fill(PeerDevice& to) {
    to.proxy = BodyId{word()};
    fill(to.pose);
    to.linear_velocity = vector();
    to.angular_velocity = vector();
    fill(to.applied);
    to.device_s = positive();
    to.offset = vector();
    to.turn = quaternion();
  }
  void fill(Body& to) {
    to.id = BodyId{word()};
    to.name = text();
    to.shape = {static_cast<ShapeKind>(word() % 5), vector().cwiseAbs(), positive(), positive(), word()};
    to.material = {positive(), 0.1 * positive()};
    to.mass = positive();
    to.inertia = vector().cwiseAbs();
    to.gravity = coin();
    to.rotates = coin();
  }
  void fill(EnteringBody& to) {
    fill(to.body);
    fill(to.state);
  }
  void fill(Mesh& to) {
    to.file = text();
    to.vertices.resize(3 + count());
    for (Vec3& vertex : to.vertices) vertex = vector();
    to.triangles.resize(1 + count());
    for (auto& triangle : to.triangles) {
      for (auto& corner : triangle) corner = word() % static_cast<std::uint32_t>(to.vertices.size());
    }
  }
  void fill(UserView& to) {
    to.user = UserId{word()};
    to.proxy = BodyId{word()};
    fill_all(to.members);
    fill_all(to.border);
    fill(to.wrench);
  }
  template <class T>
  void fill_all(std::vector<T>& to) {
    to.resize(count());
    for (T& element : to) fill(element);
  }

  void fill(ControlReply& to) {
    to.program = static_cast<ProgramKind>(word() % 4);
    to.instance = user();
    to.number = word();
    to.answer.outcome = static_cast<OrderState>(word() % 3);
    to.answer.text = text();
  }
  void fill(NamedSetting& to) {
    to.name = text();
    to.value = text();
  }
  void fill(Joint& to) {
    to.name = text();
    to.kind = static_cast<JointKind>(word() % 8);
    fill(to.in_a);
    fill(to.in_b);
    for (JointAxis& axis : to.axes) axis.free = coin();
  }
  void fill(SceneDescription& to) {
    to.name = text();
    fill_all(to.settings);
    to.session = long_word();
    to.users = word();
    to.meshes.resize(1 + count());
    for (Mesh& mesh : to.meshes) fill(mesh);
    to.bodies.resize(1 + count());
    to.states.resize(to.bodies.size());
    for (Body& body : to.bodies) fill(body);
    for (BodyState& state : to.states) fill(state);
    to.bodies[0].shape.kind = ShapeKind::mesh;
    to.bodies[0].shape.mesh = word() % static_cast<std::uint32_t>(to.meshes.size());
    fill_all(to.joints);
    for (Joint& joint : to.joints) joint.b = BodyId{word() % static_cast<std::uint32_t>(to.bodies.size())};
  }
  void fill(DeviceState& to) {
    to.device = user();
    to.session = long_word();
    to.sender = long_word();
    to.sequence = long_word();
    to.stamp_s = number();
    to.sent_ns = static_cast<std::int64_t>(long_word());
    fill(to.pose);
    to.linear_velocity = vector();
    to.angular_velocity = vector();
    fill(to.applied);
    to.buttons = word();
  }
  void fill(DeviceCommand& to) {
    to.device = user();
    to.session = long_word();
    to.served = long_word();
    to.sequence = long_word();
    to.stamp_s = number();
    to.echoed_sent_ns = static_cast<std::int64_t>(long_word());
    fill(to.wrench);
    fill(to.pose);
    to.linear_velocity = vector();
    to.angular_velocity = vector();
    to.others_work_j = number();
    to.bodies_j = 2.0 * to.others_work_j;
    to.last = coin();
  }
  void fill(WorldFrame& to) {
    to.user = UserId{user()};
    to.session = long_word();
    to.served = long_word();
    to.stamp = long_word();
    to.stamp_s = positive();
    to.start_in_s = number();
    to.real_time_factor = positive();
    to.echoed_sent_ns = static_cast<std::int64_t>(long_word());
    to.echoed_stamp = long_word();
    to.newest_stamp = long_word();
    to.last = coin();
    to.cycle_s = positive();
    to.ratio = 1 + static_cast<int>(word() % 1000);
    to.planned = {long_word(), 1 + static_cast<int>(word() % 1000)};
    fill_all(to.members);
    fill_all(to.fixed);
    fill_all(to.islands);
    fill_all(to.entering);
    fill_all(to.states);
    to.border_contacts = word();
    to.border_bodies = word();
    fill_all(to.border);
    fill_all(to.ghosts);
    fill_all(to.ghost_peers);
    fill_all(to.peers);
    to.outside_work_j = number();
    to.bodies_j = 2.0 * to.outside_work_j;
    to.broken_joints = {7, 3};
    if (coin()) to.suppression = {long_word(), {vector(), vector()}};
  }
  void fill(HapticReport& to) {
    to.user = UserId{user()};
    to.session = long_word();
    to.sender = long_word();
    to.stamp = long_word();
    to.stamp_s = number();
    to.clock_rate = positive();
    to.sent_ns = static_cast<std::int64_t>(long_word());
    to.confirmed_stamp = long_word();
    to.started_stamp = long_word();
    fill(to.impulse_total);
    to.device_work_j = number();
    to.coupling_energy_j = number();
    to.operator_work_j = number();
    to.peer_age_s = number();
    fill(to.proxy);
    if (coin()) {
      to.device.emplace();
      fill(to.device->pose);
      to.device->linear_velocity = vector();
      to.device->angular_velocity = vector();
      fill(to.device->applied);
    }
    fill_all(to.members);
    fill_all(to.islands);
    to.indicators = {positive(), positive(), positive(), word(), word()};
    to.timing = {positive(), positive()};
    fill_all(to.missed);
    fill_all(to.followed);
  }
  void fill(FollowedOrder& to) { to = {positive(), text()}; }
  void fill(MissedStates& to) {
    const double from_s = positive();
    to = {user(), from_s, from_s + positive()};
  }
  void fill(WorldSnapshot& to) {
    to.sequence = long_word();
    to.stamp_s = number();
    to.real_time_factor = positive();
    fill_all(to.moved);
    fill_all(to.users);
    fill_all(to.broken_joints);
  }
  void fill(Control& to) { to = {static_cast<std::uint32_t>(word()), static_cast<ControlVerb>(word() % 10), text()}; }
  void fill(Status& to) {
    to.program = static_cast<ProgramKind>(word() % 4);
    to.instance = user();
    to.state = text();
    to.time_s = number();
    to.rate_hz = number();
    to.steps = long_word();
    to.missed_deadlines = long_word();
    to.missed_by_os = long_word();
    to.step_s = number();
    to.force_n = number();
    to.real_time_factor = number();
    to.done_ratio = number();
    to.paused = coin();
    to.waits_for = text();
    to.events = {long_word(), long_word(), long_word(), long_word(), long_word(), long_word(), long_word()};
    to.text = text();
  }

  template <class M>
  M make() {
    M sample;
    fill(sample);
    return sample;
  }

 private:
  std::mt19937 random_;
};

/// Calls `visit` with every number, text and size of a sample, in order. Templates over const and non-const are not
/// needed, because it only reads.
template <class Visit>
struct NumberVisitor {
  Visit& visit;

  void operator()(double value) { visit(value); }
  void operator()(const std::string& text) {
    visit(static_cast<double>(text.size()));
    for (const char letter : text) visit(static_cast<double>(letter));
  }
  void operator()(const Vec3& v) { all(v.x(), v.y(), v.z()); }
  void operator()(const Quat& q) { all(q.w(), q.x(), q.y(), q.z()); }
  void operator()(std::uint64_t value) {
    visit(static_cast<double>(value >> 32U));
    visit(static_cast<double>(value & 0xffffffffU));
  }
  void operator()(std::int64_t value) { (*this)(static_cast<std::uint64_t>(value)); }
  void operator()(std::uint32_t value) { visit(static_cast<double>(value)); }
  void operator()(bool value) { visit(value ? 1.0 : 0.0); }
  void operator()(BodyId id) { (*this)(index(id)); }
  void operator()(UserId id) { (*this)(index(id)); }
  void operator()(const Pose& p) { all(p.position, p.orientation); }
  void operator()(const Wrench& w) { all(w.force, w.torque); }
  void operator()(const BodyState& s) { all(s.position, s.orientation, s.linear_velocity, s.angular_velocity); }
  void operator()(const StampedBody& b) { all(b.id, b.state); }
  void operator()(const std::array<std::uint32_t, 3>& t) { all(t[0], t[1], t[2]); }
  void operator()(const Mesh& m) { all(m.file, m.vertices, m.triangles); }
  void operator()(const Body& b) {
    all(b.id, b.name, static_cast<std::uint32_t>(b.shape.kind), b.shape.half_extents, b.shape.radius,
        b.shape.half_length, b.shape.mesh, b.material.friction, b.material.restitution, b.mass, b.inertia, b.gravity,
        b.rotates);
  }
  void operator()(const EnteringBody& e) { all(e.body, e.state); }
  void operator()(const BoundaryContact& b) {
    all(b.inside, b.outside, b.point, b.normal, b.distance, b.normal_impulse, b.tangential_impulse);
  }
  void operator()(const GhostModel& g) {
    all(g.outside, g.mass_kg, g.load_n, g.approaching);
    for (std::size_t i = 0; i < g.axis_count; ++i) {
      all(g.axes[i].normal, g.axes[i].force_n, g.axes[i].coulomb_limit_n, g.axes[i].load_dependent_friction);
    }
    if (g.carried) {
      all(g.carried->mass_kg, g.carried->centre_m, g.carried->drive);
      for (int i = 0; i < 3; ++i) all(Vec3(g.carried->inertia_kg_m2.col(i)));
    }
  }
  void operator()(const GhostPeer& p) { all(p.outside, p.axis, p.proxy, p.offset_m); }
  void operator()(const PeerDevice& p) {
    all(p.proxy, p.pose, p.linear_velocity, p.angular_velocity, p.applied, p.device_s, p.offset, p.turn);
  }
  void operator()(const UserView& u) { all(u.user, u.proxy, u.members, u.border, u.wrench); }
  void operator()(const ControlReply& r) {
    all(static_cast<std::uint32_t>(r.program), r.instance, r.number, static_cast<std::uint32_t>(r.answer.outcome),
        r.answer.text);
  }
  void operator()(const NamedSetting& s) { all(s.name, s.value); }
  void operator()(const Joint& j) {
    all(j.name, static_cast<std::uint32_t>(j.kind), j.a, j.b, j.in_a, j.in_b);
    for (const JointAxis& axis : j.axes) (*this)(axis.free);
  }
  void operator()(const SceneDescription& s) {
    all(s.wire_version, s.name, s.settings, s.session, s.users, s.meshes, s.bodies, s.states, s.joints);
  }
  void operator()(const DeviceState& d) {
    all(d.device, d.session, d.sender, d.sequence, d.stamp_s, d.sent_ns, d.pose, d.linear_velocity, d.angular_velocity,
        d.applied, d.buttons);
  }
  void operator()(const DeviceCommand& d) {
    all(d.device, d.session, d.served, d.sequence, d.stamp_s, d.echoed_sent_ns, d.wrench, d.pose, d.linear_velocity,
        d.angular_velocity, d.others_work_j, d.bodies_j, d.last);
  }
  void operator()(const WorldFrame& f) {
    all(f.user, f.session, f.served, f.stamp, f.stamp_s, f.start_in_s, f.real_time_factor, f.echoed_sent_ns,
        f.echoed_stamp, f.newest_stamp, f.last, f.cycle_s, static_cast<std::uint32_t>(f.ratio), f.planned.stamp,
        static_cast<std::uint32_t>(f.planned.ratio), f.members, f.fixed, f.islands, f.entering, f.states,
        f.border_contacts, f.border_bodies, f.border, f.ghosts, f.ghost_peers, f.peers, f.outside_work_j, f.bodies_j,
        f.broken_joints, f.suppression.has_value());
    if (f.suppression) all(f.suppression->until, f.suppression->place.lower, f.suppression->place.upper);
  }
  void operator()(const HapticReport& r) {
    all(r.user, r.session, r.sender, r.stamp, r.stamp_s, r.clock_rate, r.sent_ns, r.confirmed_stamp, r.started_stamp,
        r.impulse_total, r.device_work_j, r.coupling_energy_j, r.operator_work_j, r.peer_age_s, r.proxy,
        r.device.has_value(), r.members, r.islands, r.indicators.proxy_impulse_n_s, r.indicators.total_impulse_n_s,
        r.indicators.device_impulse_n_s, r.indicators.border_bodies, r.indicators.proxy_contacts, r.timing.mean_s,
        r.timing.max_s, r.missed, r.followed);
    if (r.device) all(r.device->pose, r.device->linear_velocity, r.device->angular_velocity, r.device->applied);
  }
  void operator()(const FollowedOrder& o) { all(o.at_s, o.engine); }
  void operator()(const MissedStates& m) { all(m.peer, m.from_s, m.to_s); }
  void operator()(const WorldSnapshot& s) {
    all(s.sequence, s.stamp_s, s.real_time_factor, s.moved, s.users, s.broken_joints);
  }
  void operator()(const Control& c) { all(c.number, static_cast<std::uint32_t>(c.verb), c.argument); }
  void operator()(const Status& s) {
    all(static_cast<std::uint32_t>(s.program), s.instance, s.state, s.time_s, s.rate_hz, s.steps, s.missed_deadlines,
        s.missed_by_os, s.step_s, s.force_n, s.real_time_factor, s.done_ratio, s.paused, s.waits_for, s.events.matched,
        s.events.unmatched, s.events.deadline_missed, s.events.liveliness_lost, s.events.incompatible_qos,
        s.events.lost, s.events.rejected, s.events.refused, s.text);
  }
  template <class T>
  void operator()(const std::vector<T>& elements) {
    visit(static_cast<double>(elements.size()));
    for (const T& element : elements) (*this)(element);
  }

 private:
  template <class... Parts>
  void all(const Parts&... parts) {
    ((*this)(parts), ...);
  }
};

/// All contents of a sample as numbers; equal lists mean equal samples, bit for bit.
template <class M>
std::vector<double> numbers_of(const M& sample) {
  std::vector<double> numbers;
  auto collect = [&numbers](double value) { numbers.push_back(value); };
  NumberVisitor<decltype(collect)>{collect}(sample);
  return numbers;
}

}  // namespace subworld::test
