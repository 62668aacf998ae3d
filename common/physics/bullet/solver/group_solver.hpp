#pragma once

#include "physics/bullet/movers.hpp"
#include "physics/bullet/solver/bounce_limit.hpp"
#include "physics/bullet/solver/joint_rows.hpp"

#include <span>
#include <vector>

namespace subworld::bullet {

/// Common part of the solvers of this folder. They support contacts and the joints of JointConstraint, no others, and
/// no rolling friction.
class GroupSolver : public btConstraintSolver {
 public:
  /// With `keep`, contacts without friction get friction rows too, for comparison.
  void keep_frictionless(bool keep) { keeps_frictionless_ = keep; }

  btScalar solveGroup(btCollisionObject** bodies, int body_count, btPersistentManifold** manifolds, int manifold_count,
                      btTypedConstraint** constraints, int constraint_count, const btContactSolverInfo& info,
                      btIDebugDraw* /*drawer*/, btDispatcher* /*dispatcher*/) final {
    constraints_ = {constraints, static_cast<std::size_t>(constraint_count)};
    solve_group({bodies, static_cast<std::size_t>(body_count)}, {manifolds, static_cast<std::size_t>(manifold_count)},
                info);
    return 0;
  }
  void reset() final {}
  btConstraintSolverType getSolverType() const final { return BT_SEQUENTIAL_IMPULSE_SOLVER; }

 protected:
  GroupSolver() { movers_.reserve(kUsualBodies); }

  virtual void solve_group(std::span<btCollisionObject* const> bodies, std::span<btPersistentManifold* const> manifolds,
                           const btContactSolverInfo& info) = 0;

  std::vector<Mover> movers_;                        ///< the first one represents all fixed bodies
  std::span<btTypedConstraint* const> constraints_;  ///< of the group
  JointRows joints_;
  BounceLimit bounce_limit_;
  std::vector<Motion> before_;  ///< velocities of movers_[i] before the step, with the changes by forces in it
  bool keeps_frictionless_ = false;
};

}  // namespace subworld::bullet
