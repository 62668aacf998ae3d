#pragma once

#include <btBulletDynamicsCommon.h>

namespace subworld::bullet {

/// Bullet's solver with friction of mu N in every direction. Bullet bounds each of a contact's two friction directions
/// by mu N: along their diagonal a body would hold, and be braked, by 41 % too much. Where a contact slides, or is
/// about to, each direction gets its part of mu N here. The directions stay as they are: turning them costs the warm
/// start.
class ConeFrictionSolver final : public btSequentialImpulseConstraintSolver {
 public:
  /// m/s: what may well stop within the step counts as sticking.
  void set_slow(btScalar speed) { slow_ = speed; }

 private:
  void convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info) override;
  void bound_friction(const btPersistentManifold& manifold, int& row);

  btScalar slow_ = 0;
};

}  // namespace subworld::bullet
