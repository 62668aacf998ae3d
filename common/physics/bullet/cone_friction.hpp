#pragma once

#include <btBulletDynamicsCommon.h>

namespace subworld::bullet {

/// Bullet's solver with friction of mu N in every direction. Bullet bounds each of a contact's two friction directions
/// by mu N: along their diagonal a body would hold, and be braked, by 41 % too much. Where a contact slides, or is
/// about to, each direction gets its part of mu N here. The directions stay as they are: turning them costs the warm
/// start.
///
/// Bullet 3 starts every step with friction at zero, whatever its flag for warm starts says. What stands by friction
/// then sags a little in each step, and creeps. Here friction may start from the step before, as the normal impulses
/// do.
class ConeFrictionSolver final : public btSequentialImpulseConstraintSolver {
 public:
  /// m/s: what may well stop within the step counts as sticking.
  void set_slow(btScalar speed) { slow_ = speed; }
  void set_warm_friction(bool warm) { warm_friction_ = warm; }

 private:
  void convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info) override;
  /// `row`: in, the first row of the pair's points; out, that of the next pair.
  void warm_start_friction(const btPersistentManifold& manifold, int& row);
  void bound_friction(const btPersistentManifold& manifold, int& row);
  /// Rows stand in the order of the points; a point that is too far off has none.
  [[nodiscard]] bool has_row(const btManifoldPoint& point, int row) const;

  btScalar slow_ = 0;
  bool warm_friction_ = false;
};

}  // namespace subworld::bullet
