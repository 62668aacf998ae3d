#pragma once

#include "model/body.hpp"
#include "model/joint.hpp"
#include "model/settings/optimisation.hpp"
#include "model/settings/presence.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// How fast a move or a turn goes on its way: at constant speed, which jumps at both ends, or as an arm moves, with the
/// least jerk: 10 s^3 - 15 s^4 + 6 s^5 of the way after the part s of the time (Flash and Hogan 1985).
enum class Profile : std::uint8_t { constant, minimum_jerk };

/// One segment of a device path; the segments of a path add up. Displacements are relative to the start pose.
struct PathSegment {
  enum class Kind : std::uint8_t { move, turn, circle, wave };
  Kind kind = Kind::move;
  double from_s = 0.0;
  double to_s = 0.0;                 ///< move and turn: reached at this time and held; circle: infinity if not given
  std::optional<Profile> profile;    ///< move and turn; none: the device's
  double every_s = 0.0;              ///< move and turn: period of repetition, each on top of the last one; 0: once
  Vec3 displacement = Vec3::Zero();  ///< move: m
  Vec3 axis = Vec3::UnitZ();         ///< turn, circle: unit
  double angle = 0.0;                ///< turn: rad
  double radius = 0.0;               ///< circle: m; starts at +x (or the first axis after `axis`) of its centre
  double period_s = 0.0;             ///< circle: one turn
  Vec3 along = Vec3::UnitX();        ///< wave: the displacement along this unit axis is the argument u
  Vec3 across = Vec3::UnitY();       ///< wave: unit axis of the added displacement, amplitude sin(wavenumber u)
  double amplitude = 0.0;            ///< wave: m
  double wavenumber = 0.0;           ///< wave: rad/m
};

struct PathPoint {
  Pose offset;  ///< displacement and rotation from the start pose
  Vec3 linear_velocity = Vec3::Zero();
  Vec3 angular_velocity = Vec3::Zero();
};

/// Pose and velocity of a path at time t >= 0. `profile`: of segments that have none of their own.
[[nodiscard]] PathPoint evaluate(const std::vector<PathSegment>& path, double t_s,
                                 Profile profile = Profile::constant) noexcept;

enum class DeviceKind : std::uint8_t { impedance, admittance };

/// Physiological tremor of an operator: a sine.
struct TremorSpec {
  double frequency_hz = 10.0;
  double amplitude_m = 0.0;  ///< of the free arm; 0: none
};

/// Emulated operator: follows the intended motion (the path) through the impedance of an arm, and feels the force.
struct OperatorSpec {
  double mass_kg = 1.0;
  double damping_n_s_m = 10.0;
  double stiffness_n_m = 300.0;
  double inertia_kg_m2 = 0.005;  ///< used with 6 degrees of freedom
  double rotational_damping_n_m_s = 0.1;
  double rotational_stiffness_n_m = 3.0;  ///< per rad
  TremorSpec tremor;
};

/// A haptic device.
struct DeviceSpec {
  static constexpr double kFullScale_s = 4e-3;
  static constexpr double kFastestPush_m_s = 1.0;

  DeviceKind kind = DeviceKind::impedance;
  int degrees_of_freedom = 3;  ///< 3 or 6
  double rate_hz = 1000.0;
  double force_limit_n = 40.0;
  double torque_limit_n_m = 2.0;
  std::optional<double> force_rate_limit_n_s;  ///< none: force_limit_n within kFullScale_s
  std::optional<double> power_limit_w;  ///< power delivered to the operator; none: force_limit_n at kFastestPush_m_s
  double speed_limit_m_s = 0.4;         ///< of an admittance device
  double mass_kg = 0.1;
  double damping_n_s_m = 0.5;
  double friction_n = 0.1;             ///< Coulomb
  double position_resolution_m = 0.0;  ///< 0: exact
  std::vector<PathSegment> path;
  Profile profile = Profile::constant;         ///< of the path
  std::optional<OperatorSpec> operator_model;  ///< none: the device follows the path whatever the force
};

/// Largest Weber fraction that was found for a force (Chaudhari 2011).
inline constexpr double kMostDeadband = 0.27;
/// Longest time between two samples in a deadband: a receiver knows soon that a sender has gone.
inline constexpr double kLongestAbsence_s = 0.005;

