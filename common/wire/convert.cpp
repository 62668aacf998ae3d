#include "wire/convert.hpp"

#include "wire/parts.hpp"

namespace subworld {

using parts::get;
using parts::get_all;
using parts::get_ghosts;
using parts::get_one;
using parts::get_positive;
using parts::get_ratio;
using parts::put;
using parts::put_all;
using parts::put_ghosts;
using parts::put_one;

namespace {

bool meshes_exist(const SceneDescription& scene) {
  for (const Body& body : scene.bodies) {
    const bool needs_mesh = body.shape.kind == ShapeKind::convex || body.shape.kind == ShapeKind::mesh;
    if (needs_mesh && body.shape.mesh >= scene.meshes.size()) return false;
  }
  return true;
}

}  // namespace

void to_wire(const SceneDescription& in, msg::Scene& out) {
  out.name(in.name);
  out.settings_hash(in.settings_hash);
  out.session(in.session);
  out.users(in.users);
  put_all(in.meshes, out.meshes());
  put_all(in.bodies, out.bodies());
  out.states().resize(in.states.size());
  for (std::size_t i = 0; i < in.states.size(); ++i) {
    const BodyId id = i < in.bodies.size() ? in.bodies[i].id : BodyId{};
    put(id, in.states[i], out.states()[i]);
  }
}

bool from_wire(const msg::Scene& in, SceneDescription& out) {
  out.name = in.name();
  out.settings_hash = in.settings_hash();
  out.session = in.session();
  out.users = in.users();
  if (in.states().size() != in.bodies().size()) return false;
  for (std::size_t i = 0; i < in.states().size(); ++i) {
    if (in.states()[i].body() != in.bodies()[i].id()) return false;
  }
  return get_all(in.meshes(), out.meshes) && get_all(in.bodies(), out.bodies) && get_all(in.states(), out.states) &&
         meshes_exist(out);
}

void to_wire(const DeviceState& in, msg::DeviceState& out) {
  out.device(in.device);
  out.session(in.session);
  out.sender(in.sender);
  out.sequence_number(in.sequence);
  out.stamp_s(in.stamp_s);
  out.sent_ns(in.sent_ns);
  put(in.pose, out.pose());
  put(in.linear_velocity, out.linear_velocity());
  put(in.angular_velocity, out.angular_velocity());
  put(in.applied, out.applied());
  out.buttons(in.buttons);
}

bool from_wire(const msg::DeviceState& in, DeviceState& out) {
  out.device = in.device();
  out.session = in.session();
  out.sender = in.sender();
  out.sequence = in.sequence_number();
  out.sent_ns = in.sent_ns();
  out.buttons = in.buttons();
  return get(in.stamp_s(), out.stamp_s) && get(in.pose(), out.pose) && get(in.linear_velocity(), out.linear_velocity) &&
         get(in.angular_velocity(), out.angular_velocity) && get(in.applied(), out.applied);
}

void to_wire(const DeviceCommand& in, msg::DeviceCommand& out) {
  out.device(in.device);
  out.session(in.session);
  out.served(in.served);
  out.sequence_number(in.sequence);
  out.stamp_s(in.stamp_s);
  out.echoed_sent_ns(in.echoed_sent_ns);
  put(in.wrench, out.wrench());
  put(in.pose, out.pose());
  put(in.linear_velocity, out.linear_velocity());
  put(in.angular_velocity, out.angular_velocity());
  out.last(in.last);
}

bool from_wire(const msg::DeviceCommand& in, DeviceCommand& out) {
  out.device = in.device();
  out.session = in.session();
  out.served = in.served();
  out.sequence = in.sequence_number();
  out.echoed_sent_ns = in.echoed_sent_ns();
  out.last = in.last();
  return get(in.stamp_s(), out.stamp_s) && get(in.wrench(), out.wrench) && get(in.pose(), out.pose) &&
         get(in.linear_velocity(), out.linear_velocity) && get(in.angular_velocity(), out.angular_velocity);
}

void to_wire(const WorldFrame& in, msg::WorldFrame& out) {
  out.user(index(in.user));
  out.session(in.session);
  out.served(in.served);
  out.stamp(in.stamp);
  out.stamp_s(in.stamp_s);
  out.start_in_s(in.start_in_s);
  out.real_time_factor(in.real_time_factor);
  out.echoed_sent_ns(in.echoed_sent_ns);
  out.echoed_stamp(in.echoed_stamp);
  out.last(in.last);
  out.cycle_s(in.cycle_s);
  out.ratio(static_cast<std::uint32_t>(in.ratio));
  out.planned_stamp(in.planned.stamp);
  out.planned_ratio(static_cast<std::uint32_t>(in.planned.ratio));
  put_all(in.members, out.members());
  put_all(in.fixed, out.fixed_bodies());
  out.islands() = in.islands;
  put_all(in.entering, out.entering());
  put_all(in.states, out.states());
  out.border_contacts(in.border_contacts);
  out.border_bodies(in.border_bodies);
  put_all(in.border, out.border());
  put_ghosts(in.ghosts, out);
  put_all(in.peers, out.peers());
  put_one(in.suppression, out.suppression());
}

bool from_wire(const msg::WorldFrame& in, WorldFrame& out) {
  out.user = UserId{in.user()};
  out.session = in.session();
  out.served = in.served();
  out.stamp = in.stamp();
  out.islands = in.islands();
  out.echoed_sent_ns = in.echoed_sent_ns();
  out.echoed_stamp = in.echoed_stamp();
  out.last = in.last();
  out.planned.stamp = in.planned_stamp();
  out.border_contacts = in.border_contacts();
  out.border_bodies = in.border_bodies();
  return get_positive(in.stamp_s(), out.stamp_s) && get(in.start_in_s(), out.start_in_s) &&
         get_positive(in.cycle_s(), out.cycle_s) && get_ratio(in.ratio(), out.ratio) &&
         get_ratio(in.planned_ratio(), out.planned.ratio) &&
         get_positive(in.real_time_factor(), out.real_time_factor) && get_all(in.members(), out.members) &&
         get_all(in.fixed_bodies(), out.fixed) && get_all(in.entering(), out.entering) &&
         get_all(in.states(), out.states) && get_all(in.border(), out.border) && get_ghosts(in, out.ghosts) &&
         get_all(in.peers(), out.peers) && get_one(in.suppression(), out.suppression);
}

void to_wire(const HapticReport& in, msg::HapticReport& out) {
  out.user(index(in.user));
  out.session(in.session);
  out.sender(in.sender);
  out.stamp(in.stamp);
  out.stamp_s(in.stamp_s);
  out.clock_rate(in.clock_rate);
  out.sent_ns(in.sent_ns);
  out.confirmed_stamp(in.confirmed_stamp);
  put(in.impulse_total, out.impulse_total());
  out.device_work_j(in.device_work_j);
  out.coupling_energy_j(in.coupling_energy_j);
  put(BodyId{}, in.proxy, out.proxy());
  put_one(in.device, out.device());
  put_all(in.members, out.members());
  out.islands() = in.islands;
  out.indicators().proxy_impulse_n_s(in.indicators.proxy_impulse_n_s);
  out.indicators().total_impulse_n_s(in.indicators.total_impulse_n_s);
  out.indicators().device_impulse_n_s(in.indicators.device_impulse_n_s);
  out.indicators().border_bodies(in.indicators.border_bodies);
  out.indicators().proxy_contacts(in.indicators.proxy_contacts);
  out.step_mean_s(in.timing.mean_s);
  out.step_max_s(in.timing.max_s);
}

bool from_wire(const msg::HapticReport& in, HapticReport& out) {
  out.user = UserId{in.user()};
  out.session = in.session();
  out.sender = in.sender();
  out.stamp = in.stamp();
  out.sent_ns = in.sent_ns();
  out.confirmed_stamp = in.confirmed_stamp();
  out.islands = in.islands();
  out.indicators.border_bodies = in.indicators().border_bodies();
  out.indicators.proxy_contacts = in.indicators().proxy_contacts();
  return get(in.stamp_s(), out.stamp_s) && get_positive(in.clock_rate(), out.clock_rate) && out.clock_rate > 0.0 &&
         get(in.impulse_total(), out.impulse_total) && get(in.device_work_j(), out.device_work_j) &&
         get(in.coupling_energy_j(), out.coupling_energy_j) && get(in.proxy(), out.proxy) &&
         get_one(in.device(), out.device) && get_all(in.members(), out.members) &&
         get(in.indicators().proxy_impulse_n_s(), out.indicators.proxy_impulse_n_s) &&
         get(in.indicators().total_impulse_n_s(), out.indicators.total_impulse_n_s) &&
         get(in.indicators().device_impulse_n_s(), out.indicators.device_impulse_n_s) &&
         get(in.step_mean_s(), out.timing.mean_s) && get(in.step_max_s(), out.timing.max_s);
}

void to_wire(const WorldSnapshot& in, msg::WorldState& out) {
  out.sequence_number(in.sequence);
  out.stamp_s(in.stamp_s);
  out.real_time_factor(in.real_time_factor);
  put_all(in.moved, out.moved());
  put_all(in.users, out.users());
}

bool from_wire(const msg::WorldState& in, WorldSnapshot& out) {
  out.sequence = in.sequence_number();
  return get(in.stamp_s(), out.stamp_s) && get_positive(in.real_time_factor(), out.real_time_factor) &&
         get_all(in.moved(), out.moved) && get_all(in.users(), out.users);
}

void to_wire(const Control& in, msg::Control& out) {
  out.number(in.number);
  out.verb(static_cast<std::uint8_t>(in.verb));
  out.argument(in.argument);
}

bool from_wire(const msg::Control& in, Control& out) {
  if (in.verb() > static_cast<std::uint8_t>(ControlVerb::set_scheme)) return false;
  out.number = in.number();
  out.verb = static_cast<ControlVerb>(in.verb());
  out.argument = in.argument();
  return true;
}

void to_wire(const Status& in, msg::Status& out) {
  out.program(static_cast<std::uint32_t>(in.program));
  out.instance(in.instance);
  out.state(in.state);
  out.time_s(in.time_s);
  out.rate_hz(in.rate_hz);
  out.steps(in.steps);
  out.missed_deadlines(in.missed_deadlines);
  out.missed_by_os(in.missed_by_os);
  out.step_s(in.step_s);
  out.force_n(in.force_n);
  out.real_time_factor(in.real_time_factor);
  out.done_ratio(in.done_ratio);
  out.matched(in.events.matched);
  out.unmatched(in.events.unmatched);
  out.deadline_missed(in.events.deadline_missed);
  out.liveliness_lost(in.events.liveliness_lost);
  out.incompatible_qos(in.events.incompatible_qos);
  out.lost(in.events.lost);
  out.rejected(in.events.rejected);
  out.refused(in.events.refused);
  out.text(in.text);
}

bool from_wire(const msg::Status& in, Status& out) {
  if (in.program() > static_cast<std::uint32_t>(ProgramKind::gui_headless)) return false;
  out.program = static_cast<ProgramKind>(in.program());
  out.instance = in.instance();
  out.state = in.state();
  out.steps = in.steps();
  out.missed_deadlines = in.missed_deadlines();
  out.missed_by_os = in.missed_by_os();
  out.events = {in.matched(),          in.unmatched(), in.deadline_missed(), in.liveliness_lost(),
                in.incompatible_qos(), in.lost(),      in.rejected(),        in.refused()};
  out.text = in.text();
  return get(in.time_s(), out.time_s) && get(in.rate_hz(), out.rate_hz) && get(in.step_s(), out.step_s) &&
         get(in.force_n(), out.force_n) && get(in.real_time_factor(), out.real_time_factor) &&
         get(in.done_ratio(), out.done_ratio);
}

}  // namespace subworld
