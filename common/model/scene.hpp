#pragma once

#include "model/body.hpp"
#include "model/optimisation.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// One part of a device path; the parts of a path add up. Displacements are relative to the start pose.
struct PathSegment {
  enum class Kind : std::uint8_t { move, turn, circle, wave };
  Kind kind = Kind::move;
  double from_s = 0.0;
  double to_s = 0.0;     ///< move and turn: reached here and held; circle: infinity if not given
  double every_s = 0.0;  ///< move and turn: made again, on top of the last one, each time so much later; 0: once
  Vec3 displacement = Vec3::Zero();  ///< move: m
  Vec3 axis = Vec3::UnitZ();         ///< turn, circle: unit
  double angle = 0.0;                ///< turn: rad
  double radius = 0.0;               ///< circle: m; starts at +x (or the first axis after `axis`) of its centre
  double period_s = 0.0;             ///< circle: one turn
  Vec3 along = Vec3::UnitX();        ///< wave: the displacement along this unit axis is the argument u,
  Vec3 across = Vec3::UnitY();       ///< wave: amplitude sin(wavenumber u) is added along this one
  double amplitude = 0.0;            ///< wave: m
  double wavenumber = 0.0;           ///< wave: rad/m
};

struct PathPoint {
  Pose offset;  ///< displacement and rotation from the start pose
  Vec3 linear_velocity = Vec3::Zero();
  Vec3 angular_velocity = Vec3::Zero();
};

/// Where a path is at time t >= 0, and how fast it moves there.
[[nodiscard]] PathPoint evaluate(const std::vector<PathSegment>& path, double t_s) noexcept;

enum class DeviceKind : std::uint8_t { impedance, admittance };

/// A hand that follows its intention (the path) through the impedance of an arm and feels the force.
struct OperatorSpec {
  double mass_kg = 1.0;
  double damping_n_s_m = 10.0;
  double stiffness_n_m = 300.0;
  double inertia_kg_m2 = 0.005;  ///< 6 degrees of freedom
  double rotational_damping_n_m_s = 0.1;
  double rotational_stiffness_n_m = 3.0;  ///< per rad
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
  std::optional<double> force_rate_limit_n_s;  ///< none: all of its force within kFullScale_s
  std::optional<double> power_limit_w;         ///< given to the hand; none: all of its force at kFastestPush_m_s
  double speed_limit_m_s = 0.4;                ///< of an admittance device
  double mass_kg = 0.1;
  double damping_n_s_m = 0.5;
  double friction_n = 0.1;             ///< Coulomb
  double position_resolution_m = 0.0;  ///< 0: exact
  std::vector<PathSegment> path;
  std::optional<OperatorSpec> operator_model;  ///< none: the device follows the path whatever it feels
};

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
  box,       ///< those that meet a box around the proxy (paper 4.1), and those within `contact_depth`
  contacts,  ///< those that hang on the proxy by at most `contact_depth` contacts
  budget,    ///< of the box's, those that matter most and fit into `budget_ratio`
};

struct UserSpec {
  std::string name;
  BodyId proxy{};
  bool own_proxy = false;   ///< the proxy is there for this user alone, not a body of the scene
  bool joins_late = false;  ///< the proxy comes into the world when that has settled
  Selection selection = Selection::budget;
  double box_half_m = 0.2;    ///< half side of the selection box around the proxy
  int contact_depth = 0;      ///< contacts from the proxy to a member, beside those of the box
  double budget_ratio = 0.4;  ///< part of the haptic step that simulating the sub-world may take
  CouplingSettings coupling;
  DeviceSpec device;
};

struct EngineSettings {
  std::string name = "bullet";
  std::string preset = "fast";
  std::optional<int> iterations;            ///< instead of the preset's
  std::optional<int> substeps;              ///< parts of a step; world: each with a force of its own on the proxies
  std::optional<double> longest_substep_s;  ///< instead of the preset's: the engine divides its steps by it
  Vec3 gravity{0.0, 0.0, -9.81};            ///< m/s^2
  double length_unit_m = 1.0;  ///< that the engine computes in; some engines need a smaller one for small bodies
  Disabled disabled = kDisableNothing;  ///< as in Settings

  /// Names another engine or preset: without what was set for the one before.
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
  double device_impulse_threshold_n_s = 1e-4;  ///< below: the user added no energy in this cycle
};

