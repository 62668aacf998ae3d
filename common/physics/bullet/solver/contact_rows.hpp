#pragma once

#include <LinearMath/btMatrix3x3.h>
#include <LinearMath/btVector3.h>

namespace subworld::bullet {

/// A number for each body of a pair, side by side. Vectors of the second body are negated: an impulse acts on it in the
/// opposite direction, so that both halves have the same equations.
using Both = btScalar __attribute__((vector_size(2 * sizeof(btScalar))));

struct Both3 {
  Both x, y, z;
};

inline Both3 of_both(const btVector3& a, const btVector3& b) {
  return {Both{a.x(), b.x()}, Both{a.y(), b.y()}, Both{a.z(), b.z()}};
}

inline Both dot(const Both3& a, const Both3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Both dot(const btVector3& a, const Both3& b) { return a.x() * b.x + a.y() * b.y + a.z() * b.z; }
inline Both3 cross(const Both3& a, const Both3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Both3 cross(const Both3& a, const btVector3& b) {
  return {a.y * b.z() - a.z * b.y(), a.z * b.x() - a.x * b.z(), a.x * b.y() - a.y * b.x()};
}

/// Velocities, or their changes by impulses: m/s and rad/s.
struct BothMotion {
  Both3 linear, angular;
};

/// Inverse masses of both bodies.
struct BothInertia {
  Both inverse_mass;         ///< 1/kg
  Both3 inverse_inertia[3];  ///< world, rows of the matrix, 1/(kg m^2)
};

/// An impulse along one axis at a contact point. The axis is n. Both bodies have an arm r from the centre to the point,
/// velocities v and w, a mass m and an inertia I. The speed along the axis is, summed over both:
///   u = n v + (r x n) w.                                                                    (1)
/// The effective mass is 1 / k, again summed over both:
///   k = 1/m + n ((I^-1 (r x n)) x r).                                                       (2)
/// An impulse p changes the velocities:
///   v by (n / m) p,  w by I^-1 (r x n) p.                                                   (3)
struct Row {
  btScalar axis[3];  ///< n
  btScalar impulse;  ///< p so far, N s
  btScalar rhs;      ///< N s, impulse that changes the speed from before the step to the target
  btScalar step;     ///< relaxation / k, kg
  Both3 arm;         ///< r x n, m
  Both3 turn;        ///< I^-1 (r x n), 1/(kg m)
};

/// With impulse and rhs not set.
inline Row make_row(const btVector3& axis, const Both3& arm, const BothInertia& inertia, btScalar relaxation) {
  Row row;
  row.axis[0] = axis.x(), row.axis[1] = axis.y(), row.axis[2] = axis.z();
  row.impulse = row.rhs = 0;
  row.arm = cross(arm, axis);
  const auto& inverse = inertia.inverse_inertia;
  row.turn = {dot(inverse[0], row.arm), dot(inverse[1], row.arm), dot(inverse[2], row.arm)};
  const Both k = inertia.inverse_mass + dot(axis, cross(row.turn, arm));  // (2)
  row.step = relaxation / (k[0] + k[1]);
  return row;
}

/// The step that both friction directions of a point take: only with equal ones does the projection to mu N point
/// against the motion. Without over-relaxation it is the longest step that converges, one over the larger eigenvalue of
/// the 2 x 2 inverse mass matrix. `relaxation`: of the rows.
inline btScalar friction_step(const Row (&rows)[2], btScalar relaxation, btScalar over_relaxation) {
  const btScalar first = relaxation / rows[0].step, second = relaxation / rows[1].step;
  const Both products = dot(rows[1].arm, rows[0].turn);
  const btScalar across = products[0] + products[1];
  const btScalar half = (first - second) / 2;
  return over_relaxation / ((first + second) / 2 + btSqrt(half * half + across * across));
}

/// Speeds along the row's axis from linear and from angular velocity.
inline Both linear_speed(const Row& row, const BothMotion& motion) {
  return row.axis[0] * motion.linear.x + row.axis[1] * motion.linear.y + row.axis[2] * motion.linear.z;
}
inline Both angular_speed(const Row& row, const BothMotion& motion) { return dot(row.arm, motion.angular); }

/// (3)
inline void apply(const Row& row, Both inverse_mass, btScalar impulse, BothMotion& motion) {
  motion.linear.x += row.axis[0] * inverse_mass * impulse;
  motion.linear.y += row.axis[1] * inverse_mass * impulse;
  motion.linear.z += row.axis[2] * inverse_mass * impulse;
  motion.angular.x += row.turn.x * impulse;
  motion.angular.y += row.turn.y * impulse;
  motion.angular.z += row.turn.z * impulse;
}

/// Velocity of one body, or its change by impulses.
struct Motion {
  btScalar linear[3] = {};
  btScalar angular[3] = {};
};

inline Motion sum(const Motion& a, const Motion& b, btScalar times = 1) {
  Motion both;
  for (int i = 0; i < 3; ++i) {
    both.linear[i] = a.linear[i] + times * b.linear[i];
    both.angular[i] = a.angular[i] + times * b.angular[i];
  }
  return both;
}

inline BothMotion gather(const Motion& a, const Motion& b) {
  return {{Both{a.linear[0], -b.linear[0]}, Both{a.linear[1], -b.linear[1]}, Both{a.linear[2], -b.linear[2]}},
          {Both{a.angular[0], -b.angular[0]}, Both{a.angular[1], -b.angular[1]}, Both{a.angular[2], -b.angular[2]}}};
}

inline void scatter(const BothMotion& both, Motion& a, Motion& b) {
  const Both values[] = {both.linear.x, both.linear.y, both.linear.z};
  const Both turns[] = {both.angular.x, both.angular.y, both.angular.z};
  for (int i = 0; i < 3; ++i) {
    a.linear[i] = values[i][0];
    b.linear[i] = -values[i][1];
    a.angular[i] = turns[i][0];
    b.angular[i] = -turns[i][1];
  }
}

}  // namespace subworld::bullet
