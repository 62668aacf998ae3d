#pragma once

#include <btBulletDynamicsCommon.h>

#include <vector>

namespace subworld::bullet {

/// Bullet's solver with friction of mu N in every direction. Bullet bounds each of a contact's two friction directions
/// by mu N: along their diagonal a body would hold, and be braked, by 41 % too much. Where a contact slides or is about
/// to, its first direction is turned there, and the second one's bound falls as it slides faster; all others keep what
/// Bullet gives them, so that what rests stays as quiet as it is.
class AlignedFrictionSolver final : public btSequentialImpulseConstraintSolver {
 public:
  btScalar solveGroup(btCollisionObject** bodies, int body_count, btPersistentManifold** manifolds, int manifold_count,
                      btTypedConstraint** constraints, int constraint_count, const btContactSolverInfo& info,
                      btIDebugDraw* drawer, btDispatcher* dispatcher) override;
  /// m/s: what may well stop within the step counts as sticking.
  void set_slow(btScalar speed) { slow_ = speed; }

 private:
  struct Sliding {
    const btManifoldPoint* point;
    btScalar across_ratio;  ///< of mu, for the second direction
  };
  void align(btPersistentManifold& manifold);
  void convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info) override;

  btScalar slow_ = 0;
  std::vector<Sliding> sliding_;  ///< in the order of the solver's rows
};

}  // namespace subworld::bullet
