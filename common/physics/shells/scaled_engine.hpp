#pragma once

#include "physics/shells/engine_shell.hpp"

#include <memory>
#include <span>
#include <vector>

namespace subworld {

/// An engine with another unit of length. The inner engine has a world that is 1 / unit_m times as large, with gravity
/// in the same proportion; the caller uses metres. Engines have tolerances, margins and velocity thresholds in units of
/// length, and small parts are below those of some. Mass and time keep their units.
class ScaledEngine final : public EngineShell {
 public:
  /// `inner` was made with scaled() settings and meshes.
  ScaledEngine(std::unique_ptr<Engine> inner, double unit_m) : inner_(std::move(inner)), unit_m_(unit_m) {}

  void set_joints(std::span<const Joint> joints) override;
  std::span<const JointLoad> joint_loads() const noexcept override { return loads_; }
  using EngineShell::add;
  void add(const Body& body, const BodyState& state, Role role) override;
  void remove(BodyId id) override;
  void remove_all(std::span<const BodyId> ids) override;
  BodyState state(BodyId id) const override;
  bool set_state(BodyId id, const BodyState& state) override;
  bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) override;
  void set_inertia(BodyId id, double mass, const Vec3& inertia) override;
  bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) override;
  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) override;
  std::span<const Contact> contacts() const noexcept override { return contacts_; }
  std::span<const Contact> contacts_with_friction() override;
  Box bounds(BodyId id) const override;
  void overlap(const Box& box, std::vector<BodyId>& out) const override;
  void restore(const Checkpoint& checkpoint) override;

 private:
  Engine& inner() const noexcept override { return *inner_; }
  void stepped(double dt) override;
  void take(std::span<const Contact> large);
  [[nodiscard]] BodyState shown(const BodyState& state) const;

  std::unique_ptr<Engine> inner_;
  double unit_m_;
  std::vector<Contact> contacts_;
  std::vector<JointLoad> loads_;
};

/// Converts to units of `unit_m` instead of metres. `length_unit_m` is not changed; engines need it for their own
/// values in metres.
[[nodiscard]] EngineSettings scaled(EngineSettings settings, double unit_m);
[[nodiscard]] std::vector<Mesh> scaled(std::span<const Mesh> meshes, double unit_m);

}  // namespace subworld
