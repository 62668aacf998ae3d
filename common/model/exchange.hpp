#pragma once

#include "model/agreed_settings.hpp"
#include "model/body.hpp"
#include "model/contact.hpp"
#include "model/presence.hpp"

#include <Eigen/Core>

#include <algorithm>
#include <array>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

/// The messages between the programs, one struct per topic. `session` identifies the world's run, `sender` the sending
/// process, `served` the process that is answered. With these a receiver rejects messages of another run, or of a
/// program that was restarted.
///
/// `fields(archive, message)` describes what travels: names and order are those of the struct in the IDL. An archive
/// writes the fields, reads them (wire/cdr), or shows them, and says whether they are valid. A reader leaves a message
/// that is not valid half filled. `check` holds for readers alone: a writer sends everything, the receiver decides.
/// What stands in `archive.changes` travels in place of a list of the message (wire/changes).
namespace subworld {

/// A struct of the model, constant while it is written.
template <class T, class Struct>
concept Is = std::same_as<std::remove_const_t<T>, Struct>;

bool fields(auto& archive, Is<Pose> auto& m) {
  return archive("position", m.position) && archive("orientation", m.orientation);
}

bool motion_fields(auto& archive, Is<BodyState> auto& m) {
  return archive("position", m.position) && archive("orientation", m.orientation) &&
         archive("linear_velocity", m.linear_velocity) && archive("angular_velocity", m.angular_velocity);
}
bool fields(auto& archive, Is<StampedBody> auto& m) { return archive("body", m.id) && motion_fields(archive, m.state); }
/// Where it is known whose state it is.
bool fields(auto& archive, Is<BodyState> auto& m) {
  BodyId body{};
  return archive("body", body) && motion_fields(archive, m);
}
/// A state with the id that it must have.
template <class State>
struct StateOf {
  BodyId id;
  State& state;
};
template <class State>
StateOf(BodyId, State&) -> StateOf<State>;
template <class State>
bool fields(auto& archive, const StateOf<State>& m) {
  BodyId body = m.id;
  return archive("body", body) && archive.check(body == m.id) && motion_fields(archive, m.state);
}

bool fields(auto& archive, Is<Mesh> auto& m) {
  return archive("file", m.file) && archive("vertices", m.vertices) && archive("triangles", m.triangles) &&
         archive.check(std::ranges::all_of(m.triangles, [&](const auto& triangle) {
           return std::ranges::all_of(triangle, [&](std::uint32_t corner) { return corner < m.vertices.size(); });
         }));
}

bool fields(auto& archive, Is<Body> auto& m) {
  return archive("id", m.id) && archive("name", m.name) && archive("shape", m.shape.kind) &&
         archive("half_extents", m.shape.half_extents) && archive("radius", m.shape.radius) &&
         archive("half_length", m.shape.half_length) && archive("mesh", m.shape.mesh) &&
         archive("friction", m.material.friction) && archive("restitution", m.material.restitution) &&
         archive("mass", m.mass) && archive("inertia", m.inertia) && archive("gravity", m.gravity) &&
         archive("rotates", m.rotates) &&
         archive.check(m.shape.kind <= ShapeKind::mesh && m.shape.half_extents.minCoeff() >= 0.0 &&
                       m.shape.radius >= 0.0 && m.shape.half_length >= 0.0 && m.material.friction >= 0.0 &&
                       m.material.restitution >= 0.0 && m.material.restitution <= 1.0 && m.mass >= 0.0 &&
                       m.inertia.minCoeff() >= 0.0);
}

bool fields(auto& archive, Is<NamedSetting> auto& m) { return archive("name", m.name) && archive("value", m.value); }

bool fields(auto& archive, Is<MissedStates> auto& m) {
  return archive("peer", m.peer) && archive("from_s", m.from_s) && archive.check(m.from_s >= 0.0) &&
         archive("to_s", m.to_s) && archive.check(m.from_s < m.to_s);
}

bool fields(auto& archive, Is<FollowedOrder> auto& m) {
  return archive("at_s", m.at_s) && archive.check(m.at_s >= 0.0) && archive("engine", m.engine);
}

struct Wrench {
  Vec3 force = Vec3::Zero();   ///< N
  Vec3 torque = Vec3::Zero();  ///< N m
};
bool fields(auto& archive, Is<Wrench> auto& m) { return archive("force", m.force) && archive("torque", m.torque); }

/// Version of the messages: it changes with each change of their layout or meaning. Programs of different versions
/// refuse to work together. Versions before had none; they begin with the length of a name, which is shorter.
inline constexpr std::uint32_t kWireVersion = 100'004;

/// Topic `scene`: all that a late joiner needs to create every body.
struct SceneDescription {
  std::uint32_t wire_version = kWireVersion;  ///< of another version nothing else is known
  std::string name;
  std::vector<NamedSetting> settings;  ///< programs with other ones refuse to work together
  std::uint64_t session = 0;           ///< drawn by the world
  std::uint32_t users = 0;             ///< haptic processes that take part
  std::vector<Mesh> meshes;
  std::vector<Body> bodies;
  std::vector<BodyState> states;  ///< of bodies[i] when the description was written
};
bool fields(auto& archive, Is<SceneDescription> auto& m) {
  return archive("wire_version", m.wire_version) && archive("name", m.name) && archive("settings", m.settings) &&
         archive("session", m.session) && archive("users", m.users) && archive("meshes", m.meshes) &&
         archive("bodies", m.bodies) &&
         archive.sequence("states", m.states,
                          [&](std::size_t i, auto& state) {
                            return archive("", StateOf{i < m.bodies.size() ? m.bodies[i].id : BodyId{}, state});
                          }) &&
         archive.check(m.states.size() == m.bodies.size()) &&
         archive.check(std::ranges::all_of(m.bodies, [&](const Body& body) {
           const bool needs_mesh = body.shape.kind == ShapeKind::convex || body.shape.kind == ShapeKind::mesh;
           return !needs_mesh || body.shape.mesh < m.meshes.size();
         }));
}

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
  double others_work_j = 0.0;  ///< of the other operators on the bodies that this one feels, since the start
  bool last = false;           ///< the run is over
};
bool fields(auto& archive, Is<DeviceCommand> auto& m) {
  return archive("device", m.device) && archive("session", m.session) && archive("served", m.served) &&
         archive("sequence_number", m.sequence) && archive("stamp_s", m.stamp_s) &&
         archive("echoed_sent_ns", m.echoed_sent_ns) && archive("wrench", m.wrench) && archive("pose", m.pose) &&
         archive("linear_velocity", m.linear_velocity) && archive("angular_velocity", m.angular_velocity) &&
         archive("others_work_j", m.others_work_j) && archive("last", m.last);
}

