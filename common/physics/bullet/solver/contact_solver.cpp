#include "physics/bullet/solver/contact_solver.hpp"

#include <LinearMath/btTransformUtil.h>

#include <algorithm>

namespace subworld::bullet {

namespace {

/// Of friction in each iteration where a pair also resists turning: on a ball each undoes most of the other. A round
/// leaves 5 / 7 of the error.
constexpr int kTurningRounds = 10;

/// Speed (m/s) along the normal with which a bounce ends the step: that of a flight to the height that Newton's
/// restitution e gives. Bodies advance v by a h, then x by v h, so that their points lie on a parabola with the speed
/// v - a h / 2 (a: towards the other body, h: the step, p: approach, d: gap, below 0 if they overlap).
///   met at the touch:   c^2 = (p + a h / 2)^2 + 2 a d                                         (1)
///   left at gap d:      (u + a h / 2)^2 = e^2 c^2 - 2 a d                                     (2)
/// It never exceeds p. A gap above the height of the bounce ends it there, at u = 0.
btScalar bounce_speed(btScalar approach, btScalar restitution, btScalar gap, btScalar by_force, btScalar dt) {
  const btScalar half = by_force / 2, square = restitution * restitution;
  const btScalar left = square * (approach + half) * (approach + half) - 2 * (1 - square) * by_force * gap / dt;
  return btClamped(btSqrt(btMax(left, btScalar(0))) - half, btScalar(0), approach);
}

/// One Gauss-Seidel update of a row whose impulse cannot pull. False if nothing changed.
bool solve(const Row& row, btScalar rhs, btScalar& impulse, Both inverse_mass, BothMotion& motion) {
  const Both speeds = linear_speed(row, motion) + angular_speed(row, motion);
  const btScalar wanted = rhs - speeds[0] * row.step - speeds[1] * row.step;
  const btScalar by = btMax(wanted, -impulse);
  impulse = btMax(impulse + wanted, btScalar(0));
  apply(row, inverse_mass, by, motion);
  return by != 0;
}

/// Whether a vector is shorter than `most`, by more than rounding. Needs no square root.
bool is_within(btScalar x, btScalar y, btScalar most) {
  constexpr btScalar kRounding = 16 * SIMD_EPSILON;
  return x * x + y * y < (1 - kRounding) * (most * most);
}

}  // namespace

ContactSolver::ContactSolver() {
  motions_.reserve(kUsualBodies);
  pushed_.reserve(kUsualBodies);
  pairs_.reserve(kUsualPairs);
  normals_.reserve(kUsualPoints);
  frictions_.reserve(kUsualPoints);
  pushes_.reserve(kUsualPoints);
}

void ContactSolver::solve_group(std::span<btCollisionObject* const> bodies,
                                std::span<btPersistentManifold* const> manifolds, const btContactSolverInfo& info) {
  list_movers(bodies, info.m_timeStep, movers_);
  motions_.assign(movers_.size(), Motion{});
  pushed_.assign(movers_.size(), Motion{});
  pairs_.clear();
  normals_.clear();
  frictions_.clear();
  turning_.clear();
  pushes_.clear();
  for (btPersistentManifold* manifold : manifolds) prepare_pair(*manifold, info);
  joints_.clear();
  if (!constraints_.empty()) prepare_joints(info.m_timeStep);
  start_from_last_friction(1 - friction_forgotten_s_ / info.m_timeStep);

  iterate(info.m_numIterations, {});
  limit_bounces(info.m_numIterations);
  joints_.finish(motions_);
  write_impulses();
  write_motions(info);
}

void ContactSolver::iterate(int most, Active active) {
  for (int i = 0; i < most && (active.pushes || active.impulses || joints_.any()); ++i) {
    if (joints_.any()) active.impulses |= joints_.solve(motions_) > 0.0;
    const bool friction = active.impulses;
    active = solve_normals(active);
    if (friction) solve_friction();
  }
}

void ContactSolver::prepare_joints(btScalar dt) {
  after_.assign(movers_.size(), Motion{});
  for (std::size_t i = kFixed + 1; i < movers_.size(); ++i)
    after_[i] = sum(motion_of(movers_[i]), by_loads(movers_[i]));
  joints_.prepare(constraints_, movers_, {}, after_, true, dt);
  joints_.start(motions_);
}

void ContactSolver::limit_bounces(int most) {
  const auto bounces = [](const Normal& row) { return row.bounce != 0; };
  if (std::ranges::none_of(normals_, bounces)) return;
  bounce_limit_.begin(movers_);
  for (const Pair& pair : pairs_) {
    const auto rows = std::span(normals_).subspan(pair.begin, pair.end - pair.begin);
    bounce_limit_.join(pair.a, pair.b, std::ranges::any_of(rows, bounces));
  }
  for (const auto& joint : joints_.nodes()) bounce_limit_.join(joint.a, joint.b, false);
  before_.assign(movers_.size(), Motion{});
  for (std::size_t i = kFixed + 1; i < movers_.size(); ++i)
    before_[i] = sum(motion_of(movers_[i]), by_loads(movers_[i]));
  after_.resize(movers_.size());
  for (int tries = 1; tries <= BounceLimit::kMostTries; ++tries) {
    for (std::size_t i = kFixed + 1; i < movers_.size(); ++i) after_[i] = sum(before_[i], motions_[i]);
    if (!bounce_limit_.lower(before_, after_, tries == BounceLimit::kMostTries)) return;
    for (const Pair& pair : pairs_) {
      const btScalar factor = bounce_limit_.factor(pair.a, pair.b);
      for (std::size_t i = pair.begin; i < pair.end; ++i)
        normals_[i].rhs = normals_[i].plastic + factor * normals_[i].bounce;
    }
    iterate(most, {.pushes = false, .impulses = true});
  }
}

ContactSolver::PairState ContactSolver::state_of(const Mover& a, const Mover& b) {
  const btVector3 none(0, 0, 0);
  const btVector3 spin_a = a.body ? a.body->getAngularVelocity() + a.by_torque : none;
  const btVector3 spin_b = b.body ? b.body->getAngularVelocity() + b.by_torque : none;
  const btVector3 speed_a = a.body ? a.body->getLinearVelocity() + a.by_force : none;
  const btVector3 speed_b = b.body ? b.body->getLinearVelocity() + b.by_force : none;
  return {inertia_of(a, b), {of_both(speed_a, -speed_b), of_both(spin_a, -spin_b)}};
}

void ContactSolver::prepare_pair(btPersistentManifold& manifold, const btContactSolverInfo& info) {
  if (manifold.getNumContacts() == 0) return;
  const Mover& mover_a = movers_[mover_of(*manifold.getBody0())];
  const Mover& mover_b = movers_[mover_of(*manifold.getBody1())];
  if (mover_a.immovable && mover_b.immovable) return;

  Pair& pair = pairs_.emplace_back(make_pair_of(manifold, movers_, normals_.size(), keeps_frictionless_));
  const PairState before = state_of(mover_a, mover_b);
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    btManifoldPoint& point = manifold.getContactPoint(i);
    const Both3 arm = arms_of(manifold, point);
    prepare_normal(point, arm, pair, before, info);
    set_tangents(point);
    Friction& friction = frictions_.emplace_back();
    if (pair.rubs)
      prepare_friction(point, arm, before, sliding(manifold, point.getPositionWorldOnB()), info.m_sor, friction);
    pair.penetrates = pair.penetrates || pushes_.back().rhs != 0;
  }
  pair.end = static_cast<std::uint32_t>(normals_.size());
  turning_.add(pair, before.inertia, before.motion);

