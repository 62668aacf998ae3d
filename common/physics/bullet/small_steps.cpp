#include "physics/bullet/small_steps.hpp"

#include <LinearMath/btTransformUtil.h>

#include <algorithm>

namespace subworld::bullet {

namespace {

/// Oscillations of a contact's spring in a small step: the stiffest spring that an iteration can follow (Catto 2024).
constexpr auto kOscillations = btScalar(0.25);
/// Damping ratio. With 1 or 10, heaps of unequal masses gain more energy, or a cube on one of a thousandth of its mass
/// trembles.
constexpr auto kDamping = btScalar(5);
/// Speed limit for removing penetration, m/s: the rigid iteration must remove all of this speed again.
constexpr auto kFastestPush = btScalar(0.1);
/// Rounding of a gap, relative to the coordinates from which it is computed. Without this tolerance, a card house of
/// seven stages in single precision creeps by 0.4 mm/s and falls after 20 s.
constexpr auto kPlaceRounding = 16 * SIMD_EPSILON;
/// Passes over the contacts of one part at most, as springs and as rigid. Heaps of 3 g to 30 kg win 1.5 % of energy by
/// impacts with 20, 3 % with 8 and 5 % with 1.
constexpr int kMostSpringPasses = 4, kMostRigidPasses = 20;
/// Iterations end when they change no velocity by more than this factor times the change by forces in a small step.
constexpr auto kEnough = btScalar(5);
/// The same limit relative to the largest speed, for worlds without forces.
constexpr auto kEnoughOfSpeed = btScalar(1e-4);

btScalar speed_of(const Row& row, const BothMotion& motion) {
  const Both speeds = linear_speed(row, motion) + angular_speed(row, motion);
  return speeds[0] + speeds[1];
}

/// Speeds (m/s) along the normal of a bounce whose flight has the height that Newton's restitution e gives. Bodies
/// advance v by f, then x by v h (f: by forces, h: a small step, d: gap). Such points lie on a parabola that has the
/// speed v - f / 2 before the step, v being the speed after the forces.
///   met at the touch:                            c^2 = (v - f / 2)^2 - 2 f d / h              (1)
///   left at gap d, before the next small step:   (u + f / 2)^2 = e^2 c^2 + 2 f d / h          (2)
btScalar touch_speed(btScalar speed, btScalar by_force, btScalar gap, btScalar h) {
  const btScalar behind = speed - by_force / 2;
  return behind < 0 ? btSqrt(btMax(behind * behind - 2 * by_force * gap / h, btScalar(0))) : btScalar(0);
}
btScalar bounce_speed(btScalar bounce, btScalar by_force, btScalar gap, btScalar h) {
  return btSqrt(btMax(bounce * bounce + 2 * by_force * gap / h, btScalar(0))) - by_force / 2;
}

}  // namespace

SmallStepSolver::SmallStepSolver() {
  motions_.reserve(kUsualBodies);
  moved_.reserve(kUsualBodies);
  busy_.reserve(kUsualBodies);
  busy_next_.reserve(kUsualBodies);
  pairs_.reserve(kUsualPairs);
  points_.reserve(kUsualPoints);
}

void SmallStepSolver::solve_group(std::span<btCollisionObject* const> bodies,
                                  std::span<btPersistentManifold* const> manifolds, const btContactSolverInfo& info) {
  const int count = step_count(info.m_numIterations);
  const btScalar h = info.m_timeStep / btScalar(count);
  list_movers(bodies, h, movers_);
  prepare_motions();
  pairs_.clear();
  points_.clear();
  for (btPersistentManifold* manifold : manifolds) prepare_pair(*manifold);

  const btScalar change = enough();
  for (int i = 0; i < count; ++i) {
    add_forces();
    start_from_last(h);
    solve(Contacts::springs, kMostSpringPasses, h, change);
    move(h);
    solve(Contacts::rigid, kMostRigidPasses, h, change);
    for (Point& p : points_) {
      p.total += p.normal.impulse;
      for (int k = 0; k < 2; ++k) p.across[k] += p.sides[k].impulse;
    }
  }
  bounce_within_energy(count, h, info.m_restitutionVelocityThreshold, change);
  write_impulses();
  write_motions(info);
}

SmallStepSolver::Spring SmallStepSolver::spring_for(btScalar h) {
  const btScalar w = SIMD_2_PI * kOscillations / h;
  const btScalar s = 2 * kDamping + h * w, c = h * w * s;
  return {w / s, c / (1 + c), 1 / (1 + c)};
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
  const auto count = btScalar(btMax<std::size_t>(movers_.size() - kFixed - 1, 1));
  return btMax(kEnough * by_forces / count, kEnoughOfSpeed * btSqrt(fastest));
}

void SmallStepSolver::prepare_pair(btPersistentManifold& manifold) {
  if (manifold.getNumContacts() == 0) return;
  const btCollisionObject &first = *manifold.getBody0(), &second = *manifold.getBody1();
  if (mover_of(first) == kFixed && mover_of(second) == kFixed) return;
  Pair& pair = pairs_.emplace_back(make_pair_of(manifold, movers_, points_.size(), keeps_frictionless_));
  pair.restitution = manifold.getContactPoint(0).m_combinedRestitution;
  const BothInertia inertia = inertia_of(movers_[pair.a], movers_[pair.b]);
  const BothMotion by_forces = gather(by_loads(movers_[pair.a]), by_loads(movers_[pair.b]));
  for (int i = 0; i < manifold.getNumContacts(); ++i) {
    const btManifoldPoint& point = manifold.getContactPoint(i);
    prepare_point(point, arms_of(manifold, point), inertia, pair.rubs);
    if (pair.restitution != 0) points_.back().by_force = speed_of(points_.back().normal, by_forces);
  }
  pair.end = static_cast<std::uint32_t>(points_.size());
}

void SmallStepSolver::prepare_point(const btManifoldPoint& point, const Both3& arm, const BothInertia& inertia,
                                    bool rubs) {
  Point& p = points_.emplace_back();
  p.normal = make_row(point.m_normalWorldOnB, arm, inertia, 1);
  if (rubs) {
    p.sides[0] = make_row(point.m_lateralFrictionDir1, arm, inertia, 1);
    p.sides[1] = make_row(point.m_lateralFrictionDir2, arm, inertia, 1);
    p.sides[0].step = p.sides[1].step = friction_step(p.sides, 1, 1);
  }
  // Within the rounding of positions, contacts are rigid: a spring would follow the noise.
  const btVector3 place = point.getPositionWorldOnB().absolute();
  p.noise = kPlaceRounding * place[place.maxAxis()];
  p.start = p.gap = point.getDistance();
  p.met = p.by_force = 0;
  p.total = p.across[0] = p.across[1] = 0;
  p.bounced = false;
  const LastPart last = last_part_of(point);
  p.normal.impulse = last.normal;
  p.sides[0].impulse = last.lateral_1;
  p.sides[1].impulse = last.lateral_2;
  p.held = last.lateral_1 != 0 || last.lateral_2 != 0;
}

void SmallStepSolver::add_forces() {
  for (std::size_t i = kFixed + 1; i < movers_.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      motions_[i].linear[k] += movers_[i].by_force[k];
      motions_[i].angular[k] += movers_[i].by_torque[k];
    }
  }
}