/// A Coulomb limit that no load in a scene exceeds. It marks a body that does not move.
inline constexpr double kWallLimit_n = 1e9;

/// Resistance of an outside body to a push along one direction.
struct GhostAxis {
  /// Towards the inside bodies, or an unconstrained direction; the axes of a ghost are orthogonal.
  Vec3 normal = Vec3::UnitZ();
  double force_n = 0.0;          ///< present force along `normal`
  double coulomb_limit_n = 0.0;  ///< under the model's load; kWallLimit_n: a wall
  Vec3 load_dependent_friction =
      Vec3::Zero();  ///< N/N, increase of the limit per force of the inside bodies on the outside body
};

inline constexpr std::size_t kMostGhostAxes = 3;

/// An outside body that only inside bodies support, and the bodies that it carries, as one rigid body
/// (coupling/carried).
struct CarriedBody {
  double mass_kg = 0.0;
  Vec3 centre_m = Vec3::Zero();                             ///< centre of mass, relative to the outside body's centre
  Eigen::Matrix3d inertia_kg_m2 = Eigen::Matrix3d::Zero();  ///< about the centre of mass, world axes
  Wrench drive;  ///< of everything but the inside bodies, at the outside body's centre
};
bool fields(auto& archive, Is<CarriedBody> auto& m) {
  return archive("mass_kg", m.mass_kg) && archive.check(m.mass_kg > 0.0) && archive("centre_m", m.centre_m) &&
         archive("inertia_kg_m2", m.inertia_kg_m2) && archive("drive", m.drive);
}