/// Artificial delay of messages in lock-step, and their loss. World and sub-world send reliably: a lost message comes a
/// round trip later. Device and sub-world do not: it never comes, and the newest one that did counts.
struct DelaySettings {
  double up_s = 0.0;           ///< from the sub-world to the world
  double down_s = 0.0;         ///< from the world to the sub-world
  double from_device_s = 0.0;  ///< to the sub-world
  double to_device_s = 0.0;    ///< from the sub-world
  double jitter_s = 0.0;       ///< most that a single message takes longer, uniform
  double loss_ratio = 0.0;     ///< of the messages
  std::uint64_t seed = 1;

  [[nodiscard]] bool any() const noexcept {
    return up_s > 0.0 || down_s > 0.0 || from_device_s > 0.0 || to_device_s > 0.0 || jitter_s > 0.0 || loss_ratio > 0.0;
  }
};

/// Whether the energy that a device gives to a hand is bounded by what it got (coupling/energy_tank).
enum class Passivity : std::uint8_t { automatic, on, off };

inline constexpr int kMostRatio = 1000;

/// Between which the simulation ratio may change.
struct RatioBounds {
  int least = 4;
  int most = 4;
};
/// "4" or "4-12"; nothing where it is neither, or out of [1, kMostRatio].
[[nodiscard]] std::optional<RatioBounds> parse_ratio(std::string_view text);
[[nodiscard]] std::string to_text(const RatioBounds& ratio);

enum class Mode : std::uint8_t { lockstep, realtime };

struct Settings {
  double h_s = 0.001;  ///< haptic step
  int ratio = 4;       ///< r, and the least that it may be: the world's cycle is T = r h
  int ratio_most = 0;  ///< to which r may rise (coupling/ratio_control); 0: it is fixed
  double duration_s = 5.0;
  double settle_s = 0.5;  ///< the world alone, before t = 0
  double settle_step_s = 0.004;
  int users = 0;  ///< how many of the scene's users take part; 0: all
  Mode mode = Mode::lockstep;
  std::string scheme = "reduced";
  PaperSettings paper;
  DelaySettings delay;
  Passivity passivity = Passivity::automatic;  ///< automatic: where messages are delayed
  bool remote = false;                         ///< programs of the run are on other hosts (--peers)
  EngineSettings world;
  EngineSettings haptic;
  Disabled disabled = kDisableNothing;  ///< though the scene does not need it; disable() sets it

  void disable(Disabled items) noexcept { disabled = world.disabled = haptic.disabled = disabled | items; }

  void set_ratio(const RatioBounds& bounds) noexcept {
    ratio = bounds.least;
    ratio_most = bounds.most > bounds.least ? bounds.most : 0;
  }
  [[nodiscard]] RatioBounds ratio_bounds() const noexcept { return {ratio, largest_ratio()}; }
  [[nodiscard]] int largest_ratio() const noexcept { return ratio_most > ratio ? ratio_most : ratio; }
  [[nodiscard]] bool adapts_ratio() const noexcept { return largest_ratio() > ratio; }
  /// T, the first and the shortest.
  [[nodiscard]] double shortest_cycle_s() const noexcept { return ratio * h_s; }
  [[nodiscard]] double longest_cycle_s() const noexcept { return largest_ratio() * h_s; }
};

struct Scene {
  std::string name;
  std::string description;
  std::string file;
  std::vector<Mesh> meshes;
  std::vector<Body> bodies;        ///< bodies[i].id == i
  std::vector<BodyState> initial;  ///< of bodies[i]
  std::vector<UserSpec> users;
  Settings settings;

  [[nodiscard]] const Body& body(BodyId id) const { return bodies[index(id)]; }
};

/// Leaves out the users after the first `count`, with their own proxies.
void keep_users(Scene& scene, int count);

/// Over all that two programs must agree on.
[[nodiscard]] std::uint64_t settings_hash(const Scene& scene);

/// Reads a scene file and its meshes. Throws `Error` (usage) with file:line:column, the key and the cure.
[[nodiscard]] Scene load_scene(const std::string& file);

/// Equal for two programs that may work together: covers bodies, meshes, initial states, users and all settings but the
/// duration. FNV-1a of 64 bits, equal on every machine.
[[nodiscard]] std::uint64_t settings_hash(const Scene& scene);

}  // namespace subworld