void SmallStepSolver::start_from_last(btScalar h) {
  for (const Pair& pair : pairs_) {
    BothMotion motion = gather(motions_[pair.a], motions_[pair.b]);
    for (std::size_t i = pair.begin; i < pair.end; ++i) {
      Point& p = points_[i];
      if (pair.restitution != 0 && p.total == 0) p.met = touch_speed(speed_of(p.normal, motion), p.by_force, p.gap, h);
      if (p.normal.impulse != 0) apply(p.normal, pair.inverse_mass, p.normal.impulse, motion);
      if (!p.held) continue;
      for (const Row& row : p.sides) apply(row, pair.inverse_mass, row.impulse, motion);
    }
    scatter(motion, motions_[pair.a], motions_[pair.b]);
  }
}

template <class Visit>
void SmallStepSolver::until_quiet(int most, btScalar enough, const Visit& visit) {
  bool any = true;
  for (int pass = 0; pass < most && any; ++pass) {
    any = false;
    busy_next_.assign(movers_.size(), 0);
    for (const Pair& pair : pairs_) {
      if (pass > 0 && busy_[pair.a] == 0 && busy_[pair.b] == 0) continue;
      BothMotion motion = gather(motions_[pair.a], motions_[pair.b]);
      const btScalar change = visit(pair, motion);
      scatter(motion, motions_[pair.a], motions_[pair.b]);
      if (change <= enough) continue;
      any = true;
      busy_next_[pair.a] = pair.a != kFixed;
      busy_next_[pair.b] = pair.b != kFixed;
    }
    std::swap(busy_, busy_next_);
  }
}