  // Normal impulses start from those of the previous step.
  BothMotion motion = gather(motions_[pair.a], motions_[pair.b]);
  for (std::size_t i = pair.begin; i < pair.end; ++i) {
    apply(normals_[i], pair.inverse_mass, normals_[i].impulse, motion);
  }
  scatter(motion, motions_[pair.a], motions_[pair.b]);
}

void ContactSolver::prepare_normal(const btManifoldPoint& point, const Both3& arm, const Pair& pair,
                                   const PairState& before, const btContactSolverInfo& info) {
  const btVector3& axis = point.m_normalWorldOnB;
  const btScalar distance = point.getDistance(), restitution = point.m_combinedRestitution;
  const btScalar per_s = btScalar(1) / info.m_timeStep;
  Normal normal{make_row(axis, arm, before.inertia, info.m_sor), 0, 0, pair.friction, false};
  normal.impulse = point.m_appliedImpulse;

  const Both speeds = linear_speed(normal, before.motion) + angular_speed(normal, before.motion);
  const btScalar speed = speeds[0] + speeds[1];
  normal.plastic = (-speed - (distance > 0 ? distance * per_s : btScalar(0))) * normal.step;
  normal.rhs = normal.plastic;
  bool leaves = false;
  if (restitution > 0) {
    const Mover &a = movers_[pair.a], &b = movers_[pair.b];
    const auto velocity = [](const Mover& mover, const Both3& at, int which) {
      if (mover.body == nullptr) return btVector3(0, 0, 0);
      return mover.body->getVelocityInLocalPoint(btVector3(at.x[which], at.y[which], at.z[which]));
    };
    const btScalar approach = axis.dot(velocity(b, arm, 1) - velocity(a, arm, 0));
    const bool touches = distance <= 0 || -speed * info.m_timeStep > distance;
    if (touches && approach >= info.m_restitutionVelocityThreshold) {
      const btScalar left = bounce_speed(approach, restitution, distance, -speed - approach, info.m_timeStep);
      normal.rhs = (left - speed) * normal.step;
    }
    leaves = normal.rhs != normal.plastic || speed > 0;
  }
  normal.bounce = normal.rhs - normal.plastic;
  normals_.push_back(normal);
  // A push would add to the height of a bounce.
  const btScalar depth = distance > 0 || leaves ? btScalar(0) : -distance;
  pushes_.push_back({depth * info.m_erp2 * per_s * normal.step, 0});
}

