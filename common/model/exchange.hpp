#pragma once

#include "model/agreed_settings.hpp"
#include "model/body.hpp"
#include "model/contact.hpp"
#include "model/presence.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// The messages between the programs, one struct per topic. `wire/convert` maps each to its IDL type. `session`
/// identifies the world's run, `sender` the sending process, `served` the process that is answered. With these a
/// receiver rejects messages of another run, or of a program that was restarted.
namespace subworld {

struct Wrench {
  Vec3 force = Vec3::Zero();   ///< N
  Vec3 torque = Vec3::Zero();  ///< N m
};

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

/// Whether the pair is already in contact.
[[nodiscard]] inline bool touches(const BoundaryContact& pair) noexcept {
  return pair.normal_impulse > 0.0 || pair.distance < 0.0;
}

struct EnteringBody {
  Body body;
  BodyState state;
};

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

/// Message suppression (coupling/suppression): no messages are sent until a stamp, or until the proxy leaves a region.
struct Suppression {
  std::uint64_t until = 0;  ///< stamp of the next frame and the next report
  Box place;                ///< region in which there is no body but the proxy until then
};

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
  std::vector<BodyId> members;         ///< movable bodies of the sub-world from this stamp on, proxy included
  std::vector<BodyId> fixed;           ///< fixed bodies of the sub-world
  std::vector<std::uint32_t> islands;  ///< island of each member, by the world's contacts (coupling/contact_graph)
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

enum class ControlVerb : std::uint8_t {
  stop,
  pause,
  resume,
  step,
  reset,
  set_engine,
  set_scheme,
  leave,
  set_ratio,  ///< "4" or "4-12"
  set_speed,  ///< of a replay: simulated time per time
};

/// Topic `control`.
struct Control {
  std::uint32_t number = 0;  ///< drawn by the sender; the answer repeats it
  ControlVerb verb = ControlVerb::stop;
  std::string argument;
};

/// What came of an order: `preparing` is followed by one of the others.
enum class OrderState : std::uint8_t { preparing, done, refused };
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

enum class ProgramKind : std::uint8_t { world_sim, haptic_sim, device_sim, gui_headless };

/// Topic `control_reply`, keyed by program and instance.
struct ControlReply {
  ProgramKind program = ProgramKind::world_sim;
  std::uint32_t instance = 0;
  std::uint32_t number = 0;  ///< of the `Control`
  OrderAnswer answer;
};

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

}  // namespace subworld
