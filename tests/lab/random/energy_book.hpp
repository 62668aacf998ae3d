#pragma once

#include "model/scene/scene.hpp"
#include "physics/shells/engine_shell.hpp"

#include <memory>
#include <optional>
#include <vector>

namespace subworld {

/// Energy balance of the bodies in one engine.
///
///   m, I    kg, kg m^2   mass and principal inertia of a body, as it was added
///   M       kg           mass in the engine's step, set by set_inertia(); M > m in an implicit coupling
///   v0, v1  m/s          velocity before and after a step
///   vs      m/s          velocity at the start of the step, set by set_velocity()
///   F       N            force on the body in the step of length dt
///   x, g    m, m/s^2     position, gravity
///   a       s            half of an integration sub-step: a position is this time ahead of the forces
///
///   Energy:         E = sum of m v^2 / 2 + w I w / 2 - m g (x - a v).                           (1)
///   User's impulse: J = dt F + (M vs - m v0) - (M - m) v1.                                      (2)
///                   A step adds this momentum without contacts and weight. For a linearly implicit spring it is the
///                   mean force on the proxy times dt.
///   User's work:    W = J (v0 + v1) / 2 for a body without contact: its velocity changes linearly.
///                   W = J v1 for a body in contact: the contact may have stopped it at any time of the step. Some
///                   engines move such a body with another velocity than they report, so W = J (x1 - x0) / dt is used
///                   if it is larger. Rotation likewise, by w1.                                  (3)
///                   An implicit coupling begins with vs < v0. In a step of several sub-steps the body then moves less
///                   than dt (v0 + v1) / 2. The missing work of its weight counts as the user's work.
///   Correction:     C = E after set_state() - E before it.                                      (4)
/// Contacts, friction and damping can only remove energy: E - sum of W - sum of C never rises. A rise above its initial
/// value is unexplained.
struct EnergyBook {
  double begin_j = 0.0;      ///< E
  double kinetic_j = 0.0;    ///< kinetic share of begin_j
  double energy_j = 0.0;     ///< E now
  double work_j = 0.0;       ///< W so far
  double corrected_j = 0.0;  ///< C so far
  double given_j = 0.0;      ///< positive parts of W and C
  double released_j = 0.0;   ///< sum of the decreases of each body's potential energy in each step
  /// Sum of m g |a v|: reading error, because a contact may have begun at any time of the last sub-step.
  double reading_j = 0.0;

  [[nodiscard]] double unexplained_j() const noexcept { return energy_j - begin_j - work_j - corrected_j; }
  /// Energy added by the scene, users, corrections and gravity.
  [[nodiscard]] double put_in_j() const noexcept { return kinetic_j + given_j + released_j; }
};

/// Wraps an engine and records its energy balance.
class BookedEngine final : public EngineShell {
 public:
  BookedEngine(std::unique_ptr<Engine> inner, const Vec3& gravity) : inner_(std::move(inner)), gravity_(gravity) {}

  /// Starts the balance.
  void begin();
  [[nodiscard]] const EnergyBook& book() const noexcept { return book_; }

  using EngineShell::add;
  void add(const Body& body, const BodyState& state, Role role) override;
  void remove(BodyId id) override;
  bool set_state(BodyId id, const BodyState& state) override;
  bool set_velocity(BodyId id, const Vec3& linear, const Vec3& angular) override;
  void set_inertia(BodyId id, double mass, const Vec3& inertia) override;
  bool apply_impulse(BodyId id, const Vec3& impulse, const Vec3& point) override;
  bool apply_force(BodyId id, const Vec3& force, const Vec3& torque) override;
  void step(double dt) override;
  /// What drives the bodies is booked before whole steps.
  void step_driven(double dt, std::span<const BodyId> driven, const StepDrive& drive) override {
    Engine::step_driven(dt, driven, drive);
  }
  Capabilities capabilities() const noexcept override {
    Capabilities can = EngineShell::capabilities();
    can.drives_inside = false;
    return can;
  }

 private:
  Engine& inner() const noexcept override { return *inner_; }
  struct Entry {
    Body body;  ///< m, I
    double mass = 0.0;
    Vec3 inertia = Vec3::Zero();  ///< M
    BodyState before;             ///< v0; the pose of the last step or correction
    Vec3 force = Vec3::Zero(), torque = Vec3::Zero();
    double potential_j = 0.0;
    bool touched = false;  ///< in the last step
  };
  [[nodiscard]] double potential_j(const Entry& entry, const BodyState& state) const noexcept;
  [[nodiscard]] double work_j(const Entry& entry, const BodyState& start, const BodyState& after, double dt) const;
  /// Finds the bodies in contact with an impulse.
  void find_touched();
  void total() noexcept;
  /// Call when the formula of the energy changes: shifts the initial value by the same amount.
  void rebase() noexcept;
  [[nodiscard]] Entry* find(BodyId id) noexcept;

  std::unique_ptr<Engine> inner_;
  Vec3 gravity_;
  double ahead_s_ = 0.0;                       ///< a, of the last step
  std::vector<std::optional<Entry>> entries_;  ///< of the movable bodies, by id
  std::vector<BodyState> starts_;              ///< with vs, by id
  EnergyBook book_;
};

}  // namespace subworld
