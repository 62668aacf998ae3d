#pragma once

#include "physics/bullet/solver/contact_rows.hpp"
#include "physics/bullet/solver/group_solver.hpp"
#include "physics/bullet/solver/turning_friction.hpp"

#include <btBulletDynamicsCommon.h>

#include <span>
#include <vector>

namespace subworld::bullet {

/// Contacts by sequential impulses, as in Bullet's own solver. Gauss-Seidel over all contact points: in every iteration
/// first the normals, then friction. Penetrations are removed separately by moving the bodies without adding velocity.
/// (With added velocity, resting bodies hop and the felt friction of a sliding row varies by 3 %.) The solver stores
/// together the data that an iteration reads, and skips work without effect. The order of operations is Bullet's, so
/// impulses along normals are equal to Bullet's bit by bit.
///
/// Friction is Coulomb's: at most mu N, against the motion, in every direction. Bullet bounds each of a contact's two
/// friction directions by mu N separately: along their diagonal the friction is 41 % too large, and a load in one
/// direction does not reduce the bound in the other.
///
/// Bullet 3 starts every step with friction at zero, whatever its flag for warm starts. Then a body held by friction
/// slips a little in each step, and creeps. Here friction may start from a share of that of the previous step; normal
/// impulses start from their full values.
///
/// Of btContactSolverInfo it reads m_timeStep, m_numIterations, m_sor, m_erp2, m_splitImpulseTurnErp and
/// m_restitutionVelocityThreshold.
class ContactSolver final : public GroupSolver {
 public:
  ContactSolver();

  /// Time of each step that friction forgets, s: friction starts with the share (step - forgotten) / step of the
  /// previous step's.
  void set_friction_forgotten(btScalar forgotten_s) { friction_forgotten_s_ = forgotten_s; }
  /// Over-relaxation of friction in each iteration, 0 to 2; normal impulses use Bullet's m_sor.
  void set_friction_relaxation(btScalar relaxation) { friction_relaxation_ = relaxation; }

 private:
  struct Normal : Row {
    btScalar plastic;   ///< rhs without restitution
    btScalar bounce;    ///< addition to rhs by restitution
    btScalar friction;  ///< mu
    bool held;          ///< some friction impulse is not 0
  };

  struct Friction {
    Row rows[2];
  };

  struct Push {
    btScalar rhs;      ///< as in a row; 0: no penetration
    btScalar impulse;  ///< kg m/s
  };

  /// Its points are in normals_, frictions_ and pushes_.
  struct Pair : ContactPair {
    bool penetrates = false;
  };

  /// State of two bodies before the step.
  struct PairState {
    BothInertia inertia;
    BothMotion motion;  ///< with the changes by forces and torques in this step
  };

  void solve_group(std::span<btCollisionObject* const> bodies, std::span<btPersistentManifold* const> manifolds,
                   const btContactSolverInfo& info) override;
  [[nodiscard]] static PairState state_of(const Mover& a, const Mover& b);
  void prepare_pair(btPersistentManifold& manifold, const btContactSolverInfo& info);
  void prepare_normal(const btManifoldPoint& point, const Both3& arm, const Pair& pair, const PairState& before,
                      const btContactSolverInfo& info);
  static void set_tangents(btManifoldPoint& point);
  /// `sliding`: of the surfaces, m/s.
  void prepare_friction(const btManifoldPoint& point, const Both3& arm, const PairState& before,
                        const btVector3& sliding, btScalar relaxation, Friction& friction);
  void start_from_last_friction(btScalar part);

  /// Whether iterations over the normals still change anything.
  struct Active {
    bool pushes = true;
    bool impulses = true;
  };
  Active solve_normals(Active active);
  void prepare_joints(btScalar dt);
  void iterate(int most, Active active);
  void limit_bounces(int most);
  void solve_friction();
  /// One iteration over a pair's friction. Returns whether it did anything.
  bool rub(const Pair& pair, BothMotion& motion);

  void write_impulses() const;
  void write_motions(const btContactSolverInfo& info);

  std::vector<Motion> after_;    ///< as before_, with the changes by impulses too
  std::vector<Motion> motions_;  ///< velocity changes of movers_[i] by impulses
  std::vector<Motion> pushed_;   ///< displacements of movers_[i] by pushes, as a velocity over the step
  std::vector<Pair> pairs_;
  std::vector<Normal> normals_;
  std::vector<Friction> frictions_;  ///< of normals_[i]
  std::vector<Push> pushes_;         ///< of normals_[i]
  TurningFriction turning_;
  btScalar friction_forgotten_s_ = 0;
  btScalar friction_relaxation_ = 1;
};

}  // namespace subworld::bullet
