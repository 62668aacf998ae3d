#include "physics/bullet/solver/joint_rows.hpp"

#include "physics/bullet/solver/bounce_limit.hpp"

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace subworld::bullet {

namespace {

constexpr std::size_t kUsualJoints = 256, kUsualRows = 2048;
/// Share of an error that is removed in a step, and the largest speed for it, m/s or rad/s: copies of a body are
/// shifted against those that it is joined to, and a faster return would be felt.
constexpr double kReturnRatio = 0.5, kFastestReturn = 0.5;
/// Largest rate at which the locks may raise the kinetic energy, 1/s, beside that of a speed that grows with the other
/// rate, m/s^2. A chain that is taut, or too short, has no position to aim at: Newton's steps would throw it about.
constexpr double kMostGain = 50.0, kSlowReturn = 20.0;
constexpr double kLong_s = 1e-3;  ///< longer steps raise it no more
/// Rows along a free direction, and their places in JointConstraint::last_n.
enum Bounded : int { kDrive, kFriction, kLimit, kBounded };
constexpr double kEarly = 4.0;        ///< springs of a chain oscillate faster than one alone
constexpr double kLeastAhead = 1e-6;  ///< share of a step
constexpr double kAny = 1e30;         ///< impulse, N s or N m s

Pose pose_of(const Mover& mover, const btRigidBody& body, const Motion& moved, const Motion& velocity, double h) {
  const btTransform& at = body.getWorldTransform();
  const btQuaternion q = at.getRotation();
  Pose pose{{at.getOrigin().x(), at.getOrigin().y(), at.getOrigin().z()}, Quat(q.w(), q.x(), q.y(), q.z())};
  if (mover.body == nullptr) return pose;
  Vec3 turn;
  for (int i = 0; i < 3; ++i) {
    pose.position[i] += moved.linear[i] + h * velocity.linear[i];
    turn[i] = moved.angular[i] + h * velocity.angular[i];
  }
  const double angle = turn.norm();
  if (angle > 0.0) pose.orientation = Quat(Eigen::AngleAxisd(angle, turn / angle)) * pose.orientation;
  return pose;
}

Vec3 turned(const Mover& mover, const Vec3& v) {
  const btVector3 w = mover.inverse_inertia * btVector3(btScalar(v.x()), btScalar(v.y()), btScalar(v.z()));
  return {w.x(), w.y(), w.z()};
}

Vec3 vec(const btScalar (&v)[3]) { return {v[0], v[1], v[2]}; }

double returning(double off, double h) { return std::clamp(kReturnRatio * off / h, -kFastestReturn, kFastestReturn); }

}  // namespace

JointRows::JointRows() {
  joints_.reserve(kUsualJoints);
  nodes_.reserve(kUsualJoints);
  responses_.reserve(kUsualJoints);
  missing_.reserve(kUsualJoints);
  rows_.reserve(kUsualRows);
}

void JointRows::prepare(std::span<btTypedConstraint* const> joints, std::span<const Mover> movers,
                        std::span<const Motion> moved, std::span<const Motion> velocities, bool changes, btScalar h) {
  movers_ = movers;
  moved_ = moved;
  velocities_ = velocities;
  changes_ = changes;
  h_ = h;
  clear();
  for (btTypedConstraint* constraint : joints) {
    auto& joint = static_cast<JointConstraint&>(*constraint);
    const auto a = static_cast<std::uint32_t>(mover_of(joint.getRigidBodyA()));
    const auto b = static_cast<std::uint32_t>(mover_of(joint.getRigidBodyB()));
    if (a == kFixed && b == kFixed) continue;
    Sides& sides = joints_.emplace_back(Sides{.joint = &joint,
                                              .a = a,
                                              .b = b,
                                              .mass_a = movers[a].inverse_mass,
                                              .mass_b = movers[b].inverse_mass,
                                              .begin = static_cast<std::uint32_t>(rows_.size()),
                                              .bounds = 0,
                                              .end = 0});
    const JointPlace place = place_after(sides, 0.0, {}, {});
    const Motion still;
    sides.arm_a =
        place.point - pose_of(movers[a], joint.getRigidBodyA(), moved.empty() ? still : moved[a], still, 0.0).position;
    sides.arm_b =
        place.point - pose_of(movers[b], joint.getRigidBodyB(), moved.empty() ? still : moved[b], still, 0.0).position;
    add_locks(sides, place);
    add_bounded(sides, place);
    sides.end = static_cast<std::uint32_t>(rows_.size());
    nodes_.push_back({a, b, sides.bounds - sides.begin});
  }
  if (any()) couple();
}

JointPlace JointRows::place_after(const Sides& sides, double time, const Motion& a, const Motion& b) const {
  const Motion still;
  const auto pose = [&](std::uint32_t mover, const btRigidBody& body, const Motion& velocity) {
    return pose_of(movers_[mover], body, moved_.empty() ? still : moved_[mover], velocity, time);
  };
  return place_of(sides.joint->joint, pose(sides.a, sides.joint->getRigidBodyA(), a),
                  pose(sides.b, sides.joint->getRigidBodyB(), b));
}

void JointRows::add(const Sides& sides, const JointPlace& place, int axis, Row row) {
  const Vec3& direction = place.directions[axis];
  row.turn_a = direction;
  row.turn_b = -direction;
  if (axis < 3) {
    row.linear = direction;
    row.turn_a = sides.arm_a.cross(direction);
    row.turn_b = -sides.arm_b.cross(direction);
  }
  rows_.push_back(row);
}

void JointRows::add_locks(Sides& sides, const JointPlace& place) {
  const Joint& joint = sides.joint->joint;
  const JointPlace ahead = place_after(sides, h_, velocities_[sides.a], velocities_[sides.b]);
  for (int i = 0; i < 6; ++i) {
    if (joint.axes[i].free) continue;
    const double off = place.coordinates[i];
    const double ends = off - h_ * returning(off, h_);
    add(sides, place, i, {.target = (ends - ahead.coordinates[i]) / h_, .off = off, .ends = ends});
  }
  sides.bounds = static_cast<std::uint32_t>(rows_.size());
  const auto count = static_cast<Eigen::Index>(sides.bounds - sides.begin);
  BlockSystem::Block& responses = responses_.emplace_back(count, count);
  for (std::size_t i = sides.begin; i < sides.bounds; ++i) {
    Row& row = rows_[i];
    row.by_a = turned(movers_[sides.a], row.turn_a);
    row.by_b = turned(movers_[sides.b], row.turn_b);
    if (!changes_) row.target += speed(row, velocities_[sides.a], velocities_[sides.b]);
  }
  for (Eigen::Index i = 0; i < count; ++i) {
    for (Eigen::Index j = 0; j < count; ++j)
      responses(i, j) = response(sides, rows_[sides.begin + i], rows_[sides.begin + j]);
  }
}

void JointRows::add_bounded(const Sides& sides, const JointPlace& place) {
  const Joint& joint = sides.joint->joint;
  const auto begin = static_cast<std::ptrdiff_t>(rows_.size());
  const auto add_at = [&](int axis, Bounded kind, Row row) {
    row.place = static_cast<std::uint8_t>(kBounded * axis + kind);
    add(sides, place, axis, row);
  };
  for (int i = 0; i < 6; ++i) {
    const JointAxis& axis = joint.axes[i];
    if (!axis.free) continue;
    const double x = place.coordinates[i];
    if (axis.is_driven()) {
      const double most = std::min(h_ * axis.most, kAny);
      add_at(i, kDrive, {.target = axis.speed, .least = -most, .most = most});
    }
    if (std::isfinite(axis.lower) || std::isfinite(axis.upper)) {
      const bool low = x - axis.lower < axis.upper - x;
      const double gap = low ? x - axis.lower : axis.upper - x, sign = low ? 1.0 : -1.0;
      add_at(i, kLimit,
             {.target = sign * (gap > 0.0 ? -gap / h_ : returning(-gap, h_)),
              .least = low ? 0.0 : -kAny,
              .most = low ? kAny : 0.0});
    }
  }
  for (int i = 0; i < 6; ++i) {
    const JointAxis& axis = joint.axes[i];
    if (!axis.free || axis.friction <= 0.0) continue;
    Row row{.least = -h_ * axis.friction, .most = h_ * axis.friction};
    if (joint.kind == JointKind::ball) row.together = i == 3 ? 3 : 0;
    if (joint.kind == JointKind::planar && i < 3) row.together = i == 0 ? 2 : 0;
    add_at(i, kFriction, row);
  }
  const auto& locks = responses_.back();
  const BlockSystem::Block inverse =
      locks.size() > 0
          ? BlockSystem::Block(locks.ldlt().solve(BlockSystem::Block::Identity(locks.rows(), locks.cols())))
          : locks;
  for (Row& row : std::span(rows_).subspan(begin)) {
    if (row.place % kBounded == kDrive) soften(sides, place, inverse, row);
    if (changes_) row.target -= speed(row, velocities_[sides.a], velocities_[sides.b]);
    clear_of_locks(sides, inverse, row);
    const double k = response(sides, row, row) + row.softness;
    row.step = k > 0.0 ? 1.0 / k : 0.0;
    row.impulse = std::clamp(h_ * sides.joint->last_n[row.place], row.least, row.most);
  }
}

void JointRows::soften(const Sides& sides, const JointPlace& place, const BlockSystem::Block& inverse, Row& row) const {
  const std::size_t i = row.place / kBounded;
  const JointAxis& axis = sides.joint->joint.axes[i];
  if (std::isinf(axis.damping)) return;
  Row alone = row;
  clear_of_locks(sides, inverse, alone);
  const double oscillation = h_ * h_ * axis.stiffness * response(sides, alone, alone);  // (w h)^2
  const double ahead = std::clamp(kEarly * oscillation, kLeastAhead, 1.0);
  const double rate = ahead * h_ * h_ * axis.stiffness + h_ * axis.damping;
  row.softness = std::min(1.0 / rate, kAny);
  row.target = h_ * (axis.damping * axis.speed - axis.stiffness * (place.coordinates[i] - axis.rest)) / rate;
}

void JointRows::clear_of_locks(const Sides& sides, const BlockSystem::Block& inverse, Row& row) const {
  const auto set_inertia = [&] {
    row.by_a = turned(movers_[sides.a], row.turn_a);
    row.by_b = turned(movers_[sides.b], row.turn_b);
  };
  set_inertia();
  const std::size_t count = sides.bounds - sides.begin;
  if (count == 0) return;
  BlockSystem::Values both(static_cast<Eigen::Index>(count));
  for (std::size_t i = 0; i < count; ++i)
    both[static_cast<Eigen::Index>(i)] = response(sides, rows_[sides.begin + i], row);
  both = (inverse * both).eval();
  for (std::size_t i = 0; i < count; ++i) {
    const Row& lock = rows_[sides.begin + i];
    const double part = both[static_cast<Eigen::Index>(i)];
    row.target -= part * lock.target;
    row.linear -= part * lock.linear;
    row.turn_a -= part * lock.turn_a;
    row.turn_b -= part * lock.turn_b;
  }
  set_inertia();
}

void JointRows::couple() {
  locks_.begin(nodes_);
  for (std::size_t i = 0; i < joints_.size(); ++i) locks_.diagonal(i) = responses_[i];
  for (BlockSystem::Edge& edge : locks_.edges()) {
    const Sides &i = joints_[edge.i], &j = joints_[edge.j];
    for (const bool of_i_is_a : {true, false}) {
      for (const bool of_j_is_a : {true, false}) {
        const std::uint32_t body = of_i_is_a ? i.a : i.b;
        if (body == kFixed || body != (of_j_is_a ? j.a : j.b)) continue;
        const double inverse_mass = (of_i_is_a == of_j_is_a ? 1.0 : -1.0) * movers_[body].inverse_mass;
        for (Eigen::Index r = 0; r < edge.block.rows(); ++r) {
          for (Eigen::Index c = 0; c < edge.block.cols(); ++c) {
            const Row &x = rows_[j.begin + r], &y = rows_[i.begin + c];
            edge.block(r, c) += inverse_mass * x.linear.dot(y.linear) +
                                (of_j_is_a ? x.turn_a : x.turn_b).dot(of_i_is_a ? y.by_a : y.by_b);
          }
        }
      }
    }
  }
  locks_.decompose();
  missing_.resize(joints_.size());
}

double JointRows::speed(const Row& row, const Motion& a, const Motion& b) {
  return row.linear.dot(vec(a.linear) - vec(b.linear)) + row.turn_a.dot(vec(a.angular)) +
         row.turn_b.dot(vec(b.angular));
}

double JointRows::response(const Sides& sides, const Row& x, const Row& y) {
  return (sides.mass_a + sides.mass_b) * x.linear.dot(y.linear) + x.turn_a.dot(y.by_a) + x.turn_b.dot(y.by_b);
}

void JointRows::apply(const Sides& sides, const Row& row, double impulse, std::span<Motion> motions) {
  Motion &a = motions[sides.a], &b = motions[sides.b];
  for (int i = 0; i < 3; ++i) {
    a.linear[i] += static_cast<btScalar>(impulse * sides.mass_a * row.linear[i]);
    b.linear[i] -= static_cast<btScalar>(impulse * sides.mass_b * row.linear[i]);
    a.angular[i] += static_cast<btScalar>(impulse * row.by_a[i]);
    b.angular[i] += static_cast<btScalar>(impulse * row.by_b[i]);
  }
}

Motion JointRows::velocity(std::span<const Motion> motions, std::size_t mover) const {
  return changes_ ? sum(velocities_[mover], motions[mover]) : motions[mover];
}

double JointRows::energy(std::span<const Motion> motions) const {
  double sum = 0.0;
  for (const Sides& sides : joints_) {
    for (const std::uint32_t mover : {sides.a, sides.b}) {
      if (mover != kFixed) sum += kinetic_energy(movers_[mover], velocity(motions, mover));
    }
  }
  return sum;
}

double JointRows::energy_at(double speed_m_s) const {
  double sum = 0.0;
  for (const Sides& sides : joints_) {
    for (const double inverse : {sides.mass_a, sides.mass_b}) {
      if (inverse > 0.0) sum += 0.5 * speed_m_s * speed_m_s / inverse;
    }
  }
  return sum;
}

void JointRows::aim(std::span<const Motion> motions) {
  for (const Sides& sides : joints_) {
    const JointPlace ahead = place_after(sides, h_, velocity(motions, sides.a), velocity(motions, sides.b));
    std::size_t row = sides.begin;
    for (std::size_t i = 0; i < ahead.coordinates.size(); ++i) {
      if (sides.joint->joint.axes[i].free) continue;
      rows_[row].target += (rows_[row].ends - ahead.coordinates[i]) / h_;
      ++row;
    }
  }
}

void JointRows::aim_at_speed(double most) {
  for (const Sides& sides : joints_) {
    for (std::size_t i = sides.begin; i < sides.bounds; ++i) {
      Row& row = rows_[i];
      row.target = -std::clamp(returning(row.off, h_), -most, most);
      if (changes_) row.target -= speed(row, velocities_[sides.a], velocities_[sides.b]);
    }
  }
}

void JointRows::start(std::span<Motion> motions) {
  if (!any()) return;
  for (const Sides& sides : joints_) {
    for (std::size_t i = sides.bounds; i < sides.end; ++i) apply(sides, rows_[i], rows_[i].impulse, motions);
  }
  const double time = std::min(h_, kLong_s);
  const double most = (1.0 + kMostGain * time) * energy(motions) + energy_at(kSlowReturn * time);
  before_locks_.assign(motions.begin(), motions.end());
  solve_locks(motions);
  aim(motions);
  solve_locks(motions);
  for (const double return_at : {kSlowReturn * time, 0.0}) {
    if (energy(motions) <= most) return;
    std::ranges::copy(before_locks_, motions.begin());
    for (const Sides& sides : joints_) {
      for (std::size_t i = sides.begin; i < sides.bounds; ++i) rows_[i].impulse = 0.0;
    }
    aim_at_speed(return_at);
    solve_locks(motions);
  }
}

double JointRows::solve(std::span<Motion> motions) {
  double change = 0.0;
  for (const Sides& sides : joints_) change = std::max(change, solve_bounded(sides, motions));
  return std::max(change, solve_locks(motions));
}

double JointRows::solve_bounded(const Sides& sides, std::span<Motion> motions) {
  double change = 0.0;
  for (std::size_t i = sides.bounds; i < sides.end; i += rows_[i].together) {
    const std::span<Row> rows(&rows_[i], rows_[i].together);
    std::array<double, 3> wanted{};
    double square = 0.0;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      const Row& row = rows[k];
      wanted[k] = row.impulse +
                  (row.target - speed(row, motions[sides.a], motions[sides.b]) - row.softness * row.impulse) * row.step;
      square += wanted[k] * wanted[k];
    }
    const double most = rows[0].most;
    const double part = rows.size() > 1 && square > most * most ? most / std::sqrt(square) : 1.0;
    for (std::size_t k = 0; k < rows.size(); ++k) {
      Row& row = rows[k];
      const double by = std::clamp(part * wanted[k], row.least, row.most) - row.impulse;
      row.impulse += by;
      apply(sides, row, by, motions);
      if (row.step > 0.0) change = std::max(change, std::abs(by) / row.step);
    }
  }
  return change;
}

