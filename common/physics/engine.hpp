#pragma once

#include "model/body.hpp"
#include "model/contact.hpp"
#include "model/scene.hpp"
#include "model/step_cost.hpp"
#include "physics/engine_times.hpp"

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace subworld {

/// How well an engine serves a part of the interface.
enum class Fidelity : std::uint8_t { absent, estimated, exact };

struct Capabilities {
  Fidelity normal_impulse = Fidelity::absent;
  Fidelity tangential_impulse = Fidelity::absent;
  Fidelity gyroscopic = Fidelity::absent;
  Fidelity checkpoint = Fidelity::absent;  ///< exact: a restored engine continues bit by bit
  bool deterministic = false;              ///< equal calls give equal bits
  double precision = 1e-15;                ///< relative, of the numbers that it holds
  /// Longest step (s) at which friction in a pushed row still follows the engine's own short steps to a few per cent.
  double longest_step_s = 0.005;
};

enum class Role : std::uint8_t {
  body,
  ghost,        ///< meets movable bodies only, and no other ghost
  approaching,  ///< meets movable bodies and ghosts
};

/// An opaque saved state; only the engine that made it can read it.
struct Checkpoint {
  std::vector<std::byte> bytes;
};

/// One rigid-body engine (paper 3.1). Units are SI. Ids must be known unless said otherwise; not thread-safe.
class Engine {
 public:
  virtual ~Engine() = default;

  [[nodiscard]] virtual std::string_view name() const noexcept = 0;
  [[nodiscard]] virtual Capabilities capabilities() const noexcept = 0;

  /// Adds a body that is not there yet. Throws `Error` where the shape is not supported.
  virtual void add(const Body& body, const BodyState& state, Role role) = 0;
  void add(const Body& body, const BodyState& state) { add(body, state, Role::body); }
  /// Removes a body; its contacts go with it.
  virtual void remove(BodyId id) = 0;
  [[nodiscard]] virtual bool contains(BodyId id) const noexcept = 0;

  [[nodiscard]] virtual BodyState state(BodyId id) const = 0;
  /// Refuses (returns false, changes nothing) a state that is not finite.
  virtual bool set_state(BodyId id, const BodyState& state) = 0;
  /// Of a movable body, m/s and rad/s; the pose stays. Refuses what is not finite.
  virtual bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) = 0;
  /// Mass (kg) and principal moments of inertia (kg m^2) of a movable body from the next step on; its weight stays
  /// that of the body as it was added.
  virtual void set_inertia(BodyId id, double mass, const Vec3& inertia) = 0;

  /// Changes the velocity at once. Impulse in N s, point in m, world frame. Refuses what is not finite.
  virtual bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) = 0;
  /// Acts during the next step() only, at the centre of mass, in every sub-step; calls add up. Refuses what is not
  /// finite.
  virtual bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) = 0;

  /// Advances by dt (s). Contacts are totals over the whole step, sub-steps included.
  virtual void step(double dt) = 0;
  /// From now on step() and contacts_with_friction() add where they spend their time to `times`; null: no longer. Zero
  /// throughout: the engine does not tell.
  virtual void time_parts(EngineTimes* times) noexcept { clock_.follow(times); }
  /// Length (s) of the parts in which step(dt) integrates. All of them move with the velocity that a part ends with, so
  /// a position is ahead of what the forces account for by half a part.
  [[nodiscard]] virtual double integration_substep_s(double dt) const noexcept = 0;

  /// Of the last step, ordered by bodies: equal worlds list equal contacts. Valid until the next change. Friction
  /// impulses are there where the engine itself solves them, and may be zero where it estimates them (capabilities()).
  [[nodiscard]] virtual std::span<const Contact> contacts() const noexcept = 0;
  /// The same with friction impulses, estimated now if they were not yet.
  [[nodiscard]] virtual std::span<const Contact> contacts_with_friction() { return contacts(); }

  [[nodiscard]] virtual Box bounds(BodyId id) const = 0;
  /// Bodies whose axis-aligned bounds meet the box, ascending.
  virtual void overlap(const Box& box, std::vector<BodyId>& out) const = 0;

  /// Throws `Error` where the engine has none, and capabilities() says so.
  [[nodiscard]] virtual Checkpoint checkpoint() const = 0;
  /// Takes the bodies back to where they were; throws `Error` where the checkpoint is of another engine or other
  /// bodies.
  virtual void restore(const Checkpoint& checkpoint) = 0;

 protected:
  EngineClock clock_;
};

/// Makes the engine that the settings name. `meshes` are copied. Throws `Error` (usage) for an unknown engine or
/// preset, naming those that exist.
///
/// Each engine is a library of its own, `libsubworld_engine_NAME.so`, which is loaded when it is first asked for: from
/// the folders of the environment variable SUBWORLD_ENGINES, else from beside the program. Thread-safe.
[[nodiscard]] std::unique_ptr<Engine> make_engine(const EngineSettings& settings, std::span<const Mesh> meshes);
/// make_engine(), or who puts something between an engine and its user.
using EngineMaker = std::function<std::unique_ptr<Engine>(const EngineSettings&, std::span<const Mesh>)>;

/// The engines that can be asked for here, by name.
[[nodiscard]] std::vector<std::string> engine_names();

/// What an engine costs, by its published coefficients.
struct EngineCost {
  StepCost substep;                  ///< without iterations
  double contact_iteration_s = 0.0;  ///< for each contact point and iteration
  std::optional<int> substeps;       ///< of a step; none: as many as the longest allows
  double longest_substep_s = 0.0;
  std::optional<int> iterations;  ///< of a sub-step; none: as many as the following two ask for
  int least_iterations = 0;
  double longest_iteration_s = 0.0;

  [[nodiscard]] StepCost step(double dt) const noexcept;
};

/// Of the engine that the settings name. Throws `Error` (usage) as make_engine() does.
[[nodiscard]] EngineCost engine_cost(const EngineSettings& settings);

struct EnginePlugin;
/// What an engine's library says of itself (plugin.hpp). Throws `Error` (usage) where there is none of that name.
[[nodiscard]] const EnginePlugin& engine_plugin(std::string_view name);

}  // namespace subworld
