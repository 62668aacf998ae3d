#pragma once

#include "physics/bullet/contacts/contact_points.hpp"
#include "physics/bullet/contacts/flush_bodies.hpp"
#include "physics/bullet/contacts/left_contacts.hpp"
#include "physics/bullet/solver/contact_rows.hpp"
#include "physics/bullet/solver/group_solver.hpp"

#include <btBulletDynamicsCommon.h>

#include <cstdint>
#include <span>
#include <vector>

namespace subworld::bullet {

/// Contacts by small steps (Macklin et al. 2019, "Small steps in physics simulation"; Catto 2024, "Solver2D").
/// Collisions are detected once, then the step is divided into n small steps of length h. In each, every contact is
/// solved as a stiff damped spring, the bodies move, and every contact is solved again as rigid. The rigid iteration
/// removes the velocity that the springs have added to correct penetration.
///
/// One iteration over the contacts is enough if they start from the impulses of the previous small step and masses are
/// similar. A light body between two heavy ones transmits only a share of an impact in an iteration, as small as the
/// ratio of the masses. Therefore iterations are repeated, for the affected bodies, as long as they change a velocity
/// by more than forces do in a few small steps. Without that, a heavy body that falls on a light one sinks in and is
/// thrown back.
///
/// Friction is Coulomb's: at most mu N, against the motion, in every direction. Normal impulses and friction start from
/// those of the previous small step, also from step to step, so that bodies held by friction do not creep.
///
/// It moves the bodies itself: see SmallStepWorld.
///
/// Of btContactSolverInfo it reads m_timeStep, m_numIterations (two for each small step) and
/// m_restitutionVelocityThreshold.
class SmallStepSolver final : public GroupSolver {
 public:
  SmallStepSolver();

  /// Number of small steps in a step.
  [[nodiscard]] static int step_count(int iterations) { return iterations < 4 ? 1 : iterations / 2; }

 private:
  /// Impulses of the rows are those of one small step.
  struct Point {
    Row normal;
    Row sides[2];        ///< friction; both have equal steps
    btScalar start;      ///< gap before the step, m
    btScalar gap;        ///< present gap, m
    btScalar noise;      ///< rounding of gaps, m
    btScalar met;        ///< speed of approach at the first touch, m/s
    btScalar by_force;   ///< change of the speed along the normal by forces in a small step, m/s; with restitution only
    btScalar total;      ///< of all small steps so far, along the normal, N s
    btScalar across[2];  ///< likewise of friction
    bool held;           ///< some friction impulse is not 0
    bool bounced;
  };

  struct Pair : ContactPair {
    btScalar restitution = 0;
  };

  /// A contact as a damped spring, implicit in a small step. With w = 2 pi f, damping ratio z and length h:
  ///   s = 2 z + h w,  bias rate w / s,  c = h w s,  mass scale c / (1 + c),  impulse scale 1 / (1 + c)
  /// (Catto 2011, "Soft constraints"). The stiffness is the largest that the pair's effective mass permits.
  struct Spring {
    btScalar bias_rate;      ///< of the penetration, 1/s
    btScalar mass_scale;     ///< factor of the impulse that would stop the motion
    btScalar impulse_scale;  ///< share of the impulse so far that is removed
  };
  [[nodiscard]] static Spring spring_for(btScalar h);

  enum class Contacts : std::uint8_t { springs, rigid };

  void solve_group(std::span<btCollisionObject* const> bodies, std::span<btPersistentManifold* const> manifolds,
                   const btContactSolverInfo& info) override;
  void prepare_motions();
  void prepare_pair(btPersistentManifold& manifold);
  void prepare_point(const btManifoldPoint& point, const Both3& arm, const BothInertia& inertia, bool rubs);
  /// Change of a velocity (m/s) below which no further iteration is needed.
  [[nodiscard]] btScalar enough() const;

  void add_forces();
  void start_from_last(btScalar h);
  void solve(Contacts as, int most, btScalar h, btScalar enough);
  void solve_friction(const Pair& pair, BothMotion& motion);
  /// Returns the largest change of a velocity, m/s.
  template <Contacts kAs>
  btScalar solve_normals(const Pair& pair, const Spring& spring, btScalar h, BothMotion& motion);
  void move(btScalar h);
  /// Applies restitution, reduced so that it gains no energy over the step of `count` small steps.
  void bounce_within_energy(int count, btScalar h, btScalar threshold, btScalar enough);
  void bounce(btScalar h, btScalar threshold, btScalar enough);
  /// Calls `visit(pair, motion)`, which returns the largest change of a velocity, for every pair. Then calls it, at
  /// most `most` times in all, for those whose bodies changed by more than `enough`.
  template <class Visit>
  void until_quiet(int most, btScalar enough, const Visit& visit);

  void write_impulses() const;
  void write_motions(const btContactSolverInfo& info);

  std::vector<Motion> after_;          ///< velocities at which bounces are compared with before_
  std::vector<Motion> plastic_;        ///< motions_ before bounces
  std::vector<Point> plastic_points_;  ///< points_ before bounces
  std::vector<Motion> motions_;        ///< velocities
  std::vector<Motion> moved_;          ///< displacement since the step began, m and rad
  std::vector<Pair> pairs_;
  std::vector<Point> points_;
  std::vector<std::uint8_t> busy_, busy_next_;  ///< affected, by index of movers_
};

/// Bullet's world, for a solver that moves the bodies itself in small steps. (Reversing Bullet's own motion instead
/// would make a card house collapse in single precision.)
class SmallStepWorld final : public btDiscreteDynamicsWorld {
 public:
  using btDiscreteDynamicsWorld::btDiscreteDynamicsWorld;
  void leave_moving_to_solver() { solver_moves_ = true; }
  [[nodiscard]] LeftContacts& left_contacts() { return left_contacts_; }

 private:
  void solveConstraints(btContactSolverInfo& info) override {
    flush_bodies_.omit_seams(*getDispatcher());
    left_contacts_.give_back(*getDispatcher());
    btDiscreteDynamicsWorld::solveConstraints(info);
  }
  void integrateTransforms(btScalar dt) override {
    if (!solver_moves_) btDiscreteDynamicsWorld::integrateTransforms(dt);
  }

  FlushBodies flush_bodies_;
  LeftContacts left_contacts_;
  bool solver_moves_ = false;
};

}  // namespace subworld::bullet
