#include "bullet_friction.hpp"

namespace subworld::bullet {

namespace {

constexpr btScalar kSliding = 1e-3;      ///< m/s; slower contacts count as sticking
constexpr btScalar kAboutToSlide = 0.8;  ///< part of mu N that friction carries
constexpr btScalar kSmallest = SIMD_EPSILON;

struct Tangents {
  btVector3 first, second;
};

Tangents usual_tangents(const btManifoldPoint& point) {
  Tangents tangents;
  btPlaneSpace1(point.m_normalWorldOnB, tangents.first, tangents.second);
  return tangents;
}

btVector3 friction_of(const btManifoldPoint& point, const Tangents& along) {
  return point.m_appliedImpulseLateral1 * along.first + point.m_appliedImpulseLateral2 * along.second;
}

/// Turns the directions and what is known of the last impulse along them.
void turn(btManifoldPoint& point, const Tangents& to, const btVector3& friction) {
  point.m_lateralFrictionDir1 = to.first;
  point.m_lateralFrictionDir2 = to.second;
  point.m_appliedImpulseLateral1 = friction.dot(to.first);
  point.m_appliedImpulseLateral2 = friction.dot(to.second);
  point.m_contactPointFlags |= BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
}

btVector3 across(const btVector3& v, const btVector3& normal) { return v - v.dot(normal) * normal; }

btVector3 velocity_at(const btCollisionObject* object, const btVector3& point) {
  const btRigidBody* body = btRigidBody::upcast(object);
  return body->getVelocityInLocalPoint(point - body->getCenterOfMassPosition());
}

/// Bullet forgets a point's directions when it finds the point anew, but not the impulses: these are left as they are
/// along the usual directions, which follow from the normal.
void turn_back(btPersistentManifold& manifold) {
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    btManifoldPoint& point = manifold.getContactPoint(i);
    const btVector3 friction = friction_of(point, {point.m_lateralFrictionDir1, point.m_lateralFrictionDir2});
    turn(point, usual_tangents(point), friction);
  }
}

}  // namespace

void AlignedFrictionSolver::align(btPersistentManifold& manifold) {
  btVector3 friction(0, 0, 0);
  btScalar limit = 0;
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    const btManifoldPoint& point = manifold.getContactPoint(i);
    friction += friction_of(point, usual_tangents(point));
    limit += point.m_combinedFriction * point.m_appliedImpulse;
  }
  const bool loaded = friction.length() > kAboutToSlide * limit && friction.length() > kSmallest;
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    btManifoldPoint& point = manifold.getContactPoint(i);
    const btVector3& normal = point.m_normalWorldOnB;
    const btVector3 sliding = across(velocity_at(manifold.getBody0(), point.getPositionWorldOnA()) -
                                         velocity_at(manifold.getBody1(), point.getPositionWorldOnB()),
                                     normal);
    btVector3 along = sliding;
    if (sliding.length() <= kSliding) {
      if (!loaded) continue;
      along = across(friction, normal);
      if (along.length() <= kSmallest) continue;
    }
    along.normalize();
    // A point that is still too far off gets no row.
    if (point.getDistance() <= manifold.getContactProcessingThreshold()) {
      sliding_.push_back({&point, btMin(btScalar(1), slow_ / btMax(sliding.length(), kSmallest))});
    }
    turn(point, {along, normal.cross(along)}, friction_of(point, usual_tangents(point)));
  }
}

void AlignedFrictionSolver::convertContacts(btPersistentManifold** manifolds, int count,
                                            const btContactSolverInfo& info) {
  sliding_.clear();
  for (int m = 0; m < count; ++m) align(*manifolds[m]);
  btSequentialImpulseConstraintSolver::convertContacts(manifolds, count, info);
  auto next = sliding_.begin();
  for (int i = 0; i < m_tmpSolverContactConstraintPool.size() && next != sliding_.end(); ++i) {
    const btSolverConstraint& row = m_tmpSolverContactConstraintPool[i];
    if (row.m_originalContactPoint != next->point) continue;
    m_tmpSolverContactFrictionConstraintPool[row.m_frictionIndex + 1].m_friction *= next->across_ratio;
    ++next;
  }
}

btScalar AlignedFrictionSolver::solveGroup(btCollisionObject** bodies, int body_count, btPersistentManifold** manifolds,
                                           int manifold_count, btTypedConstraint** constraints, int constraint_count,
                                           const btContactSolverInfo& info, btIDebugDraw* drawer,
                                           btDispatcher* dispatcher) {
  const btScalar residual = btSequentialImpulseConstraintSolver::solveGroup(
      bodies, body_count, manifolds, manifold_count, constraints, constraint_count, info, drawer, dispatcher);
  for (int m = 0; m < manifold_count; ++m) turn_back(*manifolds[m]);
  return residual;
}

}  // namespace subworld::bullet
