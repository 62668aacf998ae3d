#pragma once

#include "physics/bullet/movers.hpp"
#include "physics/bullet/solver/block_system.hpp"
#include "physics/bullet/solver/contact_rows.hpp"
#include "physics/bullet/solver/joint_set.hpp"

#include <btBulletDynamicsCommon.h>

#include <cstdint>
#include <span>
#include <vector>

namespace subworld::bullet {

/// Joints of a group of bodies. The directions that they lock are solved at once for all (BlockSystem), so that a
/// mechanism without contacts is exact after one iteration. Symbols:
///   h  length of the step, s            v     velocities at its end
///   J  rows of the locks                C(v)  errors of the locks at its end, m or rad
/// The locking impulses change the speeds J v by -C(v) / h. This is Newton's first step towards positions that fit at
/// the end of the step (SHAKE: Ryckaert, Ciccotti and Berendsen 1977). J is that of the beginning. Therefore the motion
/// is symplectic: a pendulum keeps its energy. Present errors are removed at a limited speed. Where that would add
/// energy, as in a taut chain, the locks only stop the motion.
///
/// Bounded rows act along free directions. They are solved by sequential impulses. Each includes those impulses of its
/// own joint's locks that leave these unchanged. A drive has
///   x  coordinate    k  stiffness        p  impulse
///   r  its rest      c  damping          a  share of the step at which the spring is taken
///   s  its speed     most  force limit   g  softness, 1 / (a h^2 k + h c)
/// and the equation
///   J v + g p = g h (c s - k (x - r)),   |p| <= h most.
/// With a = 0 an oscillation of frequency w keeps its energy, and is unstable for w h > 2. With a = 1 it is stable and
/// damped. Here a = min((2 w h)^2, 1).
/// Friction is a drive of speed 0 with infinite damping. A limit permits at most the speed that reaches it in h.
class JointRows {
 public:
  JointRows();

  /// Whether `solve` and the others have anything to do.
  [[nodiscard]] bool any() const noexcept { return !joints_.empty(); }
  /// `moved`: displacements of the movers since their bodies' transforms, m and rad; empty: none. `velocities`: at the
  /// end of the step, without impulses. The rows solve `changes` of these velocities, or the velocities themselves.
  void prepare(std::span<btTypedConstraint* const> joints, std::span<const Mover> movers, std::span<const Motion> moved,
               std::span<const Motion> velocities, bool changes, btScalar h);
  /// Forgets the joints.
  void clear() noexcept {
    joints_.clear();
    nodes_.clear();
    responses_.clear();
    rows_.clear();
  }
  /// Applies the forces of the last step, and corrects the targets of the locks for what these and the locks change:
  /// Newton's second step.
  void start(std::span<Motion> motions);
  /// One iteration. Returns the largest change of a speed, m/s or rad/s.
  double solve(std::span<Motion> motions);
  /// Adds the impulses, and the work of motors at the final motions, to the loads of the joints.
  void finish(std::span<const Motion> motions);
  /// The two movers of each joint, by index; 0: fixed.
  [[nodiscard]] std::span<const BlockSystem::Node> nodes() const noexcept { return nodes_; }

 private:
  struct Row {
    Vec3 linear = Vec3::Zero();  ///< J: of v_a - v_b, w_a, w_b
    Vec3 turn_a = Vec3::Zero(), turn_b = Vec3::Zero();
    Vec3 by_a = Vec3::Zero(), by_b = Vec3::Zero();  ///< I^-1 J
    double target = 0.0;                            ///< m/s or rad/s
    double softness = 0.0;                          ///< g
    double step = 0.0;                              ///< 1 / (J M^-1 J + g)
    double least = 0.0, most = 0.0;                 ///< impulse, N s or N m s
    double off = 0.0;                               ///< of a lock: by now
    double ends = 0.0;                              ///< of a lock: how far it should be off at the end of the step
    double impulse = 0.0;
    std::uint8_t place = 0;     ///< in JointConstraint::last_n
    std::uint8_t together = 1;  ///< so many rows from this one on are bounded together; 0: one of these
  };
  struct Sides {
    JointConstraint* joint;
    std::uint32_t a, b;                               ///< indices of the movers
    double mass_a, mass_b;                            ///< inverse, 1/kg
    Vec3 arm_a = Vec3::Zero(), arm_b = Vec3::Zero();  ///< from the centres to the joint's point, m
    std::uint32_t begin, bounds, end;                 ///< of the rows: locks, then bounded ones
  };

  /// Where the joint is after a time, if its bodies move from where `prepare` found them.
  [[nodiscard]] JointPlace place_after(const Sides& sides, double time, const Motion& a, const Motion& b) const;
  /// Of a mover at the end of the step.
  [[nodiscard]] Motion velocity(std::span<const Motion> motions, std::size_t mover) const;
  /// Twice the kinetic energy of bodies in two joints, and so on, J.
  [[nodiscard]] double energy(std::span<const Motion> motions) const;
  [[nodiscard]] double energy_at(double speed_m_s) const;
  /// Corrects the targets of the locks by where the joints would be at the end of the step.
  void aim(std::span<const Motion> motions);
  /// The locks only stop the motion, and return at most at this speed, m/s or rad/s.
  void aim_at_speed(double most);
  void add_locks(Sides& sides, const JointPlace& place);
  void add_bounded(const Sides& sides, const JointPlace& place);
  void add(const Sides& sides, const JointPlace& place, int axis, Row row);
  /// Sets target and softness of a drive.
  void soften(const Sides& sides, const JointPlace& place, const BlockSystem::Block& inverse, Row& row) const;
  /// Leaves the locks of its own joint unchanged.
  void clear_of_locks(const Sides& sides, const BlockSystem::Block& inverse, Row& row) const;
  void couple();
  [[nodiscard]] static double speed(const Row& row, const Motion& a, const Motion& b);
  [[nodiscard]] static double response(const Sides& sides, const Row& x, const Row& y);
  static void apply(const Sides& sides, const Row& row, double impulse, std::span<Motion> motions);
  double solve_bounded(const Sides& sides, std::span<Motion> motions);
  double solve_locks(std::span<Motion> motions);

  std::span<const Mover> movers_;
  std::span<const Motion> moved_, velocities_;
  bool changes_ = false;
  double h_ = 0.0;
  std::vector<Sides> joints_;
  std::vector<Row> rows_;
  std::vector<BlockSystem::Node> nodes_;
  std::vector<BlockSystem::Block> responses_;  ///< J M^-1 J of the locks of each joint
  std::vector<BlockSystem::Values> missing_;
  std::vector<Motion> before_locks_;
  BlockSystem locks_;
};

}  // namespace subworld::bullet
