#pragma once

#include "physics/contact_totals.hpp"
#include "physics/friction_estimate.hpp"
#include "physics/plugin.hpp"
#include "physics/wasm/host.hpp"

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace subworld::wasm {

/// Load on a body during a sub-step, without its torque.
struct Load {
  double h;          ///< s, of the sub-step
  BodyState now;     ///< before the sub-step
  bool turned;       ///< `now` includes the change by the gyroscopic torque, which the module does not have yet
  Vec3 force;        ///< N, weight included
  BodyState loaded;  ///< `now` with the changes of velocity by force and torque
};

/// Base of all engines that are WebAssembly modules: bodies, loads, the friction that such modules do not
/// report, and checkpoints of their memory. A derived class makes, moves and reads a body.
class ModuleEngine : public Engine {
 public:
  void add(const Body& body, const BodyState& state, Role role) final;
  void remove(BodyId id) final;
  bool contains(BodyId id) const noexcept final { return index(id) < slots_.size() && slots_[index(id)].body != 0; }

  BodyState state(BodyId id) const final { return state_of(at(id)); }
  bool set_state(BodyId id, const BodyState& state) final;
  bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) final;
  void set_inertia(BodyId id, double mass, const Vec3& inertia) final;
  bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) final;
  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) final;
  double integration_substep_s(double dt) const noexcept override;
  void step(double dt) final;
  std::span<const Contact> contacts() const noexcept final { return contacts_.contacts(); }
  std::span<const Contact> contacts_with_friction() final;
  Box bounds(BodyId id) const final { return bounds_of(at(id)); }
  void overlap(const Box& box, std::vector<BodyId>& out) const final;
  Checkpoint checkpoint() const final;
  void restore(const Checkpoint& checkpoint) final;

 protected:
  struct Slot {
    std::uint32_t id = 0;
    std::uint64_t body = 0;  ///< the module's handle; 0: no body of this id
    std::uint64_t shape = 0;
    bool fixed = false;
    bool plane = false;
    bool rotates = true;
    double friction = 0.0;
    double mass = 0.0;            ///< kg
    Vec3 inertia = Vec3::Zero();  ///< kg m^2
    Vec3 weight = Vec3::Zero();   ///< N
    Vec3 force = Vec3::Zero();    ///< for the next step
    Vec3 torque = Vec3::Zero();
    BodyState after;     ///< at the end of the last sub-step; for a fixed body, the velocity that was set
    bool known = false;  ///< movable body: `after` equals the module's state
  };

  /// `longest_substep_s`: step() divides its dt so that no sub-step is longer, unless the settings give a number.
  ModuleEngine(const EngineSettings& settings, double longest_substep_s)
      : gravity_(settings.gravity),
        fixed_substeps_(settings.substeps),
        longest_substep_s_(settings.longest_substep_s.value_or(longest_substep_s)),
        keeps_frictionless_(disables(settings.disabled, Optimisation::friction)) {}

  [[nodiscard]] virtual wasm_rt_memory_t& memory() const = 0;
  /// Makes the body in the module, in the pose of `state`, and sets the slot's handles.
  virtual void create(BodyId id, Slot& slot, const Body& body, const BodyState& state, const Filter& filter) = 0;
  virtual void destroy(const Slot& slot) = 0;
  virtual void put_pose(const Slot& slot, const Vec3& position, const Quat& orientation) = 0;
  /// This and the next two functions: for movable bodies only.
  virtual void put_inertia(const Slot& slot) = 0;
  virtual void put_velocities(const Slot& slot, const Vec3& linear, const Vec3& angular) = 0;
  virtual void load(const Slot& slot, const Load& load) = 0;
  /// Velocities of a fixed body are not used.
  [[nodiscard]] virtual BodyState read(const Slot& slot) const = 0;
  /// Not called for planes.
  [[nodiscard]] virtual Box read_bounds(const Slot& slot) const = 0;
  virtual void simulate(double h) = 0;
  /// Calls found() for each contact point of the sub-step.
  virtual void collect() = 0;
  /// Called when the slots' handles have changed.
  virtual void restored() {}

  /// Adds a contact point. `a` < `b`; point on b, normal from b to a; impulses on a in N s. `tangential`: the start of
  /// the friction estimate, for a module that reports friction roughly.
  void found(std::uint32_t a, std::uint32_t b, const Vec3& point, const Vec3& normal, double distance, double impulse,
             const Vec3& tangential = Vec3::Zero()) {
    if (impulse <= 0.0 && distance > 0.0) return;
    found_.push_back({.a = BodyId{a},
                      .b = BodyId{b},
                      .point = point,
                      .normal = normal,
                      .distance = distance,
                      .normal_impulse = impulse,
                      .tangential_impulse = tangential});
  }

  /// By id.
  [[nodiscard]] std::span<const Slot> slots() const noexcept { return slots_; }

 private:
  /// A movable body in the last sub-step.
  struct Stepped {
    double mass;
    Vec3 inertia;
    BodyState loaded;
  };

  [[nodiscard]] Slot& at(BodyId id);
  [[nodiscard]] const Slot& at(BodyId id) const;
  [[nodiscard]] BodyState state_of(const Slot& slot) const;
  [[nodiscard]] Box bounds_of(const Slot& slot) const;
  void set_velocities(Slot& slot, const Vec3& linear, const Vec3& angular);
  void apply_loads(double h);
  void estimate_friction();

  std::vector<Slot> slots_;
  Vec3 gravity_;
  std::optional<int> fixed_substeps_;
  double longest_substep_s_;
  bool keeps_frictionless_;              ///< friction is estimated for contacts without friction too, for comparison
  std::uint64_t count_ = 0;              ///< number of bodies
  std::vector<std::uint32_t> movable_;   ///< ids, in the order of adding
  double reach_ = 0.05;                  ///< m
  std::vector<Stepped> stepped_;         ///< by id
  std::vector<VelocityChange> changes_;  ///< of a sub-step, by id
  std::vector<Contact> found_;           ///< of a sub-step
  bool has_friction_ = true;             ///< the contacts of the last step have friction impulses
  std::vector<double> friction_;         ///< of found_
  FrictionEstimate estimate_;
  ContactTotals contacts_;
};

}  // namespace subworld::wasm
