#include "physics/bullet/small_steps.hpp"

#include "physics/bullet/shapes.hpp"

#include <LinearMath/btTransformUtil.h>

#include <algorithm>
#include <utility>

namespace subworld::bullet {

namespace {

/// Oscillations of a contact's spring in a small step: the stiffest spring that an iteration can follow (Catto 2024).
constexpr auto kOscillations = btScalar(0.25);
/// Damping ratio. With 1 or 10, heaps of unequal masses gain more energy, or a cube on one of a thousandth of its mass
/// trembles.
constexpr auto kDamping = btScalar(5);
/// Speed limit for removing penetration, m/s: the rigid iteration must remove all of this speed again.
constexpr auto kFastestPush = btScalar(0.1);
/// Iterations end when they change no velocity by more than this factor times the change by forces in a small step.
constexpr auto kEnough = btScalar(5);
/// The same limit relative to the largest speed, for worlds without forces.
constexpr auto kEnoughOfSpeed = btScalar(1e-4);

/// Spring for a small step, s.
ContactSpring spring_for(btScalar h) {
  const btScalar w = SIMD_2_PI * kOscillations / h;
  const btScalar s = 2 * kDamping + h * w, c = h * w * s;
  return {w / s, c / (1 + c), 1 / (1 + c), kFastestPush};
}

/// Of a body that has moved so far in a time `dt`, s.
btTransform moved_pose(const btRigidBody& body, const Motion& moved, btScalar dt) {
  btTransform pose;
  btTransformUtil::integrateTransform(body.getWorldTransform(), vector(moved.linear) / dt, vector(moved.angular) / dt,
                                      dt, pose);
  return pose;
}

bool is_round(const btCollisionObject& object) {
  const btCollisionShape& shape = *object.getCollisionShape();
  return shape.isCompound() || (shape.isConvex() && convex_of(shape).core != Convex::Core::polyhedron);
}

/// The position and distance of its points, where their bodies are now.
void follow_bodies(btPersistentManifold& manifold) {
  const btTransform &a = manifold.getBody0()->getWorldTransform(), &b = manifold.getBody1()->getWorldTransform();
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    btManifoldPoint& point = manifold.getContactPoint(i);
    point.m_positionWorldOnA = a * point.m_localPointA;
    point.m_positionWorldOnB = b * point.m_localPointB;
    point.m_distance1 = (point.m_positionWorldOnA - point.m_positionWorldOnB).dot(point.m_normalWorldOnB);
  }
}

}  // namespace

template <class Part>
void SmallStepSolver::for_movers(const Part& part) {
  constexpr std::size_t kGrain = 256;  // some microseconds
  workers_.run(movers_.size() - (kFixed + 1), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) part(i + kFixed + 1);
  });
}

SmallStepSolver::SmallStepSolver(Workers& workers, bool long_vectors)
    : workers_(workers), contacts_(workers, long_vectors) {
  for (std::vector<Motion>* motions : {&motions_, &moved_, &before_, &after_, &plastic_})
    motions->reserve(kUsualBodies);
  busy_.reserve(kUsualBodies);
  busy_next_.reserve(kUsualBodies);
}

void SmallStepSolver::solve_group(std::span<btCollisionObject* const> bodies,
                                  std::span<btPersistentManifold* const> manifolds, const btContactSolverInfo& info) {
  const int count = step_count(info.m_numIterations);
  const btScalar h = info.m_timeStep / btScalar(count);
  list_movers(bodies, h, movers_);
  prepare_motions();
  contacts_.prepare(manifolds, movers_, keeps_frictionless_);

  const btScalar change = enough();
  for (int i = 0; i < count; ++i) {
    if (i > 0) drive(i, info);
    add_forces();
    joints_.prepare(constraints_, movers_, moved_, motions_, false, h);
    joints_.start(motions_);
    contacts_.start(h, motions_);
    solve(spring_for(h), most_spring_passes_, h, change);
    move(h);
    solve({}, most_rigid_passes_, h, change);
    joints_.finish(motions_);
    contacts_.add_up();
  }
  bounce_within_energy(count, h, info.m_restitutionVelocityThreshold, change);
  contacts_.write_impulses();
  write_motions(info);
}

void SmallStepSolver::prepare_motions() {
  motions_.assign(kFixed + 1, Motion{});
  for (const Mover& mover : std::span(movers_).subspan(kFixed + 1)) motions_.push_back(motion_of(mover));
  moved_.assign(movers_.size(), Motion{});
}

btScalar SmallStepSolver::enough() const {
  btScalar by_forces = 0, fastest = 0;
  for (std::size_t i = kFixed + 1; i < movers_.size(); ++i) {
    by_forces += movers_[i].by_force.length();
    fastest = btMax(fastest, vector(motions_[i].linear).length2());
  }
  by_forces /= btScalar(btMax<std::size_t>(movers_.size() - kFixed - 1, 1));
  return btMax(kEnough * by_forces, kEnoughOfSpeed * btSqrt(fastest));
}

