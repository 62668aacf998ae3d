#pragma once

#include <btBulletDynamicsCommon.h>

namespace subworld::bullet {

/// Bullet's solver with Coulomb's friction: at most mu N, against the motion, in every direction. Bullet bounds each of
/// a contact's two friction directions by mu N of its own: along their diagonal a body holds, and is braked, by 41 %
/// too much, and a load that wanders to one direction takes nothing from the other.
///
/// Bullet 3 starts every step with friction at zero, whatever its flag for warm starts says. What stands by friction
/// then sags a little in each step, and creeps. Here friction may start from a part of that of the step before; normal
/// impulses start from all of theirs.
class ContactSolver final : public btSequentialImpulseConstraintSolver {
 public:
  /// Of each step, s: friction starts from what it was in the step before, as far as a step is longer than this.
  void set_friction_forgotten(btScalar forgotten_s) { friction_forgotten_s_ = forgotten_s; }
  /// What an iteration takes of each correction of friction, 0 to 2; those of normal impulses take Bullet's m_sor.
  void set_friction_relaxation(btScalar relaxation) { friction_relaxation_ = relaxation; }

 private:
  void convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info) override;
  btScalar solveSingleIteration(int iteration, btCollisionObject** bodies, int body_count,
                                btPersistentManifold** manifolds, int manifold_count, btTypedConstraint** constraints,
                                int constraint_count, const btContactSolverInfo& info, btIDebugDraw* drawer) override;

  void prepare_friction(const btSolverConstraint& normal, const btContactSolverInfo& info);
  /// Bullet makes a body bounce that is only near, and takes from the bounce the speed that would bring it there: lower
  /// bounces, by chance. It shall bounce if it touches within the step, and wholly.
  void time_bounce(btSolverConstraint& normal, const btContactSolverInfo& info) const;

  btScalar friction_forgotten_s_ = 0;
  btScalar friction_relaxation_ = 1;
};

}  // namespace subworld::bullet
