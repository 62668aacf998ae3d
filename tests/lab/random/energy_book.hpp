#pragma once

#include "model/scene.hpp"
#include "physics/engine_shell.hpp"

#include <memory>
#include <optional>
#include <vector>

namespace subworld {

/// The energy of the bodies in one engine, and who put it there.
///
///   m, I    kg, kg m^2   mass and principal inertia of a body, as it was added
///   M       kg           mass while the engine steps, as set_inertia() left it; M > m in an implicit coupling
///   v0, v1  m/s          velocity before a step, and after it
///   vs      m/s          velocity with which the step begins, as set_velocity() left it
///   F       N            force on the body in the step of length dt
///   x, g    m, m/s^2     position, gravity
///   a       s            half of an integration part; a position is so far ahead of the forces
///
/// Energy:         E = sum of m v^2 / 2 + w I w / 2 - m g (x - a v).                           (1)
/// User's impulse: J = dt F + (M vs - m v0) - (M - m) v1.                                      (2)
///                 A step makes this much momentum without contacts and weight. For a linearly implicit spring it is
///                 the mean force on the proxy times dt.
/// User's work:    W = J (v0 + v1) / 2, where nothing touches the body: its velocity then changes evenly.
///                 W = J v1, where a contact touches it: the contact may have stopped it anywhere in the step. Some
///                 engines place such a body by another velocity than they report, so W = J (x1 - x0) / dt counts where
///                 that is more. Rotation likewise, by w1.                                     (3)
///                 An implicit coupling begins with vs < v0. In a step of several parts the body then comes less far
///                 than dt (v0 + v1) / 2. What its weight does less for that counts as the user's work.
/// Correction:     C = E after set_state() - E before it.                                      (4)
/// Contacts, friction and damping can only take energy: E - sum of W - sum of C never rises. What it rises by above
/// its begin is unexplained.
struct EnergyBook {
  double begin_j = 0.0;      ///< E
  double kinetic_j = 0.0;    ///< of it: what moved at the begin
  double energy_j = 0.0;     ///< E now
  double work_j = 0.0;       ///< W so far
  double corrected_j = 0.0;  ///< C so far
  double given_j = 0.0;      ///< positive parts of W and C
  double released_j = 0.0;   ///< potential energy that bodies have lost, each by itself, step by step
  double reading_j = 0.0;    ///< sum of m g |a v|: a contact within the last part may have come at any time of it

  [[nodiscard]] double unexplained_j() const noexcept { return energy_j - begin_j - work_j - corrected_j; }
  /// What the scene, users, corrections and gravity have put in.
  [[nodiscard]] double put_in_j() const noexcept { return kinetic_j + given_j + released_j; }
};

/// An engine as it is, with a book of its energy.
class BookedEngine final : public EngineShell {
 public:
  BookedEngine(std::unique_ptr<Engine> inner, const Vec3& gravity) : inner_(std::move(inner)), gravity_(gravity) {}

  /// From here on energy counts.
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
  /// Notes which bodies have contacts that push.
  void find_touched();
  void total() noexcept;
  /// The energy is counted otherwise from now on: its begin moves with it.
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
