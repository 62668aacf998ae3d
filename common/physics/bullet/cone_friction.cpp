#include "cone_friction.hpp"

namespace subworld::bullet {

namespace {

/// From this part of mu N on, friction that holds is about to slide.
constexpr auto kAboutToSlide = btScalar(0.8);
/// Of mu N, what a direction keeps that a held load does not pull along: loads turn.
constexpr auto kHeldAside = btScalar(0.2);

btVector3 velocity_at(const btCollisionObject* object, const btVector3& point) {
  const btRigidBody* body = btRigidBody::upcast(object);
  return body->getVelocityInLocalPoint(point - body->getCenterOfMassPosition());
}

}  // namespace

void ConeFrictionSolver::convertContacts(btPersistentManifold** manifolds, int count, const btContactSolverInfo& info) {
  btSequentialImpulseConstraintSolver::convertContacts(manifolds, count, info);
  if (warm_friction_) {
    int row = 0;
    for (int m = 0; m < count; ++m) warm_start_friction(*manifolds[m], row);
  }
  int row = 0;
  for (int m = 0; m < count; ++m) bound_friction(*manifolds[m], row);
}

bool ConeFrictionSolver::has_row(const btManifoldPoint& point, int row) const {
  return row < m_tmpSolverContactConstraintPool.size() &&
         m_tmpSolverContactConstraintPool[row].m_originalContactPoint == &point;
}

void ConeFrictionSolver::warm_start_friction(const btPersistentManifold& manifold, int& row) {
  const auto push = [](btSolverBody& body, const btVector3& direction, const btVector3& turn, btScalar impulse) {
    if (body.m_originalBody) body.internalApplyImpulse(direction * body.internalGetInvMass(), turn, impulse);
  };
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    const btManifoldPoint& point = manifold.getContactPoint(i);
    if (!has_row(point, row)) continue;
    const btSolverConstraint& normal = m_tmpSolverContactConstraintPool[row++];
    const btScalar most = point.m_combinedFriction * normal.m_appliedImpulse;
    const btScalar held[] = {point.m_appliedImpulseLateral1, point.m_appliedImpulseLateral2};
    for (int k = 0; k < 2; ++k) {
      btSolverConstraint& friction = m_tmpSolverContactFrictionConstraintPool[normal.m_frictionIndex + k];
      friction.m_appliedImpulse = btClamped(held[k], -most, most);
      push(m_tmpSolverBodyPool[friction.m_solverBodyIdA], friction.m_contactNormal1, friction.m_angularComponentA,
           friction.m_appliedImpulse);
      push(m_tmpSolverBodyPool[friction.m_solverBodyIdB], friction.m_contactNormal2, friction.m_angularComponentB,
           friction.m_appliedImpulse);
    }
  }
}

void ConeFrictionSolver::bound_friction(const btPersistentManifold& manifold, int& row) {
  // A pair's points share a load as they like: only its sum says where it pulls.
  btScalar limit = 0, held_first = 0, held_second = 0;
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    const btManifoldPoint& point = manifold.getContactPoint(i);
    limit += point.m_combinedFriction * point.m_appliedImpulse;
    held_first += point.m_appliedImpulseLateral1;
    held_second += point.m_appliedImpulseLateral2;
  }
  const btScalar held = btSqrt(held_first * held_first + held_second * held_second);
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    const btManifoldPoint& point = manifold.getContactPoint(i);
    if (!has_row(point, row)) continue;
    const int friction = m_tmpSolverContactConstraintPool[row++].m_frictionIndex;
    const btVector3 velocity = velocity_at(manifold.getBody0(), point.getPositionWorldOnA()) -
                               velocity_at(manifold.getBody1(), point.getPositionWorldOnB());
    const btScalar first = velocity.dot(point.m_lateralFrictionDir1);
    const btScalar second = velocity.dot(point.m_lateralFrictionDir2);
    const btScalar speed = btSqrt(first * first + second * second);
    btScalar part_first = 1, part_second = 1;
    if (speed > slow_) {
      part_first = btMax(btFabs(first), slow_) / speed;
      part_second = btMax(btFabs(second), slow_) / speed;
    } else if (held > kAboutToSlide * limit && held > SIMD_EPSILON) {
      part_first = btMax(btFabs(held_first) / held, kHeldAside);
      part_second = btMax(btFabs(held_second) / held, kHeldAside);
    }
    m_tmpSolverContactFrictionConstraintPool[friction].m_friction *= part_first;
    m_tmpSolverContactFrictionConstraintPool[friction + 1].m_friction *= part_second;
  }
}

}  // namespace subworld::bullet