/// The reduced model of an outside body that touches inside bodies, or soon may (coupling/ghost).
struct GhostModel {
  BodyId outside{};
  double mass_kg = 0.0;
  Vec3 load_n = Vec3::Zero();  ///< of the inside bodies on it, friction included, mean over the world's step
  std::size_t axis_count = 0;
  std::array<GhostAxis, kMostGhostAxes> axes;  ///< the most heavily loaded first
  /// If set, the ghost moves by this; the axes then only give the contact points' directions.
  std::optional<CarriedBody> carried = {};
  bool approaching = false;  ///< touches no member yet; collides with ghosts too
};

/// Another user who pushes the outside towards the sub-world, along an axis of a ghost.
struct GhostPeer {
  BodyId outside{};        ///< of the ghost
  std::uint32_t axis = 0;  ///< of the ghost, 0 .. kMostGhostAxes - 1
  BodyId proxy{};          ///< of the user
  double offset_m = 0.0;   ///< of the proxy from the outside body, along the axis
};
bool fields(auto& archive, Is<GhostPeer> auto& m) {
  return archive("outside", m.outside) && archive("axis", m.axis) && archive.check(m.axis < kMostGhostAxes) &&
         archive("proxy", m.proxy) && archive("offset_m", m.offset_m);
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

/// No device is extrapolated for longer, s of simulated time: its user may have gone.
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
  /// Since the start, of the other operators whom contacts connect to this one while their proxies are not members.
  double outside_work_j = 0.0;
  std::optional<Suppression> suppression;  ///< takes effect after this frame
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
         archive("peers", m.peers) && archive("outside_work_j", m.outside_work_j) &&
         archive("suppression", m.suppression);
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
};
bool fields(auto& archive, Is<WorldSnapshot> auto& m) {
  return archive("sequence_number", m.sequence) && archive("stamp_s", m.stamp_s) &&
         archive("real_time_factor", m.real_time_factor) && archive.check(m.real_time_factor >= 0.0) &&
         archive("moved", m.moved) && archive("users", m.users);
}

/// Values as in the IDL. 6 is none: the world refuses it, as all that it does not know.
enum class ControlVerb : std::uint8_t {
  stop,
  pause,
  resume,
  step,
  seek,  ///< of a replay: to a moment
  set_engine,
  leave = 7,
  set_ratio,  ///< "4" or "4-12"
  set_speed,  ///< of a replay: simulated time per time
};

/// The verbs as `subworld control` names them.
struct VerbName {
  ControlVerb verb;
  const char* name;
  const char* example = "";  ///< of its argument on the command line; empty: it has none
};
inline constexpr std::array kVerbs{VerbName{ControlVerb::stop, "stop"},
                                   VerbName{ControlVerb::pause, "pause"},
                                   VerbName{ControlVerb::resume, "resume"},
                                   VerbName{ControlVerb::step, "step"},
                                   VerbName{ControlVerb::leave, "leave", "--user 1"},
                                   VerbName{ControlVerb::set_engine, "engine", "bullet_float"},
                                   VerbName{ControlVerb::set_ratio, "ratio", "--ratio 4-8"},
                                   VerbName{ControlVerb::seek, "seek", "--time 1.5"},
                                   VerbName{ControlVerb::set_speed, "speed", "--speed 2"}};
[[nodiscard]] constexpr std::string_view name_of(ControlVerb verb) noexcept {
  const auto at = std::ranges::find(kVerbs, verb, &VerbName::verb);
  return at != kVerbs.end() ? at->name : "";
}

/// Topic `control`.
struct Control {
  std::uint32_t number = 0;  ///< drawn by the sender; the answer repeats it
  ControlVerb verb = ControlVerb::stop;
  std::string argument;
};
bool fields(auto& archive, Is<Control> auto& m) {
  return archive("number", m.number) && archive("verb", m.verb) && archive.check(m.verb <= ControlVerb::set_speed) &&
         archive("argument", m.argument);
}

/// What came of an order: `preparing` is followed by one of the others.
enum class OrderState : std::uint8_t { preparing, done, refused };
[[nodiscard]] constexpr std::string_view name_of(OrderState state) noexcept {
  constexpr std::array<std::string_view, 3> kNames{"preparing", "done", "refused"};
  const auto at = static_cast<std::size_t>(state);
  return at < kNames.size() ? kNames[at] : "";
}
struct OrderAnswer {
  OrderState outcome = OrderState::done;
  std::string text;
};

