#pragma once

#include "bounce_limit.hpp"
#include "contact_points.hpp"
#include "contact_rows.hpp"
#include "left_contacts.hpp"
#include "movers.hpp"

#include <btBulletDynamicsCommon.h>

#include <cstdint>
#include <span>
#include <vector>

namespace subworld::bullet {

/// Contacts by small steps (Macklin et al. 2019, "Small steps in physics simulation"; Catto 2024, "Solver2D"):
/// collisions are looked for once, then the step is taken in n parts of length h. In each part every contact is solved
/// as a stiff damped spring, the bodies move, and every contact is solved again as rigid, which takes from the
/// velocities what the springs have added to push penetration out.
///
/// One pass over the contacts is enough where they start from what held in the part before and masses are alike. A
/// light body between two heavy ones hands on a part of a blow in a pass that is as small as the ratio of the masses.
/// So passes are repeated, for the bodies that it concerns, as long as they still change a velocity by more than what
/// forces add to it in a few parts. Without that, a heavy body that falls on a light one sinks in and is thrown back.
///
/// It knows contacts of movable and fixed bodies only: no joints, no rolling friction. Friction is Coulomb's: at most
/// mu N, against the motion, in every direction. Normal impulses and friction start from those of the part before, also
/// from step to step: then what holds still does not creep.
///
/// It moves the bodies itself: see SmallStepWorld.
///
/// Of btContactSolverInfo it reads m_timeStep, m_numIterations (two in a part) and m_restitutionVelocityThreshold.
class SmallStepSolver final : public btConstraintSolver {
 public:
  SmallStepSolver();

  /// Also contacts without friction get its rows, for comparison.
  void keep_frictionless(bool keep) { keeps_frictionless_ = keep; }

  /// In how many parts a step is taken.
  [[nodiscard]] static int parts(int iterations) { return iterations < 4 ? 1 : iterations / 2; }

  btScalar solveGroup(btCollisionObject** bodies, int body_count, btPersistentManifold** manifolds, int manifold_count,
                      btTypedConstraint** constraints, int constraint_count, const btContactSolverInfo& info,
                      btIDebugDraw* drawer, btDispatcher* dispatcher) override;
  void reset() override {}
  btConstraintSolverType getSolverType() const override { return BT_SEQUENTIAL_IMPULSE_SOLVER; }

 private:
  /// Impulses of the rows are those of one part.
  struct Point {
    Row normal;
    Row sides[2];        ///< friction, both with equal steps
    btScalar start;      ///< gap before the step, m
    btScalar gap;        ///< now, m
    btScalar noise;      ///< of gaps, m
    btScalar met;        ///< speed along the normal when the bodies met, m/s
    btScalar total;      ///< of all parts so far, along the normal, N s
    btScalar across[2];  ///< likewise of friction
    bool held;           ///< some of the friction is not 0
    bool bounced;
  };

  /// All contact points of two bodies.
  struct Pair {
    btPersistentManifold* manifold;
    std::size_t a, b;        ///< in movers_
    std::size_t begin, end;  ///< in points_
    Both inverse_mass;
    btScalar friction;  ///< mu
    btScalar restitution;
    bool rubs;  ///< friction has rows
  };

  /// A contact as a damped spring, implicit in a part. With w = 2 pi f, damping ratio z and length h:
  ///   s = 2 z + h w,  bias rate w / s,  c = h w s,  mass scale c / (1 + c),  part let go 1 / (1 + c)
  /// (Catto 2011, "Soft constraints"). It is as stiff for a pair as their effective mass allows.
  struct Spring {
    btScalar bias_rate;   ///< of the penetration, 1/s
    btScalar mass_scale;  ///< of the impulse that would stop the motion
    btScalar declutch;    ///< of the impulse so far
  };
  [[nodiscard]] static Spring spring_for(btScalar h);

  enum class Contacts : std::uint8_t { springs, rigid };

  void prepare_motions();
  void prepare_pair(btPersistentManifold& manifold);
  void prepare_point(const btManifoldPoint& point, const Both3& arm, const BothInertia& inertia, bool rubs);
  static void prepare_friction(const btManifoldPoint& point, const Both3& arm, const BothInertia& inertia, Point& p);
  /// Change of a velocity (m/s) that needs no further pass.
  [[nodiscard]] btScalar enough() const;

  void add_forces();
  void start_from_last();
  void solve(Contacts as, int most, btScalar h, btScalar enough);
  void solve_friction(const Pair& pair, BothMotion& motion);
  /// Returns the largest change of a velocity, m/s.
  template <Contacts kAs>
  btScalar solve_normals(const Pair& pair, const Spring& spring, btScalar h, BothMotion& motion);
  void move(btScalar h);
  /// With restitution, so much of it that it wins no energy over the step of so many `parts`.
  void bounce_within_energy(int parts, btScalar threshold, btScalar enough);
  void bounce(btScalar threshold, btScalar enough);
  /// Calls `visit(pair, motion)`, which returns the largest change of a velocity, for every pair, and then, `most`
  /// times in all, for those whose bodies changed by more than `enough`.
  template <class Visit>
  void until_quiet(int most, btScalar enough, const Visit& visit);

  void write_impulses() const;
  void write_motions(const btContactSolverInfo& info);

  BounceLimit bounce_limit_;
  std::vector<Motion> before_;         ///< velocities before the step, with what forces add in it
  std::vector<Motion> plastic_;        ///< motions_ before bounces
  std::vector<Point> plastic_points_;  ///< points_ before bounces
  std::vector<Mover> movers_;          ///< the first stands for all fixed bodies
  std::vector<Motion> motions_;        ///< velocities
  std::vector<Motion> moved_;          ///< since the step began, m and rad
  std::vector<Pair> pairs_;
  std::vector<Point> points_;
  std::vector<std::uint8_t> busy_, busy_next_;  ///< of movers_[i]
  bool keeps_frictionless_ = false;
};

/// Bullet's own world, which leaves it to a solver that moves bodies in parts of a step to do so. (To set them back by
/// what Bullet would move them costs single precision a card house.)
class SmallStepWorld final : public btDiscreteDynamicsWorld {
 public:
  using btDiscreteDynamicsWorld::btDiscreteDynamicsWorld;
  void leave_moving_to_solver() { solver_moves_ = true; }
  [[nodiscard]] LeftContacts& left_contacts() { return left_contacts_; }

 private:
  void solveConstraints(btContactSolverInfo& info) override {
    left_contacts_.give_back(*getDispatcher());
    btDiscreteDynamicsWorld::solveConstraints(info);
  }
  void integrateTransforms(btScalar dt) override {
    if (!solver_moves_) btDiscreteDynamicsWorld::integrateTransforms(dt);
  }

  LeftContacts left_contacts_;
  bool solver_moves_ = false;
};

}  // namespace subworld::bullet
