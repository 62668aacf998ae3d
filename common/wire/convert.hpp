#pragma once

#include "model/exchange.hpp"
#include "model/scene.hpp"
#include "wire/copy.hpp"
#include "wire/copy_changes.hpp"

#include <subworld.h>

#include <algorithm>
#include <cstdint>

/// Converts model structs to the types of the IDL and back. Only `codec.cpp` includes this: IDL types stop here. Each
/// struct has one description, `fields(copy, model, wire)`, for both directions. `copy` is `ToWire` or `FromWire` and
/// returns whether the value is valid; where it is not, the model may be half filled.
namespace subworld {

bool fields(const auto& copy, Sequence auto& m, auto& w) {
  copy.resize(m, w);
  for (std::size_t i = 0; i < m.size(); ++i) {
    if (!copy(m[i], w[i])) return false;
  }
  return true;
}

/// A sequence of length 0 or 1 on the wire.
bool fields(const auto& copy, Optional auto& m, auto& w) {
  copy.present(m, w);
  return copy.check(w.size() <= 1) && (!m || copy(*m, w.front()));
}

bool fields(const auto& copy, Is<Pose> auto& m, auto& w) {
  return copy(m.position, w.position()) && copy(m.orientation, w.orientation());
}

bool fields(const auto& copy, Is<Wrench> auto& m, auto& w) {
  return copy(m.force, w.force()) && copy(m.torque, w.torque());
}

/// The caller copies the id, which is not in this struct.
bool fields(const auto& copy, Is<BodyState> auto& m, auto& w) {
  return copy(m.position, w.position()) && copy(m.orientation, w.orientation()) &&
         copy(m.linear_velocity, w.linear_velocity()) && copy(m.angular_velocity, w.angular_velocity());
}

bool fields(const auto& copy, Is<StampedBody> auto& m, auto& w) { return copy(m.id, w.body()) && copy(m.state, w); }

bool fields(const auto& copy, Is<Mesh> auto& m, auto& w) {
  return copy(m.file, w.file()) && copy(m.vertices, w.vertices()) && copy(m.triangles, w.triangles()) &&
         copy.check(std::ranges::all_of(m.triangles, [&](const auto& triangle) {
           return std::ranges::all_of(triangle, [&](std::uint32_t corner) { return corner < m.vertices.size(); });
         }));
}

bool fields(const auto& copy, Is<Body> auto& m, auto& w) {
  return copy(m.id, w.id()) && copy(m.name, w.name()) && copy.kind(m.shape.kind, w.shape(), ShapeKind::mesh) &&
         copy(m.shape.half_extents, w.half_extents()) && copy.check((m.shape.half_extents.array() >= 0.0).all()) &&
         copy.not_negative(m.shape.radius, w.radius()) && copy.not_negative(m.shape.half_length, w.half_length()) &&
         copy(m.shape.mesh, w.mesh()) && copy.not_negative(m.material.friction, w.friction()) &&
         copy.not_negative(m.material.restitution, w.restitution()) && copy.check(m.material.restitution <= 1.0) &&
         copy.not_negative(m.mass, w.mass()) && copy(m.inertia, w.inertia()) &&
         copy.check((m.inertia.array() >= 0.0).all()) && copy(m.gravity, w.gravity()) && copy(m.rotates, w.rotates());
}

bool fields(const auto& copy, Is<EnteringBody> auto& m, auto& w) {
  return copy(m.body, w.body()) && copy(m.state, w.state()) && copy.same(m.body.id, w.state().body());
}

bool fields(const auto& copy, Is<BoundaryContact> auto& m, auto& w) {
  return copy(m.inside, w.inside()) && copy(m.outside, w.outside()) && copy(m.point, w.point()) &&
         copy(m.normal, w.normal()) && copy(m.distance, w.distance()) && copy(m.normal_impulse, w.normal_impulse()) &&
         copy(m.tangential_impulse, w.tangential_impulse());
}

bool fields(const auto& copy, Is<CarriedBody> auto& m, auto& w) {
  return copy.positive(m.mass_kg, w.mass_kg()) && copy(m.centre_m, w.centre_m()) &&
         copy(m.inertia_kg_m2, w.inertia_kg_m2()) && copy(m.drive, w.drive());
}

bool fields(const auto& copy, Is<GhostPeer> auto& m, auto& w) {
  return copy(m.outside, w.outside()) && copy(m.axis, w.axis()) && copy.check(m.axis < kMostGhostAxes) &&
         copy(m.proxy, w.proxy()) && copy(m.offset_m, w.offset_m());
}

bool fields(const auto& copy, Is<PeerDevice> auto& m, auto& w) {
  return copy(m.proxy, w.proxy()) && copy(m.pose, w.pose()) && copy(m.linear_velocity, w.linear_velocity()) &&
         copy(m.angular_velocity, w.angular_velocity()) && copy(m.applied, w.applied()) &&
         copy(m.device_s, w.device_s()) && copy(m.offset, w.offset()) && copy(m.turn, w.turn());
}

bool fields(const auto& copy, Is<Suppression> auto& m, auto& w) {
  return copy(m.until, w.until_stamp()) && copy(m.place.lower, w.lower()) && copy(m.place.upper, w.upper());
}

bool fields(const auto& copy, Is<ReportedDevice> auto& m, auto& w) {
  return copy(m.pose, w.pose()) && copy(m.linear_velocity, w.linear_velocity()) &&
         copy(m.angular_velocity, w.angular_velocity()) && copy(m.applied, w.applied()) &&
         copy(m.device_s, w.device_s()) && copy(m.offset, w.offset()) && copy(m.turn, w.turn());
}

bool fields(const auto& copy, Is<MissedStates> auto& m, auto& w) {
  return copy(m.peer, w.peer()) && copy.not_negative(m.from_s, w.from_s()) && copy(m.to_s, w.to_s()) &&
         copy.check(m.from_s < m.to_s);
}

bool fields(const auto& copy, Is<FollowedOrder> auto& m, auto& w) {
  return copy.not_negative(m.at_s, w.at_s()) && copy(m.engine, w.engine());
}

bool fields(const auto& copy, Is<Indicators> auto& m, auto& w) {
  return copy(m.proxy_impulse_n_s, w.proxy_impulse_n_s()) && copy(m.total_impulse_n_s, w.total_impulse_n_s()) &&
         copy(m.device_impulse_n_s, w.device_impulse_n_s()) && copy(m.border_bodies, w.border_bodies()) &&
         copy(m.proxy_contacts, w.proxy_contacts());
}

bool fields(const auto& copy, Is<UserView> auto& m, auto& w) {
  return copy(m.user, w.user()) && copy(m.proxy, w.proxy()) && copy(m.members, w.members()) &&
         copy(m.border, w.border()) && copy(m.wrench, w.wrench());
}

bool fields(const auto& copy, Is<NamedSetting> auto& m, auto& w) {
  return copy(m.name, w.name()) && copy(m.value, w.value());
}

// ---- Topics

bool fields(const auto& copy, Is<SceneDescription> auto& m, auto& w) {
  const bool valid = copy(m.wire_version, w.wire_version()) && copy(m.name, w.name()) &&
                     copy(m.settings, w.settings()) && copy(m.session, w.session()) && copy(m.users, w.users()) &&
                     copy(m.meshes, w.meshes()) && copy(m.bodies, w.bodies()) && copy(m.states, w.states()) &&
                     copy.check(m.states.size() == m.bodies.size());
  if (!valid) return false;
  for (std::size_t i = 0; i < std::min(m.bodies.size(), m.states.size()); ++i) {
    if (!copy.same(m.bodies[i].id, w.states()[i].body())) return false;
  }
  return copy.check(std::ranges::all_of(m.bodies, [&](const Body& body) {
    const bool needs_mesh = body.shape.kind == ShapeKind::convex || body.shape.kind == ShapeKind::mesh;
    return !needs_mesh || body.shape.mesh < m.meshes.size();
  }));
}

bool fields(const auto& copy, Is<DeviceState> auto& m, auto& w) {
  return copy(m.device, w.device()) && copy(m.session, w.session()) && copy(m.sender, w.sender()) &&
         copy(m.sequence, w.sequence_number()) && copy(m.stamp_s, w.stamp_s()) && copy(m.sent_ns, w.sent_ns()) &&
         copy(m.pose, w.pose()) && copy(m.linear_velocity, w.linear_velocity()) &&
         copy(m.angular_velocity, w.angular_velocity()) && copy(m.applied, w.applied()) && copy(m.buttons, w.buttons());
}

bool fields(const auto& copy, Is<DeviceCommand> auto& m, auto& w) {
  return copy(m.device, w.device()) && copy(m.session, w.session()) && copy(m.served, w.served()) &&
         copy(m.sequence, w.sequence_number()) && copy(m.stamp_s, w.stamp_s()) &&
         copy(m.echoed_sent_ns, w.echoed_sent_ns()) && copy(m.wrench, w.wrench()) && copy(m.pose, w.pose()) &&
         copy(m.linear_velocity, w.linear_velocity()) && copy(m.angular_velocity, w.angular_velocity()) &&
         copy(m.others_work_j, w.others_work_j()) && copy(m.last, w.last());
}

bool fields(const auto& copy, Is<WorldFrame> auto& m, auto& w) {
  return copy(m.user, w.user()) && copy(m.session, w.session()) && copy(m.served, w.served()) &&
         copy(m.stamp, w.stamp()) && copy.not_negative(m.stamp_s, w.stamp_s()) && copy(m.start_in_s, w.start_in_s()) &&
         copy.not_negative(m.real_time_factor, w.real_time_factor()) && copy(m.echoed_sent_ns, w.echoed_sent_ns()) &&
         copy(m.echoed_stamp, w.echoed_stamp()) && copy(m.newest_stamp, w.newest_stamp()) && copy(m.last, w.last()) &&
         copy.not_negative(m.cycle_s, w.cycle_s()) && copy.ratio(m.ratio, w.ratio()) &&
         copy(m.planned.stamp, w.planned_stamp()) && copy.ratio(m.planned.ratio, w.planned_ratio()) &&
         base_fields(copy, m, w) && list_fields(copy, m.members, w.members(), &Base::members) &&
         list_fields(copy, m.fixed, w.fixed_bodies(), &Base::fixed) &&
         list_fields(copy, m.islands, w.islands(), &Base::islands) && copy(m.entering, w.entering()) &&
         state_fields(copy, m.states, w.states()) && copy(m.border_contacts, w.border_contacts()) &&
         copy(m.border_bodies, w.border_bodies()) && copy(m.border, w.border()) && ghost_fields(copy, m.ghosts, w) &&
         copy(m.ghost_peers, w.ghost_peers()) && copy(m.peers, w.peers()) &&
         copy(m.outside_work_j, w.outside_work_j()) && copy(m.suppression, w.suppression());
}

bool fields(const auto& copy, Is<HapticReport> auto& m, auto& w) {
  return copy(m.user, w.user()) && copy(m.session, w.session()) && copy(m.sender, w.sender()) &&
         copy(m.stamp, w.stamp()) && copy(m.stamp_s, w.stamp_s()) && copy.positive(m.clock_rate, w.clock_rate()) &&
         copy(m.sent_ns, w.sent_ns()) && copy(m.confirmed_stamp, w.confirmed_stamp()) &&
         copy(m.started_stamp, w.started_stamp()) && copy(m.impulse_total, w.impulse_total()) &&
         copy(m.device_work_j, w.device_work_j()) && copy(m.coupling_energy_j, w.coupling_energy_j()) &&
         copy(m.operator_work_j, w.operator_work_j()) && copy(m.proxy, w.proxy()) && copy(m.device, w.device()) &&
         base_fields(copy, m, w) &&
         state_fields(copy, m.members, w.members(), [&m](std::size_t i) { return is_overruled(m, i); }) &&
         list_fields(copy, m.islands, w.islands(), &Base::islands) && copy(m.indicators, w.indicators()) &&
         copy(m.timing.mean_s, w.step_mean_s()) && copy(m.timing.max_s, w.step_max_s()) &&
         copy(m.peer_age_s, w.peer_age_s()) && copy(m.missed, w.missed()) && copy(m.followed, w.followed());
}

bool fields(const auto& copy, Is<WorldSnapshot> auto& m, auto& w) {
  return copy(m.sequence, w.sequence_number()) && copy(m.stamp_s, w.stamp_s()) &&
         copy.not_negative(m.real_time_factor, w.real_time_factor()) && copy(m.moved, w.moved()) &&
         copy(m.users, w.users());
}

bool fields(const auto& copy, Is<Control> auto& m, auto& w) {
  return copy(m.number, w.number()) && copy.kind(m.verb, w.verb(), ControlVerb::set_speed) &&
         copy(m.argument, w.argument());
}

bool fields(const auto& copy, Is<ControlReply> auto& m, auto& w) {
  return copy.kind(m.program, w.program(), ProgramKind::gui_headless) && copy(m.instance, w.instance()) &&
         copy(m.number, w.number()) && copy.kind(m.answer.outcome, w.outcome(), OrderState::refused) &&
         copy(m.answer.text, w.text());
}

bool fields(const auto& copy, Is<EventCounts> auto& m, auto& w) {
  return copy(m.matched, w.matched()) && copy(m.unmatched, w.unmatched()) &&
         copy(m.deadline_missed, w.deadline_missed()) && copy(m.liveliness_lost, w.liveliness_lost()) &&
         copy(m.incompatible_qos, w.incompatible_qos()) && copy(m.lost, w.lost()) && copy(m.rejected, w.rejected()) &&
         copy(m.refused, w.refused());
}

bool fields(const auto& copy, Is<Status> auto& m, auto& w) {
  return copy.kind(m.program, w.program(), ProgramKind::gui_headless) && copy(m.instance, w.instance()) &&
         copy(m.wire_version, w.wire_version()) && copy(m.state, w.state()) && copy(m.time_s, w.time_s()) &&
         copy(m.rate_hz, w.rate_hz()) && copy(m.steps, w.steps()) && copy(m.missed_deadlines, w.missed_deadlines()) &&
         copy(m.missed_by_os, w.missed_by_os()) && copy(m.step_s, w.step_s()) && copy(m.force_n, w.force_n()) &&
         copy(m.real_time_factor, w.real_time_factor()) && copy(m.done_ratio, w.done_ratio()) &&
         copy(m.paused, w.paused()) && copy(m.waits_for, w.waits_for()) && copy(m.events, w) && copy(m.text, w.text());
}

}  // namespace subworld
