#pragma once

#include "physics/engine.hpp"

namespace subworld {

/// Wrapper of an engine: functions that a derived class does not override go to the inner engine. Those that move a
/// body go to the engine that `moved` returns.
class EngineShell : public Engine {
 public:
  std::string_view name() const noexcept override { return inner().name(); }
  Capabilities capabilities() const noexcept override { return inner().capabilities(); }
  void set_joints(std::span<const Joint> joints) override { inner().set_joints(joints); }
  void break_joint(std::size_t joint) override { inner().break_joint(joint); }
  std::span<const JointLoad> joint_loads() const noexcept override { return inner().joint_loads(); }
  using Engine::add;
  void add(const Body& body, const BodyState& state, Role role) override { inner().add(body, state, role); }
  void remove(BodyId id) override { inner().remove(id); }
  bool contains(BodyId id) const noexcept override { return inner().contains(id); }
  BodyState state(BodyId id) const override { return inner().state(id); }
  bool set_state(BodyId id, const BodyState& state) override { return moved(id).set_state(id, state); }
  bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) override {
    return moved(id).set_velocity(id, linear, angular);
  }
  void set_inertia(BodyId id, double mass, const Vec3& inertia) override { moved(id).set_inertia(id, mass, inertia); }
  bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) override {
    return moved(id).apply_impulse(id, impulse, point);
  }
  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) override {
    return moved(id).apply_force(id, force, torque);
  }
  void step(double dt) override {
    inner().step(dt);
    stepped(dt);
  }
  void step_driven(double dt, std::span<const BodyId> driven, const StepDrive& drive) override {
    inner().step_driven(dt, driven, drive);
    stepped(dt);
  }
  void time_parts(EngineTimes* times) noexcept override { inner().time_parts(times); }
  double integration_substep_s(double dt) const noexcept override { return inner().integration_substep_s(dt); }
  std::span<const Contact> contacts() const noexcept override { return inner().contacts(); }
  std::span<const Contact> contacts_with_friction() override { return inner().contacts_with_friction(); }
  Box bounds(BodyId id) const override { return inner().bounds(id); }
  void overlap(const Box& box, std::vector<BodyId>& out) const override { inner().overlap(box, out); }
  Checkpoint checkpoint() const override { return inner().checkpoint(); }
  void restore(const Checkpoint& checkpoint) override { inner().restore(checkpoint); }

 protected:
  [[nodiscard]] virtual Engine& inner() const noexcept = 0;
  /// Called before a body is moved from outside.
  [[nodiscard]] virtual Engine& moved(BodyId) { return inner(); }
  /// Called after each step.
  virtual void stepped(double /*dt*/) {}
};

}  // namespace subworld