void ContactSolver::set_tangents(btManifoldPoint& point) {
  if (point.m_contactPointFlags & BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED) return;
  btPlaneSpace1(point.m_normalWorldOnB, point.m_lateralFrictionDir1, point.m_lateralFrictionDir2);
  point.m_contactPointFlags |= BT_CONTACT_FLAG_LATERAL_FRICTION_INITIALIZED;
}

void ContactSolver::prepare_friction(const btManifoldPoint& point, const Both3& arm, const PairState& before,
                                     const btVector3& sliding, btScalar relaxation, Friction& friction) {
  auto& rows = friction.rows;
  rows[0] = make_row(point.m_lateralFrictionDir1, arm, before.inertia, relaxation);
  rows[1] = make_row(point.m_lateralFrictionDir2, arm, before.inertia, relaxation);
  const btScalar step = friction_step(rows, relaxation, friction_relaxation_);
  for (Row& row : rows) {
    const Both speeds = linear_speed(row, before.motion) + angular_speed(row, before.motion);
    const btScalar by_surfaces = row.axis[0] * sliding.x() + row.axis[1] * sliding.y() + row.axis[2] * sliding.z();
    row.rhs = -(speeds[0] + speeds[1] + by_surfaces) * row.step;
    row.rhs *= step / row.step;
    row.step = step;
  }
}

void ContactSolver::start_from_last_friction(btScalar part) {
  if (part <= 0) return;
  for (const Pair& pair : pairs_) {
    if (!pair.rubs) continue;
    BothMotion motion = gather(motions_[pair.a], motions_[pair.b]);
    for (std::size_t i = pair.begin; i < pair.end; ++i) {
      const btManifoldPoint& point = pair.manifold->getContactPoint(static_cast<int>(i - pair.begin));
      auto& rows = frictions_[i].rows;
      rows[0].impulse = part * point.m_appliedImpulseLateral1;
      rows[1].impulse = part * point.m_appliedImpulseLateral2;
      normals_[i].held = rows[0].impulse != 0 || rows[1].impulse != 0;
      if (!normals_[i].held) continue;
      for (const Row& row : rows) apply(row, pair.inverse_mass, row.impulse, motion);
    }
    scatter(motion, motions_[pair.a], motions_[pair.b]);
  }
}

