#include "physics/bullet/solver/turning_friction.hpp"

namespace subworld::bullet {

namespace {

/// Of an angular impulse about an axis; no step for bodies that do not turn. `surfaces`: rad/s, beside the motion.
Row turning_row(const btVector3& axis, const BothInertia& inertia, const BothMotion& before,
                const btVector3& surfaces) {
  Row row{};
  row.arm = of_both(axis, axis);
  const auto& inverse = inertia.inverse_inertia;
  row.turn = {dot(axis, inverse[0]), dot(axis, inverse[1]), dot(axis, inverse[2])};
  const Both k = dot(axis, row.turn);
  row.step = k[0] + k[1] > 0 ? 1 / (k[0] + k[1]) : btScalar(0);
  const Both speed = angular_speed(row, before);
  row.rhs = -(speed[0] + speed[1] + axis.dot(surfaces)) * row.step;
  return row;
}

}  // namespace

void TurningFriction::add(ContactPair& pair, const BothInertia& inertia, const BothMotion& before) {
  const Resistance by = resistance(*pair.manifold);
  if (by.rolling <= 0 && by.spinning <= 0) return;
  pair.turning = static_cast<std::int32_t>(pairs_.size());
  const btVector3& normal = pair.manifold->getContactPoint(0).m_normalWorldOnB;
  const btVector3 surfaces = turning(*pair.manifold);
  btVector3 first, second;
  btPlaneSpace1(normal, first, second);
  pairs_.push_back({{turning_row(first, inertia, before, surfaces), turning_row(second, inertia, before, surfaces),
                     turning_row(normal, inertia, before, surfaces)},
                    by.rolling,
                    by.spinning});
}

void TurningFriction::start() {
  for (Entry& entry : pairs_) {
    for (Row& row : entry.rows) row.impulse = 0;
  }
}

bool TurningFriction::solve(const ContactPair& pair, btScalar normal_impulse, BothMotion& motion) {
  if (pair.turning < 0) return false;
  auto& [rows, rolling, spinning] = pairs_[static_cast<std::size_t>(pair.turning)];
  const auto wanted = [&motion](const Row& row) {
    const Both speed = angular_speed(row, motion);
    return row.impulse + row.rhs - (speed[0] + speed[1]) * row.step;
  };
  bool changed = false;
  const auto set = [&](Row& row, btScalar impulse) {
    changed = changed || impulse != row.impulse;
    apply(row, pair.inverse_mass, impulse - row.impulse, motion);
    row.impulse = impulse;
  };
  const btScalar most = rolling * normal_impulse, about_normal = spinning * normal_impulse;
  const btScalar first = wanted(rows[0]), second = wanted(rows[1]);
  const btScalar size = btSqrt(first * first + second * second);
  const btScalar part = size > most ? most / size : btScalar(1);
  set(rows[0], part * first);
  set(rows[1], part * second);
  set(rows[2], btClamped(wanted(rows[2]), -about_normal, about_normal));
  return changed;
}

}  // namespace subworld::bullet