struct EventCounts {
  std::uint64_t matched = 0;
  std::uint64_t unmatched = 0;
  std::uint64_t deadline_missed = 0;
  std::uint64_t liveliness_lost = 0;
  std::uint64_t incompatible_qos = 0;
  std::uint64_t lost = 0;      ///< samples that the middleware says are lost
  std::uint64_t rejected = 0;  ///< samples that did not decode or had invalid contents
  std::uint64_t refused = 0;   ///< samples of a foreign writer: one that does not take part in the run
};
bool fields(auto& archive, Is<EventCounts> auto& m) {
  return archive("matched", m.matched) && archive("unmatched", m.unmatched) &&
         archive("deadline_missed", m.deadline_missed) && archive("liveliness_lost", m.liveliness_lost) &&
         archive("incompatible_qos", m.incompatible_qos) && archive("lost", m.lost) &&
         archive("rejected", m.rejected) && archive("refused", m.refused);
}

[[nodiscard]] inline EventCounts operator-(const EventCounts& to, const EventCounts& from) noexcept {
  return {to.matched - from.matched,
          to.unmatched - from.unmatched,
          to.deadline_missed - from.deadline_missed,
          to.liveliness_lost - from.liveliness_lost,
          to.incompatible_qos - from.incompatible_qos,
          to.lost - from.lost,
          to.rejected - from.rejected,
          to.refused - from.refused};
}

enum class ProgramKind : std::uint32_t { world_sim, haptic_sim, device_sim, gui_headless };

/// Topic `control_reply`, keyed by program and instance.
struct ControlReply {
  ProgramKind program = ProgramKind::world_sim;
  std::uint32_t instance = 0;
  std::uint32_t number = 0;  ///< of the `Control`
  OrderAnswer answer;
};
bool fields(auto& archive, Is<ControlReply> auto& m) {
  return archive("program", m.program) && archive.check(m.program <= ProgramKind::gui_headless) &&
         archive("instance", m.instance) && archive("number", m.number) && archive("outcome", m.answer.outcome) &&
         archive.check(m.answer.outcome <= OrderState::refused) && archive("text", m.answer.text);
}

/// State in a `Status` of a program that ends with an error; `text` is the reason.
inline constexpr const char* kFailedState = "failed";

/// Topic `status`, keyed by program and instance: each program sends one a second.
struct Status {
  ProgramKind program = ProgramKind::world_sim;
  std::uint32_t instance = 0;                 ///< user or device
  std::uint32_t wire_version = kWireVersion;  ///< of another version nothing else is known
  std::string state;                          ///< loading, settling, waiting, running, stopping, failed
  double time_s = 0.0;
  double rate_hz = 0.0;
  std::uint64_t steps = 0;
  std::uint64_t missed_deadlines = 0;
  std::uint64_t missed_by_os = 0;  ///< of `missed_deadlines` (rt/lateness)
  double step_s = 0.0;             ///< mean over the last second
  double force_n = 0.0;            ///< haptic_sim: on the operator
  double real_time_factor = 1.0;   ///< world_sim; 1 elsewhere
  double done_ratio = 0.0;         ///< progress 0 .. 1 of `loading` or `settling`
  bool paused = false;             ///< world_sim: by an order
  std::string waits_for;           ///< program whose messages have not come for 2 s: "haptic_sim 0"; empty: none
  EventCounts events;
  std::string text;  ///< events since the last status, in words
};
bool fields(auto& archive, Is<Status> auto& m) {
  return archive("program", m.program) && archive.check(m.program <= ProgramKind::gui_headless) &&
         archive("instance", m.instance) && archive("wire_version", m.wire_version) && archive("state", m.state) &&
         archive("time_s", m.time_s) && archive("rate_hz", m.rate_hz) && archive("steps", m.steps) &&
         archive("missed_deadlines", m.missed_deadlines) && archive("missed_by_os", m.missed_by_os) &&
         archive("step_s", m.step_s) && archive("force_n", m.force_n) &&
         archive("real_time_factor", m.real_time_factor) && archive("done_ratio", m.done_ratio) &&
         archive("paused", m.paused) && archive("waits_for", m.waits_for) && fields(archive, m.events) &&
         archive("text", m.text);
}

}  // namespace subworld
