#pragma once

#include "model/contact.hpp"
#include "model/messages/control.hpp"
#include "model/messages/ghosts.hpp"
#include "model/messages/message_fields.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// The messages between the programs, one struct per topic. `session` identifies the world's run, `sender` the sending
/// process, `served` the process that is answered. With these a receiver rejects messages of another run, or of a
/// program that was restarted. This header has those of the loops, and the others by its includes.
namespace subworld {

/// Topic `device_state`, keyed by device.
struct DeviceState {
  std::uint32_t device = 0;
  std::uint64_t session = 0;
  std::uint64_t sender = 0;
  std::uint64_t sequence = 0;
  double stamp_s = 0.0;      ///< device time
  std::int64_t sent_ns = 0;  ///< device's clock; echoed, so that the device can measure the round trip
  Pose pose;
  Vec3 linear_velocity = Vec3::Zero();
  Vec3 angular_velocity = Vec3::Zero();
  Wrench applied;  ///< by the operator, for admittance devices
  std::uint32_t buttons = 0;
};
bool fields(auto& archive, Is<DeviceState> auto& m) {
  return archive("device", m.device) && archive("session", m.session) && archive("sender", m.sender) &&
         archive("sequence_number", m.sequence) && archive("stamp_s", m.stamp_s) && archive("sent_ns", m.sent_ns) &&
         archive("pose", m.pose) && archive("linear_velocity", m.linear_velocity) &&
         archive("angular_velocity", m.angular_velocity) && archive("applied", m.applied) &&
         archive("buttons", m.buttons);
}

/// Topic `device_command`, keyed by device.
struct DeviceCommand {
  std::uint32_t device = 0;
  std::uint64_t session = 0;
  std::uint64_t served = 0;    ///< sender of the device state that this answers; 0: none received yet
  std::uint64_t sequence = 0;  ///< sequence number of the device state that this answers
  double stamp_s = 0.0;        ///< simulation time
  std::int64_t echoed_sent_ns = 0;
  Wrench wrench;  ///< for impedance devices
  Pose pose;      ///< for admittance devices, as the velocities
  Vec3 linear_velocity = Vec3::Zero();
  Vec3 angular_velocity = Vec3::Zero();
  double others_work_j = 0.0;  ///< see WorldFrame; of all other operators whom this one feels
  double bodies_j = 0.0;       ///< see WorldFrame
  bool last = false;           ///< the run is over
};
bool fields(auto& archive, Is<DeviceCommand> auto& m) {
  return archive("device", m.device) && archive("session", m.session) && archive("served", m.served) &&
         archive("sequence_number", m.sequence) && archive("stamp_s", m.stamp_s) &&
         archive("echoed_sent_ns", m.echoed_sent_ns) && archive("wrench", m.wrench) && archive("pose", m.pose) &&
         archive("linear_velocity", m.linear_velocity) && archive("angular_velocity", m.angular_velocity) &&
         archive("others_work_j", m.others_work_j) && archive("bodies_j", m.bodies_j) && archive("last", m.last);
}

/// A contact between a body inside the sub-world and one outside (paper 4.2), or a pair that may come into contact soon
/// (coupling/approach). In a pair of the second kind, `inside` may be a ghost. Impulses act on `inside`.
struct BoundaryContact {
  BodyId inside{};
  BodyId outside{};
  Vec3 point = Vec3::Zero();
  Vec3 normal = Vec3::UnitZ();             ///< towards the inside body
  double distance = 0.0;                   ///< m, negative: penetration
  double normal_impulse = 0.0;             ///< over the world's whole step, N s
  Vec3 tangential_impulse = Vec3::Zero();  ///< N s
};
bool fields(auto& archive, Is<BoundaryContact> auto& m) {
  return archive("inside", m.inside) && archive("outside", m.outside) && archive("point", m.point) &&
         archive("normal", m.normal) && archive("distance", m.distance) &&
         archive("normal_impulse", m.normal_impulse) && archive("tangential_impulse", m.tangential_impulse);
}

/// Whether the pair is already in contact.
[[nodiscard]] inline bool touches(const BoundaryContact& pair) noexcept {
  return pair.normal_impulse > 0.0 || pair.distance < 0.0;
}

struct EnteringBody {
  Body body;
  BodyState state;
};
bool fields(auto& archive, Is<EnteringBody> auto& m) {
  return archive("body", m.body) && archive("state", StateOf{m.body.id, m.state});
}

/// No device is extrapolated for longer, s of its own time, and no impulse, s of simulated time: the user may have
/// gone.
inline constexpr double kLongestGuess_s = 0.2;

/// Without a message for longer, s of simulated time, a user is absent: the world holds the proxy where it is, the
/// sub-world pauses, and they start anew with each other (`WorldFrame::served`).
inline constexpr double kAbsent_s = 0.25;

/// `PeerDevice::device_s` of an absent user, whose proxy the world holds: no state of the device is newer.
inline constexpr double kHeldDevice_s = 1e300;

/// The device of another user whose proxy is in the sub-world, or pushes one of its ghosts.
struct PeerDevice {
  BodyId proxy{};
  Pose pose;                             ///< in scene coordinates, at the frame's stamp
  Vec3 linear_velocity = Vec3::Zero();   ///< in simulated time
  Vec3 angular_velocity = Vec3::Zero();  ///< in simulated time
  Wrench applied = {};                   ///< admittance devices
  double device_s = 0.0;                 ///< device time that belongs to the frame's stamp
  Vec3 offset = Vec3::Zero();            ///< position in the scene minus that of the device
  Quat turn = Quat::Identity();          ///< orientation in the scene = that of the device * turn
};
bool placed_device_fields(auto& archive, auto& m) {
  return archive("pose", m.pose) && archive("linear_velocity", m.linear_velocity) &&
         archive("angular_velocity", m.angular_velocity) && archive("applied", m.applied) &&
         archive("device_s", m.device_s) && archive("offset", m.offset) && archive("turn", m.turn);
}
bool fields(auto& archive, Is<PeerDevice> auto& m) {
  return archive("proxy", m.proxy) && placed_device_fields(archive, m);
}

/// Message suppression (coupling/messages/suppression): no messages are sent until a stamp, or until the proxy leaves a
/// region.
struct Suppression {
  std::uint64_t until = 0;  ///< stamp of the next frame and the next report
  Box place;                ///< region in which there is no body but the proxy until then
};
bool fields(auto& archive, Is<Suppression> auto& m) {
  return archive("until_stamp", m.until) && archive("lower", m.place.lower) && archive("upper", m.place.upper);
}

/// Each cycle from the one at `stamp` on has `ratio` haptic steps.
struct RatioChange {
  std::uint64_t stamp = 0;
  int ratio = 1;
};

/// Label of an island that reaches out of the sub-world.
inline constexpr std::uint32_t kOpenIsland = 0xFFFFFFFF;

/// Topic `world_frame`, keyed by user: the world at t = stamp_s for one user.
struct WorldFrame {
  UserId user{};
  std::uint64_t session = 0;
  /// Sender of the report that this answers; 0: the user is absent or joins. Then the frame is complete, and a
  /// sub-world starts anew from it. The world takes reports of the user again that confirm it.
  std::uint64_t served = 0;
  std::uint64_t stamp = 0;  ///< j: the state when cycle j begins
  double stamp_s = 0.0;
  double start_in_s =
      0.0;  ///< real time: seconds from sending until the world's clock reaches this stamp; may be negative
  double real_time_factor = 1.0;    ///< world seconds per second
  std::int64_t echoed_sent_ns = 0;  ///< of the newest report that the world has used
  std::uint64_t echoed_stamp = 0;
  std::uint64_t newest_stamp = 0;  ///< of the newest report that the world has received, used or not
  bool last = false;
  double cycle_s = 0.0;  ///< length of the cycle that ended at this stamp; impulses are totals over it
  int ratio = 1;         ///< haptic steps in the cycle that begins here
  RatioChange planned;   ///< the newest change; may lie in the past
  /// Of an older frame that the sub-world has confirmed: only what differs from it is sent (wire/changes).
  std::optional<std::uint64_t> base_stamp;
  std::vector<BodyId> members;  ///< movable bodies of the sub-world from this stamp on, proxy included
  std::vector<BodyId> fixed;    ///< fixed bodies of the sub-world
  std::vector<std::uint32_t>
      islands;  ///< island of each member, by the world's contacts (coupling/select/contact_graph)
  std::vector<EnteringBody> entering;  ///< not yet confirmed by a report
  /// The world's own result, before any blend: members, bodies that just left, ghosts.
  std::vector<StampedBody> states;
  std::uint32_t border_contacts = 0;    ///< contacts between inside and outside bodies
  std::uint32_t border_bodies = 0;      ///< members with such a contact, or with one soon
  std::vector<BoundaryContact> border;  ///< the contacts that the sub-world needs
  std::vector<GhostModel> ghosts;
  std::vector<GhostPeer> ghost_peers;
  std::vector<PeerDevice> peers;
  /// Since the start, J: of the other operators whom contacts connect to this one while their proxies are not members,
  /// and what the connected bodies have lost below the least energy of before.
  double outside_work_j = 0.0;
  double bodies_j = 0.0;                     ///< energy of the connected bodies above the least that each has had
  std::vector<std::uint32_t> broken_joints;  ///< of the scene's, since the start
  std::optional<Suppression> suppression;    ///< takes effect after this frame
};
bool fields(auto& archive, Is<WorldFrame> auto& m) {
  const auto possible = [](int ratio) { return ratio >= 1 && ratio <= kMostRatio; };
  auto& changes = archive.changes;
  return archive("user", m.user) && archive("session", m.session) && archive("served", m.served) &&
         archive("stamp", m.stamp) && archive("stamp_s", m.stamp_s) && archive("start_in_s", m.start_in_s) &&
         archive("real_time_factor", m.real_time_factor) && archive("echoed_sent_ns", m.echoed_sent_ns) &&
         archive("echoed_stamp", m.echoed_stamp) && archive("newest_stamp", m.newest_stamp) &&
         archive("last", m.last) && archive("cycle_s", m.cycle_s) && archive("ratio", m.ratio) &&
         archive("planned_stamp", m.planned.stamp) && archive("planned_ratio", m.planned.ratio) &&
         archive.check(m.stamp_s >= 0.0 && m.real_time_factor >= 0.0 && m.cycle_s >= 0.0 && possible(m.ratio) &&
                       possible(m.planned.ratio)) &&
         archive("base_stamp", m.base_stamp, changes.base_stamp) && archive("members", m.members, changes.members) &&
         archive("fixed_bodies", m.fixed, changes.fixed) && archive("islands", m.islands, changes.islands) &&
         archive("entering", m.entering) && archive("states", m.states, changes.states) &&
         archive("border_contacts", m.border_contacts) && archive("border_bodies", m.border_bodies) &&
         archive("border", m.border) && archive("ghosts", m.ghosts, changes.ghosts) &&
         archive("carried_bodies", m.ghosts, changes.carried) && archive("ghost_peers", m.ghost_peers) &&
         archive("peers", m.peers) && archive("outside_work_j", m.outside_work_j) && archive("bodies_j", m.bodies_j) &&
         archive("broken_joints", m.broken_joints) && archive("suppression", m.suppression);
}

/// Reserves memory for a usual sub-world, so that a loop does not allocate.
inline void reserve(WorldFrame& frame, std::size_t bodies) {
  frame.members.reserve(bodies);
  frame.fixed.reserve(bodies);
  frame.entering.reserve(bodies);
  frame.states.reserve(bodies);
  frame.islands.reserve(bodies);
  frame.border.reserve(4 * bodies);
  frame.ghosts.reserve(bodies);
  frame.ghost_peers.reserve(bodies);
}

/// Criteria for blending the two copies of a body (paper 4.3); sums over one haptic cycle.
struct Indicators {
  double proxy_impulse_n_s = 0.0;   ///< magnitudes of all contacts on the proxy
  double total_impulse_n_s = 0.0;   ///< magnitudes of all contacts in the sub-world
  double device_impulse_n_s = 0.0;  ///< magnitudes returned by the device
  std::uint32_t border_bodies = 0;
  std::uint32_t proxy_contacts = 0;  ///< maximum over the steps of the cycle
};
bool fields(auto& archive, Is<Indicators> auto& m) {
  return archive("proxy_impulse_n_s", m.proxy_impulse_n_s) && archive("total_impulse_n_s", m.total_impulse_n_s) &&
         archive("device_impulse_n_s", m.device_impulse_n_s) && archive("border_bodies", m.border_bodies) &&
         archive("proxy_contacts", m.proxy_contacts);
}

struct StepTiming {
  double mean_s = 0.0;
  double max_s = 0.0;
};

struct ReportedDevice {
  Pose pose;                             ///< in scene coordinates
  Vec3 linear_velocity = Vec3::Zero();   ///< in simulated time
  Vec3 angular_velocity = Vec3::Zero();  ///< in simulated time
  Wrench applied;                        ///< admittance devices
  double device_s = 0.0;                 ///< device time that belongs to the report's stamp
  Vec3 offset = Vec3::Zero();            ///< position in the scene minus that of the device
  Quat turn = Quat::Identity();          ///< orientation in the scene = that of the device * turn
};
bool fields(auto& archive, Is<ReportedDevice> auto& m) { return placed_device_fields(archive, m); }

/// Topic `haptic_report`, keyed by user: the sub-world at t = stamp_s, and the cycle before.
struct HapticReport {
  UserId user{};
  std::uint64_t session = 0;
  std::uint64_t sender = 0;
  std::uint64_t stamp = 0;
  double stamp_s = 0.0;
  double clock_rate = 1.0;  ///< simulated seconds per second in the newest step, > 0
  std::int64_t sent_ns = 0;
  std::uint64_t confirmed_stamp = 0;  ///< newest frame whose entering bodies are in the sub-world
  std::uint64_t started_stamp = 0;    ///< of the frame from which the sub-world has started, or started anew
  Wrench impulse_total;               ///< injected by the user since t = 0, N s and N m s
  double device_work_j = 0.0;         ///< since t = 0
  double coupling_energy_j = 0.0;     ///< stored in the springs of the virtual coupling
  double operator_work_j = 0.0;       ///< of the operator on the device, since the start
  BodyState proxy;
  std::optional<ReportedDevice> device;  ///< empty if no reader needs it (optimisation `device`)
  /// Of an older report that the world has used: only what differs from it is sent (wire/changes).
  std::optional<std::uint64_t> base_stamp;
  /// The states of members in open islands are not sent: the world overrules them (optimisation `overruled`). A
  /// receiver has older ones in their place.
  bool omits_overruled = false;
  std::vector<StampedBody> members;    ///< the sub-world's own result, before any blend
  std::vector<std::uint32_t> islands;  ///< island of each member, by the sub-world's contacts
  Indicators indicators;
  StepTiming timing;
  double peer_age_s = 0.0;  ///< greatest age of the other users' device motion that the cycle used, simulated time
  std::vector<MissedStates> missed;     ///< since the last report
  std::vector<FollowedOrder> followed;  ///< likewise
};
bool fields(auto& archive, Is<HapticReport> auto& m) {
  auto& changes = archive.changes;
  return archive("user", m.user) && archive("session", m.session) && archive("sender", m.sender) &&
         archive("stamp", m.stamp) && archive("stamp_s", m.stamp_s) && archive("clock_rate", m.clock_rate) &&
         archive.check(m.clock_rate > 0.0) && archive("sent_ns", m.sent_ns) &&
         archive("confirmed_stamp", m.confirmed_stamp) && archive("started_stamp", m.started_stamp) &&
         archive("impulse_total", m.impulse_total) && archive("device_work_j", m.device_work_j) &&
         archive("coupling_energy_j", m.coupling_energy_j) && archive("operator_work_j", m.operator_work_j) &&
         archive("proxy", m.proxy) && archive("device", m.device) &&
         archive("base_stamp", m.base_stamp, changes.base_stamp) && archive("members", m.members, changes.states) &&
         archive("islands", m.islands, changes.islands) && archive("indicators", m.indicators) &&
         archive("step_mean_s", m.timing.mean_s) && archive("step_max_s", m.timing.max_s) &&
         archive("peer_age_s", m.peer_age_s) && archive("missed", m.missed) && archive("followed", m.followed);
}

inline void reserve(HapticReport& report, std::size_t bodies) {
  report.members.reserve(bodies);
  report.islands.reserve(bodies);
}

/// Initial room, in bodies. A larger sub-world costs a few allocations until every buffer has grown.
inline constexpr std::size_t kUsualMembers = 128;

struct UserView {
  UserId user{};
  BodyId proxy{};
  std::vector<BodyId> members;
  std::vector<BoundaryContact> border;
  Wrench wrench;  ///< mean over the last cycle, on the proxy
};
bool fields(auto& archive, Is<UserView> auto& m) {
  return archive("user", m.user) && archive("proxy", m.proxy) && archive("members", m.members) &&
         archive("border", m.border) && archive("wrench", m.wrench);
}

/// Within so much simulated time, s, comes a snapshot of all bodies.
inline constexpr double kCompleteSnapshot_s = 1.1;

/// Topic `world_state`: for the display.
struct WorldSnapshot {
  std::uint64_t sequence = 0;
  double stamp_s = 0.0;
  double real_time_factor = 1.0;
  std::vector<StampedBody> moved;  ///< since the last snapshot; all of them once a second
  std::vector<UserView> users;
  std::vector<std::uint32_t> broken_joints;  ///< of the scene's, since the start
};
bool fields(auto& archive, Is<WorldSnapshot> auto& m) {
  return archive("sequence_number", m.sequence) && archive("stamp_s", m.stamp_s) &&
         archive("real_time_factor", m.real_time_factor) && archive.check(m.real_time_factor >= 0.0) &&
         archive("moved", m.moved) && archive("users", m.users) && archive("broken_joints", m.broken_joints);
}

}  // namespace subworld
