#pragma once

#include "model/body.hpp"
#include "model/contact.hpp"
#include "model/scene/scene.hpp"
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

/// How well an engine supports a feature of the interface.
enum class Fidelity : std::uint8_t { absent, estimated, exact };

/// Called before each part of a step, `h` (s) long, that ends `until_s` after the step began. It may read the driven
/// bodies, set their velocities and inertia and apply forces for this part. It must not change anything else.
using StepDrive = std::function<void(double until_s, double h)>;

struct Capabilities {
  Fidelity normal_impulse = Fidelity::absent;
  Fidelity tangential_impulse = Fidelity::absent;
  Fidelity gyroscopic = Fidelity::absent;
  Fidelity joints = Fidelity::absent;
  Fidelity checkpoint = Fidelity::absent;  ///< exact: a restored engine continues bit by bit
  bool deterministic = false;              ///< equal calls give equal bits
  double precision = 1e-15;                ///< relative, of the engine's numbers
  /// Longest step (s) at which friction in a pushed row agrees with the engine's own short steps to a few per cent.
  double longest_step_s = 0.005;
  bool drives_inside = false;  ///< step_driven() drives its bodies often enough in a step of any length
};

enum class Role : std::uint8_t {
  body,
  ghost,        ///< collides with movable bodies only, and with no other ghost
  approaching,  ///< collides with movable bodies and ghosts
};

/// An opaque saved state that only the engine that made it can read.
struct Checkpoint {
  std::vector<std::byte> bytes;
};

/// One rigid-body engine (paper 3.1). Units are SI. Ids must be known unless stated otherwise. Not thread-safe.
class Engine {
 public:
  virtual ~Engine() = default;

  [[nodiscard]] virtual std::string_view name() const noexcept = 0;
  [[nodiscard]] virtual Capabilities capabilities() const noexcept = 0;

  /// The scene's joints, once, before the first body. Each acts while both of its bodies are in the engine, neither a
  /// ghost, and is then listed as a contact without a normal. Throws `Error` (usage) if a kind is not supported.
  virtual void set_joints(std::span<const Joint> joints) = 0;
  /// Ends the action of a joint, by its index; it has broken.
  virtual void break_joint(std::size_t /*joint*/) {}
  /// What each joint did in the last step.
  [[nodiscard]] virtual std::span<const JointLoad> joint_loads() const noexcept { return {}; }

  /// Adds a body that is not in the engine. Throws `Error` if the shape is not supported.
  virtual void add(const Body& body, const BodyState& state, Role role) = 0;
  void add(const Body& body, const BodyState& state) { add(body, state, Role::body); }
  /// Removes a body and its contacts.
  virtual void remove(BodyId id) = 0;
  /// The same for each of these, in less time.
  virtual void remove_all(std::span<const BodyId> ids) {
    for (const BodyId id : ids) remove(id);
  }
  [[nodiscard]] virtual bool contains(BodyId id) const noexcept = 0;

  [[nodiscard]] virtual BodyState state(BodyId id) const = 0;
  /// Returns false and changes nothing if the state is not finite.
  virtual bool set_state(BodyId id, const BodyState& state) = 0;
  /// Sets the velocity of a movable body, m/s and rad/s, and leaves the pose. Returns false if it is not finite.
  virtual bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) = 0;
  /// Sets mass (kg) and principal moments of inertia (kg m^2) of a movable body from the next step on. Its weight stays
  /// that of the added body.
  virtual void set_inertia(BodyId id, double mass, const Vec3& inertia) = 0;

  /// Changes the velocity at once. Impulse in N s, point in m, world frame. Returns false if it is not finite.
  virtual bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) = 0;
  /// Acts during the next step() only, at the centre of mass, in every sub-step; calls add up. N and N m, world frame.
  /// Returns false if it is not finite.
  virtual bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) = 0;

  /// Advances by dt (s). Contacts are totals over the whole step, sub-steps included.
  virtual void step(double dt) = 0;
  /// The same, with bodies that a function drives.
  virtual void step_driven(double dt, std::span<const BodyId> /*driven*/, const StepDrive& drive) {
    drive(dt, dt);
    step(dt);
  }
  /// From now on step() and contacts_with_friction() add their CPU times to `times`; null: no longer. All zero: the
  /// engine does not report them.
  virtual void time_parts(EngineTimes* times) noexcept { clock_.follow(times); }
  /// Length (s) of the sub-steps in which step(dt) integrates. Bodies move with the velocity at the end of a sub-step,
  /// so a position is half a sub-step ahead of the forces.
  [[nodiscard]] virtual double integration_substep_s(double dt) const noexcept = 0;

  /// Contacts of the last step, ordered by bodies: equal worlds list equal contacts. Valid until the next change.
  /// Friction impulses are included if the engine itself solves them, and may be zero if it estimates them
  /// (capabilities()).
  [[nodiscard]] virtual std::span<const Contact> contacts() const noexcept = 0;
  /// The same with friction impulses, estimated now if needed.
  [[nodiscard]] virtual std::span<const Contact> contacts_with_friction() { return contacts(); }

  [[nodiscard]] virtual Box bounds(BodyId id) const = 0;
  /// Bodies whose axis-aligned bounds intersect the box, in ascending order.
  virtual void overlap(const Box& box, std::vector<BodyId>& out) const = 0;

  /// Throws `Error` if the engine has no checkpoints; capabilities() reports it.
  [[nodiscard]] virtual Checkpoint checkpoint() const = 0;
  /// Restores the bodies' states. Throws `Error` if the checkpoint is of another engine or of other bodies.
  virtual void restore(const Checkpoint& checkpoint) = 0;

 protected:
  EngineClock clock_;
};

/// Makes the engine that the settings name. `meshes` are copied. Throws `Error` (usage) for an unknown engine or
/// preset, with the available names.
///
/// Each engine is a library of its own, `libsubworld_engine_NAME.so`, loaded on first use: from the folders of the
/// environment variable SUBWORLD_ENGINES, else from the program's folder. Thread-safe.
[[nodiscard]] std::unique_ptr<Engine> make_engine(const EngineSettings& settings, std::span<const Mesh> meshes);
/// make_engine(), or a function that wraps the engine.
using EngineMaker = std::function<std::unique_ptr<Engine>(const EngineSettings&, std::span<const Mesh>)>;

/// Names of the available engines.
[[nodiscard]] std::vector<std::string> engine_names();

/// Cost of an engine by its published coefficients.
struct EngineCost {
  StepCost substep;                  ///< without iterations
  double contact_iteration_s = 0.0;  ///< for each contact point and iteration
  std::optional<int> substeps;       ///< of a step; none: as many as the longest sub-step requires
  double longest_substep_s = 0.0;
  std::optional<int> iterations;  ///< of a sub-step; none: as many as the following two members require
  int least_iterations = 0;
  double longest_iteration_s = 0.0;
  double parallel_ratio = 0.0;  ///< share of the time which threads divide among them
  int threads = 1;

  [[nodiscard]] StepCost step(double dt) const noexcept;
};

/// Cost of the engine that the settings name. Throws `Error` (usage) as make_engine() does.
[[nodiscard]] EngineCost engine_cost(const EngineSettings& settings);

struct EnginePlugin;
/// Description in an engine's library (plugin.hpp). Throws `Error` (usage) if there is no engine of that name.
[[nodiscard]] const EnginePlugin& engine_plugin(std::string_view name);

}  // namespace subworld
