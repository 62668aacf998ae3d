#include "contact_solver.hpp"

namespace subworld::bullet {

namespace {

/// The impulse (N s) that would stop a row's motion.
btScalar wanted(const btSolverConstraint& row, const btSolverBody& a, const btSolverBody& b) {
  const btScalar speed =
      row.m_contactNormal1.dot(a.getDeltaLinearVelocity()) + row.m_relpos1CrossNormal.dot(a.getDeltaAngularVelocity()) +
      row.m_contactNormal2.dot(b.getDeltaLinearVelocity()) + row.m_relpos2CrossNormal.dot(b.getDeltaAngularVelocity());
  return btScalar(row.m_appliedImpulse) + row.m_rhs - speed * row.m_jacDiagABInv;
}

/// Sets what a row's impulse has become to `impulse` (N s).
void change(btSolverConstraint& row, btSolverBody& a, btSolverBody& b, btScalar impulse) {
  const btScalar by = impulse - btScalar(row.m_appliedImpulse);
  row.m_appliedImpulse = impulse;
  a.internalApplyImpulse(row.m_contactNormal1 * a.internalGetInvMass(), row.m_angularComponentA, by);
  b.internalApplyImpulse(row.m_contactNormal2 * b.internalGetInvMass(), row.m_angularComponentB, by);
}

}  // namespace

void ContactSolver::convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info) {
  btSequentialImpulseConstraintSolver::convertContacts(manifolds, count, info);
  for (int i = 0; i < m_tmpSolverContactConstraintPool.size(); ++i) {
    time_bounce(m_tmpSolverContactConstraintPool[i], info);
    prepare_friction(m_tmpSolverContactConstraintPool[i], info);
  }
}

void ContactSolver::time_bounce(btSolverConstraint& normal, const btContactSolverInfo& info) const {
  const auto& point = *static_cast<const btManifoldPoint*>(normal.m_originalContactPoint);
  if (point.m_combinedRestitution <= 0 || point.getDistance() <= 0) return;
  const auto speed_of = [](const btSolverBody& body, const btVector3& direction, const btVector3& turn) {
    return direction.dot(body.m_linearVelocity + body.m_externalForceImpulse) +
           turn.dot(body.m_angularVelocity + body.m_externalTorqueImpulse);
  };
  const btScalar approach =
      -speed_of(m_tmpSolverBodyPool[normal.m_solverBodyIdA], normal.m_contactNormal1, normal.m_relpos1CrossNormal) -
      speed_of(m_tmpSolverBodyPool[normal.m_solverBodyIdB], normal.m_contactNormal2, normal.m_relpos2CrossNormal);
  if (approach < info.m_restitutionVelocityThreshold) return;
  const btScalar to_touch = point.getDistance() / info.m_timeStep;
  const btScalar bounce = point.m_combinedRestitution * approach;
  normal.m_rhs += (approach > to_touch ? to_touch : -bounce) * normal.m_jacDiagABInv;
}

void ContactSolver::prepare_friction(const btSolverConstraint& normal, const btContactSolverInfo& info) {
  const auto& point = *static_cast<const btManifoldPoint*>(normal.m_originalContactPoint);
  btSolverConstraint* rows = &m_tmpSolverContactFrictionConstraintPool[normal.m_frictionIndex];
  // The two directions take equal steps: only then does what is drawn back to mu N point against the motion. The
  // longest that converges without over-relaxation is one over the larger eigenvalue of their 2 x 2 inverse mass.
  const btScalar first = info.m_sor / rows[0].m_jacDiagABInv, second = info.m_sor / rows[1].m_jacDiagABInv;
  const btScalar across = rows[1].m_relpos1CrossNormal.dot(rows[0].m_angularComponentA) +
                          rows[1].m_relpos2CrossNormal.dot(rows[0].m_angularComponentB);
  const btScalar half = (first - second) / 2;
  const btScalar step = friction_relaxation_ / ((first + second) / 2 + btSqrt(half * half + across * across));
  const btScalar kept = 1 - friction_forgotten_s_ / info.m_timeStep;
  const btScalar held[] = {point.m_appliedImpulseLateral1, point.m_appliedImpulseLateral2};
  for (int k = 0; k < 2; ++k) {
    rows[k].m_rhs *= step / rows[k].m_jacDiagABInv;
    rows[k].m_jacDiagABInv = step;
    if (kept > 0) {
      change(rows[k], m_tmpSolverBodyPool[normal.m_solverBodyIdA], m_tmpSolverBodyPool[normal.m_solverBodyIdB],
             kept * held[k]);
    }
  }
}

btScalar ContactSolver::solveSingleIteration(int /*iteration*/, btCollisionObject** /*bodies*/, int /*body_count*/,
                                             btPersistentManifold** /*manifolds*/, int /*manifold_count*/,
                                             btTypedConstraint** /*constraints*/, int /*constraint_count*/,
                                             const btContactSolverInfo& /*info*/, btIDebugDraw* /*drawer*/) {
  btScalar worst = 0;  // there are no joints and no rolling friction
  for (int i = 0; i < m_tmpSolverContactConstraintPool.size(); ++i) {
    const btSolverConstraint& row = m_tmpSolverContactConstraintPool[i];
    const btScalar residual = m_resolveSingleConstraintRowLowerLimit(m_tmpSolverBodyPool[row.m_solverBodyIdA],
                                                                     m_tmpSolverBodyPool[row.m_solverBodyIdB], row);
    btSetMax(worst, residual * residual);
  }
  for (int i = 0; i < m_tmpSolverContactConstraintPool.size(); ++i) {
    const btSolverConstraint& normal = m_tmpSolverContactConstraintPool[i];
    btSolverConstraint* rows = &m_tmpSolverContactFrictionConstraintPool[normal.m_frictionIndex];
    const btScalar most = rows[0].m_friction * btScalar(normal.m_appliedImpulse);
    if (most == 0 && rows[0].m_appliedImpulse == 0 && rows[1].m_appliedImpulse == 0) continue;
    btSolverBody& a = m_tmpSolverBodyPool[normal.m_solverBodyIdA];
    btSolverBody& b = m_tmpSolverBodyPool[normal.m_solverBodyIdB];
    const btScalar first = wanted(rows[0], a, b), second = wanted(rows[1], a, b);
    const btScalar size = btSqrt(first * first + second * second);
    const btScalar part = size > most ? most / size : btScalar(1);
    change(rows[0], a, b, part * first);
    change(rows[1], a, b, part * second);
  }
  return worst;
}

}  // namespace subworld::bullet