// Pushes and impulses are independent. Alternating them lets the processor overlap the computations.
ContactSolver::Active ContactSolver::solve_normals(Active active) {
  Active changed{false, false};
  for (const Pair& pair : pairs_) {
    const bool pushes = active.pushes && pair.penetrates;
    if (!pushes && !active.impulses) continue;
    BothMotion motion = gather(motions_[pair.a], motions_[pair.b]);
    BothMotion pushed = gather(pushed_[pair.a], pushed_[pair.b]);
    bool by_pushes = false, by_impulses = false;
    for (std::size_t i = pair.begin; i < pair.end; ++i) {
      Row& row = normals_[i];
      Push& push = pushes_[i];
      if (pushes && push.rhs != 0) by_pushes |= solve(row, push.rhs, push.impulse, pair.inverse_mass, pushed);
      if (active.impulses) by_impulses |= solve(row, row.rhs, row.impulse, pair.inverse_mass, motion);
    }
    if (by_pushes) scatter(pushed, pushed_[pair.a], pushed_[pair.b]);
    if (by_impulses) scatter(motion, motions_[pair.a], motions_[pair.b]);
    changed.pushes |= by_pushes;
    changed.impulses |= by_impulses;
  }
  return changed;
}

void ContactSolver::solve_friction() {
  for (const Pair& pair : pairs_) {
    if (!pair.rubs) continue;
    BothMotion motion = gather(motions_[pair.a], motions_[pair.b]);
    bool applied = false;
    for (int round = 0; round < (pair.turning < 0 ? 1 : kTurningRounds); ++round) applied |= rub(pair, motion);
    if (applied) scatter(motion, motions_[pair.a], motions_[pair.b]);
  }
}

bool ContactSolver::rub(const Pair& pair, BothMotion& motion) {
  bool applied = false;
  btScalar pressed = 0;
  for (std::size_t i = pair.begin; i < pair.end; ++i) {
    Normal& normal = normals_[i];
    pressed += normal.impulse;
    const btScalar most = normal.friction * normal.impulse;
    if (most == 0 && !normal.held) continue;
    auto& rows = frictions_[i].rows;
    // The impulse that would stop a row's motion.
    const auto wanted = [&motion](const Row& row) {
      const Both linear = linear_speed(row, motion), angular = angular_speed(row, motion);
      return row.impulse + row.rhs - (linear[0] + angular[0] + linear[1] + angular[1]) * row.step;
    };
    const auto set = [&](Row& row, btScalar impulse) {
      apply(row, pair.inverse_mass, impulse - row.impulse, motion);
      row.impulse = impulse;
    };
    const btScalar first = wanted(rows[0]), second = wanted(rows[1]);
    if (is_within(first, second, most)) {
      set(rows[0], first);
      set(rows[1], second);
    } else {
      const btScalar size = btSqrt(first * first + second * second);
      const btScalar part = size > most ? most / size : btScalar(1);
      set(rows[0], part * first);
      set(rows[1], part * second);
    }
    normal.held = rows[0].impulse != 0 || rows[1].impulse != 0;
    applied = true;
  }
  return turning_.solve(pair, pressed, motion) || applied;
}

void ContactSolver::write_impulses() const {
  for (const Pair& pair : pairs_) {
    for (std::size_t i = pair.begin; i < pair.end; ++i) {
      btManifoldPoint& point = pair.manifold->getContactPoint(static_cast<int>(i - pair.begin));
      point.m_appliedImpulse = normals_[i].impulse;
      point.m_appliedImpulseLateral1 = frictions_[i].rows[0].impulse;
      point.m_appliedImpulseLateral2 = frictions_[i].rows[1].impulse;
    }
  }
}

void ContactSolver::write_motions(const btContactSolverInfo& info) {
  for (std::size_t i = kFixed + 1; i < movers_.size(); ++i) {
    btRigidBody& body = *movers_[i].body;
    body.setLinearVelocity(body.getLinearVelocity() + vector(motions_[i].linear) + movers_[i].by_force);
    body.setAngularVelocity(body.getAngularVelocity() + vector(motions_[i].angular) + movers_[i].by_torque);
    body.setCompanionId(-1);
    const btVector3 push = vector(pushed_[i].linear), turn = vector(pushed_[i].angular);
    if (push.isZero() && turn.isZero()) continue;
    btTransform pose;
    btTransformUtil::integrateTransform(body.getWorldTransform(), push, turn * info.m_splitImpulseTurnErp,
                                        info.m_timeStep, pose);
    body.setWorldTransform(pose);
  }
}

}  // namespace subworld::bullet