double JointRows::solve_locks(std::span<Motion> motions) {
  double change = 0.0;
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const Sides& sides = joints_[j];
    missing_[j].resize(sides.bounds - sides.begin);
    for (std::size_t i = sides.begin; i < sides.bounds; ++i) {
      const double missing = rows_[i].target - speed(rows_[i], motions[sides.a], motions[sides.b]);
      missing_[j][static_cast<Eigen::Index>(i - sides.begin)] = missing;
      change = std::max(change, std::abs(missing));
    }
  }
  locks_.solve(missing_);
  for (std::size_t j = 0; j < joints_.size(); ++j) {
    const Sides& sides = joints_[j];
    for (std::size_t i = sides.begin; i < sides.bounds; ++i) {
      const double by = missing_[j][static_cast<Eigen::Index>(i - sides.begin)];
      rows_[i].impulse += by;
      apply(sides, rows_[i], by, motions);
    }
  }
  return change;
}

void JointRows::finish(std::span<const Motion> motions) {
  for (const Sides& sides : joints_) {
    JointConstraint& joint = *sides.joint;
    joint.last_n.fill(0.0);
    for (std::size_t i = sides.begin; i < sides.end; ++i) {
      const Row& row = rows_[i];
      if (i >= sides.bounds) joint.last_n[row.place] = row.impulse / h_;
      joint.load.impulse += row.impulse * row.linear;
      joint.load.turn += row.impulse * (row.turn_a - sides.arm_a.cross(row.linear));
      if (i < sides.bounds || row.place % kBounded != kDrive || joint.joint.axes[row.place / kBounded].speed == 0.0)
        continue;
      joint.load.motor_j += row.impulse * speed(row, velocity(motions, sides.a), velocity(motions, sides.b));
    }
  }
}

}  // namespace subworld::bullet