void SmallStepSolver::drive(int small_step, const btContactSolverInfo& info) {
  if (driven_.bodies.empty()) return;
  const auto set_velocity = [](btRigidBody& body, const Motion& velocity) {
    body.setLinearVelocity(vector(velocity.linear));
    body.setAngularVelocity(vector(velocity.angular));
  };
  starts_.clear();
  for (btRigidBody* body : driven_.bodies) {
    const std::size_t i = mover_of(*body);
    starts_.push_back(
        {body->getWorldTransform(), motion_of(movers_[i]), body->getInvMass(), body->getInvInertiaDiagLocal()});
    body->setWorldTransform(moved_pose(*body, moved_[i], info.m_timeStep));
    set_velocity(*body, motions_[i]);
    body->clearForces();
  }
  driven_.drive(small_step);
  for (std::size_t k = 0; k < starts_.size(); ++k) {
    btRigidBody& body = *driven_.bodies[k];
    const std::size_t i = mover_of(body);
    motions_[i] = motion_of(movers_[i]);
    movers_[i] = make_mover(body, info.m_timeStep / btScalar(step_count(info.m_numIterations)));
    const Start& start = starts_[k];
    if (start.inverse_mass != body.getInvMass() || start.inverse_inertia != body.getInvInertiaDiagLocal())
      contacts_.set_inertia(static_cast<std::uint32_t>(i), movers_);
    body.setWorldTransform(start.pose);
    set_velocity(body, start.velocity);
  }
}

void SmallStepSolver::add_forces() {
  for_movers([this](std::size_t i) {
    for (int k = 0; k < 3; ++k) {
      motions_[i].linear[k] += movers_[i].by_force[k];
      motions_[i].angular[k] += movers_[i].by_torque[k];
    }
  });
}

template <class Pass>
void SmallStepSolver::until_quiet(int most, btScalar enough, const Pass& contacts) {
  bool any = true;
  for (int pass = 0; pass < most && any; ++pass) {
    any = false;
    busy_next_.assign(movers_.size(), 0);
    if (joints_.any() && joints_.solve(motions_) > enough) {
      any = true;
      busy_next_.assign(movers_.size(), 1);
      busy_ = busy_next_;
    }
    if (contacts(pass > 0 ? std::span<const std::uint8_t>(busy_) : std::span<const std::uint8_t>())) any = true;
    std::swap(busy_, busy_next_);
  }
}

void SmallStepSolver::solve(const ContactSpring& spring, int most, btScalar h, btScalar enough) {
  until_quiet(most, enough, [&](std::span<const std::uint8_t> busy) {
    return contacts_.solve(spring, h, enough, busy, busy_next_, motions_);
  });
}

void SmallStepSolver::move(btScalar h) {
  for_movers([this, h](std::size_t i) {
    for (int k = 0; k < 3; ++k) {
      moved_[i].linear[k] += h * motions_[i].linear[k];
      moved_[i].angular[k] += h * motions_[i].angular[k];
    }
  });
  contacts_.follow(moved_);
}

// Newton's restitution, from the speed at the touch. The next step does not start from the impulse of a bounce.
void SmallStepSolver::bounce_within_energy(int count, btScalar h, btScalar threshold, btScalar enough) {
  const std::span<const ContactBatches::Pair> pairs = contacts_.pairs();
  bool any = false;
  for (std::size_t i = 0; i < pairs.size() && !any; ++i) any = contacts_.bounces(i, threshold);
  if (!any) return;
  bounce_limit_.begin(movers_);
  for (std::size_t i = 0; i < pairs.size(); ++i)
    bounce_limit_.join(pairs[i].a, pairs[i].b, contacts_.bounces(i, threshold));
  for (const auto& joint : joints_.nodes()) bounce_limit_.join(joint.a, joint.b, false);
  before_.resize(movers_.size());
  after_.resize(movers_.size());
  for (std::size_t i = kFixed + 1; i < movers_.size(); ++i) {
    before_[i] = sum(motion_of(movers_[i]), by_loads(movers_[i]), btScalar(count) + btScalar(0.5));
  }
  plastic_ = motions_;
  contacts_.save();
  for (int tries = 1; tries <= BounceLimit::kMostTries + 1; ++tries) {
    bounce(h, threshold, enough);
    if (tries > BounceLimit::kMostTries) return;
    for (std::size_t i = kFixed + 1; i < movers_.size(); ++i)
      after_[i] = sum(motions_[i], by_loads(movers_[i]), btScalar(0.5));
    if (!bounce_limit_.lower(before_, after_, tries == BounceLimit::kMostTries)) return;
    motions_ = plastic_;
    contacts_.revert();
  }
}