/// Virtual coupling between device and proxy (Colgate 1995).
struct CouplingSettings {
  double stiffness_n_m = 1000.0;
  double damping_n_s_m = 20.0;
  double rotational_stiffness_n_m = 5.0;  ///< per rad
  double rotational_damping_n_m_s = 0.05;
  double ramp_s = 0.1;  ///< the device's force rises from zero over this time
};

/// Which bodies belong to a user's sub-world.
enum class Selection : std::uint8_t {
  box,       ///< those that intersect a box around the proxy (paper 4.1), and those within `contact_depth`
  contacts,  ///< those connected to the proxy by at most `contact_depth` contacts
  budget,    ///< of the box's bodies, those that matter most and fit into `budget_ratio`
};

struct UserSpec {
  std::string name;
  BodyId proxy{};
  bool own_proxy = false;   ///< the proxy belongs to this user only and is not a body of the scene
  bool joins_late = false;  ///< the proxy is added to the world when the world has settled
  Selection selection = Selection::budget;
  double box_half_m = 0.2;    ///< half side of the selection box around the proxy
  int contact_depth = 0;      ///< largest number of contacts from the proxy to a member, in addition to the box
  double budget_ratio = 0.4;  ///< largest share of the haptic step for simulating the sub-world
  CouplingSettings coupling;
  DeviceSpec device;
};

struct EngineSettings {
  std::string name = "bullet";
  std::string preset = "fast";
  std::optional<int> iterations;  ///< overrides the preset
  /// Sub-steps of a step, overrides the preset; in the world the proxies' forces are set in each.
  std::optional<int> substeps;
  std::optional<double> longest_substep_s;  ///< s, overrides the preset: the engine divides its steps by it
  Vec3 gravity{0.0, 0.0, -9.81};            ///< m/s^2
  std::optional<int> threads;               ///< that share a step; none: 1. Some engines use one only
  double length_unit_m = 1.0;           ///< length unit of the engine; some engines need a smaller one for small bodies
  Disabled disabled = kDisableNothing;  ///< as in Settings
  std::vector<MaterialPair> pairs;      ///< of the scene

  /// Selects another engine or preset, and clears the settings of the one before.
  void change_to(const std::string& engine, const std::string& other_preset) {
    if (engine != name) iterations = substeps = std::nullopt;
    if (engine != name || other_preset != preset) longest_substep_s.reset();
    name = engine;
    preset = other_preset;
  }
};

/// Thresholds of the scheme `paper` (paper 4.3).
struct PaperSettings {
  bool device_force_in_world = true;           ///< the mean device force also acts on the world's proxy
  double device_impulse_threshold_n_s = 1e-4;  ///< below: the user has added no energy in this cycle
};

/// In real time, of a report's way to the world and back, s. Longer, the world cannot use it.
inline constexpr double kLongestRoundTrip_s = 0.5;

/// Artificial delay and loss of messages. World and sub-world use reliable messages: a lost one arrives a
/// round trip later. Device and sub-world do not: a lost one never arrives, and the newest one received counts.
struct DelaySettings {
  double up_s = 0.0;           ///< from sub-world to world
  double down_s = 0.0;         ///< from world to sub-world
  double from_device_s = 0.0;  ///< from device to sub-world
  double to_device_s = 0.0;    ///< from sub-world to device
  double jitter_s = 0.0;       ///< largest additional delay of a single message, uniformly distributed
  double loss_ratio = 0.0;     ///< share of lost messages
  std::uint64_t seed = 1;

  [[nodiscard]] bool any() const noexcept {
    return up_s > 0.0 || down_s > 0.0 || from_device_s > 0.0 || to_device_s > 0.0 || jitter_s > 0.0 || loss_ratio > 0.0;
  }
};

/// Whether the energy that a device delivers to its operator is bounded by the energy it received
/// (coupling/safety/passivity).
enum class Passivity : std::uint8_t { automatic, on, off };

inline constexpr int kMostRatio = 1000;

/// Range of the simulation ratio.
struct RatioBounds {
  int least = 4;
  int most = 4;
};
/// "4" or "4-12"; empty for any other text, or out of [1, kMostRatio].
[[nodiscard]] std::optional<RatioBounds> parse_ratio(std::string_view text);
[[nodiscard]] std::string to_text(const RatioBounds& ratio);

