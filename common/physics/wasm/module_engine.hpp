#pragma once

#include "physics/adapter.hpp"
#include "physics/friction_estimate.hpp"
#include "physics/wasm/host.hpp"

#include <cstdint>
#include <limits>
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

struct Slot : AdapterSlot {
  std::uint64_t body = 0;  ///< the module's handle
  std::uint64_t shape = 0;
  BodyState after;     ///< at the end of the last sub-step; for a fixed body, the velocity that was set
  bool known = false;  ///< movable body: `after` equals the module's state
};

/// Base of all engines that are WebAssembly modules: loads, the friction that such modules do not report, and
/// checkpoints of their memory. A derived class makes, moves and reads a body.
class ModuleEngine : public Adapter<Slot> {
 public:
  Capabilities capabilities() const noexcept override {
    return {.normal_impulse = Fidelity::exact,
            .tangential_impulse = Fidelity::estimated,  // from the balance of momentum
            .gyroscopic = Fidelity::exact,              // computed here
            .checkpoint = Fidelity::exact,
            .deterministic = true,
            .precision = std::numeric_limits<float>::epsilon()};
  }
  BodyState state(BodyId id) const final { return state_of(at(id)); }
  void step(double dt) final;
  std::span<const Contact> contacts_with_friction() final;
  Box bounds(BodyId id) const final { return bounds_of(at(id)); }

 protected:
  using Slot = wasm::Slot;

  ModuleEngine(const EnginePlugin& plugin, const EngineSettings& settings, std::span<const Mesh> meshes)
      : Adapter(plugin, settings),
        meshes_(meshes.begin(), meshes.end()),
        keeps_frictionless_(disables(settings.disabled, Optimisation::friction)) {
    if (!settings.pairs.empty()) refuse_pairs(plugin.name);
  }

  [[nodiscard]] virtual wasm_rt_memory_t& memory() const = 0;
  /// Makes the body in the module, in the pose of `state`, and sets the slot's handles.
  virtual void make(Slot& slot, const Body& body, const BodyState& state, const CollisionClass& collides) = 0;
  virtual void put_pose(const Slot& slot, const Vec3& position, const Quat& orientation) = 0;
  /// This and the next function: for movable bodies only.
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
  virtual void handles_changed() {}

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

  std::vector<Mesh> meshes_;

 private:
  /// A movable body in the last sub-step.
  struct Stepped {
    double mass;
    Vec3 inertia;
    BodyState loaded;
  };

  void create(Slot& slot, const Body& body, const BodyState& state, const CollisionClass& collides) final;
  void place(Slot& slot, const BodyState& state) final;
  void put_velocity(Slot& slot, const Vec3& linear, const Vec3& angular) final;
  void push(Slot& slot, const Vec3& impulse, const Vec3& point) final;
  void save_rest(std::span<const SavedBody> bodies, std::vector<std::byte>& to) const final;
  void restore_rest(std::span<const SavedBody> bodies, std::span<const std::byte> rest) final;
  void restore_body(Slot& slot, const BodyState& state) final;
  [[nodiscard]] BodyState state_of(const Slot& slot) const;
  [[nodiscard]] Box bounds_of(const Slot& slot) const;
  void apply_loads(double h);
  void estimate_friction();

  bool keeps_frictionless_;              ///< friction is estimated for contacts without friction too, for comparison
  double reach_ = 0.05;                  ///< m
  std::vector<Stepped> stepped_;         ///< by id
  std::vector<VelocityChange> changes_;  ///< of a sub-step, by id
  std::vector<Contact> found_;           ///< of a sub-step
  bool has_friction_ = true;             ///< the contacts of the last step have friction impulses
  std::vector<double> friction_;         ///< of found_
  FrictionEstimate estimate_;
};

}  // namespace subworld::wasm