void SmallStepSolver::bounce(btScalar h, btScalar threshold, btScalar enough) {
  const std::span<const ContactBatches::Pair> pairs = contacts_.pairs();
  until_quiet(most_rigid_passes_, enough, [&](std::span<const std::uint8_t> busy) {
    bool any = false;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const auto [a, b] = std::pair(pairs[i].a, pairs[i].b);
      if (!busy.empty() && busy[a] == 0 && busy[b] == 0) continue;
      if (contacts_.bounce(i, bounce_limit_.factor(a, b), threshold, h, motions_) <= enough) continue;
      any = true;
      busy_next_[a] = a != kFixed;
      busy_next_[b] = b != kFixed;
    }
    return any;
  });
}

void SmallStepSolver::write_motions(const btContactSolverInfo& info) {
  const btScalar dt = info.m_timeStep;
  for_movers([this, dt](std::size_t i) {
    btRigidBody& body = *movers_[i].body;
    body.setLinearVelocity(vector(motions_[i].linear));
    body.setAngularVelocity(vector(motions_[i].angular));
    body.setCompanionId(-1);
    body.proceedToTransform(moved_pose(body, moved_[i], dt));
  });
}

void SmallStepWorld::part_leaving() {
  btBroadphasePairArray& pairs = getPairCache()->getOverlappingPairArray();
  const auto is_leaving = [](const btBroadphaseProxy& proxy) {
    return leaves(*static_cast<const btCollisionObject*>(proxy.m_clientObject));
  };
  for (int i = pairs.size() - 1; i >= 0; --i) {  // the last one takes the place of one that is removed
    btBroadphaseProxy &a = *pairs[i].m_pProxy0, &b = *pairs[i].m_pProxy1;
    if (is_leaving(a) || is_leaving(b)) getPairCache()->removeOverlappingPair(&a, &b, getDispatcher());
  }
}

void SmallStepWorld::advance(btScalar dt) {
  if (!solver_moves_) {
    stepSimulation(dt, 0);
    return;
  }
  if (searched_s_ >= btScalar(0.999) * dt) {
    follow(dt);
  } else {
    search(btMax(dt, ahead_s_));
    searched_s_ = ahead_s_;
  }
  searched_s_ -= dt;
  getSolverInfo().m_timeStep = dt;
  solveConstraints(getSolverInfo());
  clearForces();
}

void SmallStepWorld::search(btScalar ahead) {
  predictUnconstraintMotion(ahead);  // for the bounds
  getDispatchInfo().m_timeStep = ahead;
  performDiscreteCollisionDetection();
  round_pairs_.clear();
  if (ahead_s_ == 0) return;
  btBroadphasePairArray& pairs = getPairCache()->getOverlappingPairArray();
  const auto is_of_round = [](const btBroadphaseProxy* proxy) {
    return is_round(*static_cast<const btCollisionObject*>(proxy->m_clientObject));
  };
  for (int i = 0; i < pairs.size(); ++i) {
    if (is_of_round(pairs[i].m_pProxy0) || is_of_round(pairs[i].m_pProxy1)) round_pairs_.push_back(&pairs[i]);
  }
}

void SmallStepWorld::follow(btScalar dt) {
  constexpr std::size_t kGrain = 128;  // some microseconds
  btPersistentManifold** const manifolds = getDispatcher()->getInternalManifoldPointer();
  workers_.run(static_cast<std::size_t>(getDispatcher()->getNumManifolds()), kGrain,
               [manifolds](std::size_t begin, std::size_t end) {
                 for (std::size_t m = begin; m < end; ++m) follow_bodies(*manifolds[m]);
               });
  getDispatchInfo().m_timeStep = dt;
  static_cast<Dispatcher*>(getDispatcher())->find_contacts(round_pairs_, getDispatchInfo());
}

void SmallStepWorld::solveConstraints(btContactSolverInfo& info) {
  flush_bodies_.omit_seams(*getDispatcher());
  left_contacts_.give_back(*getDispatcher());
  if (!solver_moves_) return btDiscreteDynamicsWorld::solveConstraints(info);
  if (m_constraints.size() > 0) {  // each mechanism is solved until it is quiet
    calculateSimulationIslands();
    return btDiscreteDynamicsWorld::solveConstraints(info);
  }
  // Islands are for bodies that sleep, and for solvers that stop early in one of them.
  const auto data = [](auto& array) { return array.size() > 0 ? &array[0] : nullptr; };
  m_constraintSolver->solveGroup(data(m_collisionObjects), m_collisionObjects.size(),
                                 getDispatcher()->getInternalManifoldPointer(), getDispatcher()->getNumManifolds(),
                                 nullptr, 0, info, nullptr, nullptr);
}

}  // namespace subworld::bullet