void SmallStepSolver::solve(Contacts as, int most, btScalar h, btScalar enough) {
  const Spring spring = spring_for(h);
  until_quiet(most, enough, [&](const Pair& pair, BothMotion& motion) {
    if (pair.rubs) solve_friction(pair, motion);
    return as == Contacts::springs ? solve_normals<Contacts::springs>(pair, spring, h, motion)
                                   : solve_normals<Contacts::rigid>(pair, spring, h, motion);
  });
}

void SmallStepSolver::solve_friction(const Pair& pair, BothMotion& motion) {
  for (std::size_t i = pair.begin; i < pair.end; ++i) {
    Point& p = points_[i];
    if (p.normal.impulse == 0 && !p.held) continue;
    const btScalar most = pair.friction * p.normal.impulse;
    // The impulses that would stop the motion.
    btScalar first = p.sides[0].impulse - speed_of(p.sides[0], motion) * p.sides[0].step;
    btScalar second = p.sides[1].impulse - speed_of(p.sides[1], motion) * p.sides[1].step;
    const btScalar square = first * first + second * second;
    if (square > most * most) {
      const btScalar part = most / btSqrt(square);
      first *= part;
      second *= part;
    }
    apply(p.sides[0], pair.inverse_mass, first - p.sides[0].impulse, motion);
    apply(p.sides[1], pair.inverse_mass, second - p.sides[1].impulse, motion);
    p.sides[0].impulse = first;
    p.sides[1].impulse = second;
    p.held = first != 0 || second != 0;
  }
}

template <SmallStepSolver::Contacts kAs>
btScalar SmallStepSolver::solve_normals(const Pair& pair, const Spring& spring, btScalar h, BothMotion& motion) {
  btScalar change = 0;
  for (std::size_t i = pair.begin; i < pair.end; ++i) {
    Point& p = points_[i];
    Row& row = p.normal;
    btScalar by = -row.step * speed_of(row, motion);
    if (p.gap > 0) {
      by -= row.step * p.gap / h;  // it may close
    } else if (kAs == Contacts::springs && p.gap < -p.noise) {
      const btScalar depth = -p.gap - p.noise;
      const btScalar push =
          spring.mass_scale * spring.bias_rate * depth * row.step - spring.impulse_scale * row.impulse;
      by = spring.mass_scale * by + btMin(push, kFastestPush * row.step);
    }
    by = btMax(by, -row.impulse);
    if (by == 0) continue;
    row.impulse += by;
    apply(row, pair.inverse_mass, by, motion);
    change = btMax(change, btFabs(by) / row.step);
  }
  return change;
}

void SmallStepSolver::move(btScalar h) {
  for (std::size_t i = kFixed + 1; i < movers_.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      moved_[i].linear[k] += h * motions_[i].linear[k];
      moved_[i].angular[k] += h * motions_[i].angular[k];
    }
  }
  for (const Pair& pair : pairs_) {
    const BothMotion moved = gather(moved_[pair.a], moved_[pair.b]);
    for (std::size_t i = pair.begin; i < pair.end; ++i) {
      points_[i].gap = points_[i].start + speed_of(points_[i].normal, moved);
    }
  }
}

