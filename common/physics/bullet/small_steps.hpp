#pragma once

#include "physics/bullet/contacts/contact_algorithm.hpp"
#include "physics/bullet/contacts/flush_bodies.hpp"
#include "physics/bullet/contacts/left_contacts.hpp"
#include "physics/bullet/solver/contact_batches.hpp"
#include "physics/bullet/solver/group_solver.hpp"

#include <btBulletDynamicsCommon.h>

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace subworld::bullet {

/// Bodies that are driven in each small step.
struct DrivenBodies {
  std::vector<btRigidBody*> bodies;
  /// Called before each small step but the first, with its number. The bodies show their poses and velocities. Their
  /// new velocities, inertia and forces count, nothing else.
  std::function<void(int)> drive;
};

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
  /// `workers` must outlive this object.
  explicit SmallStepSolver(Workers& workers, bool long_vectors = ContactBatches::has_long_vectors());

  /// Number of small steps in a step.
  [[nodiscard]] static int step_count(int iterations) { return iterations < 4 ? 1 : iterations / 2; }
  /// Passes over the contacts of a small step at most, as springs and as rigid.
  void set_most_passes(int springs, int rigid) { most_spring_passes_ = springs, most_rigid_passes_ = rigid; }
  /// Of the next steps. They must be in the world, and the world must not have joints.
  [[nodiscard]] DrivenBodies& driven() { return driven_; }

 private:
  void solve_group(std::span<btCollisionObject* const> bodies, std::span<btPersistentManifold* const> manifolds,
                   const btContactSolverInfo& info) override;
  void prepare_motions();
  /// Change of a velocity (m/s) below which no further iteration is needed.
  [[nodiscard]] btScalar enough() const;

  void drive(int small_step, const btContactSolverInfo& info);
  void add_forces();
  void solve(const ContactSpring& spring, int most, btScalar h, btScalar enough);
  void move(btScalar h);
  /// Applies restitution, reduced so that it gains no energy over the step of `count` small steps.
  void bounce_within_energy(int count, btScalar h, btScalar threshold, btScalar enough);
  void bounce(btScalar h, btScalar threshold, btScalar enough);
  /// Calls `contacts(busy)`, a pass over all contacts that marks the bodies that change in busy_next_ and returns
  /// whether there are any. Then calls it, at most `most` times in all, for the bodies that changed by more than
  /// `enough`.
  template <class Pass>
  void until_quiet(int most, btScalar enough, const Pass& contacts);

  void write_motions(const btContactSolverInfo& info);
  /// Calls `part(i)` for each movable mover, in any order.
  template <class Part>
  void for_movers(const Part& part);

  Workers& workers_;
  int most_spring_passes_ = 1, most_rigid_passes_ = 1;
  DrivenBodies driven_;
  struct Start {
    btTransform pose;
    Motion velocity;
    btScalar inverse_mass;
    btVector3 inverse_inertia;
  };
  std::vector<Start> starts_;  ///< of driven bodies, before they are shown
  ContactBatches contacts_;
  std::vector<Motion> after_;                   ///< velocities at which bounces are compared with before_
  std::vector<Motion> plastic_;                 ///< motions_ before bounces
  std::vector<Motion> motions_;                 ///< velocities
  std::vector<Motion> moved_;                   ///< displacement since the step began, m and rad
  std::vector<std::uint8_t> busy_, busy_next_;  ///< affected, by index of movers_
};

/// Bullet's world, for a solver that moves the bodies itself in small steps. (Reversing Bullet's own motion instead
/// would make a card house collapse in single precision.)
class SmallStepWorld final : public btDiscreteDynamicsWorld {
 public:
  /// All must outlive this object.
  SmallStepWorld(btDispatcher& dispatcher, btBroadphaseInterface& broadphase, btConstraintSolver& solver,
                 btCollisionConfiguration& configuration, Workers& workers)
      : btDiscreteDynamicsWorld(&dispatcher, &broadphase, &solver, &configuration), workers_(workers) {}

  /// `ahead`: contacts are found for this time at once, s; 0: for a step.
  void leave_moving_to_solver(double ahead) {
    solver_moves_ = true;
    ahead_s_ = btScalar(ahead);
  }
  [[nodiscard]] LeftContacts& left_contacts() { return left_contacts_; }
  /// The next step searches for contacts again: a body has come or gone, or was moved.
  void search_again() { searched_s_ = 0; }
  /// Removes the pairs of all bodies that leave together (kLeaves).
  void part_leaving();

  void advance(btScalar dt);

 private:
  void solveConstraints(btContactSolverInfo& info) override;
  /// Finds the contacts of bodies that may meet within `ahead`, s.
  void search(btScalar ahead);
  /// Moves the contacts that were found last with their bodies. Those of round bodies are found again.
  void follow(btScalar dt);

  Workers& workers_;
  FlushBodies flush_bodies_;
  LeftContacts left_contacts_;
  bool solver_moves_ = false;
  btScalar ahead_s_ = 0;
  btScalar searched_s_ = 0;                     ///< rest of that time
  std::vector<btBroadphasePair*> round_pairs_;  ///< valid until the next search
};

}  // namespace subworld::bullet
