#include "physics/bullet/sweep.hpp"

#include "physics/bullet/shapes.hpp"

#include <Eigen/Geometry>

namespace subworld::bullet {

namespace {

constexpr int kMostAdvances = 64;
constexpr double kFarOfInner = 0.5;  ///< of what is inside both shapes

const Convex* convex_at(const btCollisionObject& object) {
  return static_cast<const Convex*>(object.getCollisionShape()->getUserPointer());
}

}  // namespace

Sweep::Sweep(const btCollisionObject& object) : velocity(Vec3::Zero()), spin(Vec3::Zero()) {
  const btRigidBody* body = btRigidBody::upcast(&object);
  if (body == nullptr) return;
  velocity = from_bullet(body->getLinearVelocity());
  spin = from_bullet(body->getAngularVelocity());
}

Placed Sweep::after(const Placed& start, double seconds) const {
  Placed then = start;
  then.at += seconds * velocity;
  const double angle = seconds * spin.norm();
  if (angle > 0.0) then.turn = Eigen::AngleAxisd(angle, spin.normalized()).toRotationMatrix() * start.turn;
  return then;
}

FastPair::FastPair(const btCollisionObject& a, const btCollisionObject& b) {
  const auto inner = [](const btCollisionObject& object) {
    return convex_at(object) != nullptr ? convex_at(object)->inner_radius : 0.0;
  };
  const auto outer = [](const btCollisionObject& object) {
    return convex_at(object) != nullptr ? convex_at(object)->outer_radius : 0.0;
  };
  far_ = kFarOfInner * (inner(a) + inner(b));
  outer_a_ = outer(a);
  outer_b_ = outer(b);
}

double FastPair::way(const btCollisionObject& a, const btCollisionObject& b, double dt) const {
  const btRigidBody &one = static_cast<const btRigidBody&>(a), &other = static_cast<const btRigidBody&>(b);
  const double straight = (one.getLinearVelocity() - other.getLinearVelocity()).length2();
  const double turn_a = one.getAngularVelocity().length2() * outer_a_ * outer_a_;
  const double turn_b = other.getAngularVelocity().length2() * outer_b_ * outer_b_;
  // The sum of three roots is at most the root of three times the sum.
  if (3.0 * dt * dt * (straight + turn_a + turn_b) <= far_ * far_) return 0.0;
  const double way = motion(a, b, dt);
  return way > far_ ? way : 0.0;
}

double FastPair::motion(const btCollisionObject& a, const btCollisionObject& b, double dt) const {
  const btRigidBody &one = static_cast<const btRigidBody&>(a), &other = static_cast<const btRigidBody&>(b);
  return dt * ((one.getLinearVelocity() - other.getLinearVelocity()).length() +
               one.getAngularVelocity().length() * outer_a_ + other.getAngularVelocity().length() * outer_b_);
}

std::optional<double> first_touch(const Placed& a, const Sweep& sweep_a, const Placed& b, const Sweep& sweep_b,
                                  double dt, double fine) {
  const double turning =
      sweep_a.spin.norm() * a.shape.outer_radius + sweep_b.spin.norm() * b.shape.outer_radius;  // upper bound, m/s
  Vec3 guess = a.centre() - b.centre();
  double passed = 0.0;
  for (int i = 0; i < kMostAdvances; ++i) {
    const Gap gap = gap_between(sweep_a.after(a, passed), sweep_b.after(b, passed), guess);
    if (gap.distance <= fine) return passed;
    const double closing = (sweep_b.velocity - sweep_a.velocity).dot(gap.normal) + turning;
    if (closing <= 0.0) return std::nullopt;
    passed += gap.distance / closing;
    if (passed > dt) return std::nullopt;
    guess = gap.normal;
  }
  return passed;
}

bool passes_by(const Patch& patch, const Placed& a, const Sweep& sweep_a, const Placed& b, const Sweep& sweep_b,
               double dt, double fine) {
  constexpr double kClose = 1e-3;  // of what is fine for a choice
  bool stops = false;
  for (const PatchPoint& p : patch.all()) {
    if (p.distance <= 0.0) return false;
    const Vec3 on_a = p.on_b + p.distance * patch.normal;
    const Vec3 speed =
        sweep_b.velocity + sweep_b.spin.cross(p.on_b - b.at) - sweep_a.velocity - sweep_a.spin.cross(on_a - a.at);
    stops = stops || dt * speed.dot(patch.normal) > p.distance;
  }
  return stops && !first_touch(a, sweep_a, b, sweep_b, dt, kClose * fine);
}

Ahead back_from(const PatchPoint& point, const Vec3& normal, const Placed& a_then, const Placed& a_now,
                const Placed& b_then, const Placed& b_now) {
  const Vec3 on_a = point.on_b + point.distance * normal;
  Ahead ahead;
  ahead.on_a = a_now.point(a_then.turn.transpose() * (on_a - a_then.at));
  ahead.on_b = b_now.point(b_then.turn.transpose() * (point.on_b - b_then.at));
  ahead.distance = (ahead.on_a - ahead.on_b).dot(normal);
  return ahead;
}

}  // namespace subworld::bullet
