#pragma once

#include "bounce_limit.hpp"
#include "contact_rows.hpp"
#include "movers.hpp"

#include <btBulletDynamicsCommon.h>

#include <span>
#include <vector>

namespace subworld::bullet {

/// Contacts by sequential impulses as Bullet's own solver has them: Gauss-Seidel over all contact points, in every
/// iteration first the normals, then friction; penetrations are pushed out apart from that, by moving the bodies
/// without adding velocity (if they add some, resting bodies hop and the felt friction of a sliding row wanders by 3
/// %). It knows contacts of movable and fixed bodies only (no joints, no rolling friction), keeps side by side what an
/// iteration reads, and leaves out what changes nothing. Its arithmetic is in Bullet's order: impulses along normals
/// are Bullet's bit by bit.
///
/// Friction is Coulomb's: at most mu N, against the motion, in every direction. Bullet bounds each of a contact's two
/// friction directions by mu N of its own: along their diagonal a body holds, and is braked, by 41 % too much, and a
/// load that wanders to one direction takes nothing from the other.
///
/// Bullet 3 starts every step with friction at zero, whatever its flag for warm starts says. What stands by friction
/// then sags a little in each step, and creeps. Here friction may start from a part of that of the step before; normal
/// impulses start from all of theirs.
///
/// Of btContactSolverInfo it reads m_timeStep, m_numIterations, m_sor, m_erp2, m_splitImpulseTurnErp and
/// m_restitutionVelocityThreshold.
class ContactSolver final : public btConstraintSolver {
 public:
  ContactSolver();

  /// Of each step, s: friction starts from what it was in the step before, as far as a step is longer than this.
  void set_friction_forgotten(btScalar forgotten_s) { friction_forgotten_s_ = forgotten_s; }
  /// What an iteration takes of each correction of friction, 0 to 2; those of normal impulses take Bullet's m_sor.
  void set_friction_relaxation(btScalar relaxation) { friction_relaxation_ = relaxation; }
  /// Also contacts without friction get its rows, for comparison.
  void keep_frictionless(bool keep) { keeps_frictionless_ = keep; }

  btScalar solveGroup(btCollisionObject** bodies, int body_count, btPersistentManifold** manifolds, int manifold_count,
                      btTypedConstraint** constraints, int constraint_count, const btContactSolverInfo& info,
                      btIDebugDraw* drawer, btDispatcher* dispatcher) override;
  void reset() override {}
  btConstraintSolverType getSolverType() const override { return BT_SEQUENTIAL_IMPULSE_SOLVER; }

 private:
  struct Normal : Row {
    btScalar plastic;   ///< rhs without restitution
    btScalar bounce;    ///< what restitution adds to it
    btScalar friction;  ///< mu
    bool held;          ///< some of the friction is not 0
  };

  struct Friction {
    Row rows[2];
  };

  struct Push {
    btScalar rhs;      ///< as a row's; 0: no penetration
    btScalar impulse;  ///< kg m/s
  };

  /// All contact points of two bodies.
  struct Pair {
    btPersistentManifold* manifold;
    std::size_t a, b;        ///< in movers_
    std::size_t begin, end;  ///< in normals_, frictions_ and pushes_
    Both inverse_mass;
    btScalar friction;  ///< mu, as given
    bool rubs;          ///< friction has rows
    bool penetrates;
  };

  /// Of two bodies before the step.
  struct PairState {
    BothInertia inertia;
    BothMotion motion;  ///< with what forces and torques add in this step
  };

  [[nodiscard]] static PairState state_of(const Mover& a, const Mover& b);
  void prepare_pair(btPersistentManifold& manifold, const btContactSolverInfo& info);
  void prepare_normal(const btManifoldPoint& point, const Both3& arm, const Pair& pair, const PairState& before,
                      const btContactSolverInfo& info);
  static void set_tangents(btManifoldPoint& point);
  void prepare_friction(const btManifoldPoint& point, const Both3& arm, const PairState& before, btScalar relaxation,
                        Friction& friction);
  void start_from_last_friction(btScalar part);

  /// Whether passes over the normals still change anything.
  struct Active {
    bool pushes = true;
    bool impulses = true;
  };
  Active solve_normals(Active active);
  void iterate(int most, Active active);
  void limit_bounces(int most);
  void solve_friction();

  void write_impulses() const;
  void write_motions(const btContactSolverInfo& info);

  BounceLimit bounce_limit_;
  std::vector<Motion> before_;   ///< velocities of movers_[i], with what forces add in this step
  std::vector<Motion> after_;    ///< with what impulses add too
  std::vector<Mover> movers_;    ///< the first stands for all fixed bodies
  std::vector<Motion> motions_;  ///< what impulses have changed of movers_[i]
  std::vector<Motion> pushed_;   ///< what pushes move movers_[i] by, as a velocity for the length of the step
  std::vector<Pair> pairs_;
  std::vector<Normal> normals_;
  std::vector<Friction> frictions_;  ///< of normals_[i]
  std::vector<Push> pushes_;         ///< of normals_[i]
  btScalar friction_forgotten_s_ = 0;
  btScalar friction_relaxation_ = 1;
  bool keeps_frictionless_ = false;
};

}  // namespace subworld::bullet