enum class Mode : std::uint8_t { lockstep, realtime };

/// What a run in lock-step does when a user's programs do not answer any more: it ends, stands until they have been
/// started again, or goes on without the user. In real time it always goes on.
enum class Absent : std::uint8_t { end, wait, go_on };

/// Users of a scene: the programs exchange sets of users as 64 bits.
inline constexpr int kMostUsers = 64;

struct Settings {
  double h_s = 0.001;  ///< haptic step
  int ratio = 4;       ///< r, and its least value: the world's cycle is T = r h
  int ratio_most = 0;  ///< largest value of r (coupling/messages/ratio_control); 0: r is fixed
  double duration_s = 5.0;
  double settle_s = 0.5;  ///< the world runs alone for this time, before t = 0
  double settle_step_s = 0.004;
  int users = 0;  ///< users of the scene that take part; 0: all
  Mode mode = Mode::lockstep;
  Absent absent = Absent::end;
  std::vector<PresenceEvent> presence;  ///< empty: all users take part from start to end
  std::string scheme = "reduced";
  PaperSettings paper;
  DelaySettings delay;
  Passivity passivity = Passivity::automatic;  ///< automatic: where messages are delayed
  bool remote = false;                         ///< programs of the run are on other hosts (--peers)
  /// Weber fraction of the link of a device (coupling/messages/deadband); 0: every sample is sent.
  double deadband = 0.0;
  /// In real time messages have a delay that no program knows beforehand: of a network, or an artificial one.
  [[nodiscard]] bool has_unknown_delay() const noexcept { return mode == Mode::realtime && (remote || delay.any()); }
  /// In real time on one host, messages cost little: every sample is sent.
  [[nodiscard]] double deadband_in_use() const noexcept {
    return mode == Mode::lockstep || has_unknown_delay() ? deadband : 0.0;
  }
  /// Longest regular time between two samples of a device of this rate, s.
  [[nodiscard]] double sample_period_s(double rate_hz) const noexcept {
    return 1.0 / rate_hz + (deadband > 0.0 ? kLongestAbsence_s : 0.0);
  }
  EngineSettings world;
  EngineSettings haptic;
  Disabled disabled = kDisableNothing;  ///< optimisations that are off; set by disable()

  void disable(Disabled items) noexcept { disabled = world.disabled = haptic.disabled = disabled | items; }

  void set_ratio(const RatioBounds& bounds) noexcept {
    ratio = bounds.least;
    ratio_most = bounds.most > bounds.least ? bounds.most : 0;
  }
  [[nodiscard]] RatioBounds ratio_bounds() const noexcept { return {ratio, largest_ratio()}; }
  [[nodiscard]] int largest_ratio() const noexcept { return ratio_most > ratio ? ratio_most : ratio; }
  [[nodiscard]] bool adapts_ratio() const noexcept { return largest_ratio() > ratio; }
  /// T, at the start and the shortest.
  [[nodiscard]] double shortest_cycle_s() const noexcept { return ratio * h_s; }
  [[nodiscard]] double longest_cycle_s() const noexcept { return largest_ratio() * h_s; }
};

/// A mesh that moves, as convex parts.
struct DividedMesh {
  std::string file;
  std::size_t parts = 0;
  double error_m = 0.0;      ///< as in `ConvexParts`
  double concavity_m = 0.0;  ///< what it should be at most
  std::string cache;         ///< file with the parts; empty: it could not be written
};

struct Scene {
  std::string name;
  std::string description;
  std::string file;
  std::vector<Mesh> meshes;
  std::vector<Body> bodies;        ///< bodies[i].id == i
  std::vector<BodyState> initial;  ///< of bodies[i]
  std::vector<DividedMesh> divided;
  std::vector<Joint> joints;
  std::vector<UserSpec> users;
  Settings settings;

  [[nodiscard]] const Body& body(BodyId id) const { return bodies[index(id)]; }
};

/// Removes the users after the first `count`, with their own proxies.
void keep_users(Scene& scene, int count);

/// Reads a scene file and its meshes. Throws `Error` (usage) with file:line:column, the key and the cure.
[[nodiscard]] Scene load_scene(const std::string& file);

}  // namespace subworld