// Newton's restitution, from the speed at the touch. The next step does not start from the impulse of a bounce.
void SmallStepSolver::bounce_within_energy(int count, btScalar h, btScalar threshold, btScalar enough) {
  const auto bounces = [&](const Pair& pair) {
    const auto points = std::span(points_).subspan(pair.begin, pair.end - pair.begin);
    const auto met = [&](const Point& p) { return p.met >= threshold && p.total != 0; };
    return pair.restitution > 0 && std::ranges::any_of(points, met);
  };
  if (std::ranges::none_of(pairs_, bounces)) return;
  bounce_limit_.begin(movers_);
  for (const Pair& pair : pairs_) bounce_limit_.join(pair.a, pair.b, bounces(pair));
  before_.resize(movers_.size());
  after_.resize(movers_.size());
  for (std::size_t i = kFixed + 1; i < movers_.size(); ++i) {
    before_[i] = sum(motion_of(movers_[i]), by_loads(movers_[i]), btScalar(count) + btScalar(0.5));
  }
  plastic_ = motions_;
  plastic_points_ = points_;
  for (int tries = 1; tries <= BounceLimit::kMostTries + 1; ++tries) {
    bounce(h, threshold, enough);
    if (tries > BounceLimit::kMostTries) return;
    for (std::size_t i = kFixed + 1; i < movers_.size(); ++i)
      after_[i] = sum(motions_[i], by_loads(movers_[i]), btScalar(0.5));
    if (!bounce_limit_.lower(before_, after_, tries == BounceLimit::kMostTries)) return;
    motions_ = plastic_;
    points_ = plastic_points_;
  }
}

void SmallStepSolver::bounce(btScalar h, btScalar threshold, btScalar enough) {
  until_quiet(kMostRigidPasses, enough, [&](const Pair& pair, BothMotion& motion) {
    btScalar change = 0;
    if (pair.restitution == 0) return change;
    const btScalar restitution = bounce_limit_.factor(pair.a, pair.b) * pair.restitution;
    for (std::size_t i = pair.begin; i < pair.end; ++i) {
      Point& p = points_[i];
      if (p.met < threshold || p.total == 0) continue;
      p.bounced = true;
      const btScalar left = bounce_speed(restitution * p.met, p.by_force, p.gap, h);
      const btScalar missing = left - speed_of(p.normal, motion);
      const btScalar by = btMax(missing * p.normal.step, -p.normal.impulse);
      p.normal.impulse += by;
      p.total += by;
      apply(p.normal, pair.inverse_mass, by, motion);
      change = btMax(change, btFabs(by) / p.normal.step);
    }
    return change;
  });
}

void SmallStepSolver::write_impulses() const {
  for (const Pair& pair : pairs_) {
    for (std::size_t i = pair.begin; i < pair.end; ++i) {
      btManifoldPoint& point = pair.manifold->getContactPoint(static_cast<int>(i - pair.begin));
      const Point& p = points_[i];
      point.m_appliedImpulse = p.total;
      point.m_appliedImpulseLateral1 = p.across[0];
      point.m_appliedImpulseLateral2 = p.across[1];
      set_last_part(point, p.bounced ? LastPart{} : LastPart{p.normal.impulse, p.sides[0].impulse, p.sides[1].impulse});
    }
  }
}

void SmallStepSolver::write_motions(const btContactSolverInfo& info) {
  const btScalar dt = info.m_timeStep;
  for (std::size_t i = kFixed + 1; i < movers_.size(); ++i) {
    btRigidBody& body = *movers_[i].body;
    const btVector3 linear = vector(motions_[i].linear), angular = vector(motions_[i].angular);
    body.setLinearVelocity(linear);
    body.setAngularVelocity(angular);
    body.setCompanionId(-1);
    btTransform end;
    btTransformUtil::integrateTransform(body.getWorldTransform(), vector(moved_[i].linear) / dt,
                                        vector(moved_[i].angular) / dt, dt, end);
    body.proceedToTransform(end);
  }
}

}  // namespace subworld::bullet
